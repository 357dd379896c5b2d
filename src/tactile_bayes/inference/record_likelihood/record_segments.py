"""The samples of a record by sweep segment, in the frame of their sweeps."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.discrepancy import Course
from tactile_bayes.mechanics.branches.line import LINE_COLUMNS, NO_LINES, lines_through, turned_in
from tactile_bayes.mechanics.branches.sweeps import Segments
from tactile_bayes.reconstruction import contact_sides, drive_histories, least_turn
from tactile_bayes.record import CHANNELS, base_of_sample, present_channels, rod_of

_OFF = 1e-6  # distance of recorded poses from a line [L and rad] that is rounding of the record
_SCATTER = 10.0  # range of drive angles, over the noise of their readings, of a rod that is clamped at one
# Rotation as a line, with the drive angle as travel.
_TURNS = np.array([[0.0, 0.0, -0.5 * np.pi, 0.0, 0.0, 1.0, -0.5 * np.pi, 1.5 * np.pi]])
_FREE = -0.5 * np.pi + 1e-9  # drive angle in the sweep frame from which a rod was turned to where its record begins


class RecordSegments:
    """Sweep segments: samples with one pivot, side of contact and direction of the drive, or of one history of it.

    Drive angles are corrected by the load cell's data sheet; in the frame of a sweep they grow in forward contact.
    Where loads depend on the history of the drive (it carries the base, or turns back in contact while the rod `rubs`)
    the travel takes their place in `angles_in_sweep_frame`, [L] or [rad].
    """

    def __init__(self, measured: xr.Dataset, load_cell: LoadCell, rubs: bool = False) -> None:
        angle = measured.drive_angle.values - load_cell.misread(measured.direction.values)
        backward = contact_sides(without_errors(measured, load_cell), load_cell) < 0.0
        bases, pivot = base_of_sample(measured)
        poses = np.column_stack([measured.base_x.values, measured.base_y.values, angle])
        history = drive_histories(measured, backward, load_cell, rubs=rubs)
        known = _repeated(history, poses, backward)
        sense = np.where(known > 0, 0.0, np.where(measured.direction.values == "backward", -1.0, 1.0))
        places = np.array(bases)[pivot]
        kinds, which = np.unique(np.column_stack([places, backward, sense, known]), axis=0, return_inverse=True)
        self.drive_angles = angle
        self.of_sample: Index = which  # segment of each sample, shape (samples,)
        self.samples: list[Index] = [np.flatnonzero(which == k) for k in range(len(kinds))]  # of each segment
        self.pivots: Index = pivot[[own[0] for own in self.samples]]  # their numbers, in the order of the record
        self.bases = kinds[:, :2]  # pivots, or where drives begin [length], shape (segments, 2)
        self.backward = kinds[:, 2] > 0.0  # True for contact on the side of a backward sweep
        self.signs = np.where(self.backward, -1.0, 1.0)
        self.signs_of_samples: Floats = self.signs[which]
        # Direction of the drive, whatever the side of contact: +1 forward, −1 backward; 0 where it has a history.
        self.senses = kinds[:, 3]
        self.angles_in_sweep_frame = np.where(self.backward[which], np.pi - angle, angle)
        # Change of the travel with the reading of the encoder, shape (samples,): 0 if the drive carries the base.
        self.pace = self.signs_of_samples.copy()
        self._samples_by_errors: dict[bytes, Segments] = {}
        self._ways: dict[int, tuple[Floats, Floats]] = {}
        # Lines of all drives, (segments, lines, LINE_COLUMNS), NaN after the last; None if none has a history.
        self.lines: Floats | None = None
        if np.any(known):
            self.lines = self._drives(history, poses, rod_of(measured).length, load_cell)

    def __len__(self) -> int:
        return len(self.samples)

    @property
    def contacts(self) -> Floats:
        """Pivot [length], side of contact and sense of the drive of each segment, shape (segments, 4)."""
        return np.column_stack([self.bases, self.signs, self.senses])

    @property
    def has_history(self) -> bool:
        """True if loads depend on the history of a drive: it carries the base, or turns back in contact."""
        return self.lines is not None

    def _drives(self, history: Index, poses: Floats, length: float, load_cell: LoadCell) -> Floats:
        """Return `lines`, and write travels and ways of the drives with a history."""
        drives = []
        for k, own in enumerate(self.samples):
            if self.senses[k]:
                drives.append(_TURNS)
                continue
            once = poses[own[history[own] == history[own[0]]]]
            lines_of = self._carry if np.ptp(once[:, :2], axis=0).any() else self._turn
            drives.append(lines_of(k, once, length, load_cell))
        lines = np.full((len(drives), max(map(len, drives)), LINE_COLUMNS), np.nan)
        for of_segment, drive in zip(lines, drives, strict=True):
            of_segment[: len(drive)] = drive
        return lines

    def _carry(self, k: int, once: Floats, length: float, load_cell: LoadCell) -> Floats:
        """Return the lines of a segment whose base is carried, once or often, through poses."""
        own, noise = self.samples[k], max(load_cell.drive_angle_noise, load_cell.drive_angle_resolution)
        if np.ptp(once[:, 2]) <= _SCATTER * noise:
            once[:, 2] = once[:, 2].mean()
        path = turned_in(lines_through(once, length, backward=bool(self.backward[k]), off=max(_OFF, 3.0 * noise)))
        self.angles_in_sweep_frame[own] = np.tile(path.travels, own.size // len(once))
        self.pace[own] = 0.0
        self._ways[k] = path.travels, np.append(0.0, np.cumsum(np.hypot(*np.diff(once[:, :2], axis=0).T)))
        return path.lines

    def _turn(self, k: int, once: Floats, length: float, load_cell: LoadCell) -> Floats:
        """Return the lines of a segment that turns back in contact; the first is from a free angle."""
        own, backward = self.samples[k], bool(self.backward[k])
        free = np.append(once[0, :2], np.pi - _FREE if backward else _FREE)
        off = least_turn(once[:, 2], load_cell)
        path = lines_through(np.vstack([free, once]), length, backward=backward, off=off)
        lines, travels = path.lines, path.travels[1:] + _FREE
        lines[:, 6:] += _FREE
        self.angles_in_sweep_frame[own] = np.tile(travels, own.size // len(once))
        on = np.maximum(np.searchsorted(lines[:, 6], self.angles_in_sweep_frame[own], side="right") - 1, 0)
        self.pace[own] *= lines[on, 5]
        self._ways[k] = np.array([travels[0], lines[-1, 7]]), np.array([0.0, lines[-1, 7] - travels[0]])
        return lines

    def event_samples(self, loaded: Flags) -> Index:
        """Return the last sample before contact, the first and last in it, and the next, (segments, 4); −1 if none."""
        out = np.full((len(self), 4), -1)
        for row, own in zip(out, self.samples, strict=True):
            ordered = own[np.argsort(self.angles_in_sweep_frame[own], kind="stable")]
            first, last = _longest(loaded[ordered])
            if first <= last:
                ranks = np.array([first - 1, first, last, last + 1])
                known = (ranks >= 0) & (ranks < ordered.size)
                row[known] = ordered[ranks[known]]
        return out

    def event_angles(self, loaded: Flags) -> Floats:
        """Return the drive angles of `event_samples` in the sweep frame [rad]; NaN if there is none."""
        samples = self.event_samples(loaded)
        return np.where(samples >= 0, self.angles_in_sweep_frame[samples], np.nan)

    @cached_property
    def course(self) -> Course:
        """Order in which a discrepancy passes through the samples: along the drive, with one course for repeats."""
        direction = np.where(self.senses == 0.0, 1.0, self.senses * self.signs)
        return Course.along(direction[self.of_sample] * self.angles_in_sweep_frame, self.samples)

    def ways(self, travels: Floats) -> Floats:
        """Convert travels, (n, segments), to ways of the base [length], or angles, as read or since the first [rad]."""
        ways = np.where(self.backward, np.pi - travels, travels)
        for k, known in self._ways.items():
            ways[:, k] = np.interp(travels[:, k], *known)
        return ways

    @property
    def ways_of_samples(self) -> Floats:
        """`ways` at the samples, shape (samples,)."""
        every = np.repeat(self.angles_in_sweep_frame[:, None], len(self), axis=1)
        return np.asarray(self.ways(every)[np.arange(len(every)), self.of_sample])

    def samples_with(self, errors: Floats) -> Segments:
        """Return the samples of every segment, once for each error of the encoder, sorted by drive angle."""
        key = errors.tobytes()
        if key not in self._samples_by_errors:
            samples, angles = [], []
            for own in self.samples:
                shifted = (self.angles_in_sweep_frame[own] - self.pace[own] * errors[:, None]).ravel()
                order = np.argsort(shifted, kind="stable")
                angles.append(shifted[order])
                samples.append((own + self.drive_angles.size * np.arange(errors.size)[:, None]).ravel()[order])
            first = np.cumsum([0, *(part.size for part in samples)])
            lines = NO_LINES if self.lines is None else self.lines
            self._samples_by_errors[key] = Segments(first, np.concatenate(samples), np.concatenate(angles), lines)
        return self._samples_by_errors[key]


def _repeated(history: Index, poses: Floats, backward: Flags) -> Index:
    """Return for each sample the first history of a drive through the same poses as its own; 0 if it has none."""
    found, first = np.zeros(len(poses), dtype=np.intp), dict[tuple[bytes, bytes], int]()
    for number in np.unique(history[history > 0]).tolist():
        own = history == number
        found[own] = first.setdefault((poses[own].tobytes(), backward[own].tobytes()), number)
    return found


def _longest(loaded: Flags) -> tuple[int, int]:
    """Return the first and last index of the interval in which loaded samples outnumber the others the most."""
    sums = np.concatenate([[0], np.cumsum(np.where(loaded, 1, -1))])
    lowest = np.minimum.accumulate(sums)
    end = int(np.argmax(sums - lowest))
    return int(np.argmin(sums[: end + 1])), end - 1


def without_errors(measured: xr.Dataset, load_cell: LoadCell) -> xr.Dataset:
    """Return the record corrected for the cell's known errors; if channels are missing, those of the moment alone."""
    if len(present_channels(measured)) == len(CHANNELS):
        return load_cell.corrected(measured)
    bias, gain = load_cell.bias[0], load_cell.gain[0][0]
    return measured.assign(holding_moment=(measured.holding_moment - bias) * np.sign(gain or 1.0))

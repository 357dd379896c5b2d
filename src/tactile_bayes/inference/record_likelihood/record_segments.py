"""The samples of a record by sweep segment, in the frame of their sweeps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.discrepancy import Course
from tactile_bayes.mechanics.branches.line import LINE_COLUMNS, lines_through
from tactile_bayes.mechanics.branches.sweeps import Segments
from tactile_bayes.reconstruction import contact_sides
from tactile_bayes.record import CHANNELS, base_of_sample, carried_sweeps, present_channels, rod_of

__all__ = ["RecordSegments", "Segment", "without_errors"]

_OFF = 1e-6  # distance of recorded poses from a line [L and rad] that is rounding of the record
_SCATTER = 10.0  # range of drive angles, over the noise of their readings, of a rod that is clamped at one
# Rotation as a line, with the drive angle as travel.
_TURNS = np.array([[0.0, 0.0, -0.5 * np.pi, 0.0, 0.0, 1.0, -0.5 * np.pi, 1.5 * np.pi]])


@dataclass(frozen=True)
class Segment:
    """Sweep segment: samples with one pivot, one side of contact and one direction of the drive, or those of sweeps
    in which the drive carries the base through the same poses."""

    pivot: int  # index of the pivot, in the order of the record
    base: tuple[float, float]  # the pivot, or where the drive begins [length]
    backward: bool  # True if the side of contact is that of a backward sweep
    # Direction of the drive, whatever the side of contact: +1 forward, −1 backward; 0 if it carries the base, which
    # turns no encoder.
    sense: float
    samples: Index  # indices of the samples, shape (samples of the segment,)


class RecordSegments:
    """Sweep segments of a record; a sequence of `Segment`.

    Drive angles are corrected by the data sheet of the load cell. In the frame of a sweep they grow in forward contact;
    where the drive carries the base, its travel takes their place. `pivots`, `signs` (−1 for contact as in a backward
    sweep) and `senses` are by segment; `lines`, (segments, lines, `LINE_COLUMNS`), are those of all drives, NaN after
    the last, a rotation being a line along the drive angle; None if no drive carries the base.
    """

    def __init__(self, measured: xr.Dataset, load_cell: LoadCell) -> None:
        angle = measured.drive_angle.values - load_cell.misread(measured.direction.values)
        backward = contact_sides(without_errors(measured, load_cell), load_cell) < 0.0
        bases, of_sample = base_of_sample(measured)
        poses = np.column_stack([measured.base_x.values, measured.base_y.values, angle])
        carried = _repeated(measured, poses)
        sense = np.where(carried > 0, 0.0, np.where(measured.direction.values == "backward", -1.0, 1.0))
        places = np.array(bases)[of_sample]
        kinds, which = np.unique(np.column_stack([places, backward, sense, carried]), axis=0, return_inverse=True)
        rows = [np.flatnonzero(which == k) for k in range(len(kinds))]
        self._segments = [
            Segment(int(of_sample[own[0]]), bases[of_sample[own[0]]], bool(kind[2]), float(kind[3]), own)
            for kind, own in zip(kinds, rows, strict=True)
        ]
        self.drive_angles = angle
        self.pivots = np.array([segment.pivot for segment in self])
        self.signs = np.array([-1.0 if segment.backward else 1.0 for segment in self])
        self.senses = np.array([segment.sense for segment in self])
        self._angles = np.full((len(self), max(segment.samples.size for segment in self)), np.nan)
        for row, segment in zip(self._angles, self, strict=True):
            read = angle[segment.samples]
            row[: read.size] = np.pi - read if segment.backward else read
        self._samples_by_errors: dict[bytes, Segments] = {}
        self._ways: dict[int, Floats] = {}
        self.lines: Floats | None = None
        if np.any(carried):
            noise = max(load_cell.drive_angle_noise, load_cell.drive_angle_resolution)
            self.lines = self._drives(measured.sweep.values, poses, rod_of(measured).length, noise)

    def __len__(self) -> int:
        return len(self._segments)

    def __iter__(self) -> Iterator[Segment]:
        return iter(self._segments)

    def __getitem__(self, k: int) -> Segment:
        return self._segments[k]

    @property
    def contacts(self) -> list[tuple[tuple[float, float], bool, float]]:
        """Pivot [length], whether contact is on the side of a backward sweep, and sense of the drive, by segment."""
        return [(segment.base, segment.backward, segment.sense) for segment in self]

    @property
    def is_carried(self) -> bool:
        """True if a drive carries the base in any sweep."""
        return self.lines is not None

    def _drives(self, sweep: Index, poses: Floats, length: float, noise: float) -> Floats:
        """Return `lines`, and write the travels of the sweeps that carry the base, for a noise of the encoder."""
        drives = []
        for k, (row, segment) in enumerate(zip(self._angles, self, strict=True)):
            if segment.sense:
                drives.append(_TURNS)
                continue
            own = segment.samples
            once = poses[own[sweep[own] == sweep[own[0]]]]
            if np.ptp(once[:, 2]) <= _SCATTER * noise:
                once[:, 2] = once[:, 2].mean()
            path = lines_through(once, length, backward=segment.backward, off=max(_OFF, 3.0 * noise))
            row[: own.size] = np.tile(path.travels, own.size // len(once))
            self._ways[k] = np.append(0.0, np.cumsum(np.hypot(*np.diff(once[:, :2], axis=0).T)))
            drives.append(path.lines)
        lines = np.full((len(drives), max(map(len, drives)), LINE_COLUMNS), np.nan)
        for of_segment, drive in zip(lines, drives, strict=True):
            of_segment[: len(drive)] = drive
        return lines

    def event_samples(self, loaded: Flags) -> Index:
        """Return the samples between which the events of each segment lie, shape (segments, 4).

        They are the last before contact, the first and the last in contact, and the next after it; −1 if there is none.
        """
        out = np.full((len(self), 4), -1)
        for row, segment, angles in zip(out, self, self._angles, strict=True):
            order = np.argsort(angles[: segment.samples.size], kind="stable")
            first, last = _longest(loaded[segment.samples[order]])
            if first <= last:
                ranks = np.array([first - 1, first, last, last + 1])
                known = (ranks >= 0) & (ranks < order.size)
                row[known] = segment.samples[order[ranks[known]]]
        return out

    def event_angles(self, loaded: Flags) -> Floats:
        """Return the drive angles of `event_samples` in the sweep frame [rad]; NaN if there is none."""
        samples = self.event_samples(loaded)
        return np.where(samples >= 0, self.angles_in_sweep_frame[samples], np.nan)

    @cached_property
    def angles_in_sweep_frame(self) -> Floats:
        """Reading of the drive angle of each sample in the sweep frame [rad], shape (samples,); where the base is
        carried, its travel [L]."""
        angles = np.empty(self.drive_angles.size)
        for segment, row in zip(self, self._angles, strict=True):
            angles[segment.samples] = row[: segment.samples.size]
        return angles

    @cached_property
    def of_sample(self) -> Index:
        """Index of the segment of each sample, shape (samples,)."""
        which = np.empty(self.drive_angles.size, dtype=np.intp)
        for k, segment in enumerate(self):
            which[segment.samples] = k
        return which

    @property
    def signs_of_samples(self) -> Floats:
        """−1 for the samples of segments with contact as in a backward sweep, else 1, shape (samples,)."""
        return np.asarray(self.signs[self.of_sample])

    @cached_property
    def course(self) -> Course:
        """Order in which a discrepancy passes through the samples: by drive angle, in the direction of the drive, or by
        travel where the drive carries the base.

        Sweeps from one pivot in one direction, or carried through the same poses, repeat each other, and have one
        discrepancy in common.
        """
        direction = np.where(self.senses == 0.0, 1.0, self.senses * self.signs)
        coordinate = direction[self.of_sample] * self.angles_in_sweep_frame
        return Course.along(coordinate, [segment.samples for segment in self])

    def ways(self, travels: Floats) -> Floats:
        """Convert travels in the sweep frame, shape (n, segments), to ways of the base [length] where it is carried,
        and to drive angles as read [rad] elsewhere."""
        ways = np.array(travels)
        for k, segment in enumerate(self):
            if segment.sense:
                ways[:, k] = np.pi - ways[:, k] if segment.backward else ways[:, k]
            else:
                ways[:, k] = np.interp(ways[:, k], self._angles[k, : self._ways[k].size], self._ways[k])
        return ways

    def samples_with(self, errors: Floats) -> Segments:
        """Return the samples of every segment, once for each error of the encoder, sorted by drive angle."""
        key = errors.tobytes()
        if key not in self._samples_by_errors:
            samples, angles = [], []
            for row, segment in zip(self._angles, self, strict=True):
                shifts = errors if segment.backward else -errors
                if not segment.sense:
                    shifts = np.zeros_like(errors)
                shifted = (row[: segment.samples.size] + shifts[:, None]).ravel()
                order = np.argsort(shifted, kind="stable")
                angles.append(shifted[order])
                rows = segment.samples + self.drive_angles.size * np.arange(errors.size)[:, None]
                samples.append(rows.ravel()[order])
            first = np.cumsum([0, *(part.size for part in samples)])
            self._samples_by_errors[key] = Segments(first, np.concatenate(samples), np.concatenate(angles), self.lines)
        return self._samples_by_errors[key]


def _repeated(measured: xr.Dataset, poses: Floats) -> Index:
    """Return for each sample one more than the first sweep that is carried through the same poses, shape (samples, 3),
    as its own; 0 if its sweep is not carried."""
    sweep, backward = measured.sweep.values, measured.direction.values == "backward"
    found, first = np.zeros(len(poses), dtype=np.intp), dict[tuple[bytes, bytes], int]()
    for number in carried_sweeps(measured):
        own = sweep == number
        found[own] = 1 + first.setdefault((poses[own].tobytes(), backward[own].tobytes()), number)
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

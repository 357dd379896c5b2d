"""Likelihood of a whole record, loaded and unloaded samples, for many contours at once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.special import logsumexp

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.contours import Contour
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.encoder import EncoderErrors
from tactile_bayes.inference.rod_tables import RodTables
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.discrepancy import Course, Discrepancy
from tactile_bayes.mechanics.line import LINE_COLUMNS, lines_through
from tactile_bayes.mechanics.paths import Paths, trace
from tactile_bayes.mechanics.profile import Profile
from tactile_bayes.mechanics.reachability import Reachability
from tactile_bayes.mechanics.shapes import shapes_of
from tactile_bayes.reconstruction import contact_sides
from tactile_bayes.record import (
    CHANNELS,
    base_of_sample,
    carried_sweeps,
    frame_of,
    present_channels,
    rod_of,
    to_dimensionless,
    turned,
)

if TYPE_CHECKING:
    from tactile_bayes.mechanics.forward_table import Tables
    from tactile_bayes.mechanics.sweeps import Segments, Shapes, Solutions, Sweeps

__all__ = ["RecordLikelihood", "Rig", "without_errors"]

_UNFELT = 2e-3
"""Error of loads over their noise that is negligible for 360 samples: it changes their log-likelihood by less than
0.05 in 999 of 1000 records."""

_LEAST = 1e-10
"""Least tolerance of loads, over the largest load: tables are no more accurate."""

_TABULATED = 5e-6
"""Least tolerance of loads for which the pose of a rod with a profile comes from a table."""

_OFF = 1e-6
"""Distance of recorded poses from a line [L and rad] that is rounding of the record."""

_SCATTER = 10.0
"""Range of drive angles, over the noise of their readings, of a rod that is clamped at one."""

_LENGTHS_OF_LINE = [0, 1, 3, 4]
"""Columns of a line that are lengths, or changes of lengths."""

_TURNS = np.array([[0.0, 0.0, -0.5 * np.pi, 0.0, 0.0, 1.0, -0.5 * np.pi, 1.5 * np.pi]])
"""Rotation as a line, with the drive angle as travel."""


@dataclass(frozen=True)
class _Segment:
    """A sweep segment: samples with one pivot, one side of contact and one direction of the drive, or those of sweeps
    in which the drive carries the base through the same poses."""

    pivot: int
    """Index of the pivot, in the order of the record."""
    base: tuple[float, float]
    """The pivot, or where the drive begins [length]."""
    backward: bool
    """True if the side of contact is that of a backward sweep."""
    sense: float
    """Direction of the drive, whatever the side of contact: +1 forward, −1 backward; 0 if it carries the base, which
    turns no encoder."""
    samples: Index
    """Indices of the samples, shape (samples of the segment,)."""


class Rig(NamedTuple):
    """Deviations of a rig from the stated one; numbers, or arrays of shape (n,) with one for every contour."""

    drive_angle_offset: Any = 0.0
    """Encoder offset in addition to that of the load cell's data sheet [rad]."""
    rigidity_scale: Any = 1.0
    """Flexural rigidity over the stated one."""
    suspension_compliance: Any = 0.0
    """Turn of the pivot's suspension per holding moment, in the unit of the record as stated [rad/(EI/L)]."""
    friction: Any = 0.0
    """Coulomb's coefficient."""
    drive_angle_backlash: Any = 0.0
    """Reading of the encoder in forward motion less that in backward motion, in addition to the data sheet [rad]."""
    rest_curvature: Any = 0.0
    """Rest curvature of the rod in addition to the stated one [1/L]."""
    taper: Any = 0.0
    """Taper of the rod in addition to the stated one."""
    stem: Any = 0.0
    """Rigid piece between pivot and rod in addition to the stated one [L]."""
    length: Any = 1.0
    """Length of the rod over the stated one; its rest curvature, and what is added to it, are then per that length."""
    base_shifts: Any = None
    """Shifts of pivots from their recorded positions [length], shape (n, pivots, 2), in the order of the record; pivots
    after the last given one are not shifted."""


def _repeated(measured: xr.Dataset, poses: Floats) -> Index:
    """Return for each sample one more than the first sweep that is carried through the same poses, shape (samples, 3),
    as its own; 0 if its sweep is not carried."""
    sweep, backward = measured.sweep.values, measured.direction.values == "backward"
    found, first = np.zeros(len(poses), dtype=np.intp), dict[tuple[bytes, bytes], int]()
    for number in carried_sweeps(measured):
        own = sweep == number
        found[own] = 1 + first.setdefault((poses[own].tobytes(), backward[own].tobytes()), number)
    return found


class RecordLikelihood:
    """Likelihood of a record as a function of contour, rig and noise.

    Contours are in the record's unit of length, loads inside in EI/L and EI/L². Because loads drop to zero at snap-off,
    the likelihood distinguishes contours that release the rod earlier or later than the record shows. Predicted forces
    are turned into the record's frame, since measured ones may lack a component.

    Parameters
    ----------
    measured : xr.Dataset
        A valid record.
    load_cell : LoadCell
        Load cell in the record's units. Its encoder offset and backlash are subtracted from the drive angles.
    friction : float
        Coulomb's coefficient μ, >= 0.
    exact : bool
        Whether paths are exact to rounding; otherwise they are as accurate as the noise requires, at a fifth of the
        cost.
    is_always_clear : bool
        Whether the unloaded rod is clear of every contour after snap-off, so that clearance need not be checked.
        No load is predicted after snap-off, and contours that are not clear are excluded.

    Raises
    ------
    ParameterError
        If the frame of the load cell is another than the record's, or errors of the encoder are combined with drift or
        an uncertain bias, for which there is no closed form.
    """

    def __init__(
        self,
        measured: xr.Dataset,
        load_cell: LoadCell,
        friction: float = 0.0,
        exact: bool = False,
        is_always_clear: bool = True,
    ) -> None:
        self.exact = exact
        self.is_always_clear = is_always_clear
        self.rod = rod_of(measured)
        self.friction = friction
        record = to_dimensionless(measured)
        load_cell.refuse_other_frame(measured)
        self.load_cell = load_cell.dimensionless(self.rod)
        self.encoder = EncoderErrors(self.load_cell)
        if self.encoder.count > 1 and (load_cell.drift or any(load_cell.bias_uncertainty)):
            raise ParameterError(
                "drive_angle_noise or drive_angle_resolution together with drift or bias_uncertainty have no closed "
                "form: leave one of the two out (a bias can be inferred instead, as a nuisance parameter)"
            )
        self.measured = np.stack([record[name].values for name in CHANNELS], axis=-1)
        self.noise = self.load_cell.noise
        angle = record.drive_angle.values - load_cell.misread(measured.direction.values)
        self._turn = angle if frame_of(record) == "turning" else None
        backward = contact_sides(without_errors(measured, load_cell), load_cell) < 0.0
        bases, of_sample = base_of_sample(measured)
        poses = np.column_stack([measured.base_x.values, measured.base_y.values, angle])
        carried = _repeated(measured, poses)
        sense = np.where(carried > 0, 0.0, np.where(measured.direction.values == "backward", -1.0, 1.0))
        places = np.array(bases)[of_sample]
        kinds, which = np.unique(np.column_stack([places, backward, sense, carried]), axis=0, return_inverse=True)
        rows = [np.flatnonzero(which == k) for k in range(len(kinds))]
        self.segments = [
            _Segment(int(of_sample[own[0]]), bases[of_sample[own[0]]], bool(kind[2]), float(kind[3]), own)
            for kind, own in zip(kinds, rows, strict=True)
        ]
        self._pivots = np.array([segment.pivot for segment in self.segments])
        self._signs = np.array([-1.0 if segment.backward else 1.0 for segment in self.segments])
        longest = max(segment.samples.size for segment in self.segments)
        self._samples_by_errors: dict[bytes, Segments] = {}
        self._tables = RodTables(self.rod, friction, bool(np.any(carried)))
        self._angles = np.full((len(self.segments), longest), np.nan)
        for row, segment in zip(self._angles, self.segments, strict=True):
            read = angle[segment.samples]
            row[: read.size] = np.pi - read if segment.backward else read
        self._ways: dict[int, Floats] = {}
        self._lines = self._drives(measured.sweep.values, poses) if np.any(carried) else None

    def _drives(self, sweep: Index, poses: Floats) -> Floats:
        """Return the lines of all drives, as in `Segments`; travels take the place of drive angles in those that carry.

        A rotation is a line along the drive angle.
        """
        noise = max(self.load_cell.drive_angle_noise, self.load_cell.drive_angle_resolution)
        drives = []
        for k, (row, segment) in enumerate(zip(self._angles, self.segments, strict=True)):
            if segment.sense:
                drives.append(_TURNS)
                continue
            own = segment.samples
            once = poses[own[sweep[own] == sweep[own[0]]]]
            if np.ptp(once[:, 2]) <= _SCATTER * noise:
                once[:, 2] = once[:, 2].mean()
            path = lines_through(once, self.rod.length, backward=segment.backward, off=max(_OFF, 3.0 * noise))
            row[: own.size] = np.tile(path.travels, own.size // len(once))
            self._ways[k] = np.append(0.0, np.cumsum(np.hypot(*np.diff(once[:, :2], axis=0).T)))
            drives.append(path.lines)
        lines = np.full((len(drives), max(map(len, drives)), LINE_COLUMNS), np.nan)
        for of_segment, drive in zip(lines, drives, strict=True):
            of_segment[: len(drive)] = drive
        return lines

    @property
    def contacts(self) -> list[tuple[tuple[float, float], bool, float]]:
        """Pivot [length], whether contact is on the side of a backward sweep, and sense of the drive, by segment."""
        return [(segment.base, segment.backward, segment.sense) for segment in self.segments]

    @property
    def is_carried(self) -> bool:
        """True if a drive carries the base in any sweep."""
        return self._lines is not None

    @property
    def noise(self) -> Floats:
        """Approximate standard deviation of each channel, to which tolerances are relative, shape (3,)."""
        return self._noise

    @noise.setter
    def noise(self, deviation: Floats) -> None:
        self._noise = np.asarray(deviation, dtype=float)
        largest = np.nan_to_num(np.abs(self.measured)).max(axis=0)
        share = _UNFELT * math.sqrt(min(1.0, 360.0 / len(self.measured)))
        self._tolerance = np.maximum(share * self._noise, _LEAST * np.maximum(largest, 1.0))

    def paths(
        self, contours: Contour, rig: Rig | None = None, *, exact: bool = True, drive_angles: Floats | None = None
    ) -> Paths:
        """Return the paths of every contour in every segment; batch index k·n + i is contour i in segment k.

        Parameters
        ----------
        contours : Contour
            Contours with parameters of shape (n,).
        rig : Rig, optional
            Deviations from the stated rig.
        exact : bool
            Whether paths are exact to rounding, or as accurate as the noise requires.
        drive_angles : ndarray, shape (segments · n, k), optional
            Travels as from `travels`, or others in the sweep frame.
        """
        rig = self._rig_of(rig, contours.shape[0])
        segments, lines = len(self.segments), None
        if self._lines is not None:
            lines = np.repeat(self._lines[:, None], contours.shape[0], axis=1)
            lines[..., 2] -= (self._signs * self._misread(rig)).T[..., None]
            lines[..., _LENGTHS_OF_LINE] /= rig.length[:, None, None]
            lines = lines.reshape(-1, *lines.shape[2:])
        return trace(
            self._in_sweep_frame(contours, rig),
            friction_angle=np.tile(np.arctan(rig.friction), segments),
            suspension_compliance=np.tile(self._compliance(rig), segments),
            profile=self._profile(rig),
            tolerance=None if exact else self._tolerance,
            drive_angles=drive_angles,
            lines=lines,
        )

    def _in_sweep_frame(self, contours: Contour, rig: Rig) -> SweepFrame:
        (count,), segments = contours.shape, len(self.segments)
        base_x, base_y = self._bases(rig).reshape(-1, 2).T
        backward = np.repeat(self._signs < 0.0, count)
        every = contours.take(np.tile(np.arange(count), segments))
        length = np.tile(self.rod.length * rig.length, segments)
        of_rod = (np.tile(values, segments) for values in (*self._shape_of_rod(rig), self._stem(rig)))
        return SweepFrame(every, base_x, base_y, length, 0.5 * self.rod.diameter, backward, *of_rod)

    def _profile(self, rig: Rig) -> Profile | None:
        """Return the profile of the rod, without what the rig adds to it; None for arcs."""
        return self._as_profile if self.rod.profile is not None or np.any(rig.taper) else None

    @cached_property
    def _as_profile(self) -> Profile:
        return self.rod.as_profile()

    def _shape_of_rod(self, rig: Rig) -> tuple[Floats, Floats]:
        """Return rest curvature and taper of each contour, as in `Sweeps`."""
        known = self.rod.rest_curvature / self.rod.curvature_unit if self._profile(rig) is None else 0.0
        return known + rig.rest_curvature, self.rod.taper + rig.taper

    def _stem(self, rig: Rig) -> Floats:
        """Return the stem of each contour, in lengths of its rod."""
        return np.asarray((self.rod.stem / self.rod.length + rig.stem) / rig.length)

    def _compliance(self, rig: Rig) -> Floats:
        """Return the compliance of the suspension of each contour, in rad per EI/L of its rod."""
        return np.asarray(rig.suspension_compliance * rig.rigidity_scale / rig.length)

    def _known(self, rig: Rig) -> Tables:
        """Return tables for the rod, as far as the noise allows their errors."""
        from tactile_bayes.mechanics.forward_table import NO_TABLES  # numba takes a second to load

        profile = self._profile(rig)
        if self.exact or profile is None or self._tolerance.min() < _TABULATED:
            return NO_TABLES
        return self._tables.known(profile, rig.taper, rig.rest_curvature, rig.friction, rig.length)

    def _bases(self, rig: Rig) -> Floats:
        """Return the pivots, shape (segments, n, 2)."""
        stated = np.array([segment.base for segment in self.segments])
        return np.asarray(stated[:, None] + rig.base_shifts[:, self._pivots].swapaxes(0, 1))

    def snap_offs(self, contours: Contour, rig: Rig | None = None) -> Floats:
        """Return the readings of the drive angle at snap-off, in the sweep frame [rad], shape (n, segments)."""
        rig = self._rig_of(rig, contours.shape[0])
        return self._events(self._solutions(contours, rig), rig)[..., 1]

    def travels(self, drive_angles: Floats, rig: Rig) -> Floats:
        """Return travels of samples as `paths` takes them, shape (n or 1, samples): drive angles [rad], or ways [L].

        Parameters
        ----------
        drive_angles : ndarray, shape (samples,)
            Readings of drive angles, corrected by the data sheet; NaN for samples without interest.
        rig : Rig
            Deviations from the stated rig.
        """
        backward = np.array([segment.backward for segment in self.segments])[self.segment_of_sample]
        in_sweep_frame = np.where(backward, np.pi - drive_angles, drive_angles)[None]
        if self._lines is None:
            return np.asarray(in_sweep_frame - np.where(backward, -1.0, 1.0) * self.misread(rig))
        carried = np.array([not segment.sense for segment in self.segments])[self.segment_of_sample]
        known = carried & np.isfinite(drive_angles)
        return np.where(known, self.angles_in_sweep_frame, in_sweep_frame)

    def ways(self, travels: Floats) -> Floats:
        """Convert travels in the sweep frame, shape (n, segments), to ways of the base [length] where it is carried,
        and to drive angles as read [rad] elsewhere."""
        ways = np.array(travels)
        for k, segment in enumerate(self.segments):
            if segment.sense:
                ways[:, k] = np.pi - ways[:, k] if segment.backward else ways[:, k]
            else:
                ways[:, k] = np.interp(ways[:, k], self._angles[k, : self._ways[k].size], self._ways[k])
        return ways

    def misread(self, rig: Rig) -> Floats:
        """Return the errors of the encoder in addition to the data sheet [rad], shape (n or 1, samples)."""
        return self._misread(rig)[:, self.segment_of_sample]

    def _misread(self, rig: Rig) -> Floats:
        """Return the errors of the encoder by segment [rad], shape (n or 1, segments)."""
        offset, backlash = (np.atleast_1d(v)[:, None] for v in (rig.drive_angle_offset, rig.drive_angle_backlash))
        return np.asarray(offset + 0.5 * backlash * np.array([segment.sense for segment in self.segments]))

    def event_samples(self, loaded: Flags) -> Index:
        """Return the samples between which the events of each segment lie, shape (segments, 4).

        They are the last before contact, the first and the last in contact, and the next after it; −1 if there is none.

        Parameters
        ----------
        loaded : ndarray of bool, shape (samples,)
            True for samples with a load that noise does not explain.
        """
        out = np.full((len(self.segments), 4), -1)
        for row, segment, angles in zip(out, self.segments, self._angles, strict=True):
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
        angles = np.empty(len(self.measured))
        for segment, row in zip(self.segments, self._angles, strict=True):
            angles[segment.samples] = row[: segment.samples.size]
        return angles

    @cached_property
    def segment_of_sample(self) -> Index:
        """Index of the segment of each sample, shape (samples,)."""
        which = np.empty(len(self.measured), dtype=np.intp)
        for k, segment in enumerate(self.segments):
            which[segment.samples] = k
        return which

    @property
    def signs_of_samples(self) -> Floats:
        """−1 for the samples of segments with contact as in a backward sweep, else 1, shape (samples,)."""
        return np.asarray(self._signs[self.segment_of_sample])

    @cached_property
    def course(self) -> Course:
        """Order in which a discrepancy passes through the samples: by drive angle, in the direction of the drive, or by
        travel where the drive carries the base.

        Sweeps from one pivot in one direction, or carried through the same poses, repeat each other, and have one
        discrepancy in common.
        """
        pairs = zip(self.segments, self._signs, strict=True)
        direction = np.array([segment.sense * sign or 1.0 for segment, sign in pairs])
        coordinate = direction[self.segment_of_sample] * self.angles_in_sweep_frame
        return Course.along(coordinate, [segment.samples for segment in self.segments])

    def usable(self, contours: Contour, rig: Rig | None = None) -> Flags:
        """Return True for contours that the rod reaches in every segment and is clear of after snap-off, shape (n,)."""
        return self._usable(self._solutions(contours, self._rig_of(rig, contours.shape[0])))

    def predict(self, contours: Contour, rig: Rig | None = None) -> tuple[Floats, Flags]:
        """Return noise-free loads, shape (n, samples, 3), and which contours are usable, shape (n,).

        Forces are in the record's frame, loads in EI/L and EI/L² of the stated rod, at the drive angles read.
        """
        return self.predict_with_events(contours, rig)[:2]

    def predict_with_errors(self, contours: Contour, rig: Rig | None = None) -> tuple[Floats, Flags]:
        """Return loads for every error of the encoder, shape (n, errors, samples, 3), and which contours are usable."""
        return self._predict(contours, rig, self.encoder.errors)[:2]

    def predict_with_events(self, contours: Contour, rig: Rig | None = None) -> tuple[Floats, Flags, Floats]:
        """Return the results of `predict`, and the drive angles of first contact and snap-off.

        The angles are readings in the sweep frame [rad], shape (n, segments, 2); NaN if there is no such event.
        """
        loads, reached, events = self._predict(contours, rig, np.zeros(1))
        return loads[:, 0], reached, events

    def _predict(self, contours: Contour, rig: Rig | None, errors: Floats) -> tuple[Floats, Flags, Floats]:
        rig = self._rig_of(rig, contours.shape[0])
        found = self._solutions(contours, rig, errors)
        predicted = found.loads.reshape(-1, errors.size, *self.measured.shape)
        if self._turn is not None:
            turn = self._turn - self.misread(rig)[:, None] - errors[:, None]
            predicted[..., 1], predicted[..., 2] = turned(predicted[..., 1], predicted[..., 2], turn)
        return predicted, self._usable(found), self._events(found, rig)

    def _solutions(self, contours: Contour, rig: Rig, errors: Floats | None = None) -> Solutions:
        """Solve the forward model; batch index k·n + i is contour i in segment k; without errors, for no samples."""
        from tactile_bayes.mechanics.sweeps import solve_sweeps  # numba takes a second to load

        errors = np.empty(0) if errors is None else errors
        return solve_sweeps(
            self._shapes(contours, rig),
            self._sweeps(rig),
            self._samples_with(errors),
            (contours.shape[0], errors.size * len(self.measured)),
            profile=self._profile(rig),
            known=self._known(rig),
            tolerance=None if self.exact else self._tolerance,
            asks_clearance=not self.is_always_clear,
        )

    def _usable(self, found: Solutions) -> Flags:
        usable = found.reach == Reachability.TOUCHES
        if not self.is_always_clear:
            usable &= found.snap_angle > found.clear_angle
        return np.asarray(usable.reshape(len(self.segments), -1).all(axis=0))

    def _events(self, found: Solutions, rig: Rig) -> Floats:
        """Return readings of the drive angle at first contact and snap-off, in the sweep frame, (n, segments, 2)."""
        events = np.stack([found.first_angle, found.snap_angle], axis=-1).reshape(len(self.segments), -1, 2)
        misread = 0.0 if self._lines is not None else (self._signs * self._misread(rig))[..., None]
        return np.asarray(events.swapaxes(0, 1) + misread)

    def _shapes(self, contours: Contour, rig: Rig) -> Shapes:
        if contours.halves is not None:
            return shapes_of(contours)
        low, high = (end.reshape(len(self.segments), -1) for end in self._in_sweep_frame(contours, rig).own_domain())
        return shapes_of(contours, low.min(axis=0), high.max(axis=0))

    def _sweeps(self, rig: Rig) -> Sweeps:
        from tactile_bayes.mechanics.sweeps import Sweeps

        count, segments = rig.friction.size, len(self.segments)
        bases, (curvature, taper) = self._bases(rig), self._shape_of_rod(rig)
        return Sweeps(
            contour=np.tile(np.arange(count), segments),
            segment=np.repeat(np.arange(segments), count),
            base_x=bases[..., 0].ravel(),
            base_y=bases[..., 1].ravel(),
            length=np.tile(self.rod.length * rig.length, segments),
            standoff=np.full(segments * count, 0.5 * self.rod.diameter),
            backward=np.repeat(self._signs < 0.0, count),
            friction_angle=np.tile(np.arctan(rig.friction), segments),
            compliance=np.tile(self._compliance(rig), segments),
            rest_curvature=np.tile(curvature, segments),
            taper=np.tile(taper, segments),
            stem=np.tile(self._stem(rig), segments),
            offset=np.broadcast_to(self._misread(rig), (count, segments)).T.flatten(),
            rigidity=np.tile(rig.rigidity_scale, segments),
            relative_length=np.tile(rig.length, segments),
        )

    def _rig_of(self, rig: Rig | None, count: int) -> Rig:
        """Return the rig of every contour, with the stated values as defaults."""
        rig = rig or Rig(friction=self.friction)
        shifts = np.zeros((count, self._pivots.max() + 1, 2))
        if rig.base_shifts is not None:
            shifts[:, : rig.base_shifts.shape[1]] = rig.base_shifts
        return Rig._make((*(np.broadcast_to(value, (count,)) for value in rig[:-1]), shifts))

    def _samples_with(self, errors: Floats) -> Segments:
        """Return the samples of every segment, once for each error of the encoder, sorted by drive angle."""
        from tactile_bayes.mechanics.sweeps import Segments

        key = errors.tobytes()
        if key not in self._samples_by_errors:
            samples, angles = [], []
            for row, segment in zip(self._angles, self.segments, strict=True):
                shifts = errors if segment.backward else -errors
                if not segment.sense:
                    shifts = np.zeros_like(errors)
                shifted = (row[: segment.samples.size] + shifts[:, None]).ravel()
                order = np.argsort(shifted, kind="stable")
                angles.append(shifted[order])
                rows = segment.samples + len(self.measured) * np.arange(errors.size)[:, None]
                samples.append(rows.ravel()[order])
            first = np.cumsum([0, *(part.size for part in samples)])
            self._samples_by_errors[key] = Segments(first, np.concatenate(samples), np.concatenate(angles), self._lines)
        return self._samples_by_errors[key]

    def log_likelihood(
        self, contours: Contour, noise_scale: Any = 1.0, rig: Rig | None = None, *, pointwise: bool = False
    ) -> Floats:
        """Return the log-likelihood of each contour, shape (n,), or of each sample, (n, samples); −inf out of reach.

        Parameters
        ----------
        contours : Contour
            Contours with parameters of shape (n,).
        noise_scale : array_like, broadcastable to shape (n, 3)
            Factor on the load cell's standard deviations, by channel.
        rig : Rig, optional
            Deviations from the stated rig.
        pointwise : bool
            Whether the result is by sample.
        """
        return self.score(*self.predict_with_errors(contours, rig), noise_scale, pointwise=pointwise)

    def score(
        self,
        predicted: Floats,
        reached: Flags,
        noise_scale: Any = 1.0,
        *,
        pointwise: bool = False,
        discrepancy: Discrepancy | None = None,
    ) -> Floats:
        """Return the `log_likelihood` of contours from the loads of `predict_with_errors`, beside a discrepancy."""
        is_exact = self.encoder.count == 1
        scale = np.asarray(noise_scale, dtype=float)
        if scale.ndim > 1 and not is_exact:
            scale = scale[:, None]
        values = self.load_cell.log_likelihood(
            self.measured,
            predicted[:, 0] if is_exact else predicted,
            noise_scale=scale,
            pointwise=pointwise or not is_exact,
            discrepancy=discrepancy,
        )
        if not is_exact:
            values = logsumexp(values + self.encoder.log_weights[:, None], axis=1)
            values = values if pointwise else values.sum(axis=-1)
        values[~reached] = -np.inf
        if np.any(np.isnan(values)):
            raise ParameterError(
                f"the likelihood of {np.count_nonzero(np.isnan(values))} contours is not a number: please report this"
            )
        return values


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

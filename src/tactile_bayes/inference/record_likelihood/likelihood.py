"""Likelihood of a whole record, loaded and unloaded samples, for many contours at once."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from scipy.special import logsumexp, ndtr

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.contours import Contour
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.parameters.unknowns import RigValues
from tactile_bayes.inference.record_likelihood.record_segments import RecordSegments
from tactile_bayes.inference.record_likelihood.rod_tables import RodTables
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.averaged_cell import AveragedCell
from tactile_bayes.load_cell.blocks import Blocks
from tactile_bayes.load_cell.discrepancy import Discrepancy
from tactile_bayes.mechanics.branches.sweeps import Shapes, Solutions, Sweeps, shapes_of, solve_sweeps
from tactile_bayes.mechanics.paths import Paths, trace
from tactile_bayes.mechanics.reachability import Reachability
from tactile_bayes.mechanics.rods.profile import MOST_MODES, Profile
from tactile_bayes.record import CHANNELS, frame_of, loads_of, rod_of, to_dimensionless, turned

if TYPE_CHECKING:
    from tactile_bayes.mechanics.poses.forward_table import Tables

_WIDEST, _NARROWEST = 0.75, 0.1  # distance between neighbouring errors, in standard deviations, at most and at least
_REACH = 3.75  # largest error that is taken into account, in standard deviations
_STEEP = np.array([10.0, 30.0, 30.0])  # change of loads close to snap-off [EI/L and EI/L² per rad]


class EncoderErrors:
    """Quadrature nodes (reading less true angle [rad]) and weights over errors of the encoder of a dimensionless cell.
    A sample's log-probability errs by 0.001, and by 0.8 at worst next to an event, which is resolved to the nodes."""

    def __init__(self, cell: LoadCell) -> None:
        noise, step = cell.drive_angle_noise, cell.drive_angle_resolution
        # The sum resolves loads that change by their noise over the distance of nodes.
        resolved = float(np.min(np.where(cell.noise > 0.0, cell.noise, np.inf) / _STEEP))
        if noise:
            distance = noise * float(np.clip(resolved / noise, _NARROWEST, _WIDEST))
            half = int(np.ceil((_REACH * noise + 0.5 * step) / distance))
            errors = np.linspace(-half * distance, half * distance, 2 * half + 1)
            logs = _log_density(errors, noise, step)
        else:
            count = int(np.ceil(step / resolved)) + 2 if step else 1
            errors, logs = step * ((np.arange(count) + 0.5) / count - 0.5), np.zeros(count)
        self.errors, self.log_weights = errors, logs - logsumexp(logs)

    @property
    def count(self) -> int:
        """Number of nodes."""
        return int(self.errors.size)

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Index:
        """Draw indices of errors by their weights."""
        return rng.choice(self.count, size=shape, p=np.exp(self.log_weights))


def _log_density(error: Floats, noise: float, step: float) -> Floats:
    """Return the log-density of the sum of a normal error and a uniform one over a step, up to a constant."""
    if step == 0.0:
        return np.asarray(-0.5 * (error / noise) ** 2)
    far, near = (np.abs(error) + 0.5 * step) / noise, (np.abs(error) - 0.5 * step) / noise
    return np.asarray(np.log(ndtr(-near) - ndtr(-far)))


_UNFELT = 2e-3  # error of loads over their noise that changes the log-likelihood of 360 samples by less than 0.05
_LEAST = 1e-10  # least tolerance of loads, over the largest load: tables are no more accurate
# Least tolerance of loads, over the largest load, for which the pose of a rod with a profile comes from a table, or a
# shorter series: errors are shares of the loads, which are large where a rod touches an object near its pivot.
_ROUGHLY = 1e-6
_LENGTHS_OF_LINE = [0, 1, 3, 4]  # columns of a line that are lengths, or changes of lengths


class RecordLikelihood:
    """Likelihood of a record as a function of contour (in the record's unit of length), rig and noise.

    Loads inside are in EI/L and EI/L², forces in the record's frame. With `exact`, paths are so to rounding; otherwise
    as the noise requires, at a fifth of the cost. Unless `is_always_clear`, contours that the unloaded rod is not clear
    of after snap-off are excluded. Friction acts if it is stated, or if the rod `rubs` with that of a rig.
    """

    def __init__(
        self,
        measured: xr.Dataset,
        load_cell: LoadCell,
        friction: float = 0.0,
        exact: bool = False,
        is_always_clear: bool = True,
        rubs: bool = False,
    ) -> None:
        self.exact = exact
        self.is_always_clear = is_always_clear
        self.rod = rod_of(measured)
        self.friction = friction
        record = to_dimensionless(measured)
        load_cell.refuse_other_frame(measured)
        self.blocks = Blocks.of(measured, self.rod)
        single = load_cell.dimensionless(self.rod)
        self.load_cell = single if self.blocks is None else AveragedCell.of(single, self.blocks.readings)
        self.encoder = EncoderErrors(self.load_cell)
        if self.encoder.count > 1 and (load_cell.drift or any(load_cell.bias_uncertainty)):
            raise ParameterError(
                "drive_angle_noise or drive_angle_resolution together with drift or bias_uncertainty have no closed "
                "form: leave one of the two out (a bias can be inferred instead, as an unknown of the rig)"
            )
        self.measured = loads_of(record)
        self.noise = self.load_cell.noise
        self.segments = RecordSegments(measured, load_cell, rubs or friction > 0.0)
        self._turn = self.segments.drive_angles if frame_of(record) == "turning" else None
        self._tables = RodTables(self.rod, friction)

    @property
    def noise(self) -> Floats:
        """Approximate standard deviation of each channel, to which tolerances are relative, shape (3,)."""
        return self._noise

    @noise.setter
    def noise(self, deviation: Floats) -> None:
        self._noise = np.asarray(deviation, dtype=float)
        per_load = np.abs(self.load_cell.own_gains)  # of a sensor that counts, in counts
        largest = np.maximum(np.nan_to_num(np.abs(self.measured)).max(axis=0) / per_load, 1.0)
        readings = len(self.measured) if self.blocks is None else float(self.blocks.readings.sum())
        share = _UNFELT * math.sqrt(min(1.0, 360.0 / readings))
        self._tolerance = np.maximum(share * self._noise / per_load, _LEAST * largest)
        self._tolerated_share = float((self._tolerance / largest).min())

    @property
    def _may_be_rough(self) -> bool:
        """True if errors of a table, or of shorter series, are negligible."""
        return not self.exact and self._tolerated_share >= _ROUGHLY

    def paths(
        self, contours: Contour, rig: RigValues | None = None, *, exact: bool = True, drive_angles: Floats | None = None
    ) -> Paths:
        """Return the paths of every contour in every segment; batch index k·n + i is contour i in segment k."""
        rig, lines = self._rig_of(rig, contours.shape[0]), None
        sweeps = self._sweeps(rig)
        if self.segments.lines is not None:
            lines = np.repeat(self.segments.lines[:, None], contours.shape[0], axis=1)
            lines[..., 2] -= (self.segments.signs * self._misread(rig)).T[..., None]
            lines[..., _LENGTHS_OF_LINE] /= rig.length[:, None, None]
            lines = lines.reshape(-1, *lines.shape[2:])
        return trace(
            self._in_sweep_frame(contours, sweeps),
            friction_angle=sweeps.friction_angle,
            suspension_compliance=sweeps.compliance,
            contact_compliance=sweeps.yielding,
            profile=self._profile(rig),
            tolerance=None if exact else self._tolerance,
            drive_angles=drive_angles,
            lines=lines,
        )

    def _in_sweep_frame(self, contours: Contour, sweeps: Sweeps) -> SweepFrame:
        every, standoff = contours.take(sweeps.contour), 0.5 * self.rod.diameter
        of_rod = sweeps.rest_curvature, sweeps.taper, sweeps.stem, 0.0, sweeps.rest_shape
        return SweepFrame(every, sweeps.base_x, sweeps.base_y, sweeps.length, standoff, sweeps.backward, *of_rod)

    def _profile(self, rig: RigValues) -> Profile | None:
        """Return the profile of the rod, without what the rig adds to it; None for arcs."""
        varies = self.rod.profile is not None or np.any(rig.taper) or np.any(rig.rest_shape)
        return self._as_profile if varies else None

    @cached_property
    def _as_profile(self) -> Profile:
        return self.rod.as_profile()

    def _known(self, rig: RigValues) -> Tables:
        """Return tables for the rod, as far as the noise allows their errors."""
        from tactile_bayes.mechanics.poses.forward_table import NO_TABLES  # numba takes a second to load

        profile = self._profile(rig)
        # Where a rod may stick, sliding and sticking must not differ by the error of a table: it hardly yields along
        # itself. Tables of a rod whose shape is uncertain take longer than they save.
        if profile is None or not self._may_be_rough or self.segments.has_history or self.rod.rest_shape_modes:
            return NO_TABLES
        return self._tables.known(profile, rig.taper, rig.rest_curvature, rig.friction, rig.length)

    def travels(self, drive_angles: Floats, rig: RigValues) -> Floats:
        """Return travels of samples as `paths` takes them, shape (n or 1, samples): drive angles [rad], or ways [L]."""
        sign = self.segments.signs_of_samples
        in_sweep_frame = np.where(sign < 0.0, np.pi - drive_angles, drive_angles)[None]
        if not self.segments.has_history:
            return np.asarray(in_sweep_frame - sign * self.misread(rig))
        known = (self.segments.senses[self.segments.of_sample] == 0.0) & np.isfinite(drive_angles)
        return np.where(known, self.segments.angles_in_sweep_frame, in_sweep_frame)

    def misread(self, rig: RigValues) -> Floats:
        """Return the errors of the encoder in addition to the data sheet [rad], shape (n or 1, samples)."""
        return self._misread(rig)[:, self.segments.of_sample]

    def _misread(self, rig: RigValues) -> Floats:
        """Return the errors of the encoder by segment [rad], shape (n or 1, segments)."""
        offset, backlash = (np.atleast_1d(v)[:, None] for v in (rig.drive_angle_offset, rig.drive_angle_backlash))
        return np.asarray(offset + 0.5 * backlash * self.segments.senses)

    def usable(self, contours: Contour, rig: RigValues | None = None) -> Flags:
        """Return True for contours that the rod reaches in every segment and is clear of after snap-off, shape (n,)."""
        return self._usable(self._solutions(contours, self._rig_of(rig, contours.shape[0])))

    def predict(self, contours: Contour, rig: RigValues | None = None) -> tuple[Floats, Flags]:
        """Return noise-free loads [stated EI/L, EI/L²], (n, samples, 3), and which contours are usable, (n,)."""
        return self.predict_with_events(contours, rig)[:2]

    def predict_with_errors(self, contours: Contour, rig: RigValues | None = None) -> tuple[Floats, Flags]:
        """Return loads for every error of the encoder, shape (n, errors, samples, 3), and which contours are usable."""
        return self._predict(contours, rig, self.encoder.errors)[:2]

    def predict_with_events(self, contours: Contour, rig: RigValues | None = None) -> tuple[Floats, Flags, Floats]:
        """Return the results of `predict`, and readings [rad] at first contact and snap-off, (n, segments, 2)."""
        loads, reached, events = self._predict(contours, rig, np.zeros(1))
        return loads[:, 0], reached, events

    def _predict(self, contours: Contour, rig: RigValues | None, errors: Floats) -> tuple[Floats, Flags, Floats]:
        rig = self._rig_of(rig, contours.shape[0])
        found = self._solutions(contours, rig, errors)
        predicted = found.loads.reshape(-1, errors.size, *self.measured.shape)
        if self._turn is not None:
            turn = self._turn - self.misread(rig)[:, None] - errors[:, None]
            predicted[..., 1], predicted[..., 2] = turned(predicted[..., 1], predicted[..., 2], turn)
        return predicted, self._usable(found), self._events(found, rig)

    def _solutions(self, contours: Contour, rig: RigValues, errors: Floats | None = None) -> Solutions:
        """Solve the forward model; batch index k·n + i is contour i in segment k; without errors, for no samples."""
        errors = np.empty(0) if errors is None else errors
        sweeps = self._sweeps(rig)
        return solve_sweeps(
            self._shapes(contours, sweeps),
            sweeps,
            self.segments.samples_with(errors),
            (contours.shape[0], errors.size * len(self.measured)),
            profile=self._profile(rig),
            known=self._known(rig),
            tolerance=None if self.exact else self._tolerance,
            # A rod that turns about a pivot begins at a point of its shape at rest, which a shorter series would miss.
            roughly=self._may_be_rough and self.segments.has_history,
            asks_clearance=not self.is_always_clear,
        )

    def _usable(self, found: Solutions) -> Flags:
        usable = found.reach == Reachability.TOUCHES
        if not self.is_always_clear:
            usable &= found.snap_angle > found.clear_angle
        return np.asarray(usable.reshape(len(self.segments), -1).all(axis=0))

    def _events(self, found: Solutions, rig: RigValues) -> Floats:
        """Return readings of the drive angle at first contact and snap-off, in the sweep frame, (n, segments, 2)."""
        events = np.stack([found.first_angle, found.snap_angle], axis=-1).reshape(len(self.segments), -1, 2)
        misread = 0.0 if self.segments.has_history else (self.segments.signs * self._misread(rig))[..., None]
        return np.asarray(events.swapaxes(0, 1) + misread)

    def _shapes(self, contours: Contour, sweeps: Sweeps) -> Shapes:
        if contours.halves is not None:
            return shapes_of(contours)
        low, high = (end.reshape(len(self.segments), -1) for end in self._in_sweep_frame(contours, sweeps).own_domain())
        return shapes_of(contours, low.min(axis=0), high.max(axis=0))

    def _sweeps(self, rig: RigValues) -> Sweeps:
        count, segments, rod = rig.friction.size, len(self.segments), self.rod
        bases = self.segments.bases[:, None] + rig.base_shifts[:, self.segments.pivots].swapaxes(0, 1)
        curvature = rod.rest_curvature / rod.curvature_unit if self._profile(rig) is None else 0.0
        return Sweeps(
            contour=np.tile(np.arange(count), segments),
            segment=np.repeat(np.arange(segments), count),
            base_x=bases[..., 0].ravel(),
            base_y=bases[..., 1].ravel(),
            length=np.tile(rod.length * rig.length, segments),
            standoff=np.full(segments * count, 0.5 * rod.diameter),
            backward=np.repeat(self.segments.signs < 0.0, count),
            friction_angle=np.tile(np.arctan(rig.friction), segments),
            compliance=np.tile(rig.suspension_compliance * rig.rigidity_scale / rig.length, segments),
            yielding=np.tile(rig.contact_compliance * rig.rigidity_scale / rig.length**3, segments),
            rest_curvature=np.tile(curvature + rig.rest_curvature, segments),
            rest_shape=np.tile(rig.rest_shape, (segments, 1)),
            taper=np.tile(rod.taper + rig.taper, segments),
            stem=np.tile((rod.stem / rod.length + rig.stem) / rig.length, segments),
            offset=np.broadcast_to(self._misread(rig), (count, segments)).T.flatten(),
            rigidity=np.tile(rig.rigidity_scale, segments),
            relative_length=np.tile(rig.length, segments),
        )

    def _rig_of(self, rig: RigValues | None, count: int) -> RigValues:
        """Return the rig of every contour, with the stated values as defaults."""
        rig = rig or RigValues(friction=self.friction)
        shifts = np.zeros((count, self.segments.pivots.max() + 1, 2))
        if rig.base_shifts is not None:
            shifts[:, : rig.base_shifts.shape[1]] = rig.base_shifts
        shape = np.broadcast_to(0.0 if rig.rest_shape is None else rig.rest_shape, (count, MOST_MODES))
        return RigValues._make((*(np.broadcast_to(value, (count,)) for value in rig[:-2]), shape, shifts))

    def log_likelihood(
        self, contours: Contour, noise_scale: Any = 1.0, rig: RigValues | None = None, *, pointwise: bool = False
    ) -> Floats:
        """Return the log-likelihood of each contour, shape (n,), or of each sample, (n, samples); −inf out of reach."""
        return self.score(*self.predict_with_errors(contours, rig), noise_scale, pointwise=pointwise)

    def score(
        self,
        predicted: Floats,
        reached: Flags,
        noise_scale: Any = 1.0,
        *,
        pointwise: bool = False,
        discrepancy: Discrepancy | None = None,
        channels: int = len(CHANNELS),
    ) -> Floats:
        """Return the `log_likelihood` of the first channels from the loads of `predict_with_errors`."""
        measured = self.measured
        if channels < len(CHANNELS):
            measured = np.where(np.arange(len(CHANNELS)) < channels, measured, np.nan)
        is_exact = self.encoder.count == 1
        scale = np.asarray(noise_scale, dtype=float)
        if scale.ndim > 1 and not is_exact:
            scale = scale[:, None]
        values = self.load_cell.log_likelihood(
            measured,
            predicted[:, 0] if is_exact else predicted,
            noise_scale=scale,
            pointwise=pointwise or not is_exact,
            discrepancy=discrepancy,
        )
        if not is_exact:
            values = logsumexp(values + self.encoder.log_weights[:, None], axis=1)
            values = values if pointwise else values.sum(axis=-1)
        if self.blocks is not None:
            assert isinstance(self.load_cell, AveragedCell)
            of_reading = np.atleast_2d(self.load_cell.deviation_of_readings(predicted[:, 0]))
            deviation = of_reading * (scale[..., None, :] if scale.ndim else scale)
            present = np.asarray(~np.isnan(measured).all(axis=0))
            values = values + self.blocks.log_density_within(deviation, present, pointwise=pointwise)
        values[~reached] = -np.inf
        if np.any(np.isnan(values)):
            raise ParameterError(
                f"the likelihood of {np.count_nonzero(np.isnan(values))} contours is not a number: please report this"
            )
        return values

    def score_readings(
        self, predicted: Floats, reached: Flags, noise_scale: Any, discrepancy: Discrepancy | None
    ) -> Floats:
        """Return the pointwise `score` of each measured channel given those before it, (n, samples, channels)."""
        present = np.flatnonzero(~np.isnan(self.measured).all(axis=0))
        sums = [
            self.score(predicted, reached, noise_scale, pointwise=True, discrepancy=discrepancy, channels=int(last) + 1)
            for last in present
        ]
        return np.diff(np.stack(sums, axis=-1), prepend=0.0)


def events_of(
    likelihood: RecordLikelihood, contours: Contour, rig: RigValues | None = None, *, exact: bool = True
) -> dict[str, Floats]:
    """Return drive angle and contact point of first contact and snap-off in every sweep segment, (n, segments)."""
    count = contours.shape[0]
    paths = likelihood.paths(contours, rig, exact=exact)
    batch = np.arange(paths.sweep_frame.size)
    backward = paths.sweep_frame.mirrored
    out = {}
    for label, angle, parameter in (
        ("first", paths.first_angle, paths.first_parameter),
        ("snap_off", paths.snap_angle, paths.snap_parameter),
    ):
        locus = paths.sweep_frame.contour.take(batch).locate(np.where(backward, -parameter, parameter))
        turned = paths.drive_angles_at(angle)
        out[f"{label}_drive_angle"] = np.where(backward, np.pi - turned, turned)
        if paths.lines is not None:
            out[f"{label}_travel"] = likelihood.segments.ways(angle.reshape(-1, count).T).T.ravel()
        out[f"{label}_contact_x"], out[f"{label}_contact_y"] = locus.x, locus.y
    return {name: values.reshape(-1, count).T for name, values in out.items()}

"""How likely a whole record is, for many contours at once: its loaded samples, its unloaded ones, and the change."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.special import logsumexp

from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Contour
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.encoder import EncoderErrors
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.paths import Paths, trace
from tactile_bayes.mechanics.reachability import Reachability
from tactile_bayes.mechanics.shapes import shapes_of
from tactile_bayes.reconstruction import contact_sides
from tactile_bayes.record import CHANNELS, frame_of, present_channels, rod_of, to_dimensionless, turned

if TYPE_CHECKING:
    from tactile_bayes.mechanics.sweeps import Segments, Shapes, Solutions, Sweeps

__all__ = ["RecordLikelihood", "Rig", "bases_of", "without_errors"]

_UNFELT = 2e-3
"""Error of loads over their noise that 360 samples together do not show: it moves their log-likelihood by less than
0.05 in 999 of 1000 records."""

_LEAST = 1e-10
"""Error of loads that is not asked for to be less, over the largest load: tables are no better."""


@dataclass(frozen=True)
class _Stroke:
    """Samples with one pivot, that meet the object from one side while the drive moves one way."""

    pivot: int
    """Which of the record's pivots, in the order in which they come."""
    base: tuple[float, float]
    backward: bool
    sense: float
    """In which the drive moves: +1 forward, −1 backward, whatever side it meets the object from."""
    samples: NDArray[np.intp]


class Rig(NamedTuple):
    """What a rig may have otherwise than stated; numbers, or arrays of shape (n,) with one for every contour."""

    drive_angle_offset: Any = 0.0
    """What the encoder reads too much, beyond what the load cell's data sheet says [rad]."""
    rigidity_scale: Any = 1.0
    """Flexural rigidity over that stated."""
    suspension_compliance: Any = 0.0
    """Turn of the pivot's suspension per holding moment, in the unit of the record as stated [rad/(EI/L)]."""
    friction: Any = 0.0
    """Coulomb's coefficient."""
    drive_angle_backlash: Any = 0.0
    """What the encoder reads more in forward motion than in backward motion, beyond what the data sheet says [rad]."""
    base_shifts: Any = None
    """By how much pivots are off where the record has them, in its unit of length, shape (n, pivots, 2), in the order
    in which they come; those after the last that is given are where they should be."""


class RecordLikelihood:
    """The record as a function of contour and noise.

    Contours are in the record's unit of length, loads inside in EI/L and EI/L². Because loads drop to zero at snap-off,
    contours that would have let go earlier or held on longer than the record shows are told apart by it. Predicted
    forces are turned into the record's frame, not measured ones out of it: one of the two may be missing.

    Parameters
    ----------
    measured : xr.Dataset
        A valid record.
    load_cell : LoadCell
        In the record's units. Its encoder's offset and backlash are taken out of the drive angles.
    friction : float
        Coulomb's coefficient μ.
    exact : bool
        Whether paths are followed as well as can be, and not as well as noise asks, which takes a fifth of that.
    is_always_clear : bool
        Whether a rod that has snapped off is past every contour that will be asked for, so that it need not be looked
        at. After snap-off no load is predicted, which would be wrong for others: they are excluded.
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
        places = np.stack([measured.base_x.values, measured.base_y.values], axis=-1)
        pivots = {base: k for k, base in enumerate(bases_of(measured))}
        sense = np.where(measured.direction.values == "backward", -1.0, 1.0)
        kinds, which = np.unique(np.column_stack([places, backward, sense]), axis=0, return_inverse=True)
        self.strokes = [
            _Stroke(pivots[float(x), float(y)], (float(x), float(y)), bool(b), float(s), np.flatnonzero(which == k))
            for k, (x, y, b, s) in enumerate(kinds)
        ]
        self._pivots = np.array([stroke.pivot for stroke in self.strokes])
        self._signs = np.array([-1.0 if stroke.backward else 1.0 for stroke in self.strokes])
        longest = max(stroke.samples.size for stroke in self.strokes)
        self._strokes: dict[bytes, Segments] = {}
        self._angles = np.full((len(self.strokes), longest), np.nan)
        for row, stroke in zip(self._angles, self.strokes, strict=True):
            seen = angle[stroke.samples]
            row[: seen.size] = np.pi - seen if stroke.backward else seen

    @property
    def noise(self) -> Floats:
        """Standard deviation of each channel, about, to which loads are followed, shape (3,)."""
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
        """Paths of every contour in every stroke; lane k·n + i is contour i in stroke k.

        Drive angles are as seen in forward sweeps, less what is misread, shape (lanes, k). What is not exact is as good
        as noise asks.
        """
        rig = self._rig_of(rig, contours.shape[0])
        strokes = len(self.strokes)
        return trace(
            self._seen(contours, rig),
            friction_angle=np.tile(np.arctan(rig.friction), strokes),
            suspension_compliance=np.tile(rig.suspension_compliance * rig.rigidity_scale, strokes),
            tolerance=None if exact else self._tolerance,
            drive_angles=drive_angles,
        )

    def _seen(self, contours: Contour, rig: Rig) -> SweepFrame:
        (count,), strokes = contours.shape, len(self.strokes)
        base_x, base_y = self._bases(rig).reshape(-1, 2).T
        backward = np.repeat(self._signs < 0.0, count)
        every = contours.take(np.tile(np.arange(count), strokes))
        return SweepFrame(every, base_x, base_y, self.rod.length, 0.5 * self.rod.diameter, backward)

    def _bases(self, rig: Rig) -> Floats:
        """Pivots, shape (strokes, n, 2)."""
        stated = np.array([stroke.base for stroke in self.strokes])
        return np.asarray(stated[:, None] + rig.base_shifts[:, self._pivots].swapaxes(0, 1))

    def snap_offs(self, contours: Contour, rig: Rig | None = None) -> Floats:
        """Drive angles at which contact ends, as read and as seen in forward sweeps, shape (n, strokes)."""
        rig = self._rig_of(rig, contours.shape[0])
        return self._events(self._answers(contours, rig), rig)[..., 1]

    def misread(self, rig: Rig) -> Floats:
        """What the encoder reads too much, beyond what the data sheet says [rad], shape (n or 1, samples)."""
        return self._misread(rig)[:, self.stroke_of_sample]

    def _misread(self, rig: Rig) -> Floats:
        """By stroke, in each of which the drive moves one way."""
        offset, backlash = (np.atleast_1d(v)[:, None] for v in (rig.drive_angle_offset, rig.drive_angle_backlash))
        return np.asarray(offset + 0.5 * backlash * np.array([stroke.sense for stroke in self.strokes]))

    def event_samples(self, loaded: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Of each stroke the samples between which events lie: the last before contact, the first and the last in it,
        and the next after, shape (strokes, 4); −1 where there is none.
        """
        out = np.full((len(self.strokes), 4), -1)
        for row, stroke, angles in zip(out, self.strokes, self._angles, strict=True):
            order = np.argsort(angles[: stroke.samples.size], kind="stable")
            first, last = _longest(loaded[stroke.samples[order]])
            if first <= last:
                places = np.array([first - 1, first, last, last + 1])
                known = (places >= 0) & (places < order.size)
                row[known] = stroke.samples[order[places[known]]]
        return out

    def event_angles(self, loaded: NDArray[np.bool_]) -> Floats:
        """Drive angles of `event_samples`, as seen in forward sweeps; NaN where there is none."""
        samples = self.event_samples(loaded)
        return np.where(samples >= 0, self.seen_angles[samples], np.nan)

    @cached_property
    def seen_angles(self) -> Floats:
        """Drive angle of each sample, as read and as seen in forward sweeps."""
        angles = np.empty(len(self.measured))
        for stroke, seen in zip(self.strokes, self._angles, strict=True):
            angles[stroke.samples] = seen[: stroke.samples.size]
        return angles

    @cached_property
    def stroke_of_sample(self) -> NDArray[np.intp]:
        which = np.empty(len(self.measured), dtype=np.intp)
        for k, stroke in enumerate(self.strokes):
            which[stroke.samples] = k
        return which

    def usable(self, contours: Contour, rig: Rig | None = None) -> NDArray[np.bool_]:
        """Contours that every stroke can reach, and that the rod is past after snap-off, shape (n,)."""
        return self._usable(self._answers(contours, self._rig_of(rig, contours.shape[0])))

    def predict(self, contours: Contour, rig: Rig | None = None) -> tuple[Floats, NDArray[np.bool_]]:
        """Noise-free loads, shape (n, samples, 3), and which contours are usable, shape (n,).

        Forces are in the record's frame, loads in units of the rod as stated, drive angles as read.
        """
        return self.predict_with_events(contours, rig)[:2]

    def predict_with_errors(self, contours: Contour, rig: Rig | None = None) -> tuple[Floats, NDArray[np.bool_]]:
        """`predict` for every error that the encoder may have made, shape (n, errors, samples, 3)."""
        return self._predict(contours, rig, self.encoder.errors)[:2]

    def predict_with_events(
        self, contours: Contour, rig: Rig | None = None
    ) -> tuple[Floats, NDArray[np.bool_], Floats]:
        """`predict`, and drive angles of first contact and snap-off, as read and as seen in forward sweeps, shape
        (n, strokes, 2); NaN where there is none.
        """
        loads, reached, events = self._predict(contours, rig, np.zeros(1))
        return loads[:, 0], reached, events

    def _predict(self, contours: Contour, rig: Rig | None, errors: Floats) -> tuple[Floats, NDArray[np.bool_], Floats]:
        rig = self._rig_of(rig, contours.shape[0])
        found = self._answers(contours, rig, errors)
        predicted = found.loads.reshape(-1, errors.size, *self.measured.shape)
        if self._turn is not None:
            turn = self._turn - self.misread(rig)[:, None] - errors[:, None]
            predicted[..., 1], predicted[..., 2] = turned(predicted[..., 1], predicted[..., 2], turn)
        return predicted, self._usable(found), self._events(found, rig)

    def _answers(self, contours: Contour, rig: Rig, errors: Floats | None = None) -> Solutions:
        """Of the forward model, lane k·n + i for contour i in stroke k; of no samples if no errors are given."""
        from tactile_bayes.mechanics.sweeps import solve_sweeps  # numba takes a second to load

        errors = np.empty(0) if errors is None else errors
        return solve_sweeps(
            self._shapes(contours, rig),
            self._lanes(rig),
            self._strokes_with(errors),
            (contours.shape[0], errors.size * len(self.measured)),
            tolerance=None if self.exact else self._tolerance,
            asks_clearance=not self.is_always_clear,
        )

    def _usable(self, found: Solutions) -> NDArray[np.bool_]:
        usable = found.reach == Reachability.TOUCHES
        if not self.is_always_clear:
            usable &= found.snap_angle > found.clear_angle
        return np.asarray(usable.reshape(len(self.strokes), -1).all(axis=0))

    def _events(self, found: Solutions, rig: Rig) -> Floats:
        """First contact and snap-off, as read and as seen in forward sweeps, shape (n, strokes, 2)."""
        events = np.stack([found.first_angle, found.snap_angle], axis=-1).reshape(len(self.strokes), -1, 2)
        return np.asarray(events.swapaxes(0, 1) + (self._signs * self._misread(rig))[..., None])

    def _shapes(self, contours: Contour, rig: Rig) -> Shapes:
        if contours.halves is not None:
            return shapes_of(contours)
        low, high = (end.reshape(len(self.strokes), -1) for end in self._seen(contours, rig).own_domain())
        return shapes_of(contours, low.min(axis=0), high.max(axis=0))

    def _lanes(self, rig: Rig) -> Sweeps:
        from tactile_bayes.mechanics.sweeps import Sweeps

        count, strokes = rig.friction.size, len(self.strokes)
        bases = self._bases(rig)
        return Sweeps(
            contour=np.tile(np.arange(count), strokes),
            segment=np.repeat(np.arange(strokes), count),
            base_x=bases[..., 0].ravel(),
            base_y=bases[..., 1].ravel(),
            length=np.full(strokes * count, self.rod.length),
            standoff=np.full(strokes * count, 0.5 * self.rod.diameter),
            backward=np.repeat(self._signs < 0.0, count),
            friction_angle=np.tile(np.arctan(rig.friction), strokes),
            compliance=np.tile(rig.suspension_compliance * rig.rigidity_scale, strokes),
            offset=np.broadcast_to(self._misread(rig), (count, strokes)).T.flatten(),
            rigidity=np.tile(rig.rigidity_scale, strokes),
        )

    def _rig_of(self, rig: Rig | None, count: int) -> Rig:
        """Of every contour, what is known of the rig where nothing is said of it."""
        rig = rig or Rig(friction=self.friction)
        shifts = np.zeros((count, self._pivots.max() + 1, 2))
        if rig.base_shifts is not None:
            shifts[:, : rig.base_shifts.shape[1]] = rig.base_shifts
        return Rig._make((*(np.broadcast_to(value, (count,)) for value in rig[:-1]), shifts))

    def _strokes_with(self, errors: Floats) -> Segments:
        """Every sample once for each error, one error after the other."""
        from tactile_bayes.mechanics.sweeps import Segments

        key = errors.tobytes()
        if key not in self._strokes:
            samples, angles = [], []
            for row, stroke in zip(self._angles, self.strokes, strict=True):
                shifts = errors if stroke.backward else -errors
                seen = (row[: stroke.samples.size] + shifts[:, None]).ravel()
                order = np.argsort(seen, kind="stable")
                angles.append(seen[order])
                rows = stroke.samples + len(self.measured) * np.arange(errors.size)[:, None]
                samples.append(rows.ravel()[order])
            first = np.cumsum([0, *(part.size for part in samples)])
            self._strokes[key] = Segments(first, np.concatenate(samples), np.concatenate(angles))
        return self._strokes[key]

    def log_likelihood(
        self, contours: Contour, noise_scale: Any = 1.0, rig: Rig | None = None, *, pointwise: bool = False
    ) -> Floats:
        """Log-likelihood of each contour, shape (n,), or of each sample under it, (n, samples); −inf out of reach.

        Parameters
        ----------
        contours : Contour
            With parameters of shape (n,).
        noise_scale : array_like, broadcastable to shape (n, 3)
            Factor on the load cell's standard deviations, by channel.
        rig : Rig, optional
            What is not as stated.
        pointwise : bool
            Whether samples are kept apart.
        """
        return self.score(*self.predict_with_errors(contours, rig), noise_scale, pointwise=pointwise)

    def score(
        self, predicted: Floats, reached: NDArray[np.bool_], noise_scale: Any = 1.0, *, pointwise: bool = False
    ) -> Floats:
        """`log_likelihood` of contours whose loads `predict_with_errors` has given already."""
        alone = self.encoder.count == 1
        scale = np.asarray(noise_scale, dtype=float)
        if scale.ndim > 1 and not alone:
            scale = scale[:, None]
        values = self.load_cell.log_likelihood(
            self.measured, predicted[:, 0] if alone else predicted, noise_scale=scale, pointwise=pointwise or not alone
        )
        if not alone:
            values = logsumexp(values + self.encoder.log_weights[:, None], axis=1)
            values = values if pointwise else values.sum(axis=-1)
        values[~reached] = -np.inf
        if np.any(np.isnan(values)):
            raise ParameterError(
                f"the likelihood of {np.count_nonzero(np.isnan(values))} contours is not a number: please report this"
            )
        return values


def _longest(loaded: NDArray[np.bool_]) -> tuple[int, int]:
    """First and last of the stretch in which loaded samples outnumber the others the most."""
    sums = np.concatenate([[0], np.cumsum(np.where(loaded, 1, -1))])
    lowest = np.minimum.accumulate(sums)
    end = int(np.argmax(sums - lowest))
    return int(np.argmin(sums[: end + 1])), end - 1


def bases_of(measured: xr.Dataset) -> list[tuple[float, float]]:
    """Where the record has pivots, in the order in which they come."""
    return list(dict.fromkeys(zip(measured.base_x.values.tolist(), measured.base_y.values.tolist(), strict=True)))


def without_errors(measured: xr.Dataset, load_cell: LoadCell) -> xr.Dataset:
    """The record with the cell's known errors taken out; where channels are missing, those of the moment alone."""
    if len(present_channels(measured)) == len(CHANNELS):
        return load_cell.corrected(measured)
    bias, gain = load_cell.bias[0], load_cell.gain[0][0]
    return measured.assign(holding_moment=(measured.holding_moment - bias) * np.sign(gain or 1.0))

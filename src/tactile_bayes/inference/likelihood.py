"""How likely a whole record is, for many contours at once: its loaded samples, its unloaded ones, and the change."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.contours import Contour
from tactile_bayes.contours.halves import Halves
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.path import Paths, Reach, trace
from tactile_bayes.reconstruction import contact_sides
from tactile_bayes.record import CHANNELS, frame_of, present_channels, rod_of, to_dimensionless, turned

if TYPE_CHECKING:
    from tactile_bayes.compiled.loads import Strokes

__all__ = ["FAST_ORDER", "FINE_ORDER", "RecordLikelihood"]

Floats = NDArray[np.float64]

FAST_ORDER, FINE_ORDER = 16, 32
"""Interpolate loads to about 1e-5 of their largest value (at worst some 1e-4), and to 1e-10 (1e-6)."""


@dataclass(frozen=True)
class _Stroke:
    """Samples with one pivot, that meet the object from one side."""

    base: tuple[float, float]
    backward: bool
    samples: NDArray[np.intp]


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
        In the record's units. Its encoder's offset is taken out of the drive angles.
    friction : float
        Coulomb's coefficient μ.
    order : int
        Number of Chebyshev nodes on each smooth stretch of a path; more for a load cell that is nearly free of noise.
    is_always_clear : bool
        Whether a rod that has snapped off is past every contour that will be asked for, so that it need not be looked
        at. After snap-off no load is predicted, which would be wrong for others: they are excluded.
    """

    def __init__(
        self,
        measured: xr.Dataset,
        load_cell: LoadCell,
        friction: float = 0.0,
        order: int = FAST_ORDER,
        is_always_clear: bool = True,
    ) -> None:
        self.order = order
        self.is_always_clear = is_always_clear
        self.rod = rod_of(measured)
        self.friction_angle = float(np.arctan(friction))
        record = to_dimensionless(measured)
        load_cell.refuse_other_frame(measured)
        if load_cell.drive_angle_noise or load_cell.drive_angle_resolution:
            raise ParameterError(
                "the load cell's drive_angle_noise and drive_angle_resolution have no place in the likelihood of a "
                "record yet: give a cell without them (infer --force-noise ... --moment-noise ...), with what they do "
                "to the loads in force_noise and moment_noise"
            )
        self.load_cell = load_cell.dimensionless(self.rod)
        self.measured = np.stack([record[name].values for name in CHANNELS], axis=-1)
        angle = record.drive_angle.values - load_cell.drive_angle_offset
        self._turn = angle if frame_of(record) == "turning" else None
        backward = contact_sides(_without_errors(measured, load_cell), load_cell) < 0.0
        place = np.stack([measured.base_x.values, measured.base_y.values, backward], axis=-1)
        kinds, which = np.unique(place, axis=0, return_inverse=True)
        self.strokes = [
            _Stroke((float(x), float(y)), bool(b), np.flatnonzero(which == k)) for k, (x, y, b) in enumerate(kinds)
        ]
        others = [[t.base == s.base and t.backward != s.backward for t in self.strokes] for s in self.strokes]
        self._opposite = np.argmax(others, axis=1) if np.all(np.any(others, axis=1)) and not friction else None
        longest = max(stroke.samples.size for stroke in self.strokes)
        self._angles = np.full((len(self.strokes), longest), np.nan)
        for row, stroke in zip(self._angles, self.strokes, strict=True):
            seen = angle[stroke.samples]
            row[: seen.size] = np.pi - seen if stroke.backward else seen

    def paths(self, contours: Contour, *, exact_events: bool = False) -> Paths:
        """Paths of every contour in every stroke; lane k·n + i is contour i in stroke k."""
        count = contours.shape[0]
        strokes = len(self.strokes)
        index = np.tile(np.arange(count), strokes)
        base_x, base_y, backward = (
            np.repeat(np.array(column), count)
            for column in (
                [s.base[0] for s in self.strokes],
                [s.base[1] for s in self.strokes],
                [s.backward for s in self.strokes],
            )
        )
        seen = SeenContour(contours.take(index), base_x, base_y, self.rod.length, 0.5 * self.rod.diameter, backward)
        return trace(seen, friction_angle=self.friction_angle, order=self.order, exact_events=exact_events)

    def usable(self, contours: Contour) -> NDArray[np.bool_]:
        """Contours that every stroke can reach, and that the rod is past after snap-off, shape (n,)."""
        return self._usable(self.paths(contours), contours.shape[0])

    def _usable(self, paths: Paths, count: int) -> NDArray[np.bool_]:
        usable = paths.reach == Reach.TOUCHES
        if not self.is_always_clear:
            usable = usable & self._is_clear(paths)
        return np.asarray(usable.reshape(-1, count).all(axis=0))

    def _is_clear(self, paths: Paths) -> NDArray[np.bool_]:
        """Where the sweep in the other direction is at hand its first contact says so."""
        if self._opposite is None:
            return paths.is_clear()
        first = paths.first_angle.reshape(len(self.strokes), -1)[self._opposite]
        with np.errstate(invalid="ignore"):
            return np.asarray(paths.snap_angle > np.pi - first.ravel())

    def predict(self, contours: Contour) -> tuple[Floats, NDArray[np.bool_]]:
        """Noise-free loads, shape (n, samples, 3), and which contours are usable, shape (n,).

        Forces are in the record's frame.
        """
        halves = contours.halves
        if halves is None or self.friction_angle or self.order > FAST_ORDER:
            predicted, reached = self._by_arrays(contours)
        else:
            predicted, reached = self._by_compiled(halves)
        if self._turn is not None:
            predicted[..., 1], predicted[..., 2] = turned(predicted[..., 1], predicted[..., 2], self._turn)
        return predicted, reached

    def _by_compiled(self, halves: Halves) -> tuple[Floats, NDArray[np.bool_]]:
        """`predict`, in the pivot's frame, without friction and to `FAST_ORDER`."""
        from tactile_bayes.compiled.loads import loads_of  # numba takes a second to load

        rod = self.rod
        return loads_of(
            halves, self._compiled_strokes, rod.length, 0.5 * rod.diameter, is_always_clear=self.is_always_clear
        )

    @cached_property
    def _compiled_strokes(self) -> Strokes:
        from tactile_bayes.compiled.loads import Strokes

        bases = np.array([stroke.base for stroke in self.strokes])
        return Strokes(
            base_x=bases[:, 0].copy(),
            base_y=bases[:, 1].copy(),
            backward=np.array([stroke.backward for stroke in self.strokes]),
            first=np.cumsum([0, *(stroke.samples.size for stroke in self.strokes)]),
            samples=np.concatenate([stroke.samples for stroke in self.strokes]),
            angles=self._angles[~np.isnan(self._angles)],
        )

    def _by_arrays(self, contours: Contour) -> tuple[Floats, NDArray[np.bool_]]:
        """`predict`, in the pivot's frame, for any contour, with friction, and to any accuracy."""
        count = contours.shape[0]
        paths = self.paths(contours)
        loads = paths.observables(np.repeat(self._angles, count, axis=0))
        predicted = np.zeros((count, *self.measured.shape))
        for k, stroke in enumerate(self.strokes):
            sign = np.array([-1.0, -1.0, 1.0]) if stroke.backward else 1.0
            predicted[:, stroke.samples] = sign * loads[k * count : (k + 1) * count, : stroke.samples.size]
        return predicted, self._usable(paths, count)

    def log_likelihood(self, contours: Contour, noise_scale: Any = 1.0, *, pointwise: bool = False) -> Floats:
        """Log-likelihood of each contour, shape (n,), or of each sample under it, (n, samples); −inf out of reach.

        Parameters
        ----------
        contours : Contour
            With parameters of shape (n,).
        noise_scale : array_like, broadcastable to shape (n, 3)
            Factor on the load cell's standard deviations, by channel.
        pointwise : bool
            Whether samples are kept apart.
        """
        values = self.score(*self.predict(contours), noise_scale, pointwise=pointwise)
        if np.any(np.isnan(values)):
            raise ParameterError(f"the likelihood is not a number for {contours}: please report this contour")
        return values

    def score(
        self, predicted: Floats, reached: NDArray[np.bool_], noise_scale: Any = 1.0, *, pointwise: bool = False
    ) -> Floats:
        """`log_likelihood` of contours whose loads `predict` has given already."""
        values = self.load_cell.log_likelihood(self.measured, predicted, noise_scale=noise_scale, pointwise=pointwise)
        values[~reached] = -np.inf
        return values


def _without_errors(measured: xr.Dataset, load_cell: LoadCell) -> xr.Dataset:
    """The record with the cell's known errors taken out; where channels are missing, those of the moment alone."""
    if len(present_channels(measured)) == len(CHANNELS):
        return load_cell.corrected(measured)
    bias, gain = load_cell.bias[0], load_cell.gain[0][0]
    return measured.assign(holding_moment=(measured.holding_moment - bias) * np.sign(gain or 1.0))

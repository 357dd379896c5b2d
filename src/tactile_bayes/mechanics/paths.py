"""Equilibrium paths of many contours at once, from first contact to snap-off, for arrays.

Everything in rod lengths, EI/L and EI/L², seen as forward sweeps (`SeenContour` mirrors backward ones). Paths are
followed by compiled code (`path`), one lane after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.mechanics.elastica import Wrench, wrench_from_contact
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL
from tactile_bayes.mechanics.shapes import shapes_of

if TYPE_CHECKING:
    from tactile_bayes.mechanics.sweeps import Answers, Lanes, Shapes

__all__ = ["Paths", "States", "trace"]


class States(NamedTuple):
    """States on paths."""

    parameter: Floats
    """The contour's parameter, seen."""
    x: Floats
    y: Floats
    """Point at which rod's centreline and the contour (seen) touch."""
    slope_angle: Floats
    wrench: Wrench


@dataclass(frozen=True)
class Paths:
    """Paths of many contours, a lane each; see `trace`.

    `reach` says which lanes have one; for the others angles are NaN and nothing is ever loaded.
    """

    seen: SeenContour
    friction_angle: Floats
    reach: NDArray[np.int8]
    distance: Floats
    """Least distance of the contour from the pivot, in rod lengths."""
    first_angle: Floats
    """Drive angle of first contact."""
    first_parameter: Floats
    snap_angle: Floats
    """Drive angle of snap-off."""
    snap_parameter: Floats
    snap_off: NDArray[np.int8]
    change_parameter: Floats
    """Where phases begin, shape (lanes, phases); NaN beyond the last."""
    change_to_tip: NDArray[np.bool_]
    """Whether the tip touches from there on."""
    largest_curvature: Floats
    """Of the rod up to snap-off [1/L], to 1e-4 of it."""
    clear_angle: Floats
    """Drive angle from which on a straight rod is past the contour, as far as that is known."""
    tolerance: Floats | None
    shapes: Shapes
    lanes: Lanes
    sampled: Floats
    """What is found at the drive angles that `trace` was asked for."""

    def is_clear(self) -> NDArray[np.bool_]:
        """Whether the straight rod is free of the object after snap-off, as far as that is known; shape (lanes,)."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.snap_angle > self.clear_angle)

    def observables(self, drive_angles: Floats) -> Floats:
        """Holding moment and forces at given drive angles; zero out of contact.

        They are interpolated, to some 1e-8 of the largest.

        Parameters
        ----------
        drive_angles : ndarray, shape (k,) or (lanes, k)

        Returns
        -------
        ndarray, shape (lanes, k, 3)
        """
        sign = np.where(self.seen.mirrored[:, None, None], [-1.0, -1.0, 1.0], 1.0)
        return np.asarray(sign * _swept(self.shapes, self.lanes, self.tolerance, drive_angles).loads)

    def states(self, lane: Index, drive_angles: Floats) -> States:
        """Exact states at drive angles, shape (k,), on lanes, shape (k,); NaN and `NONE` out of contact."""
        angles = np.asarray(drive_angles, dtype=float)
        count = np.bincount(lane, minlength=self.seen.lanes)
        order = np.argsort(lane, kind="stable")
        rank = np.empty(lane.size, dtype=np.intp)
        rank[order] = np.arange(lane.size) - (np.cumsum(count) - count)[lane[order]]
        by_lane = np.full((self.seen.lanes, int(count.max(initial=0))), np.nan)
        by_lane[lane, rank] = angles
        found = _swept(self.shapes, self.lanes, self.tolerance, by_lane, states=True)
        return _as_states(found.states[lane, rank])

    def loaded_states(self) -> tuple[Index, Index, States]:
        """States at the drive angles that `trace` was asked for, of those in contact only.

        Returns
        -------
        lane, sample : ndarray, shape (n,)
            Which they are.
        states : States
            Their states, shape (n,).
        """
        lane, sample = np.nonzero(self.sampled[..., 0] != NONE)
        return lane, sample, _as_states(self.sampled[lane, sample])

    def sampled_states(self, lane: Index) -> States:
        """States on lanes at all of these drive angles, shape (*lane.shape, k); NaN and `NONE` out of contact."""
        return _as_states(self.sampled[lane])

    def states_at(self, lane: Index, parameter: Floats) -> States:
        """Exact states at the contour's parameters, whether on the path or beyond its end."""
        locus = self.seen.locate(lane, parameter)
        wrench = wrench_from_contact(locus.x, locus.y, locus.slope_angle, self.friction_angle[lane])
        return States(parameter, locus.x, locus.y, locus.slope_angle, wrench)


def trace(
    seen: SeenContour,
    *,
    friction_angle: ArrayLike = 0.0,
    suspension_compliance: ArrayLike = 0.0,
    tolerance: Floats | None = None,
    drive_angles: Floats | None = None,
    relative: bool = False,
    polished: bool = True,
) -> Paths:
    """Follow the equilibria of every lane from first contact to snap-off.

    Parameters
    ----------
    seen : SeenContour
    friction_angle : float or array_like, shape (lanes,)
        δ = arctan μ [rad].
    suspension_compliance : float or array_like, shape (lanes,)
        Turn of the pivot's suspension per holding moment, c in (drive angle) = φ0 + c m0 [rad/(EI/L)].
    tolerance : ndarray, shape (3,), optional
        By how much loads may miss [EI/L and EI/L²], which is what a likelihood needs and several times faster; by
        default events are computed to rounding.
    drive_angles : ndarray, shape (k,) or (lanes, k), optional
        At which states are wanted.
    relative : bool
        Whether they are shares of the way from first contact to snap-off.
    polished : bool
        Whether states at drive angles are exact; or else as good as series, 1e-10 of the largest, and without
        derivatives, which takes a third of the time.
    """
    from tactile_bayes.mechanics.sweeps import Lanes  # numba takes a second to load

    count, every = seen.lanes, np.arange(seen.lanes)
    friction_angle = np.broadcast_to(np.asarray(friction_angle, dtype=float), (count,))
    compliance = np.broadcast_to(np.asarray(suspension_compliance, dtype=float), (count,))
    shapes = shapes_of(seen.contour, *(seen.own_domain() if seen.contour.halves is None else ()))
    lanes = Lanes(
        contour=every,
        stroke=every,
        base_x=_each(seen.base_x, count),
        base_y=_each(seen.base_y, count),
        length=_each(seen.length, count),
        standoff=_each(seen.standoff, count),
        backward=np.ascontiguousarray(seen.mirrored),
        friction_angle=_each(friction_angle, count),
        compliance=_each(compliance, count),
        offset=np.zeros(count),
        rigidity=np.ones(count),
    )
    angles = np.empty(0) if drive_angles is None else drive_angles
    answers = _swept(shapes, lanes, tolerance, angles, relative, states=True, polished=polished)
    there = np.arange(answers.changes.shape[1]) < answers.phases[:, None]
    most = int(answers.phases.max(initial=0))
    return Paths(
        seen=seen,
        friction_angle=friction_angle,
        reach=answers.reach,
        distance=answers.distance,
        first_angle=answers.first_angle,
        first_parameter=answers.first_parameter,
        snap_angle=answers.snap_angle,
        snap_parameter=answers.snap_parameter,
        snap_off=answers.snap_off,
        change_parameter=np.where(there, answers.changes[..., 0], np.nan)[:, :most],
        change_to_tip=(there & (answers.changes[..., 1] > 0.0))[:, :most],
        largest_curvature=answers.curvature,
        clear_angle=answers.clear_angle,
        tolerance=tolerance,
        shapes=shapes,
        lanes=lanes,
        sampled=answers.states,
    )


def _each(values: Any, count: int) -> Floats:
    return np.array(np.broadcast_to(values, (count,)), dtype=float)


def _swept(
    shapes: Shapes,
    lanes: Lanes,
    tolerance: Floats | None,
    drive_angles: Floats,
    relative: bool = False,
    **options: Any,
) -> Answers:
    """What is found at drive angles, shape (k,) for all or (lanes, k), as seen in forward sweeps."""
    from tactile_bayes.mechanics.sweeps import Strokes, answered

    angles = np.atleast_2d(np.asarray(drive_angles, dtype=float))
    order = np.argsort(angles, axis=1, kind="stable")
    strokes, each = angles.shape
    asked = Strokes(
        each * np.arange(strokes + 1), order.ravel(), np.take_along_axis(angles, order, axis=1).ravel(), relative
    )
    lanes = lanes._replace(stroke=lanes.contour % strokes)
    return answered(shapes, lanes, asked, (lanes.contour.size, each), tolerance=tolerance, **options)


def _as_states(columns: Floats) -> States:
    """States from what is kept of them, shape (..., columns); NaN where nothing is."""
    side_by_side = np.moveaxis(columns, -1, 0).copy()
    phase = side_by_side[0].astype(np.int8)
    np.copyto(side_by_side, np.nan, where=phase == NONE)
    _, parameter, x, y, alpha, drive_angle, moment, force_x, force_y, *rest = side_by_side
    arclength, tip_angle, by_slope, by_distance = rest
    lying = np.where(phase == TANGENTIAL, arclength, np.nan)
    wrench = Wrench(drive_angle, moment, force_x, force_y, arclength, tip_angle, phase, by_slope, by_distance, lying)
    return States(parameter, x, y, alpha, wrench)

"""The equilibrium path: states from first contact to snap-off, for many contours at once.

Arrays only; everything in rod lengths, EI/L and EI/L², seen as forward sweeps (`SeenContour` mirrors backward ones).
A path runs along the contour from first contact (the tip, or a tangent line from the pivot, whichever is first)
against the sense of the contour's parameter, until the drive angle has its first maximum: the snap-off. It is cut
where the phase changes and where the contour's curvature jumps; on each segment all observables are smooth and are
interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tactile_bayes import chebyshev
from tactile_bayes.accuracy import Accuracy
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.elastica import NONE, TANGENTIAL, TIP, QuickWrench, Wrench, quick_wrench
from tactile_bayes.reach import CLEARANCE, Reach, clear_angle, limits
from tactile_bayes.roots import falling_root
from tactile_bayes.segments import Segments, cut_path, first_of_lane, last_of_lane, polish_changes, resolved
from tactile_bayes.snap_off import SnapOff, first_maximum, polish_fold
from tactile_bayes.states import States, angle_rate, exact_states

__all__ = ["CHANNELS", "CLEARANCE", "Paths", "Reach", "SnapOff", "States", "trace"]

Floats = NDArray[np.float64]
Index = NDArray[np.intp]

CHANNELS = ("holding_moment", "force_x", "force_y")

_LOST, _ROUNDING = 1e-4, 1e-12
"""Shares, of what is left to the end of a segment and of all of it, by which a state may miss its drive angle for the
interpolant to make up for it."""

_BLOCK = 4096
"""Samples interpolated at a time."""

_NO_MOMENT = 1e-12
"""Holding moment [EI/L] that is none."""

_LAST_STEP = 1e-6
"""Newton step on an interpolant, as a share of the segment, whose square is below the interpolation's error."""


@dataclass(frozen=True)
class Paths:
    """Paths of many contours, a lane each; see `trace`.

    `reach` says which lanes have one; for the others angles are NaN and nothing is ever loaded.
    """

    seen: SeenContour
    friction_angle: Floats
    suspension_compliance: Floats
    accuracy: Accuracy
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
    segments: Segments
    """What there is of each path up to snap-off."""
    begin_angle: Floats
    end_angle: Floats
    """Drive angles at the ends of every segment."""
    steadiness: Floats
    """Rate of the drive angle at the end of every segment over its mean rate, at most 1; 0 where it ends in a fold."""
    coefficients: Floats
    """Of way along the segment, holding moment, force_x and force_y over the drive angle: (segment, 4, order)."""

    def driven_angle(self, lane: Index, wrench: Wrench) -> Floats:
        """What the drive stands at in a state: the rod's slope at the pivot and the turn of the suspension."""
        return np.asarray(wrench.drive_angle + self.suspension_compliance[lane] * wrench.holding_moment)

    def is_clear(self) -> NDArray[np.bool_]:
        """Whether the straight rod is free of the object after snap-off, as far as that is known; shape (lanes,)."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.snap_angle > clear_angle(self.seen, self.accuracy))

    def observables(self, drive_angles: Floats) -> Floats:
        """Holding moment and forces at given drive angles; zero out of contact.

        Parameters
        ----------
        drive_angles : ndarray, shape (k,) or (lanes, k)

        Returns
        -------
        ndarray, shape (lanes, k, 3)
        """
        angles = np.broadcast_to(drive_angles, (self.seen.lanes, np.shape(drive_angles)[-1]))
        out = np.zeros((*angles.shape, 3))
        segment, sample = self._loaded(angles)
        lane = self.segments.lane[segment]
        out[lane, sample] = self._interpolated(segment, angles[lane, sample])[:, 1:]
        return out

    def states(self, lane: Index, drive_angles: Floats) -> States:
        """Exact states at drive angles, shape (k,), on lanes, shape (k,); NaN and `NONE` out of contact."""
        angles = np.asarray(drive_angles, dtype=float)
        count = np.bincount(lane, minlength=self.seen.lanes)
        order = np.argsort(lane, kind="stable")
        rank = np.empty(lane.size, dtype=np.intp)
        rank[order] = np.arange(lane.size) - (np.cumsum(count) - count)[lane[order]]
        by_lane = np.full((self.seen.lanes, int(count.max(initial=0))), np.nan)
        by_lane[lane, rank] = angles
        where = np.zeros(by_lane.shape, dtype=np.intp)
        where[lane, rank] = np.arange(lane.size)
        on_lane, sample, found = self.loaded_states(by_lane)
        at = where[on_lane, sample]

        def everywhere(values: NDArray[Any], elsewhere: float = np.nan) -> NDArray[Any]:
            filled = np.full(angles.shape, elsewhere, dtype=values.dtype)
            filled[at] = values
            return filled

        wrench = {
            name: everywhere(v, NONE if name == "phase" else np.nan) for name, v in found.wrench._asdict().items()
        }
        rest = {name: everywhere(v) for name, v in found._asdict().items() if name != "wrench"}
        return States(wrench=Wrench(**wrench), **rest)

    def loaded_states(self, drive_angles: Floats, *, polish: bool = True) -> tuple[Index, Index, States]:
        """States at drive angles, of those in contact only.

        Parameters
        ----------
        drive_angles : ndarray, shape (k,) or (lanes, k)
        polish : bool
            Whether the contour's parameter is brought to rounding; else it is as good as the interpolation, and loads
            some 1e-8 of their largest value.

        Returns
        -------
        lane, sample : ndarray, shape (n,)
            Which they are.
        states : States
            Their states, shape (n,).
        """
        angles = np.broadcast_to(drive_angles, (self.seen.lanes, np.shape(drive_angles)[-1]))
        segment, sample = self._loaded(angles)
        lane = self.segments.lane[segment]
        wanted = angles[lane, sample]
        interpolated = self._interpolated(segment, wanted)
        way = interpolated[:, 0]
        parameter = self._polish(segment, way, wanted) if polish else self.segments.take(segment).along(way)[0]
        states = self.states_at(lane, parameter)
        # A parameter has only so many digits: what they leave of the way to the angle, the interpolant goes.
        rest = interpolated - self._interpolated(segment, self.driven_angle(lane, states.wrench))
        loads = {name: getattr(states.wrench, name) + gap for name, gap in zip(CHANNELS, rest[:, 1:].T, strict=True)}
        wrench = states.wrench._replace(**loads)
        reached = wrench.phase != NONE  # but for rounding, which may undo the very first contact
        states = States(
            wrench=Wrench(*(column[reached] for column in wrench)),
            **{name: column[reached] for name, column in states._asdict().items() if name != "wrench"},
        )
        return lane[reached], sample[reached], states

    def states_at(self, lane: Index, parameter: Floats) -> States:
        """Exact states at the contour's parameters, whether on the path or beyond its end."""
        return exact_states(self.seen, lane, parameter, self.friction_angle)

    def _interpolated(self, segment: Index, angle: Floats) -> Floats:
        """Way and loads at drive angles, shape (n, 4); `segment` grows."""
        turn = self._turn(segment, angle)
        count = np.bincount(segment, minlength=self.segments.lane.size)
        before = np.cumsum(count) - count
        out = np.empty((segment.size, self.coefficients.shape[1]))
        # Samples of a segment side by side, so that one product with its coefficients serves them all; segments with
        # about as many samples side by side, and no more of them than fit into the processor's cache.
        by_count = np.argsort(count, kind="stable")
        some = by_count[np.searchsorted(count[by_count], 1) :]
        while some.size:
            most = max(1, _BLOCK // int(count[some[-1]]))
            some, block = some[:-most], some[-most:]
            rank = np.arange(count[block[-1]])
            inside = rank < count[block, None]
            sample = np.where(inside, before[block, None] + rank, before[block, None])
            basis = chebyshev.basis(self.coefficients.shape[-1], turn[sample])
            values = self.coefficients[block] @ basis.swapaxes(0, 1)
            out[sample[inside]] = values.swapaxes(1, 2)[inside]
        return out

    def _loaded(self, angles: Floats) -> tuple[Index, Index]:
        """Pairs of segment and sample such that the sample's angle, shape (lanes, k), lies in the segment."""
        at = angles[self.segments.lane]
        last = last_of_lane(self.segments.lane)
        with np.errstate(invalid="ignore"):
            inside = (at >= self.begin_angle[:, None]) & (at < self.end_angle[:, None])
            segment, sample = np.nonzero(inside | (last[:, None] & (at == self.end_angle[:, None])))
        return segment, sample

    def _turn(self, segment: Index, angle: Floats) -> Floats:
        """Drive angle on a segment from 0 to 1, stretched toward its end so that states are smooth functions of it."""
        begin, end, steady = self.begin_angle[segment], self.end_angle[segment], self.steadiness[segment]
        left = np.clip((end - angle) / (end - begin), 0.0, 1.0)
        with np.errstate(invalid="ignore"):
            ahead = 2.0 * left / (steady + np.sqrt(steady * steady + 4.0 * (1.0 - steady) * left))
        return 1.0 - np.where(left > 0.0, ahead, 0.0)

    def _polish(self, segment: Index, way: Floats, angle: Floats) -> Floats:
        """Contour parameters at which the exact drive angle is the given one, by Newton in the variable of `_turn`."""
        chosen = self.segments.take(segment)
        begin, end, steady = self.begin_angle[segment], self.end_angle[segment], self.steadiness[segment]
        target = self._turn(segment, angle)
        stiff = self.suspension_compliance[chosen.lane] == 0.0  # else the exact rate lacks that of the moment
        pace = chebyshev.evaluate(chebyshev.derivative(self.coefficients[segment, 0].T), target)

        def short_of(i: Index, at: Floats) -> tuple[Floats, Floats]:
            some = chosen.take(i)
            parameter, parameter_rate = some.along(at)
            state = self.states_at(some.lane, parameter)
            driven = self.driven_angle(some.lane, state.wrench)
            reached = np.isfinite(driven)  # but for rounding, which may undo the very first contact
            turn = np.where(reached, self._turn(segment[i], driven), 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                rate = angle_rate(self.seen, some.lane, state) * parameter_rate / (end[i] - begin[i])
                newton = (steady[i] + 2.0 * (1.0 - steady[i]) * (1.0 - turn)) / rate
                # Much nearer to the end than the goal is, the rate may be zero or rounding: the interpolant's serves.
                sound = (1.0 - turn > 0.5 * (1.0 - target[i])) & (newton > 0.0) & stiff[i]
                return target[i] - turn, -1.0 / np.where(sound, newton, pace[i])

        every = np.arange(way.size)
        way = 1.0 - np.abs(1.0 - np.clip(way, 0.0, 2.0))  # beyond a fold the drive angle is less again
        for _ in range(4):
            missing, fall = short_of(every, way)
            step = missing / fall
            way = np.clip(np.where(np.isfinite(step), way - step, way), 0.0, 1.0)
        # Where the path is not smooth at its end, Newton may go round in circles.
        lost = np.flatnonzero(np.abs(missing) > _LOST * (1.0 - target) + _ROUNDING)
        way[lost] = falling_root(
            lambda i, at: short_of(lost[i], at), np.zeros(lost.size), np.ones(lost.size), start=way[lost]
        )
        return chosen.along(way)[0]


def trace(
    seen: SeenContour,
    *,
    friction_angle: ArrayLike = 0.0,
    suspension_compliance: ArrayLike = 0.0,
    order: int = 16,
    exact_events: bool = True,
) -> Paths:
    """Follow the equilibria of every lane from first contact to snap-off.

    Parameters
    ----------
    seen : SeenContour
    friction_angle : float or array_like, shape (lanes,)
        δ = arctan μ [rad].
    suspension_compliance : float or array_like, shape (lanes,)
        Turn of the pivot's suspension per holding moment, c in (drive angle) = φ0 + c m0 [rad/(EI/L)].
    order : int
        Number of Chebyshev nodes on a segment.
    exact_events : bool
        Whether phase changes and snap-off are computed to rounding, and states on the nodes exactly; else both are as
        good as the interpolation, which is what a likelihood needs and several times faster.
    """
    accuracy = Accuracy.of(exact_events, order)
    friction_angle = np.broadcast_to(np.asarray(friction_angle, dtype=float), (seen.lanes,))
    compliance = np.broadcast_to(np.asarray(suspension_compliance, dtype=float), (seen.lanes,))
    stiff = not np.any(compliance)
    bounds = limits(seen, friction_angle, accuracy)
    segments = cut_path(seen, bounds, friction_angle, order, accuracy)
    if exact_events:
        segments = polish_changes(seen, segments, friction_angle)

    # Over the way along the contour: drive angle and its first maximum.
    def sample(some: Segments, ways: Floats) -> Floats:
        return _sample(seen, some, ways, friction_angle, compliance, accuracy)

    segments, series = resolved(segments, sample, order, accuracy.resolved)
    angle = series[..., 0]
    keep, stop, kind = first_maximum(segments, angle, accuracy)
    runs_out = bounds.runs_out[segments.lane[keep]] & (kind == SnapOff.THRUST)
    bounds.reach[segments.lane[keep][runs_out]] = Reach.RUNS_OUT
    there = bounds.reach[segments.lane[keep]] == Reach.TOUCHES
    keep, stop, kind = keep[there], stop[there], kind[there]
    segments, angle, loads = segments.take(keep), angle[:, keep], series[:, keep, 1:]
    folds = kind == SnapOff.FOLD
    if exact_events and stiff:
        stop = np.where(folds, polish_fold(seen, segments, angle, stop, friction_angle), stop)

    # Over the drive angle: where on the way it takes the values that the nodes want.
    first, last = first_of_lane(segments.lane), last_of_lane(segments.lane)
    end_parameter, _ = segments.along(stop)
    end_angle = chebyshev.evaluate(angle, stop)
    if exact_events:
        at_end = exact_states(seen, segments.lane, end_parameter, friction_angle).wrench
        driven = at_end.drive_angle + compliance[segments.lane] * at_end.holding_moment
        end_angle = np.where(np.isfinite(driven), driven, end_angle)
        # At a flat vertex the maximum and the end of all moment are one, and rounding must not choose between them.
        kind = np.where(folds & (np.abs(at_end.holding_moment) <= _NO_MOMENT), np.int8(SnapOff.THRUST), kind)
    locus = seen.locate(segments.lane, segments.begin)
    begin_angle = np.where(first, np.arctan2(locus.y, locus.x), np.append(np.nan, end_angle[:-1])[: first.size])
    node = chebyshev.nodes(order)
    end_rate = chebyshev.evaluate(chebyshev.derivative(angle), stop) * stop / (end_angle - begin_angle)
    steadiness = np.where(folds, 0.0, np.clip(end_rate, 0.0, 1.0))
    ahead, steady = 1.0 - node, steadiness[:, None]
    wanted = end_angle[:, None] - (end_angle - begin_angle)[:, None] * ahead * (steady + (1.0 - steady) * ahead)
    way = _invert(angle, stop, wanted)
    segments = segments._replace(end=end_parameter)
    share = way / stop[:, None]
    loads_there = np.ascontiguousarray(np.moveaxis(loads, 0, -1)) @ chebyshev.basis(order, way).swapaxes(0, 1)
    curves = chebyshev.coefficients(np.concatenate([share[:, None], loads_there], axis=1))

    def per_lane(values: Floats, of: NDArray[np.bool_]) -> Floats:
        out = np.full(seen.lanes, np.nan)
        out[segments.lane[of]] = values[of]
        return out

    snap_off = np.zeros(seen.lanes, dtype=np.int8)
    snap_off[segments.lane[last]] = kind[last]
    return Paths(
        seen=seen,
        friction_angle=friction_angle,
        suspension_compliance=compliance,
        accuracy=accuracy,
        reach=bounds.reach,
        distance=bounds.distance,
        first_angle=per_lane(begin_angle, first),
        first_parameter=per_lane(segments.begin, first),
        snap_angle=per_lane(end_angle, last),
        snap_parameter=per_lane(end_parameter, last),
        snap_off=snap_off,
        segments=segments,
        begin_angle=begin_angle,
        end_angle=end_angle,
        steadiness=steadiness,
        coefficients=np.ascontiguousarray(np.moveaxis(curves, 0, -1)),
    )


def _sample(
    seen: SeenContour,
    segments: Segments,
    ways: Floats,
    friction_angle: Floats,
    compliance: Floats,
    accuracy: Accuracy,
) -> Floats:
    """Drive angle, holding moment and forces, shape (segments, 4, k), at ways, shape (segments, k)."""
    parameter, _ = segments.take(np.s_[:, None]).along(ways)
    lane, tip = segments.lane[:, None], segments.tip[:, None]
    wrench: Wrench | QuickWrench
    if accuracy.exact or np.any(friction_angle):
        phase = np.where(tip, TIP, TANGENTIAL)
        wrench = exact_states(seen, lane, parameter, friction_angle, phase=phase).wrench
    else:
        locus = seen.locate(lane, parameter)
        wrench = quick_wrench(locus.x, locus.y, locus.slope_angle, tip, roughly=accuracy.roughly)
    drive_angle = wrench.drive_angle + compliance[lane] * wrench.holding_moment
    return np.stack([drive_angle, *(getattr(wrench, name) for name in CHANNELS)], axis=1)


def _invert(coefficients: Floats, stop: Floats, wanted: Floats) -> Floats:
    """Arguments in [0, stop] at which interpolants that grow there take wanted values, shape (functions, k)."""
    order = coefficients.shape[0]
    slope = np.zeros_like(coefficients)
    slope[:-1] = chebyshev.derivative(coefficients)
    both = np.ascontiguousarray(np.stack([coefficients, slope]).transpose(2, 0, 1))  # (function, 2, order)
    stop = stop[:, None]
    z = stop * chebyshev.nodes(wanted.shape[1])
    for _ in range(8):
        value, rate = (both @ chebyshev.basis(order, z).swapaxes(0, 1)).swapaxes(0, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = (value - wanted) / rate
        z = np.clip(z - step, 0.0, stop)
        settled = np.abs(step) < _LAST_STEP * stop
        if np.all(settled):
            return z

    which, k = np.nonzero(~settled)
    goal = wanted[which, k]

    def missing(i: Index, at: Floats) -> tuple[Floats, Floats]:
        value, rate = np.einsum("pn,ncp->cn", chebyshev.basis(order, at), both[which[i]])
        return goal[i] - value, -rate

    z[which, k] = falling_root(missing, np.zeros(k.size), np.broadcast_to(stop, wanted.shape)[which, k])
    return z

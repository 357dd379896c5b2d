"""Step 1 for users: the record of a rod that sweeps along a contour."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import as_numbers, check_pivots
from tactile_bayes.contours.base import Contour, Locus
from tactile_bayes.errors import ClearanceWarning, ParameterError, StrainWarning
from tactile_bayes.mechanics.elastica import Wrench, wrench_from_contact
from tactile_bayes.mechanics.paths import Paths, States
from tactile_bayes.mechanics.phases import NONE, PHASE_NAMES
from tactile_bayes.mechanics.rods.rod import LARGEST_STRAIN, Rod
from tactile_bayes.record import CHANNELS
from tactile_bayes.record.schema import column_attributes
from tactile_bayes.rig import make_record
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.rig.unknown import pivot_shifts
from tactile_bayes.sweep.columns import ManyUnits, sweep_samples, to_lab_frame
from tactile_bayes.sweep.drive import Carried, Direction, Drive, Motion, Rotation, Translation, drives_of
from tactile_bayes.sweep.events import SweepEvents, events_of
from tactile_bayes.sweep.path import Acting, carried_paths, sweep_paths, to_sweep_frame

_MARGIN = 15  # number of drive steps before first contact and after snap-off
# Largest number of corrections of a tapered rod's standoff, and the last change of the arc length [L].
_MOST_MOVES, _SETTLED = 50, 1e-15
# Default steps of rotations [rad], and of drives that carry the base, over the rod's length.
_STEP, _SHARE = float(np.radians(1.0)), 0.01
_FEWEST_POSES = 8  # number of poses of a motion up to which it is sampled by steps, and not at these
_TURN = 2.0 * math.pi


class _ByDirection(dict[str, SweepEvents]):
    def __missing__(self, direction: str) -> SweepEvents:
        several = "there are several sweeps of a direction, so take scan.sweeps[number] instead"
        hint = f"choose from {', '.join(map(repr, self))}" if self else several
        raise ParameterError(f"the scan has no events of direction {direction!r}: {hint}")


@dataclass(frozen=True, eq=False)
class Scan:
    """Result of `scan`.

    Attributes
    ----------
    record : xr.Dataset
        The record, dimension "sample", with `truth_` columns for the contact.
    sweeps : tuple of SweepEvents
        Events of each sweep, by its number in the record.
    events : mapping of str to SweepEvents
        Events by direction, if there is one base only, and one sweep of each direction.
    contour : Contour
        The contour that was scanned.
    """

    record: xr.Dataset
    sweeps: tuple[SweepEvents, ...]
    contour: Contour

    @property
    def events(self) -> Mapping[str, SweepEvents]:
        one_base = len({sweep.base for sweep in self.sweeps}) == 1
        found = {sweep.direction: sweep for sweep in self.sweeps}
        return _ByDirection(found if one_base and len(found) == len(self.sweeps) else {})


def equilibria(
    contour: Contour,
    slope_angles: ArrayLike,
    *,
    base: tuple[float, float] = (0.0, 0.0),
    direction: Direction = "forward",
    rig: Rig | None = None,
) -> xr.Dataset:
    """States in which the rod touches a contour at given slope angles.

    They solve equations 19 and 20 of Merker et al. 2018, doi 10.1155/2018/1613945, in closed form, or by continuation
    if the rod is not straight and uniform. Beyond snap-off they are equilibria too, but unstable.

    A rod that is curved toward the object, against the sense in which a load bends it, may touch with its tip in two
    equilibria at one slope angle. Early in a sweep the load only straightens it, and the contact moves outward,
    toward larger |α|; later the load bends it as it bends a straight rod, and the contact comes back. The second
    equilibrium is returned.

    Parameters
    ----------
    contour : Contour
        One contour; in metres if the rig states its rod, else in rod lengths.
    slope_angles : array_like, shape (n,)
        Slope angles α of the contour at the contact [rad]; those of a backward sweep are mostly negative.
    base : (float, float)
        The pivot, in the contour's unit of length.
    direction : {"forward", "backward"}
        Sense of the drive: forward is counter-clockwise.
    rig : Rig, optional
        Its rod, by default the dimensionless one, with the deviations that are known; friction is 0 unless it is known.
        It acts as on a straight rod, which slides toward the snap-off.

    Returns
    -------
    xr.Dataset
        Over "slope_angle": drive_angle and tip_angle [rad], holding_moment, force_x, force_y, contact_arclength,
        contact_x and contact_y, in SI or the units of the rod, and contact_phase ("tip", "tangential" or "none"). They
        are NaN beyond the rod's reach, and where the contour has no such slope.

    Raises
    ------
    ParameterError
        If a slope angle is outside (−π/2, π/2), or another argument is invalid.

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> states = equilibria(paper_profile("II", q=0.5), [0.0608483016, 0.4])
    >>> states.drive_angle.values.round(6), states.contact_phase.values.tolist()
    (array([3.154275, 1.994616]), ['tip', 'tangential'])
    """
    numbers = as_numbers(slope_angles)
    alpha = np.atleast_1d(np.nan if numbers is None else numbers)
    if alpha.ndim != 1 or not np.all(np.abs(alpha) < 0.5 * np.pi):
        raise ParameterError("slope_angles must be a list of angles in (−π/2, π/2) radians")
    pivots = check_pivots("base", base)
    if len(pivots) > 1:
        raise ParameterError(f"base is {base!r}: equilibria takes one pivot (x, y), only scan several")
    acts = Acting.of(rig_of(rig))
    rod = acts.rod
    if acts.contact_compliance:
        raise ParameterError("contact_compliance is known, but equilibria are of an object that does not yield")
    sweep_frame = to_sweep_frame(contour, pivots[0], direction, rod)
    index = np.zeros(alpha.size, dtype=np.intp)
    side = -1.0 if sweep_frame.mirrored[0] else 1.0
    parameter = side * contour.parameter_of_slope(alpha)
    locus = replace(sweep_frame, standoff=0.0).locate(index, parameter)
    states = States(parameter, locus.x, locus.y, locus.slope_angle, _wrench(locus, acts, side))
    wrench = states.wrench
    columns = to_lab_frame(sweep_frame, index, states, rod)
    reached = wrench.phase != NONE
    columns["drive_angle"] = (
        columns["drive_angle"] + acts.suspension_compliance * columns["holding_moment"] / rod.moment_unit
    )
    columns["contact_phase"] = np.array(PHASE_NAMES)[wrench.phase]
    data, units = {}, "dimensionless" if rod.is_dimensionless else "SI"
    for name, values in columns.items():
        if name == "slope_angle":
            continue
        if name != "contact_phase":
            values = np.where(reached, values, np.nan)
        data[name] = ("slope_angle", values, column_attributes(name, units))
    return xr.Dataset(data, coords={"slope_angle": ("slope_angle", alpha, column_attributes("slope_angle", units))})


def _wrench(locus: Locus, acts: Acting, side: float) -> Wrench:
    """Base wrench in the sweep frame, for points of the object."""
    rod, surface, alpha = acts.rod, acts.rod.surface, locus.slope_angle
    arclength = np.ones(alpha.shape)
    for _ in range(_MOST_MOVES if surface.half_angle else 1):
        d = surface.standoff(arclength)
        wrench = wrench_from_contact(
            locus.x + d * np.sin(alpha),
            locus.y - d * np.cos(alpha),
            alpha + surface.half_angle,
            surface.friction_angle(np.arctan(acts.friction)),
            rest_curvature=side * rod.arc_curvature,
            stem=rod.stem / rod.length,
            profile=None if rod.profile is None else rod.profile._replace(sign=side),
        )
        moved = np.abs(np.where(wrench.phase == NONE, arclength, wrench.contact_arclength) - arclength)
        if np.all(moved <= _SETTLED):
            break
        arclength = arclength + np.where(wrench.phase == NONE, 0.0, wrench.contact_arclength - arclength)
    return wrench


def scan(
    contour: Contour,
    rig: Rig | None = None,
    *,
    drive: Drive | Sequence[Drive] | None = None,
    direction: Literal["both", "forward", "backward"] = "both",
    base: tuple[float, float] | Sequence[tuple[float, float]] = (0.0, 0.0),
    drive_step: float | None = None,
    drive_angles: ArrayLike | None = None,
) -> Scan:
    """Sweep the rod along a contour, and record the loads at its base from before first contact to after snap-off.

    This is Step 1 of Merker et al. 2018, doi 10.1155/2018/1613945, in closed form for uniform rods that are straight or
    arcs, and by Taylor series for others.

    Parameters
    ----------
    contour : Contour
        One contour; in metres if the rig states its rod, else in rod lengths.
    rig : Rig, optional
        Its rod, by default the dimensionless one, with the deviations that are known; a rod with a diameter touches
        with its surface. What is not known is as stated, without friction, which is at most 0.84. Errors of load cell
        and encoder change no load: `Rig.measure` applies them. The record states the rod with these deviations, so that
        one without a length whose stiffness or length deviates makes it SI, of a rod of about 1 m; `Rig.measure` states
        the data sheets again, and `LoadCell.measure` does not. With friction the contact slides or sticks.
    drive : Rotation, Translation or Motion, or a sequence of them, optional
        Path of the base. The sweeps of several drives (a support that is moved, or an array of whiskers) are numbered
        consecutively. The grid of a rotation consists of multiples of its step, from 15 steps before contact to 15
        steps after it, within a turn; given drive angles at which the rod is in the same contact a turn before or later
        are left out.
    direction, base, drive_step, drive_angles
        Short for ``drive=Rotation(base, direction, drive_step, drive_angles)``, if there is no `drive`; with several
        pivots, for one rotation about each.

    Returns
    -------
    Scan
        Out of contact loads are zero, `truth_` columns are NaN, and the phase is "none".

    Warns
    -----
    ClearanceWarning
        If the unloaded rod would cut the object after snap-off, or a drive brings it there again later: its state is
        then unknown, and these samples are left out.
    StrainWarning
        If the rod is bent beyond its elastic strain, or beyond a strain of 0.1, where the model of a slender, linearly
        elastic rod fails.

    Raises
    ------
    ReachError
        If the rod is too short to touch the contour, its tip folds over until the other side of the rod touches, or
        a straight rod meets the object head-on with friction, and buckles.
    ContourError
        If the pivot is not below the contour or too close to it, the rod would touch beyond an end of it, or a rod that
        is curved toward the contour would touch it twice.
    ParameterError
        If an argument is invalid.

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> result = scan(paper_profile("II", q=0.5))
    >>> round(result.events["forward"].snap_off.drive_angle, 6)
    3.154275
    """
    acts, pivots = Acting.of(rig_of(rig)), check_pivots("base", base)
    is_given = {
        "base": pivots != [(0.0, 0.0)],
        "direction": direction != "both",
        "drive_step": drive_step is not None,
        "drive_angles": drive_angles is not None,
    }
    drives: list[Drive] = [Rotation(pivot, direction, drive_step, drive_angles) for pivot in pivots]
    if drive is not None:
        for name in (name for name, given in is_given.items() if given):
            raise ParameterError(
                f"{name} is for rotations without a drive: give it to the drive, as in Rotation({name}=…)"
            )
        drives = drives_of(drive)
    columns: list[dict[str, NDArray[Any]]] = []
    sweeps: list[SweepEvents] = []
    for one in _shifted(drives, rig_of(rig)):
        for paths, sense, every in _paths_of(contour, one, acts):
            sweep = events_of(paths, sense, one, acts.rod)
            for category, message in _warnings_of(sweep, one, acts.rod):
                warnings.warn(message, category, stacklevel=2)
            chosen, poses = _sampled(one, every, sweep)
            columns.append(_columns(paths, chosen, poses, len(sweeps), sweep.direction, acts.rod))
            sweeps.append(sweep)
    if not any(len(of_sweep["drive_angle"]) for of_sweep in columns):
        snaps = ", ".join(f"{sweep.snap_off.drive_angle:.6g} rad ({sweep.direction})" for sweep in sweeps)
        raise ParameterError(
            f"drive_angles: all of them are after the snap-off, at {snaps}, beyond which the state is unknown, since "
            "the rod does not come free of the object: give angles before it too"
        )
    record = {name: np.concatenate([of_sweep[name] for of_sweep in columns]) for name in columns[0]}
    return Scan(make_record(record, Rig(rod=acts.rod)), tuple(sweeps), contour)


def _shifted(drives: list[Drive], rig: Rig) -> list[Drive]:
    """Return drives about pivots, or from places, that are shifted against the stated ones."""
    begins = [one.base if isinstance(one, Rotation) else tuple(one.poses[0, :2].tolist()) for one in drives]
    numbers = {place: number for number, place in enumerate(dict.fromkeys(begins))}
    shifts = pivot_shifts(rig.known, len(numbers)).tolist()
    found: list[Drive] = []
    for one, place in zip(drives, begins, strict=True):
        x, y = shifts[numbers[place]]
        if not (x or y):
            found.append(one)
        elif isinstance(one, Motion):
            found.append(replace(one, x=np.asarray(one.x) + x, y=np.asarray(one.y) + y))
        elif isinstance(one, Rotation | Translation):
            found.append(replace(one, base=(place[0] + x, place[1] + y)))
    return found


def _paths_of(contour: Contour, drive: Drive, acts: Acting) -> Iterator[tuple[Paths, Direction, Floats]]:
    """Follow the path of each sweep of a drive, with states at its drive angles or travels, which are increasing."""
    if isinstance(drive, Carried):
        travels = drive.travels
        if drive.drive_step is not None or not isinstance(drive, Motion) or drive.x.size <= _FEWEST_POSES:
            travels = drive.by(drive.drive_step or _SHARE * acts.rod.length)
        yield *carried_paths(contour, drive, travels, acts), travels
        return
    if drive.drive_angles is not None:
        angles = np.array(drive.drive_angles)
    else:
        step = drive.drive_step or _STEP
        angles = np.arange(np.floor(-_TURN / step), np.ceil(_TURN / step) + 1) * step
        angles = angles[np.abs(angles) <= _TURN]  # a drive turns by no more
    for sense in drive.directions:
        yield sweep_paths(contour, base=drive.base, direction=sense, acts=acts, drive_angles=angles), sense, angles


def _sampled(drive: Drive, every: Floats, sweep: SweepEvents) -> tuple[Index, Floats]:
    """Indices of the drive angles or travels that are sampled, in the order of the drive, and poses of the base there.
    Where a rod is in another contact, its state is not known."""
    if isinstance(drive, Carried):
        chosen = np.flatnonzero(~(every > (sweep.touches_again if sweep.clear else sweep.snap_off.travel)))
        return chosen, drive.at(every[chosen])
    chosen = _within_a_turn(drive, every, sweep)
    return chosen, np.column_stack([*(np.full(chosen.size, value) for value in drive.base), every[chosen]])


def _within_a_turn(drive: Rotation, every: Floats, sweep: SweepEvents) -> Index:
    """Indices of the drive angles that are sampled, in their order: without those at which the rod, a turn before or
    later, is in the same contact, of which it warns if they were asked for."""
    first, snap = sweep.first_contact.drive_angle, sweep.snap_off.drive_angle
    sense, chosen = 1.0 if sweep.direction == "forward" else -1.0, np.arange(every.size)
    if drive.drive_angles is None:
        step = drive.drive_step or _STEP
        low, high = math.floor(min(first, snap) / step) - _MARGIN, math.ceil(max(first, snap) / step) + _MARGIN
        number = round(every[0] / step)
        chosen = chosen[max(low - number, 0) : high - number + 1]
    if not sweep.clear:
        chosen = chosen[sense * (snap - every[chosen]) >= 0.0]
    angles = every[chosen]
    kept = (sense * (angles - snap) > -_TURN) & (sense * (angles - first) < _TURN)
    if drive.drive_angles is not None and not kept.all():
        warnings.warn(
            f"{_name(sweep)} the rod touches the object from {first:.6g} to {snap:.6g} rad, and so it does a turn (2π) "
            f"before and later: {np.count_nonzero(~kept)} of the drive angles, up to {snap - sense * _TURN:.6g} or "
            f"from {first + sense * _TURN:.6g} rad on, are left out",
            ClearanceWarning,
            stacklevel=4,
        )
    return np.asarray(chosen[kept][:: int(sense)])


def _warnings_of(sweep: SweepEvents, drive: Drive, rod: Rod) -> Iterator[tuple[type[UserWarning], str]]:
    """Yield what is to be warned of after a sweep."""
    where, strain = _name(sweep), sweep.largest_strain
    if not sweep.clear:
        yield (
            ClearanceWarning,
            f"{where} the rod snaps at {_place(sweep)}, but unloaded it would still cut the object: it comes to rest "
            "in another contact, which no sweep reaches; the samples after that are left out",
        )
    if sweep.clear and not math.isnan(sweep.touches_again):
        x, y, angle = drive.at(sweep.touches_again) if isinstance(drive, Carried) else (math.nan,) * 3
        yield (
            ClearanceWarning,
            f"{where} the rod is free after {_place(sweep)}, and touches the object again at base ({x:.6g}, {y:.6g}) "
            f"and drive angle {angle:.6g} rad, a travel of {sweep.touches_again:.6g}: a sweep has one contact, and the "
            "samples after that are left out; end the drive there, and scan the rest as a drive of its own",
        )
    if strain > LARGEST_STRAIN:
        yield (
            StrainWarning,
            f"{where} the rod is strained by {strain:.3g}: beyond {LARGEST_STRAIN:g} it is neither slender nor "
            "linearly elastic, and the loads are unreliable; take a thinner or longer rod",
        )
    if rod.elastic_strain is not None and strain > rod.elastic_strain:
        yield (
            StrainWarning,
            f"{where} the rod is strained by {strain:.3g}, beyond its elastic strain of {rod.elastic_strain:g}: it "
            "would stay bent; take a thinner or longer rod, or stop the drive earlier",
        )


def _name(sweep: SweepEvents) -> str:
    return f"in the {sweep.direction} sweep from ({sweep.base[0]:g}, {sweep.base[1]:g})"


def _place(sweep: SweepEvents) -> str:
    """Return where a sweep ends, as text."""
    event = sweep.snap_off
    if event.travel == event.drive_angle:
        return f"{event.drive_angle:.6g} rad"
    return f"base ({event.base_x:.6g}, {event.base_y:.6g})"


def _columns(
    paths: Paths, chosen: Index, poses: Floats, number: int, direction: str, rod: Rod
) -> dict[str, NDArray[Any]]:
    """Columns of a sweep at some of the drive angles or travels of its path, which are those of poses of the base."""
    samples = sweep_samples(paths, ManyUnits.of_rod(rod), np.zeros(chosen.size, dtype=np.intp), chosen)
    samples["contact_phase"] = np.array(PHASE_NAMES)[samples["contact_phase"]]
    sweep = {"sweep": np.full(chosen.size, number), "direction": np.full(chosen.size, direction)}
    sweep |= dict(zip(("base_x", "base_y", "drive_angle"), poses.T, strict=True))
    return sweep | {name if name in CHANNELS else f"truth_{name}": values for name, values in samples.items()}

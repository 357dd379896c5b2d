"""The exact path of one sweep along one contour, or an error that says why there is none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_choice, check_kind
from tactile_bayes.contours.base import Contour
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.errors import ContourError, ParameterError, ReachError, TactileBayesError
from tactile_bayes.mechanics.branches.line import lines_through
from tactile_bayes.mechanics.paths import Paths, trace
from tactile_bayes.mechanics.phases import TIP
from tactile_bayes.mechanics.reachability import CLEARANCE, Reachability
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.rig import Rig
from tactile_bayes.sweep.drive import Carried, Direction

_DIRECTIONS: tuple[Direction, Direction] = ("forward", "backward")

# Difference of travels [L] that rounding may make. A tip that touches first does so on both sides of the rod: its side
# is then the one to which it is turned less.
_SAME = 1e-9
# Outcomes on the two sides of a carried rod, the most informative first; −1 stands for all others. A rod that is clear
# of the object on one side seems to have passed it on the other.
_PLAIN = (Reachability.TOUCHES, -1, Reachability.TOO_FAR, Reachability.BEGINS_INSIDE)
# Parameters that do not act in sweeps nor in readings, and what to do.
_NOT_SWEPT = {
    **dict.fromkeys(GROUPS["gauge"], "it is the place of a gauge, so sweep along a contour that is there"),
    **dict.fromkeys(GROUPS["discrepancy"], "a discrepancy is a function and no number, and no sweep has it"),
    **dict.fromkeys(("moment_noise", "force_noise"), "state it in the load cell, which `Rig.measure` applies"),
}
_FREE = "without friction the rod has a path (friction = 0 under [unknown] of rig.toml); with it, "

# Why there is no path although the rod touches the contour.
_IN_CONTACT: dict[Reachability, tuple[type[TactileBayesError], str]] = {
    Reachability.GRAZES: (
        ReachError,
        "{sweep} the rod touches the contour so slightly that rounding hides where contact ends: bring contour and "
        "pivot closer together (are contour, pivot and rod in one unit?)",
    ),
    Reachability.BEGINS_INSIDE: (
        ContourError,
        "{sweep} the unloaded rod would cut the contour from the beginning, or before it touches it on a side from "
        "which it can be followed: begin the drive clear of it, or carry the rod another way",
    ),
    Reachability.SLIPS_OFF: (
        ReachError,
        "{sweep} the rod's tip slips off the contour as soon as it touches it: it is turned beyond the normal of the "
        "contour there, so that any load pushes it on; sweep in the other direction, move the pivot, or take a rod "
        "that is less curved",
    ),
    Reachability.FOLDS_OVER: (
        ReachError,
        "{sweep} the rod's tip folds over: at {point} the other side of the rod lies along the contour, and contact "
        "with both sides in one sweep is not modelled; end the drive before, take a rod that is stiffer or less curved "
        "at its tip, sweep in the other direction, or move the pivot",
    ),
    Reachability.TOUCHES_TWICE: (
        ContourError,
        "{sweep} the rod would touch the contour twice: in contact at {point} it is curved toward the object so much "
        "that another part of it would cut the contour, and contact at two points is not modelled; take a rod that is "
        "less curved, sweep in the other direction, or move the pivot",
    ),
}


class Acting(NamedTuple):
    """What acts in a sweep: rod and friction, and compliances of suspension [rad/(EI/L)] and object [L/(EI/L²)]."""

    rod: Rod = Rod()
    friction: float = 0.0
    suspension_compliance: float = 0.0
    contact_compliance: float = 0.0

    @classmethod
    def of(cls, rig: Rig) -> Acting:
        """Return what acts in sweeps of a rig with the deviations that are known."""
        rod, known = rig.known_rod, rig.known
        for name, correction in _NOT_SWEPT.items():
            if known.get(name, 0.0):
                raise ParameterError(f"{name} is known to be {known[name]:g}: {correction}")
        yielding = known.get("contact_compliance", 0.0) * rod.force_unit / rod.length
        return cls(rod, rig.friction, known.get("suspension_compliance", 0.0) * rod.moment_unit, yielding)

    def trace(self, sweep_frame: SweepFrame, **options: Any) -> Paths:
        """Follow paths; see `mechanics.paths.trace`."""
        return trace(
            sweep_frame,
            friction_angle=np.arctan(self.friction),
            suspension_compliance=self.suspension_compliance,
            contact_compliance=self.contact_compliance,
            profile=self.rod.profile,
            **options,
        )

    def turn(self, sweep_frame: SweepFrame, drive_angles: Floats | None, *, polished: bool = True) -> Paths:
        """Follow paths of rods that turn in one direction, with states at drive angles in the laboratory frame."""
        if drive_angles is not None and sweep_frame.mirrored[0]:
            drive_angles = np.pi - drive_angles
        return self.trace(sweep_frame, drive_angles=drive_angles, polished=polished)


_BARE = Acting()


def sweep_paths(
    contour: Contour,
    *,
    base: tuple[float, float] = (0.0, 0.0),
    direction: Direction = "forward",
    acts: Acting = _BARE,
    drive_angles: Floats | None = None,
) -> Paths:
    """Compute the exact path of one sweep along one contour; errors are those of `scan`."""
    rod = acts.rod
    sweep_frame = to_sweep_frame(contour, base, direction, rod)
    height = float(contour.height(base[0])) - 0.5 * rod.diameter
    if height <= base[1]:
        raise ContourError(
            f"the contour cuts the base: at x = {base[0]:g} it is at y = {height:g}, not above the pivot at "
            f"y = {base[1]:g}; raise the contour or lower the pivot"
        )
    paths = acts.turn(sweep_frame, drive_angles)
    _refuse(paths, contour, rod, direction, f"in a {direction} sweep from the pivot at ({base[0]:g}, {base[1]:g})")
    return paths


def carried_paths(contour: Contour, drive: Carried, travels: Floats, acts: Acting) -> tuple[Paths, Direction]:
    """Compute the exact path of a rod that a drive carries along one contour, and the direction that its side implies.
    It touches the object with its left side, as a forward sweep does, or with its right side. States are computed at
    the travels. Errors are those of `scan`."""
    rod, poses = acts.rod, drive.poses
    base = float(poses[0, 0]), float(poses[0, 1])
    way = float(np.abs(poses[:, 0] - base[0]).max()) / rod.length
    found: dict[Direction, Paths] = {}
    for direction in _DIRECTIONS:
        path = lines_through(poses, rod.length, backward=direction == "backward")
        sweep_frame = replace(to_sweep_frame(contour, base, direction, rod), way=way)
        internal = np.interp(travels, drive.travels, path.travels)
        found[direction] = acts.trace(sweep_frame, drive_angles=internal, lines=path.lines[None])

    first = {direction: float(of_side.first_angle[0]) for direction, of_side in found.items()}
    is_same = abs(first["forward"] - first["backward"]) < _SAME

    def rank(direction: Direction) -> tuple[int, float]:
        reach = int(found[direction].reach[0])
        by = _turn_to_tangency(found[direction]) if is_same else first[direction]
        return (_PLAIN.index(reach) if reach in _PLAIN else 1), by

    side = min(_DIRECTIONS, key=rank)
    _refuse(found[side], contour, rod, side, f"in the drive that begins at ({base[0]:g}, {base[1]:g})")
    return found[side], side


def _turn_to_tangency(paths: Paths) -> float:
    """Angle by which the tip is turned from the contour at first contact [rad]; 0 in tangential contact."""
    first = paths.event_states().take(np.array(0), np.array(0))
    return float(first.wrench.tip_angle - first.slope_angle) if first.wrench.phase == TIP else 0.0


def _refuse(paths: Paths, contour: Contour, rod: Rod, direction: Direction, sweep: str) -> None:
    """Raise an error that says why there is no path."""
    x, y = float(paths.sweep_frame.base_x[0]), float(paths.sweep_frame.base_y[0])
    reach, is_carried = Reachability(int(paths.reach[0])), paths.lines is not None
    pivot, nearest = f"pivot at ({x:g}, {y:g})", f"{paths.distance[0] * rod.length:.6g}"
    if reach in _IN_CONTACT:
        kind, message = _IN_CONTACT[reach]
        raise kind(message.format(sweep=sweep, point=_point(paths)))
    match reach:
        case Reachability.TOO_FAR if is_carried:
            raise ReachError(
                f"{sweep} the rod does not touch the contour: bring them closer together, or carry the rod farther "
                "(are contour, drive and rod in one unit?)"
            )
        case Reachability.HEAD_ON:
            free = trace(paths.sweep_frame, profile=rod.profile, lines=paths.lines)
            raise ReachError(
                f"{sweep} friction lets the rod neither slide nor yield at {_point(paths)}, where it meets the object "
                "head-on, as a strut that buckles to either side; "
                + (_FREE if free.reach[0] == Reachability.TOUCHES else "")
                + "take another heading or drive angle, or another pivot"
            )
        case Reachability.TOO_FAR:
            raise ReachError(
                f"the contour is out of reach: its nearest point is {nearest} from the {pivot}, and the rod is "
                f"{rod.length:g} long" + (f", on a stem of {rod.stem:g}" if rod.stem else "")
            )
        case Reachability.CUTS_PIVOT if is_carried:
            raise ContourError(f"{sweep} the contour cuts the path of the base: raise the contour or lower the drive")
        case Reachability.CUTS_PIVOT:
            raise ContourError(
                f"the contour cuts the base: the {pivot} is not below it; raise the contour or lower the pivot"
            )
        case Reachability.TOO_CLOSE:
            raise ContourError(
                f"the contour comes within {nearest} of the {'path of the base' if is_carried else pivot}; a path can "
                f"be followed from {CLEARANCE * rod.length + rod.stem:g} on ({CLEARANCE:.0%} of the rod's length"
                f"{', beyond the stem, on which contact is not modelled' if rod.stem else ''}): move one of them away"
            )
        case Reachability.ENDS:
            raise ContourError(
                f"{sweep} the rod would touch beyond {_end(contour, direction == 'forward')}, "
                "and nothing is known of the object there: extend the contour, or move the pivot"
            )
        case Reachability.RUNS_OUT:
            raise ContourError(
                f"{sweep} the rod would still touch at {_end(contour, direction == 'backward')}, and "
                "nothing is known of the object beyond: extend the contour, or move the pivot"
            )


def _point(paths: Paths) -> str:
    """Return the end of a path as text, in the unit of the contour."""
    frame, at = paths.sweep_frame, paths.snap_parameter
    locus = frame.contour.locate(np.where(frame.mirrored, -at, at))
    return f"({locus.x[0]:.6g}, {locus.y[0]:.6g})"


def _end(contour: Contour, at_right: bool) -> str:
    side: Literal["left", "right"] = "right" if at_right else "left"
    locus = contour.locate(contour.domain[1 if at_right else 0])
    return f"the contour's {side} end at ({float(locus.x):.6g}, {float(locus.y):.6g}), {contour.end_name(side)}"


def to_sweep_frame(contour: Contour, base: tuple[float, float], direction: Direction, rod: Rod) -> SweepFrame:
    """Convert one contour to the frame of a sweep of a rod about a pivot."""
    check_kind("the contour", contour, Contour, "give one, such as tb.contours.Parabola(a=0.5, q=0.5)")
    check_choice("direction", direction, ("forward", "backward"))
    if contour.shape != ():
        raise ParameterError(
            f"one contour is wanted here, not an array of shape {contour.shape}: scan_many takes those of shape (n,)"
        )
    return frame_of(contour, 1, base, direction, rod)


def frame_of(contours: Contour, count: int, base: tuple[Any, Any], direction: Direction, rod: Rod) -> SweepFrame:
    """Convert so many contours to the frame of sweeps of a rod, each about a pivot."""
    x, y = (np.array(np.broadcast_to(b, (count,)), dtype=float) for b in base)
    return SweepFrame(
        contours.broadcast_to((count,)),
        x,
        y,
        rod.length,
        0.5 * rod.diameter,
        np.full(count, direction == "backward"),
        rod.arc_curvature,
        rod.taper,
        rod.stem / rod.length,
    )

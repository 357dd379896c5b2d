"""One sweep along one contour: its exact path, or a refusal, and its states in the world's signs and units."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.contours.base import Contour
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.elastica import PHASE_NAMES
from tactile_bayes.errors import ContourError, ParameterError, ReachError
from tactile_bayes.path import CLEARANCE, Paths, Reach, States, trace
from tactile_bayes.rod import Rod

__all__ = ["Direction", "in_world", "seen_from", "sweep_paths"]

Direction = Literal["forward", "backward"]
Floats = NDArray[np.float64]

_ORDER = 32


def sweep_paths(
    contour: Contour,
    *,
    base: tuple[float, float] = (0.0, 0.0),
    direction: Direction = "forward",
    rod: Rod | None = None,
    friction: float = 0.0,
) -> Paths:
    """The exact path of one sweep along one contour, or a refusal that says why there is none.

    Parameters and errors are those of `scan`.
    """
    rod = rod or Rod()
    seen = seen_from(contour, base, direction, rod)
    height = np.asarray(contour.height(base[0])) - 0.5 * rod.diameter
    if np.any(height <= base[1]):
        raise ContourError(
            f"the contour cuts the base: at x = {base[0]:g} it is at y = {float(np.min(height)):g}, not above the "
            f"pivot at y = {base[1]:g}; raise the contour or lower the pivot"
        )
    paths = trace(seen, friction_angle=float(np.arctan(friction)), order=_ORDER)
    match Reach(int(paths.reach[0])):
        case Reach.TOO_FAR:
            raise ReachError(
                f"the contour is out of reach: its nearest point is {paths.distance[0] * rod.length:.6g} from the "
                f"pivot at ({base[0]:g}, {base[1]:g}), and the rod is {rod.length:g} long"
            )
        case Reach.CUTS_PIVOT:
            raise ContourError(
                f"the contour cuts the base: the pivot at ({base[0]:g}, {base[1]:g}) is not below it; raise the "
                "contour or lower the pivot"
            )
        case Reach.TOO_CLOSE:
            raise ContourError(
                f"the contour comes within {paths.distance[0] * rod.length:.6g} of the pivot at ({base[0]:g}, "
                f"{base[1]:g}); a path can be followed from {CLEARANCE * rod.length:g} on ({CLEARANCE:.0%} of the "
                "rod's length): move one of them away"
            )
        case Reach.ENDS:
            raise ContourError(
                f"in a {direction} sweep the rod would first touch beyond {_end(contour, direction == 'forward')}, "
                "and nothing is known of the object there: extend the contour, or move the pivot"
            )
        case Reach.RUNS_OUT:
            raise ContourError(
                f"in a {direction} sweep the rod would still touch at {_end(contour, direction == 'backward')}, and "
                "nothing is known of the object beyond: extend the contour, or move the pivot"
            )
    return paths


def _end(contour: Contour, at_right: bool) -> str:
    side: Literal["left", "right"] = "right" if at_right else "left"
    locus = contour.locate(contour.domain[1 if at_right else 0])
    return f"the contour's {side} end at ({float(locus.x):.6g}, {float(locus.y):.6g}), {contour.end_name(side)}"


def seen_from(contour: Contour, base: tuple[float, float], direction: Direction, rod: Rod) -> SeenContour:
    if direction not in ("forward", "backward"):
        raise ParameterError(f"direction is {direction!r}: choose 'forward' or 'backward'")
    if contour.shape != ():
        raise ParameterError(f"one contour is wanted here, not an array of shape {contour.shape}")
    x, y = (np.full(1, float(b)) for b in base)
    return SeenContour(
        contour.broadcast_to((1,)), x, y, rod.length, 0.5 * rod.diameter, np.array([direction == "backward"])
    )


def in_world(seen: SeenContour, states: States, rod: Rod) -> dict[str, NDArray[Any]]:
    """States in the world's signs and units; the contact point is the object's, not the centreline's."""
    sign = -1.0 if seen.mirrored[0] else 1.0
    wrench = states.wrench
    standoff = seen.standoff / seen.length
    x = states.x - standoff * np.sin(states.slope_angle)
    y = states.y + standoff * np.cos(states.slope_angle)

    def turned(angle: Floats) -> Floats:
        return np.pi - angle if seen.mirrored[0] else angle

    return {
        "drive_angle": turned(wrench.drive_angle),
        "holding_moment": sign * wrench.holding_moment * rod.moment_unit + 0.0,  # never −0
        "force_x": sign * wrench.force_x * rod.force_unit + 0.0,
        "force_y": wrench.force_y * rod.force_unit,
        "contact_arclength": wrench.contact_arclength * rod.length_unit,
        "contact_phase": np.array(PHASE_NAMES)[wrench.phase],
        "contact_x": seen.base_x[0] + sign * x * rod.length_unit,
        "contact_y": seen.base_y[0] + y * rod.length_unit,
        "tip_angle": turned(wrench.tip_angle),
        "slope_angle": sign * states.slope_angle,
    }

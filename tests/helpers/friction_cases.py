"""Cases of a rod that touches a contour with friction, for the stepper and for the package alike."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

import tactile_bayes as tb
from helpers.friction_contact import Flexible, Stepper
from helpers.friction_stepper import Drive, contour_of

FAMILIES = {"circle": tb.contours.Circle, "ellipse": tb.contours.Ellipse, "parabola": tb.contours.Parabola}
_BASE = 0.15  # least distance of the base from the object, over the object's size


def drawn_case(rng: np.random.Generator) -> dict[str, Any]:
    """A case whose rod is free at first and touches on the first leg of a drive that turns back up to twice.

    The contour lies above the base.
    """
    while True:
        kind = rng.choice(["straight", "tapered", "curved", "both"])
        taper = rng.uniform(0.2, 0.8) if kind in ("tapered", "both") else 0.0
        curvature = rng.uniform(-0.5, 0.5, 2) if kind in ("curved", "both") else np.zeros(1)
        contour = _drawn_contour(rng)
        side, how = rng.choice([-1.0, 1.0]), rng.choice(["turned", "carried", "upright", "moved"])
        angle = 0.5 * math.pi - side * rng.uniform(0.0, 0.9) * (how != "upright")
        far = [side * 0.9, rng.uniform(-0.3, 0.2), angle]
        move = np.array([-1.8 * side, rng.uniform(-0.3, 0.3), side * rng.uniform(-0.6, 1.0)])
        if how == "turned":
            far, move = [rng.uniform(-0.3, 0.3), 0.0, 0.5 * math.pi - 1.5 * side], np.array([0.0, 0.0, 3.0 * side])
        elif how != "moved":
            move[2] = 0.0
        move[1] *= how != "upright"
        case = {
            "rod": {"taper": float(taper), "curvature": tuple(curvature.tolist())},
            "contour": contour,
            "friction": float(rng.choice([rng.uniform(0.0, 0.8), rng.uniform(0.0, 0.1)])),
            "poses": [far, (far + move).tolist()],
        }
        stepper = Stepper(Flexible(**case["rod"]), contour_of(contour), 0.0)
        whole = Drive(case["poses"])
        touch = _first(stepper, whole)
        if touch is None or abs(stepper.contour.at(touch[1].p).alpha) > 1.3:
            continue
        turns = [touch[0] / whole.travel + rng.uniform(0.02, 0.5)]
        turns += [turns[0] - rng.uniform(0.02, 0.4), turns[0] + rng.uniform(0.0, 0.3)][: rng.integers(0, 3)]
        case["poses"] = [far, *((far + u * move).tolist() for u in turns)]
        bases = np.array([Drive(case["poses"]).pose(t)[:2] for t in np.linspace(0.0, Drive(case["poses"]).travel, 50)])
        if stepper.contour.outside(*bases.T).min() > _BASE:
            return case | {"step": Drive(case["poses"]).travel / 200.0}


def _first(stepper: Stepper, drive: Drive) -> tuple[float, Any] | None:
    times = np.linspace(0.0, drive.travel, 100).tolist()
    found = (stepper.first_touch(drive.pose, a, b) for a, b in pairwise(times))
    touch = next((one for one in found if one is not None), None)
    return None if touch is None or touch[0] == 0.0 else touch


def _drawn_contour(rng: np.random.Generator) -> dict[str, Any]:
    place = {"q": float(rng.uniform(0.3, 0.95)), "x_c": float(rng.uniform(-0.2, 0.2))}
    family = str(rng.choice(["circle", "ellipse", "parabola"]))
    if family == "circle":
        return {"family": family, "r": float(rng.uniform(0.1, 0.6)), **place}
    if family == "ellipse":
        return {"family": family, "a": float(rng.uniform(0.15, 0.6)), "b": float(rng.uniform(0.1, 0.5)), **place}
    return {"family": family, "a": float(rng.uniform(0.3, 1.5)), **place}


def scanned(case):
    """The package's scan of a case."""
    rod, contour = case["rod"], dict(case["contour"])
    curvature, known = rod.get("curvature", (0.0,)), {}
    if any(curvature):
        known["rest_curvature"] = lambda s: np.polynomial.polynomial.polyval(s, curvature)
    x, y, angle = np.transpose(case["poses"])
    return tb.scan(
        FAMILIES[contour.pop("family")](**contour),
        drive=tb.Motion(x, y, angle, drive_step=case["step"]),
        rig=tb.Rig(rod=tb.Rod(taper=rod.get("taper", 0.0), **known), unknown={"friction": case["friction"]}),
    )

"""Meanings of parameters, as text."""

from __future__ import annotations

from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.rig.parameters import parameter_named

FORMULAS = {
    "parabola": "y = a (x − x_c)² + q",
    "circle": "a circle of radius r, lowest at (x_c, q)",
    "ellipse": "an ellipse of semi-axes a (sideways) and b, lowest at (x_c, q)",
    "power-law": "(y − q)/w = (|x − x_c|/w)ⁿ",
    "shape-free": "any smooth contour: log radius of curvature is a random function of the slope angle",
    "flat-sided": "any smooth contour with one flat side, shape-free elsewhere",
}


def meaning_of(name: str, family: str) -> str:
    """Return the meaning of a parameter of a contour, of its rig, or of the noise."""
    if name == "gap width":
        return "width of the arc that no sweep touches"
    table = FAMILIES[family].table if family in FAMILIES else {}
    if found := parameter_named(name) or table.get(name):
        side = next((f"{side} flank: " for side in ("left", "right") if name.startswith(f"{side}_")), "")
        return side + found.meaning
    return ""


def is_direction(name: str) -> bool:
    """Return True for a parameter that is one weight of a random function, and has no meaning by itself."""
    return name.startswith("z_")

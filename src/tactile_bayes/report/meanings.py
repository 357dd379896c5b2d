"""Meanings of parameters, as text."""

from __future__ import annotations

from tactile_bayes.rig.parameters import parameter_named

FORMULAS = {
    "parabola": "y = a (x − x_c)² + q",
    "circle": "a circle of radius r, lowest at (x_c, q)",
    "ellipse": "an ellipse of semi-axes a (sideways) and b, lowest at (x_c, q)",
    "power-law": "(y − q)/w = (|x − x_c|/w)ⁿ",
    "shape-free": "any smooth contour: log radius of curvature is a random function of the slope angle",
}

_MEANINGS = {
    "q": "height of the lowest point",
    "x_c": "x of the lowest point",
    "r": "radius",
    "b": "semi-axis in y",
    "w": "half-width at which the height equals it",
    "n": "exponent",
    "amplitude": "standard deviation of the logarithm of the radius along the contour",
    "length_scale": "correlation length of that logarithm in slope angle",
    "gap width": "width of the arc that no sweep touches",
}
_A = {"parabola": "half the curvature of the lowest point", "ellipse": "semi-axis in x"}
_R = {"shape-free": "mean radius of curvature (geometric)"}


def meaning_of(name: str, family: str) -> str:
    """Return the meaning of a parameter of a contour, of its rig, or of the noise."""
    if of_rig := parameter_named(name):
        return of_rig.meaning
    if is_direction(name):
        return "a direction of the random function"
    flanks = family.partition("/")
    for side, flank in (("left", flanks[0]), ("right", flanks[2])):
        if name.startswith(f"{side}_"):
            return f"{side} flank: {meaning_of(name.removeprefix(f'{side}_'), flank)}"
    return {"a": _A.get(family), "r": _R.get(family)}.get(name) or _MEANINGS.get(name, "")


def is_direction(name: str) -> bool:
    """Return True for a parameter that is one weight of a random function, and has no meaning by itself."""
    return name.startswith("z_")

"""Meanings of parameters, as text."""

from __future__ import annotations

import re

from tactile_bayes.mechanics.rods.profile import MOST_MODES

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
    "noise_scale": "noise over stated noise",
    "moment_noise": "noise of the holding moment",
    "force_noise": "noise of the forces",
    "discrepancy_scale": "standard deviation of the discrepancy over the largest load of a sweep",
    "discrepancy_length": "drive angle over which the discrepancy changes",
    "rigidity_scale": "flexural rigidity over stated flexural rigidity",
    "drive_angle_offset": "encoder offset",
    "lever_x": "x of the cell's reference point of the moment, from the pivot",
    "lever_y": "y of the cell's reference point of the moment, from the pivot",
    "moment_curve_quadratic": "quadratic term of the moment's reading",
    "moment_curve_cubic": "cubic term of the moment's reading",
    "lag": "lag of the readings",
    "play": "half the width of the loop of hysteresis over the largest load",
    "gauge_x": "shift of the gauge in x",
    "gauge_y": "shift of the gauge in y",
    "backlash": "encoder reading in forward motion less that in backward motion",
    "friction": "Coulomb's coefficient",
    "rest_curvature": "mean curvature of the unloaded rod",
    **{f"rest_shape_{k}": f"amplitude of mode {k} of the rest curvature" for k in range(1, MOST_MODES + 1)},
    "stem": "length of the rigid piece between pivot and rod",
    "length": "length of the rod",
    "taper_error": "error of the measured taper, in its standard deviations",
    "taper": "part of its diameter that the rod loses toward its tip",
    "suspension_compliance": "rotation of the pivot per holding moment",
    "gap width": "width of the arc that no sweep touches",
}
_A = {"parabola": "half the curvature of the lowest point", "ellipse": "semi-axis in x"}
_R = {"shape-free": "mean radius of curvature (geometric)"}
_CALIBRATION = re.compile(r"(?P<channel>moment|force_x|force_y)_(?P<what>bias|drift|gain)")
_BASE = re.compile(r"base_(?P<pivot>\d+)_(?P<axis>[xy])")
_WHATS = {"bias": "zero", "drift": "drift of the zero", "gain": "gain"}
_CHANNELS = {"moment": "the holding moment", "force_x": "force x", "force_y": "force y"}


def meaning_of(name: str, family: str) -> str:
    """Return the meaning of a parameter of a contour, of its rig, or of the noise."""
    if match := _CALIBRATION.fullmatch(name):
        return f"{_WHATS[match['what']]} of {_CHANNELS[match['channel']]}"
    if match := _BASE.fullmatch(name):
        return f"error of pivot {match['pivot']} in {match['axis']}"
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

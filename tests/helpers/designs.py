"""Designs as `tactile_bayes.design` returns them, made up."""

import itertools

import numpy as np
import xarray as xr


def made_up(xs, ys, *, steps=(0.05,), criterion="band", length=None, missing=(), pivots=()):
    """Candidates on a grid, best at the second column of the last row; lengths in metres if a rod's is given."""
    scale, unit = (1.0, {"units": "1"}) if length is None else (length, {"units": "m"})
    rows = list(itertools.product(ys, xs, steps))
    y, x, step = np.array(rows, dtype=float).T
    width = 0.01 * scale * (1.0 + (x - xs[1]) ** 2 + (y - ys[-1]) ** 2 + step)
    width[list(missing)] = np.nan
    information = 1.0 / width
    variables = {
        "base_x": ("candidate", scale * x, unit),
        "base_y": ("candidate", scale * y, unit),
        "drive_step": ("candidate", step, {"units": "rad"}),
        "is_pivot": ("candidate", np.ones(step.size, dtype=bool)),
        "present_width": ((), 0.05 * scale, unit),
        "present_base_x": ("pivot", np.array([x for x, _ in pivots], dtype=float), unit),
        "present_base_y": ("pivot", np.array([y for _, y in pivots], dtype=float), unit),
    }
    for name, values, attrs in (
        ("width", width, unit),
        ("gap", 2.0 * width, unit),
        ("information", information, {"units": "nat"}),
    ):
        variables[name] = ("candidate", values, attrs)
        variables[f"{name}_error"] = ("candidate", 0.1 * values, attrs)
    best = int(np.nanargmin(width))
    return xr.Dataset({**variables, "best": ((), best)}, attrs={"criterion": criterion, "probability": 0.95})

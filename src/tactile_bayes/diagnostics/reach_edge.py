"""Parameters of a posterior that what the model can do cuts off, in place of the record or the prior."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import experiment_of, points_of
from tactile_bayes.numerics.selection import evenly_spread

_FEW, _DRAWS = 40, 200  # number of draws that are displaced, and if one of them is then out of reach
_STEP = 0.5  # displacement, in standard deviations of the parameter
# Share of draws of which the displaced one is out of reach, from which a parameter counts as cut off: a normal density
# that ends one standard deviation from its mode has a tenth of its draws within half of one.
_MOST = 0.1


def cut_off_parameters(posterior: xr.DataTree) -> dict[str, str]:
    """Return the parameters whose posterior ends where the rod has no path, each with that end, the clearest first.

    Draws are displaced along the regression of all parameters on one; its own bounds and prior's ends do not count.
    """
    if "gauge" in posterior.attrs:
        return {}
    try:
        model = experiment_of(posterior).model
    except (InferenceError, ParameterError):  # no whole posterior, or a prior that no text determines
        return {}
    points = points_of(posterior, model.names).reshape(-1, len(model.names))
    if len(points) < _DRAWS:
        return {}
    few, many = (points[evenly_spread(len(points), count)] for count in (_FEW, _DRAWS))
    covariance = np.cov(points.T)
    found: dict[str, tuple[str, float]] = {}
    for index, name in enumerate(model.forward_parameters):
        deviation = np.sqrt(covariance[index, index])
        if index not in model.of_path or name.startswith("z_") or not deviation > 0.0:
            continue
        for end, sense in (("above", 1.0), ("below", -1.0)):
            step = sense * _STEP * covariance[index] / deviation
            share = _out_of_reach(model, few + step) and _out_of_reach(model, many + step)
            if share >= _MOST:
                found[name] = end, share
    return {name: end for name, (end, _) in sorted(found.items(), key=lambda item: -item[1][1])}


def _out_of_reach(model: ContourModel, points: Floats) -> float:
    """Return the share of points that are possible by their priors and bounds but out of reach."""
    inside = np.isfinite(model.log_prior(points))
    if not inside.any():
        return 0.0
    usable = model.likelihood.usable(model.contours(points[inside]), model.rig(points[inside]))
    return float(np.count_nonzero(~usable)) / len(points)

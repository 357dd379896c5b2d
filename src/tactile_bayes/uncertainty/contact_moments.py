"""Mean and covariance of contacts, from the draws of their posterior."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.inference.result import contact_draws
from tactile_bayes.mechanics.phases import NONE, PHASE_NAMES, TANGENTIAL, TIP
from tactile_bayes.reconstruction.estimate import spread_across

_DRAWS = ("chain", "draw")
LEAST_DRAWS = 10  # smallest number of draws in contact from which a standard deviation is computed


def contact_moments(posterior: xr.DataTree | xr.Dataset) -> xr.Dataset:
    """Return means, standard deviations and correlations of contacts, in the variables of `reconstruct`.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contacts` or `implied_contacts`.

    Returns
    -------
    xr.Dataset
        Over "sample", from the draws in contact: means contact_x, contact_y, contact_arclength [length] and slope_angle
        [rad] with their standard deviations (`contact_x_sd`, …); contact_xy_correlation; tangent_sd and normal_sd,
        along the contour and across it [length]; contact_phase, the more probable phase; contact_probability, the
        share of draws in contact. NaN where fewer than 10 draws are in contact.

    Raises
    ------
    InferenceError
        If the argument is not a result of `infer_contacts` or `implied_contacts`.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> names = {"contact_x": 0.03, "contact_y": 0.01, "slope_angle": 0.1, "contact_arclength": 0.1, "tangential": 0.0}
    >>> draws = {name: (("chain", "draw", "sample"), sd * rng.normal(size=(4, 250, 1))) for name, sd in names.items()}
    >>> moments = contact_moments(xr.Dataset(draws, coords={"sample": [0]}))
    >>> moments.tangent_sd.values.round(3), moments.normal_sd.values.round(3)
    (array([0.03]), array([0.01]))
    """
    draws = contact_draws(posterior).transpose("chain", "draw", "sample", ...)
    has = draws["contact_x"].notnull()
    number = has.sum(_DRAWS)
    enough = number >= LEAST_DRAWS
    variables: dict[str, Any] = {}
    for name in ("contact_x", "contact_y", "slope_angle", "contact_arclength"):
        attrs = draws[name].attrs
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a sample without a draw in contact
            mean, spread = draws[name].mean(_DRAWS), draws[name].std(_DRAWS)
        long_name = attrs.get("long_name", name.replace("_", " "))
        variables[name] = mean.where(enough).assign_attrs(attrs)
        variables[f"{name}_sd"] = spread.where(enough).assign_attrs(
            {**attrs, "long_name": f"standard deviation of the {long_name}"}
        )
    x, y = (draws[name] - variables[name] for name in ("contact_x", "contact_y"))
    covariance = np.empty((number.size, 2, 2))
    covariance[:, 0, 0], covariance[:, 1, 1] = (variables[f"contact_{axis}_sd"].values ** 2 for axis in "xy")
    covariance[:, 0, 1] = covariance[:, 1, 0] = ((x * y).sum(_DRAWS) / number.where(enough)).values
    tangent, normal = spread_across(covariance, variables["slope_angle"].values)
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = covariance[:, 0, 1] / np.sqrt(covariance[:, 0, 0] * covariance[:, 1, 1])
    unit = {"units": draws["contact_x"].attrs.get("units", "1")}
    is_tangential = (draws["tangential"].sum(_DRAWS) > 0.5 * number).values
    phase = np.where(enough, np.where(is_tangential, TANGENTIAL, TIP), NONE)
    variables["contact_xy_correlation"] = (
        "sample",
        correlation,
        {"units": "1", "long_name": "correlation of contact_x and contact_y"},
    )
    variables["tangent_sd"] = "sample", tangent, {**unit, "long_name": "standard deviation along the contour"}
    variables["normal_sd"] = "sample", normal, {**unit, "long_name": "standard deviation across the contour"}
    variables["contact_phase"] = "sample", np.array(PHASE_NAMES)[phase], {"units": "1", "long_name": "likelier phase"}
    share = has.mean(_DRAWS).values
    variables["contact_probability"] = "sample", share, {"units": "1", "long_name": "share of draws in contact"}
    return xr.Dataset(variables, coords={"sample": draws["sample"]})

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
    draws = contact_draws(posterior).transpose(*_DRAWS, "sample", ...)
    number = draws["contact_x"].notnull().sum(_DRAWS)
    enough = number >= LEAST_DRAWS
    variables: dict[str, Any] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a sample without a draw in contact
        for name in ("contact_x", "contact_y", "slope_angle", "contact_arclength"):
            attrs = draws[name].attrs
            spread = f"standard deviation of the {attrs.get('long_name', name.replace('_', ' '))}"
            variables[name] = draws[name].mean(_DRAWS).where(enough).assign_attrs(attrs)
            variables[f"{name}_sd"] = draws[name].std(_DRAWS).where(enough).assign_attrs(attrs | {"long_name": spread})
        shared = xr.cov(draws["contact_x"], draws["contact_y"], _DRAWS, ddof=0).where(enough)
    x_sd, y_sd = variables["contact_x_sd"], variables["contact_y_sd"]
    covariance = np.moveaxis(np.array([[x_sd**2, shared], [shared, y_sd**2]]), -1, 0)
    tangent, normal = spread_across(covariance, variables["slope_angle"].values)
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = shared / (x_sd * y_sd)
    is_tangential = (draws["tangential"].sum(_DRAWS) > 0.5 * number).values
    phase = np.array(PHASE_NAMES)[np.where(enough, np.where(is_tangential, TANGENTIAL, TIP), NONE)]
    unit = draws["contact_x"].attrs.get("units", "1")
    for name, values, units, meaning in (
        ("contact_xy_correlation", correlation.values, "1", "correlation of contact_x and contact_y"),
        ("tangent_sd", tangent, unit, "standard deviation along the contour"),
        ("normal_sd", normal, unit, "standard deviation across the contour"),
        ("contact_phase", phase, "1", "likelier phase"),
        ("contact_probability", draws["contact_x"].notnull().mean(_DRAWS).values, "1", "share of draws in contact"),
    ):
        variables[name] = "sample", values, {"units": units, "long_name": meaning}
    return xr.Dataset(variables, coords={"sample": draws["sample"]})

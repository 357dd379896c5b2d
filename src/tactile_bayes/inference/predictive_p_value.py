"""Posterior predictive checks of a discrepancy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.tasks.documents import read_json

__all__ = ["predictive_p_value"]


def _sum_of_squares(residuals: Floats) -> Floats:
    return np.asarray((residuals**2).sum(axis=-1))


def predictive_p_value(tree: xr.DataTree, discrepancy: Callable[[Floats], Floats] = _sum_of_squares) -> float:
    """Return the posterior predictive p-value of a discrepancy.

    For each draw the discrepancy is computed from the residuals over the noise, of the real readings and of predicted
    ones (Gelman, Meng and Stern 1996, Statistica Sinica 6, 733). If the model holds, the p-value lies closer to one
    half than a uniform number does.
    """
    posterior = tree["posterior"].to_dataset()
    if "noise_sd" in posterior:
        noise = posterior["noise_sd"].values[..., None]
    else:
        noise = np.asarray(read_json(tree.attrs["known"], "known")["noise_sd"])
    predictive = tree["posterior_predictive"].to_dataset()
    expected = predictive["expected_reading"].values
    observed = tree["observed_data"].to_dataset()["reading"].values
    real, predicted = (discrepancy((values - expected) / noise) for values in (observed, predictive["reading"].values))
    return float(np.mean(predicted >= real))

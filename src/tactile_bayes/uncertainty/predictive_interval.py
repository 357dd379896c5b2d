"""Posterior predictive intervals of a record."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.inference.result import refuse_no_contour
from tactile_bayes.uncertainty.band import central_levels


def predictive_interval(posterior: xr.DataTree, probability: float = 0.95) -> xr.Dataset:
    """Return the central posterior predictive interval of every sample of the record, noise included.

    If far more than a share 1 − probability of the samples lie outside, or a run of neighbours does, the model does not
    describe the record. `plotting.predictive` draws the intervals.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`.
    probability : float
        Probability of each interval, in (0, 1).

    Returns
    -------
    xr.Dataset
        Over "sample", for every measured channel, such as force_x: force_x_lower and force_x_upper, in the units and
        the frame of the record.

    Raises
    ------
    ParameterError, InferenceError
        If the probability is not in (0, 1), or the posterior is no result of `infer_contour`.

    Examples
    --------
    >>> draws = xr.Dataset({"force_x": (("chain", "draw", "sample"), np.arange(101.0).reshape(1, 101, 1))})
    >>> interval = predictive_interval(xr.DataTree.from_dict({"posterior_predictive": draws}), probability=0.9)
    >>> round(interval.force_x_lower.item(), 6), round(interval.force_x_upper.item(), 6)
    (5.0, 95.0)
    """
    refuse_no_contour(posterior, "posterior_predictive")
    lower, _, upper = central_levels(probability)
    out = {}
    for name, values in posterior["posterior_predictive"].to_dataset().items():
        for bound, level in (("lower", lower), ("upper", upper)):
            edge = np.quantile(values.values, level, axis=(0, 1))
            out[f"{name}_{bound}"] = ("sample", edge, values.attrs)
    frame = {name: posterior.attrs[name] for name in ("load_cell_frame",) if name in posterior.attrs}
    return xr.Dataset(out, attrs={"probability": probability, **frame})

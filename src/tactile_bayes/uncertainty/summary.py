"""A posterior of a contour in numbers: the parameters, and the gap where there is one."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.result import posterior_draws
from tactile_bayes.uncertainty.gap import gap, has_gap
from tactile_bayes.uncertainty.quantiles import central_levels


def summary(posterior: xr.DataTree, probability: float = 0.95, edges: xr.Dataset | None = None) -> xr.Dataset:
    """Return median, central interval, R̂ and effective sample size of each parameter, and the gap if there is one."""
    draws, stats = posterior_draws(posterior), posterior["sample_stats"].to_dataset()
    rows: list[tuple[Any, ...]] = []
    for name in stats.parameter.values:
        lower, median, upper = np.quantile(draws[name], central_levels(probability))
        diagnostics = (float(stats[d].sel(parameter=name)) for d in ("r_hat", "ess_bulk", "ess_tail"))
        rows.append((name, median, lower, upper, *diagnostics, draws[name].attrs["units"]))
    if edges is not None:
        width = edges["width"]
        values = (float(width.sel(bound=b)) for b in ("median", "lower", "upper"))
        rows.append(("gap width", *values, np.nan, np.nan, np.nan, width.attrs["units"]))
    quantity, *columns = zip(*rows, strict=True)
    names = ("median", "lower", "upper", "r_hat", "ess_bulk", "ess_tail", "unit")
    return xr.Dataset(
        {name: ("quantity", list(column)) for name, column in zip(names, columns, strict=True)},
        coords={"quantity": list(quantity)},
        attrs={"probability": probability},
    )


def gap_if_any(posterior: xr.DataTree, probability: float) -> xr.Dataset | None:
    """Return the gap, or None where the sweeps leave none between them (`has_gap`)."""
    return gap(posterior, probability) if has_gap(_events(posterior)) else None


def reach(posterior: xr.DataTree) -> Floats:
    """Return grid points, (201,), from the 5 % to the 95 % quantile of the events' x, for the band of a run."""
    events = _events(posterior)
    x = np.concatenate([events[f"{when}_contact_x"].values.ravel() for when in ("first", "snap_off")])
    if not np.isfinite(x).any():
        raise InferenceError("the rod touches none of the posterior's contours: there is no touched stretch for a band")
    lo, hi = np.nanquantile(x, [0.05, 0.95])
    return np.linspace(lo, hi, 201)


def _events(posterior: xr.DataTree) -> xr.Dataset:
    if "events" not in posterior.children:
        raise InferenceError("the posterior holds no events: first contacts and snap-offs of its contours are missing")
    return posterior["events"].to_dataset()

"""A posterior of a contour in numbers: the parameters, and the gap where there is one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.inference.result import posterior_draws
from tactile_bayes.uncertainty.band import central_levels
from tactile_bayes.uncertainty.gap import gap, has_gap
from tactile_bayes.uncertainty.rod_reach import events_of


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


def shown_in(unit: str) -> tuple[float, str]:
    """Return the factor and the name of the unit in which people read a parameter: degrees for radians."""
    return (math.degrees(1.0), "°") if unit == "rad" else (1.0, "" if unit == "1" else unit)


def gap_if_any(posterior: xr.DataTree, probability: float) -> xr.Dataset | None:
    """Return the gap, or None where the sweeps leave none between them (`has_gap`)."""
    return gap(posterior, probability) if has_gap(events_of(posterior)) else None

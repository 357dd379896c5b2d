"""Effect of the prior: sensitivity of parameters and band to power-scaling of prior and likelihood."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from arviz_stats.base.array import array_stats

from tactile_bayes.arrays import Floats
from tactile_bayes.diagnostics.predictive_check import LOST_BELOW
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import points_of
from tactile_bayes.uncertainty.band import contour_heights

# Components that are scaled: the prior of the contour, that of rig and noise, and the likelihood.
_COMPONENTS = ("contour", "rig", "likelihood")
_SENSITIVE = 0.05  # Sensitivity from which a component matters (Kallioinen et al. 2024).
_POWERS = (0.99, 1.01)


def prior_sensitivity(posterior: xr.DataTree, model: ContourModel, regions: Mapping[str, Floats]) -> xr.Dataset:
    """Return how much the posterior, and the band in regions of x, change if prior or likelihood is raised to a power.

    The sensitivity is the cumulative Jensen–Shannon distance over the change of the power's logarithm, from Pareto-
    smoothed weights (Kallioinen, Paananen, Bürkner & Vehtari 2024, doi 10.1007/s11222-023-10366-5); of a band its
    heights' largest.
    """
    points = points_of(posterior, model.names)
    every = posterior["sample_stats"].to_dataset()["lp"].transpose("chain", "draw").values
    by_name = {name: model.priors[name].logpdf(points[..., i]) for i, name in enumerate(model.names)}
    own = model.family.parameters
    of_contour = sum((by_name[name] for name in own), np.zeros(every.shape))
    of_rig = sum((value for name, value in by_name.items() if name not in own), np.zeros(every.shape))
    if (joint := model.unknowns.joint) is not None:
        together = points[..., [model.names.index(name) for name in joint.priors]]
        of_rig = of_rig + joint.log_dependence(together.reshape(-1, together.shape[-1])).reshape(every.shape)
    parts = {"contour": of_contour, "rig": of_rig, "likelihood": every - of_contour - of_rig}
    rows = {name: points[..., i][None] for i, name in enumerate(model.names)}
    rows |= {f"band {name}": _heights(posterior, x, every.shape) for name, x in regions.items()}
    kept = np.flatnonzero((every > np.median(every) - LOST_BELOW).all(axis=0))
    found = np.zeros((len(rows), len(_COMPONENTS)))
    for k, name in enumerate(_COMPONENTS):
        weights = [_weights(parts[name][:, kept], power) for power in _POWERS]
        for row, values in zip(found, rows.values(), strict=True):
            row[k] = max(_sensitivity(each[:, kept], weights) for each in values)
    return xr.Dataset(
        {
            "sensitivity": (("quantity", "component"), found, {"units": "1"}),
            "set_by": ("quantity", [_what_sets(*row) for row in found]),
        },
        coords={"quantity": list(rows), "component": list(_COMPONENTS)},
    )


def _what_sets(contour: float, rig: float, likelihood: float) -> str:
    """Return "record", "both" or "prior", whichever sets a quantity, from the sensitivities to the three components."""
    prior = max(contour, rig)
    return "record" if prior < _SENSITIVE else "both" if likelihood > prior else "prior"


def _heights(posterior: xr.DataTree, x: Floats, shape: tuple[int, ...]) -> Floats:
    """Return heights of all contours at the grid points that all of them reach, shape (x, chain, draw)."""
    heights = contour_heights(posterior, x, most=shape[0] * shape[1])
    reached = heights[:, np.isfinite(heights).all(axis=0)]
    return np.asarray(reached.T.reshape(-1, *shape))


def _weights(log_density: Floats, power: float) -> Floats:
    """Return Pareto-smoothed weights of draws, of sum one, for a component raised to a power."""
    if np.ptp(log_density) == 0.0:  # a flat prior
        return np.full(log_density.shape, 1.0 / log_density.size)
    logs = array_stats.power_scale_lw(log_density.ravel(), alpha=power)
    weights = np.exp(logs - logs.max()).reshape(log_density.shape)
    return np.asarray(weights / weights.sum())


def _sensitivity(values: Floats, weights: list[Floats]) -> float:
    if np.ptp(values) == 0.0:
        return 0.0
    lower, upper = weights
    return float(array_stats.power_scale_sense(values, lower, upper, *_POWERS))

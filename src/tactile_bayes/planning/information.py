"""Fisher's information of a record: Cramér-Rao bounds, and the contributions of channels and samples."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.inference.contour_groups import unit_of
from tactile_bayes.planning.expected_band import band_factor, deviation_of_heights, height_slopes, stretches
from tactile_bayes.planning.plan import SAMPLE_COLUMNS, Plan
from tactile_bayes.planning.record_information import prior_precision, record_information
from tactile_bayes.record import CHANNELS, COLUMNS


def information(plan: Plan, *, probability: float = 0.95) -> xr.Dataset:
    """Return bounds on the standard deviation of every parameter, and the contributions of channels and samples.

    For small noise a posterior is as wide as the Cramér-Rao bound with the priors added; see `record_information`.
    """
    model, point = plan.model, plan.point
    whole = record_information(model, point, slopes=plan.reading_slopes)
    prior = prior_precision(model)
    matrix = whole.matrix
    covariance = _inverse(matrix + prior)
    deviation = np.sqrt(np.diag(covariance))
    # The diagonal of the hat matrix of a linear model: its sum counts the parameters that the record determines.
    leverage = np.einsum("nci,ij,ncj->nc", whole.slopes, covariance, whole.slopes)

    def bound_of(channels: Flags) -> Floats:
        part = record_information(model, point, channels, slopes=plan.reading_slopes).matrix
        return np.sqrt(np.diag(_inverse(part + prior)))

    each_channel = np.eye(len(CHANNELS), dtype=bool)
    intervals = stretches(plan.scan)
    x = np.concatenate([stretch.x for stretch in intervals])
    names = np.repeat([stretch.name for stretch in intervals], [stretch.x.size for stretch in intervals])
    spread = deviation_of_heights(height_slopes(model, point, x), matrix + prior)
    wide = band_factor(probability)
    widths = {
        f"{kind}_width": float(wide * spread[names == kind].mean()) if np.any(names == kind) else np.nan
        for kind in ("touched", "gap")
    }
    units = [unit_of(model, name) for name in model.names]
    length = {"units": COLUMNS["base_x"].unit_in(plan.record.attrs["units"])}
    present = [name for name, there in zip(CHANNELS, model.present, strict=True) if there]
    return xr.Dataset(
        {
            "value": ("parameter", point),
            "bound": ("parameter", np.sqrt(np.diag(_inverse(matrix)))),
            "bound_with_priors": ("parameter", deviation),
            "bound_if_rest_known": ("parameter", 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))),
            "prior_sd": ("parameter", np.array([float(model.priors[name].std()) for name in model.names])),
            "correlation": (("parameter", "parameter_"), covariance / np.outer(deviation, deviation)),
            "bound_of_channel": (("channel", "parameter"), np.array([bound_of(own) for own in each_channel])),
            "bound_without_channel": (("channel", "parameter"), np.array([bound_of(~own) for own in each_channel])),
            "leverage": (("sample", "channel"), leverage),
            "leverage_on": (("sample", "parameter"), _leverage_on(whole.slopes, covariance)),
            "stretch": ("x", names),
            "height": ("x", np.asarray(plan.contour.height(x)), length),
            "height_sd": ("x", spread, length),
            **{name: ((), value, length) for name, value in widths.items()},
            **plan.record[SAMPLE_COLUMNS].data_vars,
        },
        coords={
            "parameter": list(model.names),
            "parameter_": list(model.names),
            "channel": present,
            "unit": ("parameter", units),
            "x": ("x", x, length),
        },
        attrs={
            "family": plan.experiment.own_family.name,
            "probability": probability,
            "readings": leverage.size,
            "leverage_sum": float(leverage.sum()),
        },
    )


def _leverage_on(slopes: Floats, covariance: Floats) -> Floats:
    """Return the share of each parameter's precision that is lost without each sample, shape (samples, d)."""
    pulled = slopes @ covariance  # (samples, channels, d)
    # The variance without a sample is larger by vᵀ (1 − H)⁻¹ v (Sherman, Morrison and Woodbury).
    left = np.eye(slopes.shape[1]) - np.einsum("nci,nki->nck", pulled, slopes)
    more = np.einsum("nci,nci->ni", pulled, np.linalg.solve(left, pulled))
    return np.asarray(more / (np.diag(covariance) + more))


def _inverse(matrix: Floats) -> Floats:
    """Invert an information matrix of any units; variances without information are infinite."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(scale, scale)
    values, axes = np.linalg.eigh(scaled)
    unknown = values < 1e-12 * values.max()
    inverse = (axes[:, ~unknown] / values[~unknown]) @ axes[:, ~unknown].T
    # A parameter with a component along a direction without information is unknown.
    lost = np.sum(axes[:, unknown] ** 2, axis=1) > 1e-9
    inverse[lost, lost] = np.inf
    return np.asarray(inverse / np.outer(scale, scale))

"""What a record will tell: Fisher's information, Cramér and Rao's bounds, and who carries it."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_groups import unit_of
from tactile_bayes.planning.expected_band import band_factor, deviation_of_heights, height_slopes, stretches
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.record_information import prior_precision, record_information
from tactile_bayes.record import CHANNELS

__all__ = ["information"]


def information(plan: Plan, *, probability: float = 0.95) -> xr.Dataset:
    """Bounds on what can be known of every parameter, and what they come from.

    No unbiased estimate scatters less than Cramér and Rao's bound, and where noise is small a posterior is as wide as
    the bound with the priors added (Bernstein and von Mises). To first order, and without what the snap-off alone says:
    see `record_information`.

    Parameters
    ----------
    plan : Plan
    probability : float
        Of the expected bands.

    Returns
    -------
    xr.Dataset
        Over "parameter", those that `infer_contour` would infer, in the record's units:

        value
            What it is.
        bound
            Cramér and Rao's: standard deviation from the record alone, infinite where it says nothing.
        bound_with_priors
            With what the priors say as well: what a posterior will be like.
        bound_if_rest_known
            If all other parameters were known.
        correlation (parameter, parameter_)
            Of a posterior.

        Over "channel": bound_of_channel (channel, parameter), with priors, from that channel alone, and
        bound_without_channel, from the other two. Over "sample", with the record's columns: leverage (sample, channel),
        what a reading contributes to what is known, which sums to the number of parameters that the record tells, and
        leverage_on (sample, parameter), the share of the bound's inverse square that is lost without the sample.

        Over "x", in the stretches that are touched and in the gaps between: stretch, height, and height_sd, standard
        deviation of the contour's height with priors. Numbers: touched_width and gap_width, the mean widths of the
        pointwise bands of that `probability` there [length]; NaN where there is no gap.
    """
    model, point = plan.model, plan.point
    whole = record_information(model, point)
    prior = np.diag(prior_precision(model))
    matrix = whole.matrix
    covariance = _inverse(matrix + prior)
    deviation = np.sqrt(np.diag(covariance))
    rows = whole.slopes.reshape(-1, point.size)
    # Of a linear model the diagonal of the hat matrix: its sum counts the parameters that the record determines.
    leverage = np.einsum("nci,ij,ncj->nc", whole.slopes, covariance, whole.slopes)
    of_channels: dict[str, list[Floats]] = {"alone": [], "without": []}
    for channel in range(len(CHANNELS)):
        only = np.arange(len(CHANNELS)) == channel
        for kind, chosen in (("alone", only), ("without", ~only)):
            part = record_information(model, point, chosen).matrix + prior
            of_channels[kind].append(np.sqrt(np.diag(_inverse(part))))
    places = stretches(plan.scan)
    x = np.concatenate([stretch.x for stretch in places])
    names = np.repeat([stretch.name for stretch in places], [stretch.x.size for stretch in places])
    spread = deviation_of_heights(height_slopes(model, point, x), matrix + prior)
    wide = band_factor(probability)
    widths = {
        f"{kind}_width": float(wide * spread[names == kind].mean()) if np.any(names == kind) else np.nan
        for kind in ("touched", "gap")
    }
    units = [unit_of(model, name) for name in model.names]
    length = {"units": "1" if plan.record.attrs["units"] == "dimensionless" else "m"}
    columns = ("sweep", "direction", "drive_angle", "base_x", "base_y")
    present = [name for name, there in zip(CHANNELS, model.present, strict=True) if there]
    return xr.Dataset(
        {
            "value": ("parameter", point),
            "bound": ("parameter", np.sqrt(np.diag(_inverse(matrix)))),
            "bound_with_priors": ("parameter", deviation),
            "bound_if_rest_known": ("parameter", 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))),
            "prior_sd": ("parameter", np.array([float(model.priors[name].std()) for name in model.names])),
            "correlation": (("parameter", "parameter_"), covariance / np.outer(deviation, deviation)),
            "bound_of_channel": (("channel", "parameter"), np.array(of_channels["alone"])),
            "bound_without_channel": (("channel", "parameter"), np.array(of_channels["without"])),
            "leverage": (("sample", "channel"), leverage),
            "leverage_on": (("sample", "parameter"), _leverage_on(whole.slopes, covariance)),
            "stretch": ("x", names),
            "height": ("x", np.asarray(plan.contour.height(x)), length),
            "height_sd": ("x", spread, length),
            **{name: ((), value, length) for name, value in widths.items()},
            **{name: ("sample", plan.record[name].values, plan.record[name].attrs) for name in columns},
        },
        coords={
            "parameter": list(model.names),
            "parameter_": list(model.names),
            "channel": present,
            "unit": ("parameter", units),
            "x": ("x", x, length),
        },
        attrs={
            "family": plan.family,
            "probability": probability,
            "readings": int(rows.shape[0]),
            "told": float(leverage.sum()),
        },
    )


def _leverage_on(slopes: Floats, covariance: Floats) -> Floats:
    """Share of the precision of each parameter that is lost with each sample, shape (samples, d)."""
    variance = np.diag(covariance)
    pulled = slopes @ covariance  # (samples, channels, d)
    channels = slopes.shape[1]
    hat = np.einsum("nci,nki->nck", pulled, slopes)
    # The variance without a sample is larger by vᵀ (1 − H)⁻¹ v (Sherman, Morrison and Woodbury).
    left = np.eye(channels) - hat
    more = np.einsum("nci,nci->ni", pulled, np.linalg.solve(left, pulled))
    return np.asarray(more / (variance + more))


def _inverse(matrix: Floats) -> Floats:
    """Of an information matrix whatever its units; infinite variances where it has none."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(scale, scale)
    values, axes = np.linalg.eigh(scaled)
    unknown = values < 1e-12 * values.max()
    inverse = (axes[:, ~unknown] / values[~unknown]) @ axes[:, ~unknown].T
    # What lies in a direction that nothing is known of is not known.
    lost = np.sum(axes[:, unknown] ** 2, axis=1) > 1e-9
    inverse[lost, lost] = np.inf
    return np.asarray(inverse / np.outer(scale, scale))

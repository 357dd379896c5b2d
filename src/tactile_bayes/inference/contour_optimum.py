"""Where a contour and all else that is not known fit a record best, sought without help."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.inference.blocks import blocks
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.families import support_of
from tactile_bayes.inference.start import best_optimum
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS, present_channels

__all__ = ["ContourOptimum", "contact_fit", "fitted_noise", "optimum_of"]

Floats = NDArray[np.float64]

_CANDIDATES = 8
"""Draws from the prior from which the optimum is sought, the likeliest first, until one explains the record. A sample
at an event that is loaded or not holds the search up where it began too far away."""

_FAR_BETTER = 100.0
"""Log-likelihood, roughly, by which a record is explained better beyond the end of a prior for that to be a mistake."""


class ContourOptimum(NamedTuple):
    """Parameters that explain a record, by robust least squares."""

    point: Floats
    """All of the model's."""
    covariance: Floats
    """Roughly theirs in the posterior, of the logarithms of those of the noise."""
    beyond: str = ""
    """What the record wants and the priors do not allow, where that explains it far better; in words."""


def optimum_of(model: ContourModel, rng: np.random.Generator, deadline: Deadline = NEVER) -> ContourOptimum:
    """The best of several searches, which begin at Step 2's contacts and at draws from the prior."""
    size = len(model.located)
    deviation, present = model.deviation, model.present
    measured = model.likelihood.measured[:, present] / deviation[present]
    candidates, _ = model.draw_prior(rng, 400, deadline)

    def residuals(points: Floats) -> Floats:
        # A prior that ends somewhere is no wall: the way to where it does not may lead through there.
        allowed = ((points > model.low[:size]) & (points < model.high[:size])).all(axis=1)
        out = np.tile(10.0 * (np.abs(measured) + 1.0), (len(points), 1, 1))
        if allowed.any():
            expected = model.likelihood.load_cell.expected(model.loads(points[allowed]))
            out[allowed] = measured - expected[..., present] / deviation[present]
        return out.reshape(len(points), -1)

    spread = np.array([float(model.priors[name].std()) for name in model.located])
    percentiles = np.quantile(candidates[:, :size], [0.16, 0.84], axis=0)
    rough = np.maximum(0.5 * np.diff(percentiles, axis=0)[0], 1e-3 * np.abs(percentiles[0]))
    spread = np.where(np.isfinite(spread), spread, rough)

    def starts() -> Iterator[Floats]:
        by_contacts = contact_fit(model)
        if by_contacts is not None:
            yield np.append(by_contacts, np.median(candidates[:, by_contacts.size : size], axis=0))
        parts = [candidates[block, :size] for block in blocks(len(candidates), measured.size)]
        costs = np.concatenate([np.sum(np.minimum(np.abs(residuals(part)), 30.0), axis=1) for part in parts])
        yield from (candidates[i, :size] for i in np.argsort(costs)[:_CANDIDATES])

    ends = np.array([support_of(model.priors[name]) for name in model.located])
    low, high = np.maximum(ends[:, 0], model.low[:size]), np.minimum(ends[:, 1], model.high[:size])
    optimum = best_optimum(residuals, starts(), percentiles.mean(axis=0), spread, low, high, deadline)

    noise = fitted_noise(model, optimum.residuals.reshape(measured.shape))
    possible = candidates[:, size:]
    if not np.isfinite(model.log_prior(np.append(optimum.point, noise)[None]))[0]:
        noise = possible[np.argmin(np.sum(np.log(possible / noise) ** 2, axis=1))]
    narrow = np.minimum(0.5 * spread / np.sqrt(np.diag(optimum.covariance)), 1.0)
    covariance = np.zeros((len(model.names), len(model.names)))
    covariance[:size, :size] = optimum.covariance * np.outer(narrow, narrow)
    covariance[range(size, len(model.names)), range(size, len(model.names))] = 0.5 / measured.size
    beyond = ""
    if optimum.beyond is not None and optimum.excess > _FAR_BETTER:
        off = np.flatnonzero((optimum.beyond <= low) | (optimum.beyond >= high))
        beyond = ", ".join(
            f"{model.located[i]} = {optimum.beyond[i]:.6g} (prior: {low[i]:.6g} to {high[i]:.6g})" for i in off
        )
    return ContourOptimum(np.append(optimum.point, noise), covariance, beyond)


def fitted_noise(model: ContourModel, residuals: Floats) -> Floats:
    """Noise parameters that fit the optimum's residuals, shape (samples, present channels), outliers aside."""
    known = model.likelihood.load_cell.noise
    fitted = model.deviation[model.present] * np.maximum(1.4826 * np.median(np.abs(residuals), axis=0), 1e-3)
    measured = np.flatnonzero(model.present)
    ratio = {CHANNELS[i]: value / (known[i] or 1.0) for i, value in zip(measured, fitted, strict=True)}
    return np.array([np.median([ratio[c] for c in channels if c in ratio]) for channels in model.noise.channels])


def contact_fit(model: ContourModel) -> Floats | None:
    """The family fitted to Step 2's contact points."""
    if len(present_channels(model.measured)) < len(CHANNELS):
        return None
    contacts = reconstruct(
        model.measured,
        load_cell=model.noise.stated_cell,
        friction=model.nuisances.friction,
    )
    force = np.hypot(model.measured.force_x.values, model.measured.force_y.values)
    firm = (contacts.status.values == "ok") & (force > 0.1 * force.max())
    said = len(model.family.parameters) - len(model.family.roughness)
    if np.count_nonzero(firm) < 2 * said:
        return None
    length = model.likelihood.rod.length
    values = model.family.fit(contacts.contact_x.values[firm] / length, contacts.contact_y.values[firm] / length)
    point = np.array([values[name] * length**power for name, power in model.family.length_powers.items()])
    inside = [np.isfinite(model.priors[n].logpdf(v)) for n, v in zip(model.family.parameters, point, strict=True)]
    return point if all(inside) else None

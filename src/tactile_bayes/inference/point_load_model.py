"""The model of a clamped rod under point loads, as a function of clamp, suspension and noise.

The reading is linear in the coefficients of the sensor curve, whose prior is normal: they are integrated out exactly
and drawn afterwards, so that five parameters are sampled and nine reported.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from tactile_bayes.arrays import Floats
from tactile_bayes.distributions import support_of
from tactile_bayes.mechanics.clamped_rod import base_curvature

_GEOMETRY = ("clamp_axial", "clamp_lateral", "clamp_angle", "compliance")
POWERS = 4  # of the curvature in the sensor curve
_GUESSES = 400  # number of draws of the prior among which the search for a start begins
_REFINED = 4  # number of the best of them that are refined
_INITIAL_NOISE = 0.01  # noise over range of the readings at the beginning of the search


@dataclass(frozen=True)
class PointLoadModel:
    """Distribution of the readings given geometry and noise, with the sensor's coefficients integrated out."""

    axial: Floats
    lateral: Floats
    reading: Floats
    unit_curvature: float  # 3/reach, the unit of the curvature in the powers of the sensor curve
    coefficient_sd: float
    priors: Mapping[str, Any]
    known: Mapping[str, float]
    small_deflection: bool

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.priors)

    def column(self, points: Floats, name: str) -> Floats:
        """Return one parameter of points, shape (n, parameters), known or not, as an array of shape (n,)."""
        if name in self.known:
            return np.full(len(points), self.known[name])
        return points[:, self.names.index(name)]

    def curvature(self, points: Floats) -> Floats:
        """Return the base curvature [1/mm], shape (n, probe points)."""
        x, y, angle, compliance = (self.column(points, name)[:, None] for name in _GEOMETRY)
        dx, dy = self.axial - x, self.lateral - y
        along, across = dx * np.cos(angle) + dy * np.sin(angle), dy * np.cos(angle) - dx * np.sin(angle)
        return base_curvature(along, across, compliance, small_deflection=self.small_deflection)

    def powers(self, curvature: Floats) -> Floats:
        """Return the powers of curvatures, shape (n, probe points), as an array of shape (n, probe points, powers)."""
        return (curvature / self.unit_curvature)[..., None] ** np.arange(POWERS)

    def coefficients(self, curvature: Floats, noise_sd: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the posterior mean of the sensor's coefficients, R of its precision RᵀR/σ², and the sum of squares."""
        powers = self.powers(curvature)
        ridge = (noise_sd / self.coefficient_sd)[:, None, None] * np.eye(POWERS)
        q, r = np.linalg.qr(np.concatenate([powers, ridge], axis=1))
        mean = np.linalg.solve(r, np.einsum("nij,i->nj", q[:, : self.reading.size], self.reading)[..., None])[..., 0]
        left = self.reading - np.einsum("nij,nj->ni", powers, mean)
        squares = (left**2).sum(-1) + (noise_sd / self.coefficient_sd) ** 2 * (mean**2).sum(-1)
        return mean, r, squares

    def log_probability(self, points: Floats) -> Floats:
        """Return the log of prior times marginal likelihood of points, shape (n, parameters), in shape (n,).

        With λ = σ²/S², S the coefficients' prior sd, the covariance's determinant is σ^(2n) λ^(−4) det(BᵀB + λ I).
        """
        values = np.zeros(len(points))
        for i, prior in enumerate(self.priors.values()):
            values = values + prior.logpdf(points[:, i])
        noise = self.column(points, "noise_sd")
        values = np.where(noise > 0.0, values, -np.inf)
        inside = np.flatnonzero(np.isfinite(values))
        curvature = self.curvature(points[inside])
        possible = np.all(np.isfinite(curvature), axis=1)
        values[inside[~possible]] = -np.inf
        inside, noise = inside[possible], noise[inside[possible]]
        if inside.size:
            _, r, squares = self.coefficients(curvature[possible], noise)
            log_determinant = np.log(np.abs(np.diagonal(r, axis1=1, axis2=2))).sum(-1)
            spread = self.reading.size * np.log(noise) - POWERS * np.log(noise / self.coefficient_sd) + log_determinant
            constant = 0.5 * self.reading.size * math.log(2.0 * math.pi)
            values[inside] += -0.5 * squares / noise**2 - spread - constant
        return values

    def misfit(self, points: Floats, noise_sd: float) -> Floats:
        """Return residuals over the noise with the sensor fitted, and distances from the priors' centres."""
        curvature = self.curvature(points)
        impossible = ~np.all(np.isfinite(curvature), axis=1)
        curvature = np.where(impossible[:, None], self.unit_curvature, curvature)
        mean, _, _ = self.coefficients(curvature, np.full(len(points), noise_sd))
        left = (self.reading - np.einsum("nij,nj->ni", self.powers(curvature), mean)) / noise_sd
        left[impossible] = 10.0 * np.abs(self.reading).max() / noise_sd
        pull = (points - self.centre) / self.spread
        return np.concatenate([left, pull[:, self.geometry]], axis=1)

    @cached_property
    def geometry(self) -> list[int]:
        """Indices of the parameters of clamp and suspension."""
        return [i for i, name in enumerate(self.names) if name != "noise_sd"]

    @cached_property
    def centre(self) -> Floats:
        """Prior medians."""
        return np.array([float(prior.ppf(0.5)) for prior in self.priors.values()])

    @cached_property
    def spread(self) -> Floats:
        """Half the width of the priors' central 68 %: the sd where they are normal."""
        return np.array([0.5 * float(prior.ppf(0.84) - prior.ppf(0.16)) for prior in self.priors.values()])


def normal_approximation(model: PointLoadModel, seed: np.random.SeedSequence) -> tuple[Floats, Floats]:
    """Return centre and covariance of the parameters by least squares, from the best of many draws of the prior."""
    rng = np.random.default_rng(seed)
    guesses = np.column_stack([prior.rvs(size=_GUESSES, random_state=rng) for prior in model.priors.values()])
    noise = _INITIAL_NOISE * float(np.ptp(model.reading))
    best = guesses[np.argsort((model.misfit(guesses, noise) ** 2).sum(-1))[:_REFINED]]
    centre, covariance = model.centre.copy(), np.zeros((model.centre.size, model.centre.size))
    geometry = model.geometry
    if geometry:
        low, high = np.array([support_of(model.priors[model.names[i]]) for i in geometry]).T

        def residuals(z: Floats, noise_sd: float) -> Floats:
            point = centre.copy()
            point[geometry] = z
            return model.misfit(point[None], noise_sd)[0]

        def refine(z: Floats, noise_sd: float) -> Any:
            return least_squares(residuals, z, bounds=(low, high), x_scale=model.spread[geometry], args=(noise_sd,))

        fit = min((refine(guess[geometry], noise) for guess in best), key=lambda found: float(found.cost))
        for _ in range(3):  # the noise weighs the data against the priors
            noise *= _rms(fit.fun[: model.reading.size], POWERS + len(geometry))
            fit = refine(fit.x, noise)
        slopes = np.asarray(fit.jac)
        centre[geometry] = fit.x
        covariance[np.ix_(geometry, geometry)] = np.linalg.inv(slopes.T @ slopes)
    left = model.misfit(centre[None], noise)[0][: model.reading.size]
    noise *= _rms(left, POWERS + len(geometry))
    if "noise_sd" in model.names:
        i = model.names.index("noise_sd")
        least, most = support_of(model.priors["noise_sd"])
        centre[i] = min(max(noise, 1.01 * least), 0.99 * most)
        covariance[i, i] = centre[i] ** 2 / (2.0 * model.reading.size)
    return centre, covariance


def _rms(residuals: Floats, fitted: int) -> float:
    """Return the root mean square of residuals over the noise, at least 1e-9."""
    return max(float(np.sqrt((residuals**2).sum() / (residuals.size - fitted))), 1e-9)

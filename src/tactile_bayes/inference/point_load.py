"""Calibration of a clamped rod from point loads: clamp, suspension compliance and sensor curve."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy import stats
from scipy.optimize import least_squares

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import (
    as_number,
    check_array,
    check_function,
    check_mapping,
    check_number,
    check_optional,
    check_positive,
    check_switch,
)
from tactile_bayes.distributions import Distribution, check_distribution, refuse_unknown_names, support_of
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.ensembles import Draws, Progress, SamplerSettings, sample, scatter_walkers
from tactile_bayes.inference.result import provenance, sample_stats
from tactile_bayes.inference.starts.cloud import gather
from tactile_bayes.mechanics.clamped_rod import base_curvature
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence, spawn
from tactile_bayes.tasks.documents import read_json

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
        """Return the log of prior times marginal likelihood of points, shape (n, parameters), in shape (n,). With λ =
        σ²/S², S the coefficients' prior sd, the covariance's determinant is σ^(2n) λ^(−4) det(BᵀB + λ I)."""
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


_UNITS = {"clamp_axial": "mm", "clamp_lateral": "mm", "clamp_angle": "rad", "compliance": "mm"}
_VAGUE = 100.0  # prior sd of a sensor coefficient, in full scales of the reading per power of 3/reach
_SETTINGS = SamplerSettings(walkers=64)  # most of an evaluation does not depend on their number


def default_priors(axial: ArrayLike, lateral: ArrayLike, *, full_scale: float) -> dict[str, Distribution]:
    """Return the default priors, from the probe points and the sensor's full scale.

    With reach R, the distance of the farthest probe point from the origin of the coordinates:

    ===================  =====================================  ====================================================
    parameter            prior                                  meaning
    ===================  =====================================  ====================================================
    ``clamp_axial``      normal(0, R/4) [mm]                    the origin is where the clamp is believed to be
    ``clamp_lateral``    normal(0, R/4) [mm]
    ``clamp_angle``      normal(0, 0.2) [rad]                   `axial` runs roughly along the undeflected rod
    ``compliance``       half-normal(R/4) [mm]                  the suspension is stiffer than the rod
    ``noise_sd``         log-uniform, 1e-6 to 1 full scale      only that there is some noise is known
    ===================  =====================================  ====================================================
    """
    scale = float(np.hypot(axial, lateral).max()) / 4.0
    return {
        "clamp_axial": stats.norm(0.0, scale),
        "clamp_lateral": stats.norm(0.0, scale),
        "clamp_angle": stats.norm(0.0, 0.2),
        "compliance": stats.halfnorm(0.0, scale),
        "noise_sd": stats.loguniform(1e-6 * full_scale, full_scale),
    }


def _checked(axial: ArrayLike, lateral: ArrayLike, reading: ArrayLike) -> tuple[Floats, Floats, Floats]:
    columns = {"axial": axial, "lateral": lateral, "reading": reading}
    arrays = {name: check_array(name, values, "give a list of numbers") for name, values in columns.items()}
    if len({array.shape for array in arrays.values()}) != 1 or arrays["reading"].ndim != 1:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ParameterError(f"probe points and readings have shapes {shapes}: give three lists of the same length")
    for name, array in arrays.items():
        if not np.all(np.isfinite(array)):
            row = int(np.argmin(np.isfinite(array)))
            raise ParameterError(f"{name}[{row}] is not a finite number: leave that row out")
    if arrays["reading"].size < 10:
        raise ParameterError(f"{arrays['reading'].size} readings for nine unknowns: give at least 10")
    if np.ptp(arrays["reading"]) == 0.0:
        raise ParameterError("all readings are the same: the sensor does not respond to the probe")
    return arrays["axial"], arrays["lateral"], arrays["reading"]


def _split_priors(
    priors: Mapping[str, Distribution | float] | None, defaults: Mapping[str, Distribution]
) -> tuple[dict[str, Distribution], dict[str, float]]:
    """Return priors of unknown parameters, and values of known ones."""
    check_mapping("priors", priors, "give distributions, or numbers, by name")
    refuse_unknown_names(priors or {}, tuple(defaults))
    given: dict[str, Any] = {**defaults, **(priors or {})}
    known = {name: number for name, prior in given.items() if (number := as_number(prior)) is not None}
    unknown = {name: prior for name, prior in given.items() if name not in known}
    for name, prior in unknown.items():
        check_distribution(name, prior)
    check_number("compliance", known.get("compliance", 0.0), "it cannot be negative", least=0.0)
    check_positive("noise_sd", known.get("noise_sd", 1.0), "give the scatter of repeated readings, or a prior")
    if not unknown:
        raise ParameterError("every parameter is given as known: leave at least one to be inferred")
    return unknown, known


def infer_point_load(
    axial: ArrayLike,
    lateral: ArrayLike,
    reading: ArrayLike,
    *,
    rng: Rng,
    priors: Mapping[str, Distribution | float] | None = None,
    full_scale: float | None = None,
    small_deflection: bool = False,
    settings: SamplerSettings | None = None,
    progress: Callable[[Progress], object] | None = None,
) -> xr.DataTree:
    """Infer clamp, suspension and sensor curve of a rod from readings at known probe points.

    A thin probe is a contour of size zero, so that the curvature at the base, κ0 [1/mm], follows from its position
    alone. The reading is b0 + b1 κ0 + b2 κ0² + b3 κ0³ + ε with independent normal noise ε. `axial` should run
    approximately along the undeflected rod, from its clamp; otherwise give priors.

    Parameters
    ----------
    axial, lateral : array_like, shape (n,)
        Probe points [mm].
    reading : array_like, shape (n,)
        Readings of the sensor [its own unit], n at least 10.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        The same seed gives the same posterior.
    priors : mapping, optional
        Frozen distributions of scipy.stats that replace those of `default_priors`; a number instead of a distribution
        declares the parameter known (``{"compliance": 0.0}``: a rigid clamp). The prior of each coefficient of the
        sensor is normal with mean 0 and sd 100 full scales per power of 3/R, R the reach of the probe: vague.
    full_scale : float, optional
        A reading that the sensor hardly exceeds; sets the scale of the priors of sensor and noise. By default the power
        of ten above the largest reading, the one thing for which the priors look at the data.
    small_deflection : bool
        Whether the model is the linear beam instead of the large-deflection rod, for comparison.
    settings : SamplerSettings, optional
        By default 64 walkers, otherwise the defaults of `SamplerSettings`.
    progress : callable, optional
        Called with a `Progress` after each evaluation of the diagnostics.

    Returns
    -------
    xarray.DataTree
        In ArviZ's layout, dims chain and draw: ``posterior`` (``clamp_axial``, ``clamp_lateral`` [mm], ``clamp_angle``
        [rad], ``compliance`` [mm], ``sensor_coefficient`` over ``power`` [reading · mm^power], ``noise_sd``; known
        parameters are left out), ``posterior_predictive`` (``reading``, and ``expected_reading`` without noise),
        ``log_likelihood``, ``sample_stats``, ``observed_data``, ``constant_data``. The attributes of the root state
        version, seed, settings, convergence and message of the sampler, and a hash of the data.

    Raises
    ------
    ParameterError
        If the data do not fit together, a prior is for an unknown name, or `rng` is none of these.
    InferenceError
        If no geometry that the priors allow lets the rod reach all the points.

    Examples
    --------
    >>> from tactile_bayes.mechanics.clamped_rod import base_curvature
    >>> along, across = np.meshgrid([10.0, 20.0, 30.0], [0.1, 0.2, 0.3, 0.4])
    >>> axial, lateral = along.ravel(), (along * across).ravel()
    >>> noise = np.random.default_rng(1).normal(scale=0.5, size=axial.size)
    >>> reading = 1e4 * base_curvature(axial + 2.0, lateral, 3.0) + noise
    >>> tree = infer_point_load(axial, lateral, reading, rng=1, settings=SamplerSettings(max_steps=200))
    >>> tree.posterior.clamp_axial.dims, list(tree.posterior_predictive)
    (('chain', 'draw'), ['reading', 'expected_reading'])
    """
    axial, lateral, reading = _checked(axial, lateral, reading)
    check_switch("small_deflection", small_deflection)
    if full_scale is None:
        full_scale = 10.0 ** math.ceil(math.log10(np.abs(reading).max()))
    check_positive("full_scale", full_scale, "give a positive reading")
    check_optional("settings", settings, SamplerSettings)
    check_function("progress", progress)
    settings = settings or _SETTINGS
    unknown, known = _split_priors(priors, default_priors(axial, lateral, full_scale=full_scale))
    unit = 3.0 / float(np.hypot(axial, lateral).max())
    model = PointLoadModel(axial, lateral, reading, unit, _VAGUE * full_scale, unknown, known, small_deflection)

    seed = seed_sequence(rng)
    for_guess, for_walkers, for_predictions = spawn(seed, 3)
    cloud = gather(model.log_probability, *normal_approximation(model, for_guess), np.random.default_rng(for_walkers))
    if not cloud.is_possible:
        raise InferenceError(
            "no clamp that the priors allow lets the rod reach all probe points: measure `axial` roughly from the "
            "clamp along the undeflected rod, or widen the priors"
        )
    start = scatter_walkers(
        model.log_probability,
        cloud.draw,
        parameters=len(model.names),
        seed=for_walkers,
        settings=settings,
        floor=lambda: cloud.floor,
    )
    draws = sample(
        model.log_probability, start, names=model.names, seed=for_walkers, settings=settings, progress=progress
    )
    tree = _tree(model, draws, np.random.default_rng(for_predictions))
    tree.attrs = provenance(
        draws,
        seed=seed,
        settings=settings,
        data_sha256=hashlib.sha256(np.stack([axial, lateral, reading]).astype("<f8").tobytes()).hexdigest(),
        model="linear beam" if small_deflection else "large-deflection rod",
        known=json.dumps(known),
        full_scale=full_scale,
    )
    return tree


def _tree(model: PointLoadModel, draws: Draws, rng: np.random.Generator) -> xr.DataTree:
    """Return draws, coefficients, predictions and pointwise likelihood in ArviZ's layout."""
    by_power = model.unit_curvature ** np.arange(POWERS)
    coefficients, expected, noises = [], [], []
    for points in draws.samples:  # one chain at a time bounds the memory
        noise = model.column(points, "noise_sd")
        curvature = model.curvature(points)
        mean, r, _ = model.coefficients(curvature, noise)
        scatter = np.linalg.solve(r, rng.normal(size=mean.shape)[..., None])[..., 0]
        coefficient = mean + noise[:, None] * scatter
        coefficients.append(coefficient / by_power)
        expected.append(np.einsum("nij,nj->ni", model.powers(curvature), coefficient))
        noises.append(noise)
    mean_reading, noise_sd = np.array(expected), np.array(noises)[..., None]
    predicted = mean_reading + noise_sd * rng.normal(size=mean_reading.shape)
    log_likelihood = stats.norm.logpdf(model.reading, mean_reading, noise_sd)
    over_draws, over_points = ("chain", "draw"), ("chain", "draw", "point")
    posterior: dict[str, Any] = {
        name: (over_draws, draws.samples[..., i], {"units": _UNITS[name]} if name in _UNITS else {})
        for i, name in enumerate(draws.names)
    }
    posterior["sensor_coefficient"] = ((*over_draws, "power"), np.array(coefficients), {"units": "reading mm^power"})
    points = {"axial": model.axial, "lateral": model.lateral}
    groups = {
        "posterior": posterior,
        "posterior_predictive": {"reading": (over_points, predicted), "expected_reading": (over_points, mean_reading)},
        "log_likelihood": {"reading": (over_points, log_likelihood)},
        "observed_data": {"reading": ("point", model.reading)},
        "constant_data": {name: ("point", values, {"units": "mm"}) for name, values in points.items()},
    }
    tree = xr.DataTree.from_dict({name: xr.Dataset(variables) for name, variables in groups.items()})
    for group in tree.children.values():
        group.coords.update({dim: np.arange(size) for dim, size in group.sizes.items()})
    tree["sample_stats"] = xr.DataTree(sample_stats(draws))
    return tree


def predictive_p_value(
    tree: xr.DataTree, discrepancy: Callable[[Floats], Floats] = lambda residuals: np.sum(residuals**2, axis=-1)
) -> float:
    """Return the posterior predictive p-value of a discrepancy, by default the sum of squares of residuals over noise.
    If the model holds, it is closer to one half than a uniform number (Gelman, Meng & Stern 1996, Statistica Sinica 6,
    733)."""
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

"""Priors of contours, by default and matched between families, and the posterior of a rig as a prior."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from scipy import optimize, stats

from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Contour
from tactile_bayes.contours.families import family_named, sides_of
from tactile_bayes.contours.family import ContourFamily, FamilyParameter
from tactile_bayes.distributions import Distribution, numbers_of
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.result import posterior_draws
from tactile_bayes.rig.parameters import MAY_VANISH
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.tasks.documents import read_json


def own_priors(family: ContourFamily, length: float) -> dict[str, Distribution]:
    """Return the default priors of a family's parameters, except the vertex; those of one entry share one object."""
    entries = {name: entry for name, entry in family.table.items() if entry.prior is not None}
    made = {id(entry): _prior(entry, length) for entry in entries.values()}
    return {name: made[id(entry)] for name, entry in entries.items()}


def _prior(entry: FamilyParameter, length: float) -> Distribution:
    assert entry.prior is not None
    numbers = dict(entry.prior.numbers)
    if entry.length_power:
        numbers["scale"] = numbers["scale"] * length if entry.length_power > 0 else numbers["scale"] / length
    prior: Distribution = getattr(stats, entry.prior.distribution)(**numbers)
    return prior


def default_priors(family: ContourFamily, base: tuple[float, float], length: float) -> dict[str, Distribution]:
    """Return the default priors of a family's parameters by name, from pivot (x, y) and rod length alone [length]."""
    x, y = base
    vertex = {"q": stats.uniform(y - length, 2.0 * length), "x_c": stats.uniform(x - length, 2.0 * length)}
    return own_priors(family, length) | {name: prior for name, prior in vertex.items() if name in family.parameters}


# Slope angles over which a flank's radius of curvature is averaged [rad].
_SLOPES = np.linspace(0.0, 0.25 * np.pi, 9, endpoint=False) + np.pi / 72.0
# Median [rod lengths] of the geometric mean of a flank's radius of curvature, and standard deviation of its logarithm.
_MEDIAN, _SPREAD = 0.5, 1.0
_DRAWS = 2048  # number of quasi-random draws from a prior
_NARROWEST, _WIDEST = 0.05, 3.0  # range of factors on standard deviations in which the matching one is sought


def matched_priors(family: str, length: float) -> dict[str, Distribution]:
    """Return priors of a family's own parameters under which a flank is as curved as in all other families. The
    geometric mean of its radius of curvature up to 45° has the median L/2, and its logarithm a deviation of 1."""
    found: dict[str, Distribution] = {}
    for side, name in sides_of(family_named(family).name).items():
        (stretch, width), powers = _matching(name), family_named(name).length_powers
        for n, prior in own_priors(family_named(name), length).items():
            found[f"{side}{n}"] = _log_normal(prior, width, stretch ** powers[n]) if powers[n] else prior
    return found


def mean_log_radius(contours: Contour) -> Floats:
    """Return the logarithm of the geometric mean radius of curvature of the right flank up to 45°, shape (n,)."""
    return np.mean([np.log(contours.radius_of_curvature(np.full(contours.shape, a))) for a in _SLOPES], axis=0)


def widened(priors: Mapping[str, Distribution], factor: float) -> dict[str, Distribution]:
    """Return priors whose log-normal ones have the same median and a standard deviation multiplied by a factor."""
    kinds = {name: getattr(getattr(prior, "dist", None), "name", "") for name, prior in priors.items()}
    return {n: _log_normal(prior, factor) if kinds[n] == "lognorm" else prior for n, prior in priors.items()}


@functools.cache
def _matching(name: str) -> tuple[float, float]:
    """Return the factors on the medians of sizes, and on the standard deviations of their logarithms."""
    family = family_named(name)
    priors = own_priors(family, 1.0)
    uniform = stats.qmc.Sobol(len(priors), seed=0).random(_DRAWS).T

    def drawn(width: float) -> Floats:
        values = {
            n: (_log_normal(prior, width) if family.length_powers[n] else prior).ppf(u)  # type: ignore[attr-defined]
            for (n, prior), u in zip(priors.items(), uniform, strict=True)
        }
        inside = {n: np.clip(value, *family.bounds[n]) for n, value in values.items()}
        return mean_log_radius(family.build(*(inside.get(n, np.zeros(_DRAWS)) for n in family.parameters)))

    def too_wide(width: float) -> float:
        ends = np.quantile(drawn(width), stats.norm.cdf([-1.0, 1.0]))
        return float(0.5 * np.diff(ends)[0] - _SPREAD)

    width = float(optimize.brentq(too_wide, _NARROWEST, _WIDEST, xtol=1e-3))
    return float(_MEDIAN / np.exp(np.median(drawn(width)))), width


def _log_normal(prior: Distribution, width: float, stretch: float = 1.0) -> Distribution:
    known = numbers_of(prior)
    return stats.lognorm(s=width * known["s"], loc=known["loc"], scale=stretch * known["scale"])


# Parts of the names of parameters that belong to one record, or to rod and object (friction).
_PASSING = ("bias", "drift", "discrepancy", "friction", "base", "gauge")
_PROBABILITIES = np.array([0.05, 0.25, 0.5, 0.75, 0.95])  # at which quantiles of draws and density are compared
# Beginnings of the attributes that must agree: the rig's parameters are deviations from what they state.
_SENSES = (
    "rod_",
    "units",
    "load_cell_frame",
    "load_cell_gain",
    "load_cell_lever",
    "load_cell_moment_curve",
    "load_cell_lag",
    "load_cell_play",
    "load_cell_drive_angle_",
)
_NOISES = ("load_cell_drive_angle_noise", "load_cell_drive_angle_resolution")


def rig_prior(rig: xr.DataTree) -> RigPrior:
    """Return a density fitted to the posterior of a rig."""
    if not isinstance(rig, xr.DataTree) or "gauge" not in rig.attrs:
        raise InferenceError("this is no posterior of a rig: give one that calibrate_rig found")
    if not rig.attrs.get("converged"):
        raise InferenceError(f"the posterior of the rig has not converged ({rig.attrs.get('message')}): infer it again")
    draws = posterior_draws(rig)
    inferred = [name for name in read_json(rig.attrs["nuisances"], "nuisances") if name in draws]
    names = tuple(name for name in inferred if not set(_PASSING) & set(name.split("_")))
    if not names:
        raise InferenceError("no unknown of the rig lasts beyond its record: say that one is, like rigidity_scale")
    points = np.stack([draws[name].values.ravel() for name in names], axis=1)
    priors = {name: _fitted(name, values) for name, values in zip(names, points.T, strict=True)}
    source = f"{rig.attrs.get('rig_data_sha256', '')} {rig.attrs['data_sha256']}".strip()
    scores = RigPrior(priors, np.eye(len(names)), 0.0, source).scores(points)
    correlation = np.atleast_2d(np.corrcoef(scores.T))
    error = max(_error(scores, correlation), float(rig.attrs.get("rig_density_error", 0.0)))
    stated = {str(name): value for name, value in rig.attrs.items() if _is_stated(str(name))}
    return RigPrior(priors, correlation, error, source, stated, rig)


def _is_stated(name: str) -> bool:
    return name.startswith(_SENSES) and name not in _NOISES and not name.startswith("rig_")


def refuse_other_rig(rig: RigPrior, own: Mapping[str, Any]) -> None:
    """Refuse a calibration of another rod, load cell, frame or unit than a posterior states by its attributes."""
    if own["data_sha256"] in rig.source.split():
        raise ParameterError("the rig was inferred from this very record, which would count twice: give another record")
    if not rig.stated:
        return
    for name in sorted({*rig.stated, *(str(name) for name in own if _is_stated(str(name)))}):
        stated, here = rig.stated.get(name, "nothing"), own.get(name, "nothing")
        is_text = isinstance(stated, str) or isinstance(here, str)
        if stated != here if is_text else not np.allclose(stated, here, rtol=1e-9, atol=0.0):
            raise ParameterError(
                f"the rig does not match: its {name} is {stated}, that of the record is {here}; its parameters are "
                "deviations from what is stated, so state the same in both"
            )


def _error(scores: Floats, correlation: Floats) -> float:
    """Return the largest difference of quantiles of normal scores and of their principal axes from normal ones."""
    variances, axes = np.linalg.eigh(correlation)
    along = scores @ axes / np.sqrt(variances)
    found = np.quantile(np.concatenate([scores, along], axis=1), _PROBABILITIES, axis=0)
    return float(np.abs(found - stats.norm.ppf(_PROBABILITIES)[:, None]).max())


def _fitted(name: str, values: Floats) -> Distribution:
    """Return a marginal fitted to draws."""
    if name in MAY_VANISH:
        return _truncated(values)
    if name == "rigidity_scale" or name.endswith("_gain"):
        logarithms = np.log(values)
        return stats.lognorm(s=float(logarithms.std()), scale=float(np.exp(logarithms.mean())))
    return stats.norm(float(values.mean()), float(values.std()))


def _truncated(values: Floats) -> Distribution:
    """Return the likeliest normal distribution cut off at zero, in units of the draws' root mean square."""
    unit = float(np.sqrt(np.mean(np.square(values))))
    mean, square = float(values.mean() / unit), 1.0

    def minus_log_likelihood(point: Floats) -> float:
        middle, log_width = point
        width = np.exp(log_width)
        scatter = (square - 2.0 * mean * middle + middle**2) / (2.0 * width**2)
        return float(scatter + log_width + stats.norm.logcdf(middle / width))

    start = np.array([mean, np.log(max(float(values.std()) / unit, 1e-6))])
    found = optimize.minimize(minus_log_likelihood, start, method="L-BFGS-B", bounds=[(-20.0, 5.0), (-15.0, 3.0)])
    middle, width = float(found.x[0]), float(np.exp(found.x[1]))
    return stats.truncnorm(-middle / width, np.inf, loc=middle * unit, scale=width * unit)

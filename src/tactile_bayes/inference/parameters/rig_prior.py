"""The posterior of a rig as a prior: a density fitted to the draws of the parameters that do not change."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy import optimize, stats

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.parameters.priors import MAY_VANISH, Prior, numbers_of
from tactile_bayes.inference.result import posterior_draws
from tactile_bayes.tasks.documents import read_json

__all__ = ["RigPrior", "refuse_other_rig", "rig_prior"]

_PASSING = ("bias", "drift", "friction", "base", "gauge")
"""Parameters, by parts of their names, that belong to one record (zeros, pivots and gauge) or to rod and object
(friction)."""

_PROBABILITIES = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
"""Probabilities of the quantiles at which draws and density are compared."""

_FARTHEST = 30.0
"""Largest normal score, beyond which densities vanish anyway."""

_SENSES = (
    "rod_",
    "units",
    "load_cell_frame",
    "load_cell_gain",
    "load_cell_lever",
    "load_cell_moment_curve",
    "load_cell_drive_angle_",
)
"""Beginnings of the attributes that must agree: the rig's parameters are deviations from what they state."""

_NOISES = ("load_cell_drive_angle_noise", "load_cell_drive_angle_resolution")


@dataclass(frozen=True, eq=False)
class RigPrior:
    """Joint prior of parameters of a rig: marginals, joined by a normal copula.

    With normal and log-normal marginals it is a multivariate normal distribution of the parameters or their logarithms.

    Parameters
    ----------
    priors : mapping of str to frozen scipy.stats distribution
        Marginals by name: normal, log-normal, or truncated normal where a parameter may be zero but not negative.
    correlation : ndarray, shape (parameters, parameters)
        Correlations of the parameters' normal scores.
    error : float
        Largest difference between quantiles of draws and density, along each parameter and each principal axis, in
        standard deviations; with several records of gauges, that of the worst density.
    source : str
        SHA-256 of the record of the gauge, or of all of them with blanks between.
    """

    priors: Mapping[str, Prior]
    correlation: Floats
    error: float
    source: str

    @property
    def entries(self) -> dict[str, Any]:
        """Attributes of a posterior with this prior; `from_entries` is the inverse."""
        return {
            "rig_parameters": json.dumps(list(self.priors)),
            "rig_correlation": json.dumps(self.correlation.tolist()),
            "rig_density_error": self.error,
            "rig_data_sha256": self.source,
        }

    @classmethod
    def from_entries(cls, attrs: Mapping[Any, Any], priors: Mapping[str, Prior]) -> RigPrior:
        """Return the prior of a posterior's attributes, with given marginals."""
        own = {name: priors[name] for name in read_json(attrs["rig_parameters"], "rig_parameters")}
        correlation = np.array(read_json(attrs["rig_correlation"], "rig_correlation"))
        return cls(own, correlation, float(attrs["rig_density_error"]), str(attrs["rig_data_sha256"]))

    def without(self, names: Collection[str]) -> RigPrior:
        """Return the prior of the parameters without some of them."""
        kept = [i for i, name in enumerate(self.priors) if name not in names]
        own = {name: prior for name, prior in self.priors.items() if name not in names}
        return RigPrior(own, self.correlation[np.ix_(kept, kept)], self.error, self.source)

    def log_dependence(self, points: Floats) -> Floats:
        """Return the log-density of points, shape (n, parameters), less that of independent marginals, shape (n,)."""
        scores = self._scores(points)
        root = np.linalg.cholesky(self.correlation)
        whitened = np.linalg.solve(root, scores.T)
        growth = 0.5 * (np.square(scores).sum(axis=1) - np.square(whitened).sum(axis=0))
        return np.asarray(growth - np.log(np.diag(root)).sum())

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """Draw points, shape (count, parameters)."""
        scores = rng.standard_normal((count, len(self.priors))) @ np.linalg.cholesky(self.correlation).T
        columns = [_at_scores(prior, z) for prior, z in zip(self.priors.values(), scores.T, strict=True)]
        return np.stack(columns, axis=1)

    def _scores(self, points: Floats) -> Floats:
        columns = [_scores_of(prior, x) for prior, x in zip(self.priors.values(), points.T, strict=True)]
        return np.stack(columns, axis=1)


def _lasting(nuisances: Collection[str]) -> tuple[str, ...]:
    """Return the names of the parameters that a rig keeps from one record to the next.

    Examples
    --------
    >>> _lasting(["rigidity_scale", "moment_bias", "lever_x", "base_2_x", "friction"])
    ('rigidity_scale', 'lever_x')
    """
    return tuple(name for name in nuisances if not any(part in _PASSING for part in name.split("_")))


def rig_prior(rig: xr.DataTree) -> RigPrior:
    """Return a density fitted to the posterior of a rig.

    Raises
    ------
    InferenceError
        If this is no result of `infer_rig`, it has not converged, or none of its parameters lasts.
    """
    if not isinstance(rig, xr.DataTree) or "gauge" not in rig.attrs:
        raise InferenceError("rig is no result of infer_rig: give the tree that it returned, or that read_result reads")
    if not rig.attrs.get("converged"):
        raise InferenceError(f"the posterior of the rig has not converged ({rig.attrs.get('message')}): infer it again")
    draws = posterior_draws(rig)
    names = _lasting(read_json(rig.attrs["nuisances"], "nuisances"))
    names = tuple(name for name in names if name in draws and "discrepancy" not in name)
    if not names:
        raise InferenceError("no parameter of the rig lasts beyond its record: infer it with nuisances=['standard']")
    points = np.stack([draws[name].values.ravel() for name in names], axis=1)
    priors = {name: _fitted(name, values) for name, values in zip(names, points.T, strict=True)}
    source = f"{rig.attrs.get('rig_data_sha256', '')} {rig.attrs['data_sha256']}".strip()
    scores = RigPrior(priors, np.eye(len(names)), 0.0, source)._scores(points)
    correlation = np.atleast_2d(np.corrcoef(scores.T))
    error = max(_error(scores, correlation), float(rig.attrs.get("rig_density_error", 0.0)))
    return RigPrior(priors, correlation, error, source)


def refuse_other_rig(rig: Mapping[Any, Any], own: Mapping[str, Any]) -> None:
    """Refuse a rig whose attributes state another rod, load cell, frame or unit than those of an experiment.

    Raises
    ------
    ParameterError
        If they differ, or the rig was inferred from the record of the experiment.
    """
    if own["data_sha256"] in (rig["data_sha256"], *str(rig.get("rig_data_sha256", "")).split()):
        raise ParameterError("the rig was inferred from this very record, which would count twice: give another record")
    names = {str(name) for name in (*rig, *own) if str(name).startswith(_SENSES)} - set(_NOISES)
    for name in sorted(names):
        stated, here = rig.get(name, "nothing"), own.get(name, "nothing")
        if not _same(stated, here):
            raise ParameterError(
                f"the rig does not match: its {name} is {stated}, that of the record is {here}; its parameters are "
                "deviations from what is stated, so state the same in both"
            )


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, str) or isinstance(other, str):
        return bool(one == other)
    return bool(np.allclose(one, other, rtol=1e-9, atol=0.0))


def _error(scores: Floats, correlation: Floats) -> float:
    """Return the largest difference of quantiles of normal scores and of their principal axes from normal ones."""
    variances, axes = np.linalg.eigh(correlation)
    along = scores @ axes / np.sqrt(variances)
    found = np.quantile(np.concatenate([scores, along], axis=1), _PROBABILITIES, axis=0)
    return float(np.abs(found - stats.norm.ppf(_PROBABILITIES)[:, None]).max())


def _fitted(name: str, values: Floats) -> Prior:
    """Return a marginal fitted to draws."""
    if name in MAY_VANISH:
        return _truncated(values)
    if name == "rigidity_scale" or name.endswith("_gain"):
        logarithms = np.log(values)
        return stats.lognorm(s=float(logarithms.std()), scale=float(np.exp(logarithms.mean())))
    return stats.norm(float(values.mean()), float(values.std()))


def _truncated(values: Floats) -> Prior:
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


def _scores_of(prior: Prior, x: Floats) -> Floats:
    """Return the normal scores of values: quantiles of the standard normal with the same probabilities."""
    known = numbers_of(prior)
    match prior.dist.name:  # type: ignore[attr-defined]
        case "norm":
            scores = (x - known["loc"]) / known["scale"]
        case "lognorm":
            with np.errstate(divide="ignore", invalid="ignore"):
                scores = np.nan_to_num(np.log(x / known["scale"]) / known["s"], nan=-np.inf)
        case _:
            below, above = prior.cdf(x), prior.sf(x)  # type: ignore[attr-defined]
            scores = np.where(below < 0.5, stats.norm.ppf(below), -stats.norm.ppf(above))
    return np.clip(scores, -_FARTHEST, _FARTHEST)


def _at_scores(prior: Prior, scores: Floats) -> Floats:
    """Return the values with these normal scores."""
    return np.asarray(prior.ppf(stats.norm.cdf(scores)))  # type: ignore[attr-defined]

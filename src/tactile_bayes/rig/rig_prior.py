"""The joint prior of parameters of a rig that a calibration has found: marginals, joined by a normal copula."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from scipy import stats
from scipy.special import ndtri

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_positive
from tactile_bayes.distributions import Distribution, in_words, numbers_of, open_share
from tactile_bayes.errors import ParameterError
from tactile_bayes.record.spelling import refuse_unknown_keys

_FARTHEST = 30.0  # largest normal score, beyond which densities vanish anyway


@dataclass(frozen=True, eq=False)
class RigPrior:
    """Joint prior of parameters of a rig: marginals, joined by a normal copula. With normal and log-normal marginals it
    is a multivariate normal distribution of the parameters or their logarithms.
    """

    # Marginals by name: normal, log-normal, or truncated normal where a parameter may be zero but not negative.
    priors: Mapping[str, Distribution]
    correlation: Floats  # of the parameters' normal scores, shape (parameters, parameters)
    # Largest difference between quantiles of draws and density, along each parameter and each principal axis, in
    # standard deviations; with several records of gauges, that of the worst density.
    error: float
    source: str  # SHA-256 of the record of the gauge, or of all of them with blanks between
    # Attributes of the posterior that state rod, load cell, frame and units, of which the parameters are deviations.
    stated: Mapping[str, Any] = field(default_factory=dict)
    posterior: xr.DataTree | None = None

    def __repr__(self) -> str:
        return f"RigPrior({', '.join(f'{name}={in_words(prior)}' for name, prior in self.priors.items())})"

    @property
    def entries(self) -> dict[str, Any]:
        """Attributes of a posterior with this prior."""
        return {
            "rig_parameters": json.dumps(list(self.priors)),
            "rig_correlation": json.dumps(self.correlation.tolist()),
            "rig_density_error": self.error,
            "rig_data_sha256": self.source,
        }

    def without(self, names: Collection[str]) -> RigPrior:
        """Return the prior of the parameters without some of them."""
        kept = [i for i, name in enumerate(self.priors) if name not in names]
        own = {name: prior for name, prior in self.priors.items() if name not in names}
        return replace(self, priors=own, correlation=self.correlation[np.ix_(kept, kept)])

    def in_a_session(self, deviations: Mapping[str, Any]) -> RigPrior:
        """Return the prior of a rig whose parameters differ in each session, by these standard deviations."""
        refuse_unknown_keys(deviations, self.priors, "session.")
        priors, kept = dict(self.priors), np.ones(len(self.priors))
        for name, value in deviations.items():
            deviation = check_positive(f"session.{name}", value, "leave it out if it is the same in every session")
            kind, numbers = self.priors[name].dist, numbers_of(self.priors[name])  # type: ignore[attr-defined]
            if kind.name not in ("norm", "lognorm"):
                raise ParameterError(f"session.{name} may vanish, and has no normal deviation: leave it out")
            width = "scale" if kind.name == "norm" else "s"
            whole = float(np.hypot(numbers[width], deviation))
            kept[list(priors).index(name)] = numbers[width] / whole
            priors[name] = kind(**{**numbers, width: whole})
        correlation = self.correlation * np.outer(kept, kept)
        np.fill_diagonal(correlation, 1.0)
        return replace(self, priors=priors, correlation=correlation)

    def log_dependence(self, points: Floats) -> Floats:
        """Return the log-density of points, shape (n, parameters), less that of independent marginals, shape (n,)."""
        scores = self.scores(points)
        root = np.linalg.cholesky(self.correlation)
        whitened = np.linalg.solve(root, scores.T)
        growth = 0.5 * (np.square(scores).sum(axis=1) - np.square(whitened).sum(axis=0))
        return np.asarray(growth - np.log(np.diag(root)).sum())

    def draw(self, rng: np.random.Generator, count: int) -> Floats:
        """Draw points, shape (count, parameters)."""
        return self.at(rng.standard_normal((count, len(self.priors))))

    def at(self, normal: Floats) -> Floats:
        """Return the points that independent standard normal numbers stand for, shape (n, parameters)."""
        scores = normal @ np.linalg.cholesky(self.correlation).T
        columns = [_at_scores(prior, z) for prior, z in zip(self.priors.values(), scores.T, strict=True)]
        return np.stack(columns, axis=1)

    def at_shares(self, shares: Floats) -> dict[str, Floats]:
        """Return values of parameters, each of shape (n,), from independent shares, shape (n, parameters)."""
        return dict(zip(self.priors, self.at(ndtri(open_share(shares))).T, strict=True))

    def scores(self, points: Floats) -> Floats:
        """Return the normal scores of points, shape (n, parameters)."""
        columns = [_scores_of(prior, x) for prior, x in zip(self.priors.values(), points.T, strict=True)]
        return np.stack(columns, axis=1)


def _scores_of(prior: Distribution, x: Floats) -> Floats:
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


def _at_scores(prior: Distribution, scores: Floats) -> Floats:
    """Return the values with these normal scores."""
    below, above = prior.ppf(stats.norm.cdf(scores)), prior.isf(stats.norm.sf(scores))  # type: ignore[attr-defined]
    return np.asarray(np.where(np.asarray(scores < 0.0), below, above))

"""Densities of priors, without the checks of arguments in every call of `scipy.stats`."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy import stats

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.parameters.priors import Prior, numbers_of

__all__ = ["log_density_of"]

_ROOT_2PI = 0.5 * math.log(2.0 * math.pi)


def log_density_of(prior: Prior) -> Callable[[Floats], Floats]:
    """Return the log-density of a frozen distribution, as its `logpdf`, for common ones ten times faster.

    For a few points a call of `logpdf` takes longer than the likelihood of a whole record.
    """
    distribution = getattr(prior, "dist", None)
    closed = _CLOSED.get(type(distribution))
    if distribution is None or closed is None:
        return prior.logpdf
    values = numbers_of(prior)
    if any(np.ndim(value) for value in values.values()):
        return prior.logpdf
    return partial(closed, **{name: float(value) for name, value in values.items()})


def _norm(x: Floats, *, loc: float, scale: float) -> Floats:
    return np.asarray(-0.5 * ((x - loc) / scale) ** 2 - (_ROOT_2PI + math.log(scale)))


def _halfnorm(x: Floats, *, loc: float, scale: float) -> Floats:
    return np.where(x >= loc, _norm(x, loc=loc, scale=scale) + math.log(2.0), -np.inf)


def _lognorm(x: Floats, *, s: float, loc: float, scale: float) -> Floats:
    inside = x > loc
    logarithm = np.log(np.where(inside, x - loc, 1.0)) - math.log(scale)
    values = -0.5 * (logarithm / s) ** 2 - logarithm - (_ROOT_2PI + math.log(s) + math.log(scale))
    return np.where(inside, values, -np.inf)


def _uniform(x: Floats, *, loc: float, scale: float) -> Floats:
    return np.where((x >= loc) & (x <= loc + scale), -math.log(scale), -np.inf)


_CLOSED: dict[type, Callable[..., Any]] = {
    type(stats.norm): _norm,
    type(stats.halfnorm): _halfnorm,
    type(stats.lognorm): _lognorm,
    type(stats.uniform): _uniform,
}

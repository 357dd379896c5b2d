"""Default priors of the parameters of contours, and priors that are matched between families."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np
from scipy import stats
from scipy.optimize import brentq

from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Contour
from tactile_bayes.contours.families import family_named, sides_of
from tactile_bayes.contours.family import ContourFamily, FamilyParameter
from tactile_bayes.distributions import Distribution, numbers_of


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

    width = float(brentq(too_wide, _NARROWEST, _WIDEST, xtol=1e-3))
    return float(_MEDIAN / np.exp(np.median(drawn(width)))), width


def _log_normal(prior: Distribution, width: float, stretch: float = 1.0) -> Distribution:
    known = numbers_of(prior)
    return stats.lognorm(s=width * known["s"], loc=known["loc"], scale=stretch * known["scale"])

"""Priors of families that expect alike: contours as bent as each other, as far as a rod can tell before it sees any."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np
from scipy import stats
from scipy.optimize import brentq

from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Contour
from tactile_bayes.contours.families import family_named, sides_of
from tactile_bayes.contours.family import Family
from tactile_bayes.inference.priors import Prior, own_priors

__all__ = ["matched_priors", "mean_log_radius", "widened"]

_SLOPES = np.linspace(0.0, 0.25 * np.pi, 9, endpoint=False) + np.pi / 72.0
"""Slope angles over which a flank's radius of curvature is averaged [rad]."""

_MEDIAN, _SPREAD = 0.5, 1.0
"""Of the geometric mean of a flank's radius of curvature: median, in rod lengths, and standard deviation of its
logarithm."""

_DRAWS = 2048

_NARROWEST, _WIDEST = 0.05, 3.0


def matched_priors(family: str, length: float) -> dict[str, Prior]:
    """Priors of a family's own parameters, for rods of a length, all families' expecting the same of a flank.

    The default priors say the same of every parameter of a kind, so that of an ellipse, which has two sizes, wider and
    rounder contours are expected than of a circle. Here, sizes have priors for which the geometric mean of the radius
    of curvature between level and a slope of 45° on one side has its median at half the rod's length, and a standard
    deviation of 1 of its logarithm. Exponents, amplitude and length scale keep their default priors.

    Parameters
    ----------
    family : str
        As of `infer_contour`.
    length : float
        Of the rod, in the unit of the record.

    Returns
    -------
    dict of str to frozen scipy.stats distribution

    Raises
    ------
    ParameterError
        If there is no such family.

    Examples
    --------
    >>> {name: round(float(p.median()), 3) for name, p in matched_priors("ellipse", 1.0).items()}
    {'a': 0.592, 'b': 0.592}
    """
    return {
        f"{side}{parameter}": prior
        for side, name in sides_of(family_named(family).name).items()
        for parameter, prior in _of_flank(name, length).items()
    }


def mean_log_radius(contours: Contour) -> Floats:
    """Logarithm of the geometric mean of the radius of curvature of the right flank up to 45°, shape (n,)."""
    return np.mean([np.log(contours.radius_of_curvature(np.full(contours.shape, a))) for a in _SLOPES], axis=0)


def widened(priors: Mapping[str, Prior], factor: float) -> dict[str, Prior]:
    """Log-normal priors about the same median, with so many times the standard deviation; others as they are."""
    return {name: _log_normal(prior, factor) if _is_log_normal(prior) else prior for name, prior in priors.items()}


def _of_flank(name: str, length: float) -> dict[str, Prior]:
    family = family_named(name)
    priors = own_priors(family, length)
    stretch, width = _matching(name)
    return {
        n: _log_normal(prior, width, stretch ** family.length_powers[n]) if family.length_powers[n] else prior
        for n, prior in priors.items()
    }


@functools.cache
def _matching(name: str) -> tuple[float, float]:
    """By how much sizes' medians and the standard deviations of their logarithms are to be multiplied."""
    family = family_named(name)
    priors = own_priors(family, 1.0)
    uniform = stats.qmc.Sobol(len(priors), seed=0).random(_DRAWS).T

    def drawn(width: float) -> Floats:
        values = {
            n: (_log_normal(prior, width) if family.length_powers[n] else prior).ppf(u)  # type: ignore[attr-defined]
            for (n, prior), u in zip(priors.items(), uniform, strict=True)
        }
        return mean_log_radius(_built(family, values))

    def too_wide(width: float) -> float:
        ends = np.quantile(drawn(width), stats.norm.cdf([-1.0, 1.0]))
        return float(0.5 * np.diff(ends)[0] - _SPREAD)

    width = float(brentq(too_wide, _NARROWEST, _WIDEST, xtol=1e-3))
    return float(_MEDIAN / np.exp(np.median(drawn(width)))), width


def _built(family: Family, values: Mapping[str, Floats]) -> Contour:
    """With the vertex at the origin; what no contour has is brought to the nearest that one has."""
    zeros = np.zeros(_DRAWS)
    inside = {name: np.clip(value, *family.bounds[name]) for name, value in values.items()}
    return family.build(*(inside.get(name, zeros) for name in family.parameters))


def _is_log_normal(prior: Prior) -> bool:
    return getattr(getattr(prior, "dist", None), "name", "") == "lognorm"


def _log_normal(prior: Prior, width: float, stretch: float = 1.0) -> Prior:
    known = dict(prior.kwds)  # type: ignore[attr-defined]
    return stats.lognorm(s=width * known["s"], loc=known.get("loc", 0.0), scale=stretch * known.get("scale", 1.0))

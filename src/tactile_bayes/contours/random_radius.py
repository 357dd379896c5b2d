"""A random radius of curvature over the slope angle: a Gaussian process in a truncated Karhunen–Loève expansion."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.smooth import Smooth

_PLACES = 200  # number of slope angles at which the expansion is computed
_LARGEST = 25.0  # bound on the logarithm of radii, far beyond any prior
_LENGTHS = 64  # number of length scales at which the expansion is computed; it is interpolated between them


class Directions(NamedTuple):
    """Terms of the expansion as functions of the slope angle, in the order of decreasing variance."""

    log_lengths: Floats  # logarithms of the length scales, shape (lengths,)
    # Values at the nodes of `Smooth`, shape (lengths, nodes, directions). With standard normal weights their sum has
    # unit variance on average over slope angles.
    values: Floats


@dataclass(frozen=True)
class RandomRadius:
    """Random radius log ρ(α) = log r + amplitude · g(α), with a Gaussian process g and the geometric mean r of ρ. The
    covariance of g is Matérn's with ν = 5/2 (Rasmussen & Williams 2006, equation 4.17), less the mean over slopes."""

    shortest: float  # range of the length scale [rad]
    longest: float
    # Share of the variance of g that is neglected at the shortest length scale; it determines the number of terms.
    tolerance: float
    nodes: int = 64  # number of values that define a contour

    @property
    def count(self) -> int:
        """Number of directions."""
        share = np.cumsum(_spectrum(self.shortest)[0])
        return int(np.searchsorted(share / share[-1], 1.0 - self.tolerance)) + 1

    @property
    def directions(self) -> Directions:
        """Terms of the expansion, at length scales from the shortest to the longest."""
        return _directions(self.shortest, self.longest, self.count, self.nodes)

    def log_radius(self, log_r: Floats, amplitude: Floats, length: Floats, weights: Floats) -> Floats:
        """log ρ at the nodes, shape (n, nodes), from arrays (n,) and standard normal weights (n, directions)."""
        sums = (self.shapes(length) @ weights[..., None])[..., 0]
        return np.clip(log_r[..., None] + amplitude[..., None] * sums, -_LARGEST, _LARGEST)

    def shapes(self, length: Floats) -> Floats:
        """Terms at the nodes, shape (n, nodes, directions), for length scales of shape (n,) [rad]."""
        at = np.log(np.clip(length, self.shortest, self.longest))
        return np.asarray(_spline(self.shortest, self.longest, self.count, self.nodes)(at))


def _covariance(one: Floats, other: Floats, length: float) -> Floats:
    distance = np.sqrt(5.0) * np.abs(one[:, None] - other) / length
    return (1.0 + distance + distance**2 / 3.0) * np.exp(-distance)


def _places() -> Floats:
    return np.pi * ((np.arange(_PLACES) + 0.5) / _PLACES - 0.5)


@functools.lru_cache(maxsize=64)
def _spectrum(length: float) -> tuple[Floats, Floats]:
    """Mean variances of the directions, the largest first, and the directions at the slope angles, a column each."""
    places = _places()
    covariance = _covariance(places, places, length)
    covariance = covariance - covariance.mean(axis=0) - covariance.mean(axis=1)[:, None] + covariance.mean()
    values, functions = np.linalg.eigh(covariance / _PLACES)
    return np.maximum(values[::-1], 0.0), functions[:, ::-1] * np.sqrt(_PLACES)


@functools.lru_cache(maxsize=8)
def _directions(shortest: float, longest: float, count: int, nodes: int) -> Directions:
    """First directions for many length scales."""
    places, at = _places(), Smooth.nodes(nodes)
    log_lengths = np.linspace(np.log(shortest), np.log(longest), _LENGTHS)
    values = np.empty((_LENGTHS, nodes, count))
    before: Floats | None = None
    for i, log_length in enumerate(log_lengths):
        variance, functions = _spectrum(float(np.exp(log_length)))
        chosen = functions[:, :count]
        if before is not None:
            chosen = chosen * np.sign(np.sum(chosen * before, axis=0))
        before = chosen
        # The functions between the slope angles, by Nyström's extension.
        across = _covariance(at, places, float(np.exp(log_length)))
        across = across - across.mean(axis=1)[:, None]
        mean = _covariance(places, places, float(np.exp(log_length))).mean(axis=0)
        across = across - (mean - mean.mean())
        values[i] = across @ chosen / (_PLACES * np.sqrt(variance[:count]))
    return Directions(log_lengths, values)


@functools.lru_cache(maxsize=8)
def _spline(shortest: float, longest: float, count: int, nodes: int) -> CubicSpline:
    known = _directions(shortest, longest, count, nodes)
    return CubicSpline(known.log_lengths, known.values)

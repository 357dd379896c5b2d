"""Chebyshev interpolation on [0, 1], many functions at once."""

from __future__ import annotations

import functools

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

__all__ = ["coefficients", "derivative", "evaluate", "integral", "nodes", "polynomials", "tabulate"]

Floats = NDArray[np.float64]


@functools.cache
def nodes(count: int) -> Floats:
    """The roots of the Chebyshev polynomial of degree `count`, increasing, in (0, 1)."""
    return 0.5 * (1.0 - np.cos(np.pi * (np.arange(count) + 0.5) / count))


@functools.cache
def _fit(count: int) -> Floats:
    angle = np.pi * np.outer(np.arange(count), np.arange(count) + 0.5) / count
    fit = 2.0 / count * np.cos(angle[:, ::-1])
    fit[0] *= 0.5
    return fit


def coefficients(values: Floats) -> Floats:
    """Coefficients, shape (count, …), of the interpolants of values, shape (…, count), at `nodes(count)`."""
    return np.moveaxis(values @ _fit(values.shape[-1]).T, -1, 0)


def evaluate(coefficients: Floats, z: Floats) -> Floats:
    """Interpolants at z, which broadcasts against the trailing axes of the coefficients."""
    return np.asarray(chebyshev.chebval(2.0 * z - 1.0, coefficients, tensor=False), dtype=float)


def tabulate(coefficients: Floats, z: Floats) -> Floats:
    """All interpolants at the same points z, shape (k,): an array of shape (…, k)."""
    return np.moveaxis(np.tensordot(polynomials(coefficients.shape[0], z), coefficients, 1), 0, -1)


def polynomials(count: int, z: Floats) -> Floats:
    """The first `count` Chebyshev polynomials on [0, 1] at z, along a new last axis."""
    out = np.empty((count, *z.shape))
    x = 2.0 * z - 1.0
    out[0] = 1.0
    if count > 1:
        out[1] = x
    twice = 2.0 * x
    for k in range(2, count):
        np.multiply(twice, out[k - 1], out=out[k, ...])
        out[k] -= out[k - 2]
    return np.moveaxis(out, 0, -1)


def derivative(coefficients: Floats) -> Floats:
    """Coefficients of the derivatives by z."""
    return np.asarray(chebyshev.chebder(coefficients, scl=2.0), dtype=float)


def integral(coefficients: Floats) -> Floats:
    """Coefficients of the integrals from 0."""
    return np.asarray(chebyshev.chebint(coefficients, lbnd=-1.0, scl=0.5), dtype=float)

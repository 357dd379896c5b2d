"""Chebyshev interpolation on [0, 1] of many functions at once."""

from __future__ import annotations

import functools

import numpy as np
from numpy.polynomial import chebyshev

from tactile_bayes.arrays import Floats


@functools.cache
def nodes(count: int) -> Floats:
    """Roots of the Chebyshev polynomial of degree `count` on [0, 1], increasing."""
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
    """Values of interpolants at z, which broadcasts with the trailing axes of the coefficients."""
    at, dimensions = basis(coefficients.shape[0], z), max(coefficients.ndim - 1, z.ndim)
    each, at = (a.reshape(a.shape[0], *(1,) * (dimensions + 1 - a.ndim), *a.shape[1:]) for a in (coefficients, at))
    return np.asarray((each * at).sum(axis=0))


def polynomials(count: int, z: Floats) -> Floats:
    """Values of the first `count` Chebyshev polynomials on [0, 1] at z, along a new last axis."""
    return np.moveaxis(basis(count, z), 0, -1)


def basis(count: int, z: Floats) -> Floats:
    """Values of the first `count` Chebyshev polynomials on [0, 1] at z, contiguous along a new first axis."""
    out = np.empty((count, *z.shape))
    x = 2.0 * z - 1.0
    out[0] = 1.0
    out[1:2] = x
    twice = 2.0 * x
    for k in range(2, count):
        np.multiply(twice, out[k - 1], out=out[k, ...])
        out[k] -= out[k - 2]
    return out


def derivative(coefficients: Floats) -> Floats:
    """Coefficients of the derivatives by z."""
    return np.tensordot(_slopes(coefficients.shape[0]), coefficients, 1)


@functools.cache
def _slopes(count: int) -> Floats:
    return np.asarray(chebyshev.chebder(np.eye(count), scl=2.0), dtype=float)


def integral(coefficients: Floats) -> Floats:
    """Coefficients of the integrals from 0."""
    return np.asarray(chebyshev.chebint(coefficients, lbnd=-1.0, scl=0.5), dtype=float)

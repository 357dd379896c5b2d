"""Jacobi's functions against those of mpmath, and their derivatives against differences in forty digits."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.compiled_calls import by_number
from helpers.exact_rod import mp
from tactile_bayes.mechanics.compiler import cached
from tactile_bayes.mechanics.poses import jacobi as compiled_jacobi

EPS = np.finfo(float).eps
_jacobi, _jacobi_and_slopes = compiled_jacobi.jacobi, compiled_jacobi.jacobi_and_slopes


@cached
def _values(rows, out):
    for i in range(len(rows)):
        for k, value in enumerate(_jacobi(rows[i, 0], rows[i, 1])):
            out[i, k] = value


@cached
def _slopes(rows, out):
    for i in range(len(rows)):
        for k, part in enumerate(_jacobi_and_slopes(rows[i, 0], rows[i, 1])):
            for n, value in enumerate(part):
                out[i, 5 * k + n] = value


def parameters():
    """Ordinary ones, and those at which elliptic functions degenerate."""
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0.0, 3.4, (2, 40)) ** 2
    special = [
        (0.0, 0.0),
        (0.0, 4.0),
        (4.0, 0.0),
        (3.0, 3.0),
        (3.0, 3.0 + 1e-9),
        (1e-300, 2.0),
        (0.3, 10.0),
        (12.0, 0.1),
    ]
    return np.concatenate([np.stack([x, y], axis=1), special]).T


def exact(x, y):
    """s, c, d, (1 − d)/y and J for t = 1; the larger parameter decides the scale."""
    x, y = mp.mpf(x), mp.mpf(y)
    if not max(x, y):
        return mp.mpf(1), mp.mpf(1), mp.mpf(1), mp.mpf(1) / 2, mp.mpf(1) / 3
    root, m = mp.sqrt(max(x, y)), min(x, y) / max(x, y)

    def s_at(t):
        return mp.ellipfun("sn", root * t, m=m) / root

    one, other = mp.ellipfun("cn", root, m=m), mp.ellipfun("dn", root, m=m)
    c, d = (one, other) if x >= y else (other, one)
    s = s_at(mp.mpf(1))
    r = (1 - d) / y if y else s * s / 2
    return s, c, d, r, mp.quad(lambda t: s_at(t) ** 2, [0, mp.mpf(1) / 2, 1])


@pytest.mark.parametrize("every", [pytest.param(1, marks=pytest.mark.slow), 40])
def test_values_are_those_of_mpmath(every):
    """Of the ordinary parameters only some, unless there is time; of the special ones all."""
    x, y = (np.append(values[:40:every], values[40:]) for values in parameters())
    found = by_number(_values, 5)(x, y)
    expected = np.array([[float(value) for value in exact(*pair)] for pair in zip(x, y, strict=True)])
    # Five halvings at most, each of which doubles an error.
    np.testing.assert_allclose(found, expected, rtol=0, atol=32 * EPS)


def test_with_slopes_they_are_the_same():
    x, y = parameters()
    found = by_number(_slopes, 15)(x, y)[:, :5]
    np.testing.assert_allclose(found, by_number(_values, 5)(x, y), rtol=0, atol=64 * EPS)


@pytest.mark.parametrize("every", [pytest.param(4, marks=pytest.mark.slow), 60])
@pytest.mark.parametrize("number", [0, 1], ids=["x", "y"])
def test_slopes_are_those_of_differences(number, every):
    x, y = (values[:40] for values in parameters())
    found = by_number(_slopes, 15)(x, y)[:, 5 * (number + 1) : 5 * (number + 2)]
    step = mp.mpf(10) ** -12
    for k in range(0, 40, every):
        ends = []
        for sign in (1, -1):
            pair = [mp.mpf(x[k]), mp.mpf(y[k])]
            pair[number] += sign * step
            ends.append(exact(*pair))
        slope = [float((after - before) / (2 * step)) for after, before in zip(*ends, strict=True)]
        np.testing.assert_allclose(found[k], slope, rtol=0, atol=256 * EPS)


@pytest.mark.parametrize("row", [(np.inf, 1.0), (1.0, np.inf), (np.nan, 1.0)])
def test_parameters_that_are_no_numbers_end(row):
    """A rod that is not loaded finitely has no pose; the search for one goes on elsewhere."""
    x, y = (np.array([value]) for value in row)
    assert not np.isfinite(by_number(_values, 5)(x, y)).all()
    assert not np.isfinite(by_number(_slopes, 15)(x, y)).all()

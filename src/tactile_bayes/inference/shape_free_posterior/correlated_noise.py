"""The noise of combined readings beside a discrepancy, which makes them alike."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.load_cell.discrepancy import Course, Discrepancy
from tactile_bayes.load_cell.drift import Zero
from tactile_bayes.numerics import chebyshev
from tactile_bayes.numerics.blocks import blocks

_NODES = 9, 7  # in correlation length, and in the scale of a discrepancy over white noise
_SPAN = 1.5  # of the logarithms of both, to either side of those about which they are tabulated
_UNSEEN = 1e12  # variance, over that of white noise, of readings that are left out


class CorrelatedNoise:
    """Noise of observations beside a discrepancy, over that of white noise, as a function of both.

    Observations are readings of one kind along orthonormal axes U. With the covariance V of the readings, over the
    variance of their white noise, they have the information Uᵀ V⁻¹ U = Rᵀ R: the triangular R and det V are
    interpolated.
    """

    def __init__(
        self, axes: Sequence[Floats], used: Flags, course: Course, largest: Sequence[Floats], about: Floats
    ) -> None:
        """Tabulate for each kind's axes, (observations, used samples, channels), and largest readings, (samples,
        channels), over the load cell's noise, about (noise of each kind, scale, length)."""
        *noises, scale, length = about
        by_length, by_share = (np.exp(_SPAN * (2.0 * chebyshev.nodes(count) - 1.0)) for count in _NODES)
        self._middle = [(math.log(length), math.log(scale / noise)) for noise in noises]
        self._tables: list[Floats] = []
        for axis, deviation, noise in zip(axes, largest, noises, strict=True):
            lengths, shares = (
                each.ravel() for each in np.meshgrid(length * by_length, scale / noise * by_share, indexing="ij")
            )
            part = [
                _seen(axis, used, course, deviation, shares[k], lengths[k]) for k in blocks(lengths.size, axis.size)
            ]
            table = np.concatenate(part).reshape(*_NODES, -1)
            table = chebyshev.coefficients(np.moveaxis(table, 0, -1))
            table = np.moveaxis(chebyshev.coefficients(np.moveaxis(table, 1, -1)), 0, 1)
            self._tables.append(table.reshape(math.prod(_NODES), -1))

    def _at(self, white: Floats, discrepancy: Floats) -> list[Floats]:
        """Interpolated tables of each kind, (n, numbers), at white noise, (n, kinds), and scale and length, (n, 2)."""
        found = []
        for table, noise, (length, share) in zip(self._tables, white.T, self._middle, strict=True):
            away = np.log(discrepancy[:, 1]) - length, np.log(discrepancy[:, 0] / noise) - share
            ways = [np.clip(0.5 + 0.5 * each / _SPAN, 0.0, 1.0) for each in away]
            by_length, by_share = (chebyshev.polynomials(count, way) for count, way in zip(_NODES, ways, strict=True))
            found.append((by_length[:, :, None] * by_share[:, None, :]).reshape(len(white), -1) @ table)
        return found

    def whitened(self, columns: Floats, white: Floats, discrepancy: Floats) -> Floats:
        """Return columns of observations, (n, observations, k), in units of this noise over that of white noise."""
        out, first = columns.copy(), 0
        for table in self._at(white, discrepancy):
            size = math.isqrt(table.shape[1] - 1)
            own = slice(first, first + size)
            out[:, own] = table[:, 1:].reshape(-1, size, size) @ columns[:, own]
            first += size
        return out

    def log_volume(self, white: Floats, discrepancy: Floats) -> float:
        """Return half of log det V of all kinds, for noise (1, kinds) and a discrepancy (1, 2)."""
        return sum(float(table[0, 0]) for table in self._at(white, discrepancy))


def _seen(axes: Floats, used: Flags, course: Course, largest: Floats, shares: Floats, lengths: Floats) -> Floats:
    """Return half of log det V, and R, as rows, for discrepancies of these shares of white noise and lengths, (n,)."""
    from tactile_bayes.load_cell.kalman import given_before  # numba takes a second to load

    ones, standard, volume = np.ones(len(axes)), [], np.zeros(shares.size)
    white, none = np.where(used, 1.0, _UNSEEN)[:, None] * ones, np.zeros(len(axes))
    for axis, of_channel in zip(np.moveaxis(axes, 2, 0), largest.T, strict=True):
        discrepancy = Discrepancy(course, shares[:, None, None] * of_channel[:, None] * ones, lengths)
        readings = np.zeros(discrepancy.deviation.shape)
        readings[:, used] = axis.T
        left, variance = given_before(readings, white, Zero.of(None, none, none), discrepancy)
        standard.append((left / np.sqrt(variance))[:, used])
        volume += 0.5 * np.log(variance[:, used, 0]).sum(axis=1)
    standard.append(np.zeros((shares.size, 1, len(axes))))  # there may be fewer readings than observations
    root = np.linalg.qr(np.concatenate(standard, axis=1), mode="r")
    root *= np.copysign(1.0, np.diagonal(root, axis1=1, axis2=2))[..., None]
    return np.column_stack([volume, root.reshape(shares.size, -1)])

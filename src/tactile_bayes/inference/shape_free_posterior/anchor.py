"""The place of a shape-free contour that a record determines best, where it is held while the rest changes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.numerics import chebyshev

_NODE, _WEIGHT = np.polynomial.legendre.leggauss(24)  # of the quadrature between vertex and anchor
_SLOPE_ANGLES = np.linspace(-1.4, 1.4, 57)  # slope angles that may be the anchor's [rad]
_LARGEST = 50.0  # bound of the change of the logarithm of a radius, far beyond any prior


@dataclass(frozen=True, eq=False)
class Anchor:
    """The point of a contour at one slope angle, and how far it is from where a linear map of the radii has it.

    The vertex is as far from an arc that was touched as the integral of the radii between them says, which is linear in
    their logarithms only near a centre: farther away the arc moves unless the vertex does.
    """

    slope_angle: float
    centre: Floats  # logarithms of the radii, at the nodes of interpolation, around which the map is linear

    @classmethod
    def best(cls, centre: Floats, radii: Floats, vertex: Floats) -> Anchor:
        """Return the anchor where a contour is known best. Shapes: centre (nodes,), radii, vertex (n, nodes)."""
        anchors = [cls(float(angle), centre) for angle in _SLOPE_ANGLES]
        spread = [np.sum(np.square(radii @ anchor._interpolation @ anchor._lengths + vertex)) for anchor in anchors]
        return anchors[int(np.argmin(spread))]

    @cached_property
    def _interpolation(self) -> Floats:
        """Logarithms of the radii between vertex and anchor from those at the nodes, shape (nodes, places)."""
        count = self.centre.size
        return np.asarray(chebyshev.coefficients(np.eye(count)).T @ chebyshev.basis(count, self._places / np.pi + 0.5))

    @cached_property
    def _places(self) -> Floats:
        return 0.5 * self.slope_angle * (_NODE + 1.0)

    @cached_property
    def _lengths(self) -> Floats:
        """Height and distance that each place contributes at the radii of the centre, shape (places, 2)."""
        lengths = 0.5 * self.slope_angle * _WEIGHT * np.exp(self.centre @ self._interpolation)
        return lengths[:, None] * np.column_stack([np.sin(self._places), np.cos(self._places)])

    def beyond_line(self, log_radius: Floats) -> Floats:
        """Return how far the anchor is above and to the right of where the linear map has it, shape (n, 2)."""
        change = (log_radius - self.centre) @ self._interpolation
        return np.asarray((np.expm1(np.minimum(change, _LARGEST)) - change) @ self._lengths)

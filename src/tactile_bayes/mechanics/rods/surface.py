"""The surface of a rod, with which it touches, beside its centreline.

A tapered rod is a cone of half angle ε. Its contact is stated by the arc length s at which the normal of its surface
meets the centreline, which is there (d/2 − s tan ε) cos ε from the object, with the diameter d at the base, and
turned by ε from the contour. To a rod without thickness this is a contour of slope angle α + ε, on which it slides with
the friction angle δ − ε: the direction α + δ of the force and the angle ψ1 = ε − δ of tangential contact follow.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats


class Surface(NamedTuple):
    """Surface of a rod; lengths in rod lengths."""

    radius: float  # half the diameter at the base
    taper: float

    @property
    def half_angle(self) -> float:
        """Half angle ε of the cone [rad]."""
        return math.atan(self.radius * self.taper)

    def friction_angle(self, delta: float) -> float:
        """Friction angle δ − ε [rad] with which the centreline touches, for that of the surface."""
        return delta - self.half_angle

    def standoff(self, arclength: Floats) -> Floats:
        """Distance from the centreline to the object at arc lengths."""
        return math.cos(self.half_angle) * self.radius - math.sin(self.half_angle) * arclength

    def on_object(self, place: Floats) -> Floats:
        """Return places on the object, shape (4, ...), from those of contacts of the centreline."""
        x, y, beside, arclength = place
        alpha, d = beside - self.half_angle, self.standoff(arclength)
        return np.stack([x - d * np.sin(alpha), y + d * np.cos(alpha), alpha, arclength])

    def slopes_on_object(self, place: Floats) -> Floats:
        """Return the derivatives of `on_object`, shape (4, 4, ...)."""
        alpha, d, closer = place[2] - self.half_angle, self.standoff(place[3]), math.sin(self.half_angle)
        one, none, sin, cos = np.ones_like(alpha), np.zeros_like(alpha), np.sin(alpha), np.cos(alpha)
        return np.array(
            [
                [one, none, -d * cos, closer * sin],
                [none, one, -d * sin, -closer * cos],
                [none, none, one, none],
                [none, none, none, one],
            ]
        )

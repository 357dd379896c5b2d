"""The certificate of convexity: the triangle of chord and tangents that holds a contour between two contacts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.base import Locus


class Triangle(NamedTuple):
    """Region of a convex contour between two of its points with known tangents, for each of n contours.

    The contour lies below the chord and above both tangents.
    """

    left: Locus
    right: Locus
    apex_x: Floats
    apex_y: Floats
    # Distance of the apex from the chord, the largest distance that the contour can have from it; shape (n,).
    height: Floats
    width: Floats  # largest extent of the triangle in y; shape (n,)

    def between(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the lowest and highest y of the contour at x, each of shape (triangles, x); NaN beyond the ends."""
        left, right = self.left, self.right
        after, before = x - left.x[:, None], x - right.x[:, None]
        inside = (after >= 0.0) & (before <= 0.0) & np.isfinite(self.height)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            chord = left.y[:, None] + after * ((right.y - left.y) / (right.x - left.x))[:, None]
        from_left = left.y[:, None] + after * np.tan(left.slope_angle)[:, None]
        from_right = right.y[:, None] + before * np.tan(right.slope_angle)[:, None]
        lower = np.minimum(np.maximum(from_left, from_right), chord)
        return np.where(inside, lower, np.nan), np.where(inside, chord, np.nan)


def triangle(left: Locus, right: Locus) -> Triangle:
    """Return the triangle between two contacts of each of n contours; NaN where the left one is not on the left.

    With the chord of length ℓ and its angles A and B to the tangents, the height is ℓ sin A sin B / sin(A + B).
    """
    across, up = right.x - left.x, right.y - left.y
    length, chord = np.hypot(across, up), np.arctan2(up, across)
    # Rounding may bend a nearly straight contour the wrong way.
    at_left = np.maximum(chord - left.slope_angle, 0.0)
    at_right = np.maximum(right.slope_angle - chord, 0.0)
    bent = at_left + at_right > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(bent, length * np.sin(at_right) / np.sin(at_left + at_right), 0.5 * length)
    open_ = across > 0.0
    along = np.where(open_, along, np.nan)
    height = along * np.sin(at_left)
    return Triangle(
        left,
        right,
        left.x + along * np.cos(left.slope_angle),
        left.y + along * np.sin(left.slope_angle),
        height,
        height / np.cos(chord),
    )

"""Where an unloaded rod lies in the object: by many points of the rod and of the contour."""

import numpy as np

import tactile_bayes as tb
from tactile_bayes.contours import Contour

_POINTS, _CELLS = 801, 1000
# Upright distance from the object up to which the distance from it is computed, of every third point.
_NEAR, _EVERY = 0.2, 3


def rest_line(rod: tb.Rod, x: float, y: float, angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centreline of the rod at rest from its base on, stem included, and half its diameter along it."""
    s = np.linspace(0.0, rod.length, _POINTS)
    middle = 0.5 * (s[1:] + s[:-1])
    curvature = rod.rest_curvature
    bent = curvature(middle) if callable(curvature) else np.full(middle.size, float(curvature))
    step = s[1] - s[0]
    at_ends = np.concatenate([[0.0], np.cumsum(bent * step)])
    slope = angle + 0.5 * (at_ends[1:] + at_ends[:-1])
    stem = rod.stem * np.linspace(0.0, 1.0, _POINTS // 4)[:-1] if rod.stem else np.empty(0)
    ahead = (
        np.concatenate([[0.0], np.cumsum(np.cos(slope) * step)]),
        np.concatenate([[0.0], np.cumsum(np.sin(slope) * step)]),
    )
    xs = x + np.concatenate([stem * np.cos(angle), rod.stem * np.cos(angle) + ahead[0]])
    ys = y + np.concatenate([stem * np.sin(angle), rod.stem * np.sin(angle) + ahead[1]])
    half = 0.5 * rod.diameter * (1.0 - rod.taper * np.concatenate([np.zeros(stem.size), s / rod.length]))
    return xs, ys, half


def depth(contour: Contour, x: np.ndarray, y: np.ndarray, half: np.ndarray | float = 0.0) -> float:
    """Greatest depth of points, with discs about them, in the object above a contour; < 0 if all are outside.

    Above the object's known part there is more of it, beside that nothing.
    """
    low, high = _domain(contour)
    inside = (x > low) & (x < high)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        above = np.where(inside, y - contour.height(np.where(inside, x, 0.5 * (low + high))), -np.inf)
    above = np.minimum(above, np.minimum(x - low, high - x))
    deepest = float(np.max(above))
    half = np.broadcast_to(half, x.shape)
    if deepest > 0.0 or not np.any(half):
        return deepest
    near = np.flatnonzero(np.minimum(above, 0.0) > -_NEAR)[::_EVERY]
    if not near.size:
        return deepest
    low, high = max(low, float(x[near].min()) - _NEAR), min(high, float(x[near].max()) + _NEAR)
    px = np.linspace(low, high, _CELLS)
    py = contour.height(px)
    known = np.isfinite(py)
    gap = np.hypot(x[near, None] - px[known], y[near, None] - py[known]).min(axis=1)
    return float(np.max(half[near] - gap))


def _domain(contour: Contour) -> tuple[float, float]:
    """Ends of what is known of a contour, in x, at most a few rod lengths away."""
    ends = []
    for end, far in zip(contour.domain, (-4.0, 4.0), strict=True):
        with np.errstate(all="ignore"):
            x = float(contour.locate(np.asarray(float(end))).x) if np.isfinite(end) else far
        ends.append(float(np.clip(x if np.isfinite(x) else far, -4.0, 4.0)))
    return ends[0], ends[1]

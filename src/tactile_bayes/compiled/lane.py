"""One contour as one rod sees it: two halves from a common vertex, in rod lengths from the pivot, swept forward."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.compiled.compiler import compiled
from tactile_bayes.contours.halves import OVAL, PARABOLA, TABLE

__all__ = ["Lane", "bearing", "end_of", "mirrored", "place"]

Floats = NDArray[np.float64]

_UPRIGHT = 0.5 * np.pi
_FAR = 1e3
"""Rod lengths beyond which an end is as good as none."""


class Lane(NamedTuple):
    """One contour as one rod sees it; one with a table is a mirror image of that if the shape of its right is −1."""

    left_kind: int
    left_size: float
    left_shape: float
    right_kind: int
    right_size: float
    right_shape: float
    x: float
    y: float
    standoff: float
    table: Floats | None


@compiled
def mirrored(lane: Lane) -> Lane:
    """As the opposite sweep sees it."""
    if lane.right_kind == TABLE:
        left, right, size = lane.right_size, lane.left_size, -lane.right_shape
        return Lane(TABLE, left, size, TABLE, right, size, -lane.x, lane.y, lane.standoff, lane.table)
    return Lane(
        lane.right_kind,
        lane.right_size,
        lane.right_shape,
        lane.left_kind,
        lane.left_size,
        lane.left_shape,
        -lane.x,
        lane.y,
        lane.standoff,
        lane.table,
    )


@compiled
def place(lane: Lane, p: float) -> tuple[float, float, float, float, float, float]:
    """Point, sine and cosine of its slope angle, and the rates of arc length and slope angle at a parameter."""
    if p < 0.0:
        kind, size, shape = lane.left_kind, lane.left_size, lane.left_shape
    else:
        kind, size, shape = lane.right_kind, lane.right_size, lane.right_shape
    if kind == PARABOLA:
        t = math.tan(p)
        square = 1.0 + t * t
        x = t / (2.0 * size)
        y = 0.5 * t * x
        root = math.sqrt(square)
        sin, cos, speed, bend = t / root, 1.0 / root, square * root / (2.0 * size), 1.0
    elif kind == OVAL:
        s, c = math.sin(p), math.cos(p)
        x, y = size * s, shape * s * s / (1.0 + c)
        square = size * size * c * c + shape * shape * s * s
        speed, bend = math.sqrt(square), size * shape / square
        sin, cos = shape * s / speed, size * c / speed
    elif kind == TABLE:
        x, y, speed = _in_table(lane.table, shape * p)
        x *= shape
        sin, cos, bend = math.sin(p), math.cos(p), 1.0
    else:
        of_offset, of_slope = max(1.0, 1.0 / (shape - 1.0)), max(1.0, shape - 1.0)
        flat, steep = abs(p) ** (of_offset - 1.0), abs(p) ** (of_slope - 1.0)
        steepness = size * shape * steep * p
        square = 1.0 + steepness * steepness
        root = math.sqrt(square)
        x, y = flat * p, size * flat * steep * p * p
        sin, cos = steepness / root, 1.0 / root
        speed, bend = of_offset * flat * root, size * shape * of_slope * steep / square
    d = lane.standoff
    return lane.x + x + d * sin, lane.y + y - d * cos, sin, cos, speed + d * bend, bend


@compiled
def _in_table(table: Floats | None, alpha: float) -> tuple[float, float, float]:
    """Point and radius of curvature at a slope angle: polynomials of fifth degree through what is known beside it."""
    if table is None:  # what is compiled for contours without one
        return math.nan, math.nan, math.nan
    cells = table.shape[0] - 1
    way = (alpha + _UPRIGHT) * (cells / (2.0 * _UPRIGHT))
    cell = min(max(int(way), 0), cells - 1)
    t = way - cell
    x, x_rate = _between(table, cell, 0, t)
    y, y_rate = _between(table, cell, 1, t)
    return x, y, (x_rate * math.cos(alpha) + y_rate * math.sin(alpha)) * (cells / (2.0 * _UPRIGHT))


@compiled
def _between(table: Floats, cell: int, axis: int, t: float) -> tuple[float, float]:
    """A coordinate and its rate, as `tactile_bayes.contours.smooth` has them."""
    start, rate, bend = table[cell, axis], table[cell, axis + 2], table[cell, axis + 4]
    rise = table[cell + 1, axis] - start - rate - 0.5 * bend
    rate_rise = table[cell + 1, axis + 2] - rate - bend
    bend_rise = table[cell + 1, axis + 4] - bend
    c = 10.0 * rise - 4.0 * rate_rise + 0.5 * bend_rise
    d = -15.0 * rise + 7.0 * rate_rise - bend_rise
    e = 6.0 * rise - 3.0 * rate_rise + 0.5 * bend_rise
    value = start + t * (rate + t * (0.5 * bend + t * (c + t * (d + t * e))))
    return value, rate + t * (bend + t * (3.0 * c + t * (4.0 * d + t * 5.0 * e)))


@compiled
def bearing(lane: Lane, p: float) -> float:
    """Direction in which the point at a parameter lies from the pivot."""
    x, y, _, _, _, _ = place(lane, p)
    return math.atan2(y, x)


@compiled
def end_of(lane: Lane, outward: float) -> float:
    """Parameter of the end on one side, brought in to just beyond the rod's reach, as `SeenContour.domain`."""
    kind = lane.left_kind if outward < 0.0 else lane.right_kind
    if kind == PARABOLA:
        end = np.nextafter(_UPRIGHT, 0.0)
    elif kind == OVAL:
        end = _UPRIGHT
    elif kind == TABLE:
        return outward * (lane.left_size if outward < 0.0 else lane.right_size)
    else:
        end = 1.0
        while not outward * place(lane, outward * end)[0] > 1.0:
            end *= 2.0
    end *= outward
    if outward * place(lane, end)[0] <= _FAR:
        return end
    return _parameter_of_x(lane, 2.0 * outward)


@compiled
def _parameter_of_x(lane: Lane, x: float) -> float:
    offset = x - lane.x
    if offset < 0.0:
        kind, size, shape = lane.left_kind, lane.left_size, lane.left_shape
    else:
        kind, size, shape = lane.right_kind, lane.right_size, lane.right_shape
    if kind == PARABOLA:
        return math.atan(2.0 * size * offset)
    if kind == OVAL:
        return math.asin(offset / size)
    return math.copysign(abs(offset) ** (1.0 / max(1.0, 1.0 / (shape - 1.0))), offset)

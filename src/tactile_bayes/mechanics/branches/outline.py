"""One contour in the sweep frame: relative to the pivot, in rod lengths, mirrored for a backward sweep.

An outline consists of two halves of families with a formula, from a common vertex, or of a table. The rod's centreline
stays half the rod's diameter outside the object, or as far as the `surface` of a tapered one says: it traces a curve
that is strictly convex too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.halves import OVAL, PARABOLA, POWER_LAW, SLOPES
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.newton import newton_step

_UPRIGHT = 0.5 * np.pi
_FAR = 1e3  # rod lengths beyond which an end of a contour does not matter
# Largest number of steps in which the parameter at an x is sought, and the last one over the range: beside it the
# contour is straight.
_MOST_STEPS, _SETTLED = 60, 1e-7


class OutlineHalf(NamedTuple):
    """One side of the vertex."""

    kind: int
    size: float
    shape: float
    unit: float  # unit of the contour's own parameter in rod lengths, for a power law; 1 for others


class Outline(NamedTuple):
    """One contour in the sweep frame; lengths in rod lengths."""

    left: OutlineHalf
    right: OutlineHalf
    low: float
    high: float  # least and greatest parameter of a table; they have no meaning without one
    sign: float  # −1 if the table is mirrored
    x: float
    y: float  # vertex
    standoff: float  # distance of the centreline at the base of the rod
    half_angle: float  # half angle ε of the cone [rad]
    narrowing: float  # distance less per arc length, sin ε
    reach: float  # lengths of rod and stem, beyond which a contour is cut
    table: Floats  # in rod lengths


class Place(NamedTuple):
    """A point of an outline."""

    x: float
    y: float
    sin: float
    cos: float  # sine and cosine of the slope angle
    speed: float  # dσ/dp ≥ 0 with the arc length σ
    bend: float  # dα/dp ≥ 0


@compiled
def mirrored(outline: Outline) -> Outline:
    """Outline in the frame of the opposite sweep."""
    left, right, low, high, sign, x, y, standoff, half_angle, narrowing, reach, table = outline
    return Outline(right, left, -high, -low, -sign, -x, y, standoff, half_angle, narrowing, reach, table)


@compiled
def from_base(outline: Outline, x: float, y: float) -> Outline:
    """Outline relative to another base."""
    left, right, low, high, sign, vertex_x, vertex_y, standoff, half_angle, narrowing, reach, table = outline
    x, y = vertex_x - x, vertex_y - y
    return Outline(left, right, low, high, sign, x, y, standoff, half_angle, narrowing, reach, table)


@compiled
def place(outline: Outline, p: float) -> Place:
    """Point at a parameter, beside which the base of the rod would lie."""
    kind, size, shape, unit = outline.left if p < 0.0 else outline.right
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
    elif kind == POWER_LAW:
        p /= unit
        of_offset, of_slope = max(1.0, 1.0 / (shape - 1.0)), max(1.0, shape - 1.0)
        flat, steep = abs(p) ** (of_offset - 1.0), abs(p) ** (of_slope - 1.0)
        steepness = size * shape * steep * p
        square = 1.0 + steepness * steepness
        root = math.sqrt(square)
        x, y = flat * p, size * flat * steep * p * p
        sin, cos = steepness / root, 1.0 / root
        speed, bend = of_offset * flat * root / unit, size * shape * of_slope * steep / square / unit
    elif kind == SLOPES:
        x, y, speed = _by_slope(outline.table, outline.sign * p)
        x *= outline.sign
        sin, cos, bend = math.sin(p), math.cos(p), 1.0
    else:
        x, y, alpha, speed, bend = _by_cell(outline.table, outline.sign * p)
        x *= outline.sign
        sin, cos = math.sin(outline.sign * alpha), math.cos(alpha)
    d = outline.standoff
    return Place(outline.x + x + d * sin, outline.y + y - d * cos, sin, cos, speed + d * bend, bend)


@compiled
def further(at: Place, way: float) -> Place:
    """Point that has moved into the object, along its normal."""
    return Place(at.x - way * at.sin, at.y + way * at.cos, at.sin, at.cos, at.speed - way * at.bend, at.bend)


@compiled
def narrower(outline: Outline, at: Place, arclength: float) -> Place:
    """Point beside which the rod lies with an arc length, from that of its base."""
    return further(at, outline.narrowing * arclength)


@compiled
def beside(outline: Outline, p: float, arclength: float) -> Place:
    """Point beside which the rod lies with an arc length, at a parameter."""
    return narrower(outline, place(outline, p), arclength)


@compiled
def on_object(outline: Outline, at: Place) -> tuple[float, float]:
    """Point of the object itself, from that of the base."""
    return at.x - outline.standoff * at.sin, at.y + outline.standoff * at.cos


@compiled
def _by_slope(table: Floats, alpha: float) -> tuple[float, float, float]:
    """Point and radius of curvature at a slope angle, by polynomials of fifth degree between the rows of the table."""
    cells = table.shape[0] - 1
    way = (alpha + _UPRIGHT) * (cells / (2.0 * _UPRIGHT))
    cell = min(max(int(way), 0), cells - 1)
    t = way - cell
    x, x_rate = _between(table, cell, 0, t)
    y, y_rate = _between(table, cell, 1, t)
    return x, y, (x_rate * math.cos(alpha) + y_rate * math.sin(alpha)) * (cells / (2.0 * _UPRIGHT))


@compiled
def _between(table: Floats, cell: int, axis: int, t: float) -> tuple[float, float]:
    """Coordinate and its rate, as in `tactile_bayes.contours.smooth`."""
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
def _by_cell(table: Floats, p: float) -> tuple[float, float, float, float, float]:
    """Point, slope angle, and rates of arc length and slope angle, by Chebyshev series in the contour's own parameter.
    A row holds the beginning and the end of its cell, and the coefficients of x, y and slope angle."""
    first, last = 0, table.shape[0] - 1
    while first < last:
        middle = (first + last + 1) // 2
        if table[middle, 0] <= p:
            first = middle
        else:
            last = middle - 1
    begin, end = table[first, 0], table[first, 1]
    size = (table.shape[1] - 2) // 3
    twice = 4.0 * min(max((p - begin) / (end - begin), 0.0), 1.0) - 2.0
    # The recurrence of U runs one step behind that of T: the derivative of T_k is k U_(k−1).
    t_before, t = 1.0, 0.5 * twice
    u_before, u = 0.0, 1.0
    x, y, alpha = table[first, 2], table[first, 2 + size], table[first, 2 + 2 * size]
    x_rate, y_rate, alpha_rate = 0.0, 0.0, 0.0
    for k in range(1, size):
        a, b, c = table[first, 2 + k], table[first, 2 + size + k], table[first, 2 + 2 * size + k]
        x, y, alpha = x + a * t, y + b * t, alpha + c * t
        ku = k * u
        x_rate, y_rate, alpha_rate = x_rate + a * ku, y_rate + b * ku, alpha_rate + c * ku
        t_before, t = t, twice * t - t_before
        u_before, u = u, twice * u - u_before
    scale = 2.0 / (end - begin)
    speed = (x_rate * math.cos(alpha) + y_rate * math.sin(alpha)) * scale
    return x, y, alpha, max(speed, 0.0), max(alpha_rate * scale, 0.0)


@compiled
def frame(at: Place) -> tuple[float, float]:
    """Components along the contour and into the object of the vector from the pivot to a point."""
    return at.x * at.cos + at.y * at.sin, at.y * at.cos - at.x * at.sin


@compiled
def bearing(at: Place) -> float:
    """Direction from the pivot to a point, continuous where it is above the pivot or beside it [rad]."""
    return math.atan2(-at.x, at.y) + _UPRIGHT


@compiled
def is_inside(outline: Outline, arclength: float, x: float, y: float, ends: tuple[float, float]) -> bool:
    """True if the rod at an arc length is within the object as far as it is known: between contour and chord of two of
    its points."""
    low, high = ends
    left, right = beside(outline, low, arclength), beside(outline, high, arclength)
    if not (left.x < x < right.x and (y - left.y) * (right.x - left.x) < (x - left.x) * (right.y - left.y)):
        return False
    at = over(outline, arclength, x, low, high)
    return (y - at.y) * at.cos > (x - at.x) * at.sin


@compiled
def over(outline: Outline, arclength: float, x: float, low: float, high: float) -> Place:
    """Point beside which the rod lies with an arc length, at an x between those of two parameters."""
    p, before = 0.5 * (low + high), high - low
    settled = _SETTLED * before
    for _ in range(_MOST_STEPS):
        at = beside(outline, p, arclength)
        new, low, high, before = newton_step(p, x - at.x, -at.speed * at.cos, low, high, before)
        step, p = abs(new - p), new
        if not step > settled:
            break
    return beside(outline, p, arclength)


@compiled
def ends(outline: Outline) -> tuple[float, float]:
    """Least and greatest parameter. Where the outline has no end, or one so far away that rounding hides its direction,
    it is cut just beyond the rod's reach."""
    return _end(outline, -1.0), _end(outline, 1.0)


@compiled
def _end(outline: Outline, outward: float) -> float:
    half = outline.left if outward < 0.0 else outline.right
    if half.kind == PARABOLA:
        end = outward * np.nextafter(_UPRIGHT, 0.0)
    elif half.kind == OVAL:
        end = outward * _UPRIGHT
    elif half.kind == POWER_LAW:
        end = outward * half.unit
        while not outward * place(outline, end).x > outline.reach:
            end *= 2.0
    else:
        return outline.low if outward < 0.0 else outline.high
    if outward * place(outline, end).x <= _FAR:
        return end
    return _parameter_of_x(outline, 2.0 * outward)


@compiled
def _parameter_of_x(outline: Outline, x: float) -> float:
    offset = x - outline.x
    half = outline.left if offset < 0.0 else outline.right
    if half.kind == PARABOLA:
        return math.atan(2.0 * half.size * offset)
    if half.kind == OVAL:
        return math.asin(offset / half.size)
    return math.copysign(half.unit * abs(offset) ** (1.0 / max(1.0, 1.0 / (half.shape - 1.0))), offset)

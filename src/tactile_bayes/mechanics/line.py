"""Straight parts of a drive that carries the base: it moves along a line, and turns with it at a constant rate.

Poses of the base are points (x, y, drive angle) in space, with lengths in rod lengths and angles in rad, and a part of
a drive is a line in it. A state is on the line if two components across it vanish. The third is the travel. A rotation
about a pivot that rests is the line along the drive angle; it needs no such line, for its travel is the angle itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import compiled

__all__ = ["LINE_COLUMNS", "NO_LINE", "Line", "Offset", "components", "drive_angle_at", "line_at", "line_of", "lines_through", "off_line", "pose_at"]

LINE_COLUMNS = 8
"""Columns of a line in an array: its beginning (x, y, drive angle), its direction, and travel at beginning and end."""


class Offset(NamedTuple):
    """A pose of the base from another, or a direction in the space of poses."""

    x: float
    y: float
    angle: float


class Line(NamedTuple):
    """A straight part of a drive, in the sweep frame and in rod lengths."""

    begin: Offset
    along: Offset
    """Direction of the drive, of length one."""
    across: Offset
    other: Offset
    """Directions of length one across it and each other."""
    travel: float
    """Travel at its beginning."""
    end: float
    """Travel at its end."""


_ORIGIN = Offset(0.0, 0.0, 0.0)
NO_LINE = Line(_ORIGIN, _ORIGIN, _ORIGIN, _ORIGIN, 0.0, 0.0)


def lines_through(poses: Floats, length: float) -> Floats:
    """Return the lines between consecutive poses of the base, those that continue each other put together.

    Parameters
    ----------
    poses : ndarray, shape (n, 3)
        Positions [length] and drive angles [rad] of the base, of which no two in succession are the same.
    length : float
        Length of the rod.

    Returns
    -------
    ndarray, shape (lines, `LINE_COLUMNS`)
        Lines from the first pose, with lengths in rod lengths.
    """
    scaled = np.asarray(poses, dtype=float) / np.array([length, length, 1.0])
    steps = np.diff(scaled, axis=0)
    ways = np.linalg.norm(steps, axis=1)
    along = steps / ways[:, None]
    bends = np.flatnonzero(np.linalg.norm(np.diff(along, axis=0), axis=1) > _STRAIGHT) + 1
    travel = np.append(0.0, np.cumsum(ways))
    first, last = np.append(0, bends), np.append(bends, ways.size)
    direction = scaled[last] - scaled[first]
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    start = scaled[first] - np.array([*scaled[0, :2], 0.0])
    return np.column_stack([start, direction, travel[first], travel[last]])


_STRAIGHT = 1e-9
"""Change of direction that is rounding."""


@compiled
def line_of(lines: Floats, k: int) -> Line:
    """Line in a row of an array."""
    row = lines[k]
    begin, along = Offset(row[0], row[1], row[2]), Offset(row[3], row[4], row[5])
    level = math.hypot(along.x, along.y)
    across = Offset(-along.y / level, along.x / level, 0.0) if level > 0.0 else Offset(1.0, 0.0, 0.0)
    other = Offset(
        along.y * across.angle - along.angle * across.y,
        along.angle * across.x - along.x * across.angle,
        along.x * across.y - along.y * across.x,
    )
    return Line(begin, along, across, other, row[6], row[7])


@compiled
def line_at(lines: Floats, travel: float) -> int:
    """Number of the line at a travel."""
    k = 0
    while k + 1 < lines.shape[0] and lines[k + 1, 6] <= travel:
        k += 1
    return k


@compiled
def off_line(line: Line, x: float, y: float, angle: float) -> Offset:
    """Components of a pose across the line, and its travel in place of the angle."""
    x, y, angle = x - line.begin.x, y - line.begin.y, angle - line.begin.angle
    return Offset(
        _component(line.across, x, y, angle),
        _component(line.other, x, y, angle),
        line.travel + _component(line.along, x, y, angle),
    )


@compiled
def components(line: Line, x: float, y: float, angle: float) -> Offset:
    """Components of a direction across the line, and along it in place of the angle."""
    return Offset(
        _component(line.across, x, y, angle),
        _component(line.other, x, y, angle),
        _component(line.along, x, y, angle),
    )


@compiled
def _component(direction: Offset, x: float, y: float, angle: float) -> float:
    return direction.x * x + direction.y * y + direction.angle * angle


@compiled
def pose_at(line: Line, travel: float) -> Offset:
    """Pose of the base at a travel."""
    way = travel - line.travel
    begin, along = line.begin, line.along
    return Offset(begin.x + way * along.x, begin.y + way * along.y, begin.angle + way * along.angle)


@compiled
def drive_angle_at(line: Line | None, travel: float) -> float:
    """Drive angle at a travel, which is the angle itself in a rotation."""
    if line is None:
        return travel
    return line.begin.angle + (travel - line.travel) * line.along.angle

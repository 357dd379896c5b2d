"""Straight parts of a drive that carries the base: it moves along a line, and turns with it at a constant rate.

Poses of the base are points (x, y, drive angle) in space, with lengths in rod lengths and angles in rad, and a part of
a drive is a line in it. A state is on the line if two components across it vanish. The third is the travel. A rotation
about a pivot that rests is the line along the drive angle, which has no end: its travel is the angle itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.mechanics.compiler import compiled

# Columns of a line in an array: its beginning (x, y, drive angle), the change of these with the travel, and travel at
# beginning and end.
LINE_COLUMNS = 8


class Offset(NamedTuple):
    """A pose of the base from another, or a direction in the space of poses."""

    x: float
    y: float
    angle: float


class Line(NamedTuple):
    """A straight part of a drive, in the sweep frame and in rod lengths."""

    begin: Offset
    along: Offset  # change of the pose with the travel
    onward: Offset  # change of the travel with the pose
    across: Offset
    other: Offset  # directions across the line and each other
    travel: float  # travel at its beginning
    end: float  # travel at its end


_STRAIGHT = 1e-9  # distance from a line that is rounding [L and rad]
_ORIGIN = Offset(0.0, 0.0, 0.0)
NO_LINES = np.empty((0, 0, LINE_COLUMNS))  # of sweeps about pivots that rest
_TURN = Offset(0.0, 0.0, 1.0)
ROTATION = Line(_ORIGIN, _TURN, _TURN, Offset(1.0, 0.0, 0.0), Offset(0.0, 1.0, 0.0), 0.0, math.inf)


class LinePath(NamedTuple):
    """A drive that carries the base, in the sweep frame and in rod lengths, from its first pose."""

    lines: Floats  # shape (lines, `LINE_COLUMNS`)
    travels: Floats  # travel at each pose, shape (n,)


def lines_through(poses: Floats, length: float, *, backward: bool = False, off: float = _STRAIGHT) -> LinePath:
    """Return the lines between consecutive poses of the base, those that continue each other put together. Poses are
    positions [length] and drive angles [rad] in the laboratory frame, shape (n, 3), of which at least two differ; `off`
    is the distance from its line [L and rad] up to which a pose lies on it. If `backward`, the sweep frame is the
    mirror image."""
    own = np.array(poses, dtype=float)
    own[:, :2] = (own[:, :2] - own[0, :2]) / length
    if backward:
        own[:, 0], own[:, 2] = -own[:, 0], np.pi - own[:, 2]
    # Drive angles as equilibria have them: a rod that points away from the object never touches it.
    own[:, 2] -= 2.0 * np.pi * np.floor((own[0, 2] + 0.5 * np.pi) / (2.0 * np.pi))
    corners = _corners(own, off)
    steps = np.diff(own[corners], axis=0)
    ways = np.linalg.norm(steps, axis=1)
    ends = np.append(0.0, np.cumsum(ways))
    along = steps / ways[:, None]
    lines = np.column_stack([own[corners[:-1]], along, ends[:-1], ends[1:]])
    on = np.searchsorted(corners, np.arange(len(own)), side="right") - 1
    on = np.minimum(on, len(lines) - 1)
    travels = ends[on] + np.einsum("ij,ij->i", own - own[corners[on]], along[on])
    lines[-1, 7] += _STRAIGHT  # rounding does not hide the last pose
    return LinePath(lines, travels)


def turned_in(path: LinePath) -> LinePath:
    """Return a drive with a first line, up to no travel, that turns the rod into its first pose."""
    before = path.lines[:1].copy()
    before[0, 2] -= np.pi
    before[0, 3:] = 0.0, 0.0, 1.0, -np.pi, 0.0
    return LinePath(np.concatenate([before, path.lines]), path.travels)


def _corners(points: Floats, off: float) -> Index:
    """Indices of the points between which a path is straight, by the method of Ramer, Douglas and Peucker. A path that
    goes back on its line has a corner where it turns."""
    corners, parts = {0, len(points) - 1}, [(0, len(points) - 1)]
    while parts:
        first, last = parts.pop()
        chord = points[last] - points[first]
        way = float(np.linalg.norm(chord))
        inside = points[first + 1 : last] - points[first]
        share = np.clip(inside @ chord / way**2, 0.0, 1.0) if way > 0.0 else np.zeros(len(inside))
        away = np.linalg.norm(inside - share[:, None] * chord, axis=1)
        back = way * (np.maximum.accumulate(share) - share)
        corner = None
        if away.size and away.max() > off:
            corner = first + 1 + int(np.argmax(away))
        elif back.size and back.max() > off:
            corner = first + 1 + int(np.argmax(share[: int(np.argmax(back))]))
        if corner is not None:
            corners.add(corner)
            parts += [(first, corner), (corner, last)]
    return np.array(sorted(corners))


@compiled
def line_of(lines: Floats, k: int) -> Line:
    """Line in a row of an array, whose direction may have any length: the travel is in its unit."""
    row = lines[k]
    begin, along = Offset(row[0], row[1], row[2]), Offset(row[3], row[4], row[5])
    level = math.hypot(along.x, along.y)
    square = level * level + along.angle * along.angle
    onward = Offset(along.x / square, along.y / square, along.angle / square)
    across = Offset(-along.y / level, along.x / level, 0.0) if level > 0.0 else Offset(1.0, 0.0, 0.0)
    other = Offset(
        along.y * across.angle - along.angle * across.y,
        along.angle * across.x - along.x * across.angle,
        along.x * across.y - along.y * across.x,
    )
    return Line(begin, along, onward, across, other, row[6], row[7])


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
    begin = line.begin
    off = components(line, x - begin.x, y - begin.y, angle - begin.angle)
    return Offset(off.x, off.y, line.travel + off.angle)


@compiled
def components(line: Line, x: float, y: float, angle: float) -> Offset:
    """Components of a direction across the line, and along it in place of the angle."""
    return Offset(
        _component(line.across, x, y, angle),
        _component(line.other, x, y, angle),
        _component(line.onward, x, y, angle),
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
def pivots(lines: Floats) -> bool:
    """True if no lines carry the base: it turns about a pivot that rests."""
    return lines.shape[0] == 0


@compiled
def is_rotation(line: Line) -> bool:
    """True for a rotation about a pivot that rests."""
    return line.end == math.inf


@compiled
def is_before_record(line: Line, travel: float) -> bool:
    """True for a travel on the line that turns a rod in."""
    return line.end <= 0.0 and travel < line.end


@compiled
def drive_angle_at(line: Line, travel: float) -> float:
    """Drive angle at a travel, which is the angle itself in a rotation."""
    return line.begin.angle + (travel - line.travel) * line.along.angle

"""Clearance: how deep an unloaded rod lies in the object, and where a drive carries it into the object."""

from __future__ import annotations

import math
from typing import NamedTuple

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.branches.line import Line, Offset, line_at, line_of, pose_at
from tactile_bayes.mechanics.branches.outline import Outline, beside, ends, from_base, over
from tactile_bayes.mechanics.compiler import compiled
from tactile_bayes.mechanics.newton import golden
from tactile_bayes.mechanics.poses.beam import Beam, rest_point

# Parts of stem and rod at whose ends depths are compared, and steps of the search between them.
_PARTS, _SHRINKS = 16, 24
# Depth [L] of a rod that has just been released, which errors of exact events and of others may cause.
_DEEP, _DEEP_IN_FAST = 1e-6, 1e-5
_STEP, _SHARE = 2e-3, 0.5  # least way of the rod [L] between two looks, and the way over its distance from the object
_HALVINGS = 40


class _Unloaded(NamedTuple):
    """An unloaded rod in a pose, and the outline relative to its base between two parameters."""

    outline: Outline
    beam: Beam
    cos: float
    sin: float
    low: float
    high: float


class _Depth(NamedTuple):
    """Depth of a point of the rod in the object; beside what is known of the object, minus the distance from that."""

    upright: float  # measured upright: concave along a straight rod, since the object is convex
    across: float  # measured across the contour


@compiled
def travel_into(outline: Outline, beam: Beam, lines: Floats, travel: float, wholly: bool) -> float:
    """Travel, from a given one on, at which an unloaded rod lies in the object; −∞ if it does so nowhere. Unless it is
    wholly looked for, this is done there and at the ends of the lines only."""
    k, deep = line_at(lines, travel), _DEEP if wholly else _DEEP_IN_FAST
    depth = _depth(outline, beam, pose_at(line_of(lines, k), travel))
    if depth > deep:
        return travel
    while k < lines.shape[0] and not math.isnan(lines[k, 0]):
        line = line_of(lines, k)
        speed = math.hypot(line.along.x, line.along.y) + (1.0 + beam.stem) * abs(line.along.angle)
        while travel < line.end:
            step = max(_STEP, -_SHARE * depth) / speed
            ahead = min(travel + step, line.end) if wholly else line.end
            depth = _depth(outline, beam, pose_at(line, ahead))
            if depth > deep:
                return _between(outline, beam, line, travel, ahead, deep)
            travel = ahead
        k += 1
    return -math.inf


@compiled
def _between(outline: Outline, beam: Beam, line: Line, clear: float, inside: float, deep: float) -> float:
    """Travel at which a rod comes into the object."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (clear + inside)
        if _depth(outline, beam, pose_at(line, middle)) > deep:
            inside = middle
        else:
            clear = middle
    return inside


@compiled
def _depth(outline: Outline, beam: Beam, pose: Offset) -> float:
    """Greatest depth of an unloaded rod in the object [L]: its distance from it, if negative."""
    seen = from_base(outline, pose.x, pose.y)
    low, high = ends(seen)
    rod = _Unloaded(seen, beam, math.cos(pose.angle), math.sin(pose.angle), low, high)
    size = (1.0 + beam.stem) / _PARTS
    best, at = _depth_at(rod, 0.0), 0.0
    for k in range(1, _PARTS + 1):
        found = _depth_at(rod, k * size)
        if found.upright > best.upright:
            best, at = found, k * size
    low, high = max(at - size, 0.0), min(at + size, 1.0 + beam.stem)
    for _ in range(_SHRINKS):
        left, right = golden(low, high)
        of_left, of_right = _depth_at(rod, left), _depth_at(rod, right)
        if of_left.upright > of_right.upright:
            high, found = right, of_left
        else:
            low, found = left, of_right
        if found.upright > best.upright:
            best = found
    return best.across


@compiled
def _depth_at(rod: _Unloaded, way: float) -> _Depth:
    """Depth of a point of stem or rod, at a way from the pivot."""
    along, aside = rest_point(rod.beam, way)
    x, y = along * rod.cos - aside * rod.sin, along * rod.sin + aside * rod.cos
    outline, arclength = rod.outline, max(way - rod.beam.stem, 0.0)
    beyond = max(beside(outline, rod.low, arclength).x - x, x - beside(outline, rod.high, arclength).x)
    if not beyond < 0.0:
        return _Depth(-beyond, -beyond)
    at = over(outline, arclength, x, rod.low, rod.high)
    across = (y - at.y) * at.cos - (x - at.x) * at.sin
    return _Depth(min(across / at.cos, -beyond), min(across, -beyond))

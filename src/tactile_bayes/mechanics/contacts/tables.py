"""Chebyshev tables of first guesses for the two maps of a straight rod in contact, from the position of its ends.

In tangential contact they are series in the angle of the chord to the contour's tangent, as a share of the largest
angle, and in the friction angle. In tip contact they are series in polar coordinates of (chord angle, chord deficit):
the polar angle, and the radius as a share of the largest radius. Factors that vanish at first contact are divided out.
Cells become smaller toward the folds of the maps, so that few terms suffice everywhere: errors are some 5e-8. They are
computed once a process, from exact arcs, in a few milliseconds.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.mechanics.compiler import cached, compiled
from tactile_bayes.mechanics.poses.arc import arc_to, chord_deficit, chord_direction
from tactile_bayes.mechanics.poses.chord import tangential_arc, tip_arc
from tactile_bayes.numerics import chebyshev

# Largest friction angle of the tables [rad]: nearer to the fold of the map the series would be longer.
MOST_FRICTION = 0.58
_TERMS = 10  # terms of each series in a cell of tip contact, in angle and in share
# Ends of the cells of tip contact, as shares of the right angle.
_ANGLES = np.array([0.0, 0.1, 0.25, 0.45, 0.6, 0.75, 0.9, 1.0])
# Ends of the cells of tip contact, as shares of the largest radius.
_SHARES = np.array([0.0, 0.5, 0.75, 0.9, 0.97, 0.993, 1.0])
_TANGENTIAL_TERMS = 12, 20  # terms of a cell in tangential contact, in the angle and in the friction angle
# Ends of the cells of tangential contact, as shares of the largest angle.
_LEVELS = np.array([0.0, 0.45, 0.65, 0.82, 1.0])
_MARGIN = 0.02  # excess of the largest ε1 of the tables over ε1 of tangential contact [rad]
_CHI_MAX = 3.2


class Tables(NamedTuple):
    """Coefficients of all tables."""

    tangential: Floats  # χ² over the angle in tangential contact, shape (friction angles, cells, terms)
    radius: Floats  # largest radius in tip contact in the angle, shape (angles, terms)
    # χ² over the angle and ε1 over the share in tip contact, side by side, for one loop over both, shape (angles,
    # shares, terms in the share, 2 · terms in the angle).
    tip: Floats


class Workspace(NamedTuple):
    """Workspace for one state, with the series for one friction angle."""

    tangential: Floats  # series of tangential contact in the angle, shape (cells, terms)
    by_angle: Floats
    by_share: Floats
    row: Floats  # two series in the angle, one after the other


def workspace() -> Workspace:
    (by_angle, by_share), tangential = np.empty((2, _TERMS)), np.empty((_LEVELS.size - 1, _TANGENTIAL_TERMS[0]))
    return Workspace(tangential, by_angle, by_share, np.empty(max(2 * _TERMS, _TANGENTIAL_TERMS[1])))


@functools.cache
def tables() -> Tables:
    """Tables for any friction angle up to `MOST_FRICTION`."""
    angles, shares = _in_cells(_ANGLES, _TERMS), _in_cells(_SHARES, _TERMS)
    levels = _in_cells(_LEVELS, _TANGENTIAL_TERMS[0])
    radius, tip = np.empty(angles.size), np.empty((2, angles.size, shares.size))
    _tabulate_tip(0.5 * np.pi * angles.ravel(), shares.ravel(), 0.5 * np.pi + _MARGIN + MOST_FRICTION, radius, tip)
    by_share = chebyshev.coefficients(tip.reshape(2, *angles.shape, *shares.shape))
    by_both = chebyshev.coefficients(by_share.swapaxes(-1, -2)).transpose(3, 4, 1, 2, 0)
    tangential = np.empty((levels.size, _TANGENTIAL_TERMS[1]))
    _tabulate_tangential(levels.ravel(), MOST_FRICTION * chebyshev.nodes(_TANGENTIAL_TERMS[1]), tangential)
    by_friction = chebyshev.coefficients(tangential.reshape(*levels.shape, -1))
    return Tables(
        tangential=np.ascontiguousarray(chebyshev.coefficients(by_friction).transpose(1, 2, 0)),
        radius=np.ascontiguousarray(chebyshev.coefficients(radius.reshape(angles.shape)).T),
        tip=by_both.reshape(*by_both.shape[:3], -1),
    )


def _in_cells(ends: Floats, terms: int) -> Floats:
    """Nodes in every cell, shape (cells, terms)."""
    return np.asarray(ends[:-1, None] + np.diff(ends)[:, None] * chebyshev.nodes(terms))


@cached
def _tabulate_tangential(levels: Floats, deltas: Floats, out: Floats) -> None:
    for j in range(deltas.size):
        m, largest = 0.5 * (1.0 + math.sin(deltas[j])), 0.5 * math.pi + deltas[j]
        for i in range(levels.size):
            angle = levels[i] * largest
            guess = min(math.sqrt(3.0 * angle / math.sqrt(m * (1.0 - m))), math.pi)
            out[i, j] = tangential_arc(angle, m, guess)[0] ** 2 / angle


@cached
def _tabulate_tip(angles: Floats, shares: Floats, largest: float, radius: Floats, out: Floats) -> None:
    """Write the largest radius at every angle, at the largest ε1, and the tabulated quantities, shape (2, angles,
    shares)."""
    m = math.sin(0.5 * largest) ** 2
    for i in range(angles.size):
        low, high = 0.0, _CHI_MAX
        for _ in range(60):
            chi = 0.5 * (low + high)
            arc, _ = arc_to(chi, m)
            deficit, chord_angle = chord_deficit(arc), largest - chord_direction(arc)
            if math.atan2(deficit, chord_angle) > angles[i]:
                high = chi
            else:
                low = chi
        radius[i] = math.hypot(deficit, chord_angle)
        chi, epsilon1 = low, largest
        for j in range(shares.size - 1, -1, -1):
            deficit = math.sin(angles[i]) * radius[i] * shares[j]
            chord_angle = math.cos(angles[i]) * radius[i] * shares[j]
            chi, epsilon1, _, _, _ = tip_arc(deficit, chord_angle, chi, epsilon1)
            out[0, i, j], out[1, i, j] = chi * chi / angles[i], epsilon1 / shares[j]


@compiled
def prepare(known: Tables, friction_angle: float, workspace: Workspace) -> None:
    """Write the series of tangential contact at a friction angle to the workspace."""
    frictions = known.tangential.shape[0]
    _polynomials(min(friction_angle / MOST_FRICTION, 1.0), frictions, workspace.row)
    workspace.tangential[:] = 0.0
    for j in range(frictions):
        weight = workspace.row[j]
        for c in range(workspace.tangential.shape[0]):
            for i in range(workspace.tangential.shape[1]):
                workspace.tangential[c, i] += weight * known.tangential[j, c, i]


@compiled
def _cell(ends: Floats, z: float) -> tuple[int, float]:
    """Index of the cell of a number, and its position in the cell."""
    cell = 0
    for k in range(1, ends.size - 1):
        cell += z > ends[k]
    return cell, (z - ends[cell]) / (ends[cell + 1] - ends[cell])


@compiled
def series(workspace: Workspace, level: float) -> float:
    """χ² over the angle in tangential contact at a share of the largest angle, by Clenshaw's recurrence."""
    cell, z = _cell(_LEVELS, level)
    twice = 4.0 * z - 2.0
    now, before = 0.0, 0.0
    for i in range(workspace.tangential.shape[1] - 1, 0, -1):
        now, before = (workspace.tangential[cell, i] - before) + twice * now, now
    return (workspace.tangential[cell, 0] - before) + 0.5 * twice * now


@compiled
def _polynomials(z: float, size: int, out: Floats) -> None:
    twice = 4.0 * z - 2.0
    out[0] = 1.0
    out[1] = 0.5 * twice
    for k in range(2, size):
        out[k] = twice * out[k - 1] - out[k - 2]


@compiled
def in_polar(
    known: Tables, deficit: float, chord_angle: float, workspace: Workspace
) -> tuple[float, float, float, float]:
    """Polar angle, share of the largest radius, and χ² over the angle and ε1 over the share there."""
    terms = _TERMS
    angle = math.atan2(deficit, chord_angle)
    i, z = _cell(_ANGLES, angle / (0.5 * math.pi))
    _polynomials(z, terms, workspace.by_angle)
    largest = 0.0
    for a in range(terms):
        largest += known.radius[i, a] * workspace.by_angle[a]
    share = min(math.sqrt(deficit * deficit + chord_angle * chord_angle) / largest, 1.0)
    j, z = _cell(_SHARES, share)
    _polynomials(z, terms, workspace.by_share)
    for a in range(2 * terms):
        workspace.row[a] = 0.0
    for s in range(terms):
        weight = workspace.by_share[s]
        for a in range(2 * terms):
            workspace.row[a] += weight * known.tip[i, j, s, a]
    one, other = 0.0, 0.0
    for a in range(terms):
        one += workspace.row[a] * workspace.by_angle[a]
        other += workspace.row[terms + a] * workspace.by_angle[a]
    return angle, share, one, other

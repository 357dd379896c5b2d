"""Poses of arcs against the rod's differential equations, integrated, and their derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.compiled_calls import by_number
from helpers.profiled_rods import integrated_pose, rod_along
from tactile_bayes.mechanics.compiler import cached
from tactile_bayes.mechanics.poses import pose as compiled_pose

_pose, _pose_and_slopes = compiled_pose.pose, compiled_pose.pose_and_slopes


@cached
def _values(rows, out):
    for i in range(len(rows)):
        out[i, 0], out[i, 1], out[i, 2] = _pose(rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3])


@cached
def _slopes(rows, out):
    for i in range(len(rows)):
        row = rows[i]
        for k, part in enumerate(_pose_and_slopes(row[0], row[1], row[2], row[3], row[4] > 0.0)):
            out[i, 3 * k], out[i, 3 * k + 1], out[i, 3 * k + 2] = part


def drawn(count=120):
    """Angles at the contact, arc lengths, forces and rest curvatures: without force, without curvature, m about 1."""
    rng = np.random.default_rng(4)
    psi1, arclength = rng.uniform(-0.7, 1.57, count), rng.uniform(0.05, 1.0, count)
    force = rng.uniform(0.0, 3.5, count) ** 2 * rng.choice([0.0, 1e-9, 1.0], count, p=[0.1, 0.1, 0.8])
    curvature = rng.uniform(-3.0, 3.0, count) * rng.choice([0.0, 1e-6, 1.0], count, p=[0.1, 0.1, 0.8])
    # The parameter of Legendre's integrals is (1 − sin ψ1)/2 + κ0²/(4 f).
    some = slice(0, count, 8)
    force[some] = curvature[some] ** 2 / (2.0 * (1.0 + np.sin(psi1[some])))
    return psi1, arclength, force, curvature


def test_a_bent_arc_is_the_integrated_one():
    """To the tolerance of the integration: m from 0.1 to beyond every bound."""
    columns = drawn()
    found = by_number(_values, 3)(*columns)
    expected = np.array([integrated_pose(rod_along(bent, 1.0, 0.0), *row) for *row, bent in zip(*columns, strict=True)])
    np.testing.assert_allclose(found, expected, rtol=0, atol=3e-12)


def test_an_arc_without_force_is_an_arc():
    psi1, arclength, _, curvature = drawn()
    u, v, turn = by_number(_values, 3)(psi1, arclength, 0.0, curvature).T
    np.testing.assert_allclose(turn, -curvature * arclength, atol=1e-14)
    half = 0.5 * curvature * arclength
    chord = arclength * np.sinc(half / np.pi)
    np.testing.assert_allclose(u, chord * np.cos(psi1 - half), atol=1e-14)
    np.testing.assert_allclose(v, chord * np.sin(psi1 - half), atol=1e-14)


@pytest.mark.parametrize(("tip", "number"), [(1.0, 0), (0.0, 1)], ids=["tip", "tangential"])
def test_slopes_are_those_of_differences(tip, number):
    columns = drawn()
    found = by_number(_slopes, 9)(*columns, tip)
    np.testing.assert_allclose(found[:, :3], by_number(_values, 3)(*columns), atol=1e-13)
    step = 1e-5
    for first, k in ((3, number), (6, 2)):
        ends = []
        for sign in (1.0, -1.0):
            moved = [np.array(column) for column in columns]
            moved[k] = np.maximum(moved[k] + sign * step, 0.0) if k == 2 else moved[k] + sign * step
            ends.append((by_number(_values, 3)(*moved), moved[k]))
        (after, high), (before, low) = ends
        inside = low > 0.0 if k == 2 else np.ones(low.size, dtype=bool)  # a force has no negative side
        slope = (after - before) / (high - low)[:, None]
        np.testing.assert_allclose(found[inside, first : first + 3], slope[inside], atol=3e-9)

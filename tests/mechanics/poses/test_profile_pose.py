"""Poses of rods of any rest curvature and rigidity against integration, closed forms and one another."""

from __future__ import annotations

import math

import numpy as np
import pytest

from helpers.profiled_rods import RodAlong, drawn_rods, integrated_pose
from tactile_bayes.mechanics.compiler import cached
from tactile_bayes.mechanics.poses import pose as closed
from tactile_bayes.mechanics.poses import profile_pose, taylor
from tactile_bayes.mechanics.poses.taylor import workspace
from tactile_bayes.mechanics.rods.profile import profile_of

_closed_and_slopes = closed.pose_and_slopes
_pose, _pose_and_slopes = profile_pose.pose_along, profile_pose.pose_along_and_slopes

RODS = drawn_rods()
WORK = workspace()


@cached
def _values(profile, psi1, arclength, force, work, out):
    for i in range(psi1.size):
        out[i, 0], out[i, 1], out[i, 2] = _pose(profile, psi1[i], arclength[i], force[i], work)


@cached
def _slopes(profile, psi1, arclength, force, work, out):
    for i in range(psi1.size):
        for k, pose in enumerate(_pose_and_slopes(profile, psi1[i], arclength[i], force[i], work, taylor.EXACT)):
            out[i, k, 0], out[i, k, 1], out[i, k, 2] = pose


@cached
def _arcs(psi1, arclength, force, curvature, out):
    for i in range(psi1.size):
        for tip in range(2):
            slopes = _closed_and_slopes(psi1[i], arclength[i], force[i], curvature, tip == 1)
            for k in range(3):
                out[i, (0, 1 if tip else 2, 3)[k], 0] = slopes[k].u
                out[i, (0, 1 if tip else 2, 3)[k], 1] = slopes[k].v
                out[i, (0, 1 if tip else 2, 3)[k], 2] = slopes[k].turn


def values(profile, *columns):
    columns = [np.array(a) for a in np.broadcast_arrays(*columns)]
    out = np.empty((columns[0].size, 3))
    _values(profile, *columns, WORK, out)
    return out


def slopes(profile, *columns):
    out = np.empty((columns[0].size, 4, 3))
    _slopes(profile, *columns, WORK, out)
    return out


def drawn(softness=1.0, count=30):
    """Angles at the contact, arc lengths and forces, also of contacts at the tip and without force."""
    rng = np.random.default_rng(11)
    psi1 = rng.uniform(-0.7, 1.57, count)
    arclength = np.where(rng.random(count) < 0.4, 1.0, rng.uniform(0.05, 1.0, count))
    force = rng.uniform(0.0, 4.0, count) ** 2 / softness * rng.choice([0.0, 1e-9, 1.0], count, p=[0.1, 0.1, 0.8])
    return psi1, arclength, force


@pytest.mark.parametrize("name", RODS)
def test_a_pose_is_the_integrated_one(name):
    rod = RODS[name]
    columns = drawn(rod.softness)
    expected = np.array([integrated_pose(rod, *row) for row in zip(*columns, strict=True)])
    np.testing.assert_allclose(values(rod.profile, *columns), expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", RODS)
def test_slopes_are_those_of_differences(name):
    """Five-point differences: error of rounding about 1e-15/step, of the formula step⁴ times a fifth derivative."""
    rod = RODS[name]
    psi1, arclength, force = drawn(rod.softness)
    arclength = np.minimum(arclength, 0.99)
    near = np.array(rod.breaks)  # the fifth derivative by the arc length jumps
    for at in near:
        arclength = np.where(np.abs(arclength - at) < 0.01, at + 0.02, arclength)
    found = slopes(rod.profile, psi1, arclength, force)
    np.testing.assert_allclose(found[:, 0], values(rod.profile, psi1, arclength, force), atol=1e-13)
    force_step = 1e-3 / rod.softness
    inside = force > 2.0 * force_step
    for k, step in ((0, 1e-3), (1, 1e-4), (2, force_step)):
        ends = []
        for times in (2.0, 1.0, -1.0, -2.0):
            columns = [psi1, arclength, force]
            columns[k] = columns[k] + times * step
            ends.append(values(rod.profile, *columns))
        slope = (8.0 * (ends[1] - ends[2]) - (ends[0] - ends[3])) / (12.0 * step)
        scale = np.maximum(1.0, np.abs(slope).max())
        np.testing.assert_allclose(found[inside, 1 + k] / scale, slope[inside] / scale, atol=2e-9)


@pytest.mark.parametrize("curvature", [0.0, 0.8, -2.5])
def test_an_arc_has_its_closed_form(curvature):
    columns = drawn()
    expected = np.empty((columns[0].size, 4, 3))
    _arcs(*columns, curvature, expected)
    np.testing.assert_allclose(slopes(profile_of(curvature), *columns), expected, rtol=0, atol=1e-12)


def test_a_bend_adds_to_the_rest_curvature_and_a_sign_mirrors_it():
    columns = drawn()
    bent = profile_of(lambda s: 0.3 - s)._replace(bend=0.2)
    expected = slopes(profile_of(lambda s: 0.5 - s), *columns)
    np.testing.assert_allclose(slopes(bent, *columns), expected, atol=1e-13)
    mirrored = slopes(profile_of(lambda s: s - 0.5), *columns)
    np.testing.assert_allclose(slopes(bent._replace(sign=-1.0), *columns), mirrored, atol=1e-13)


def test_a_cone_may_be_given_as_a_function():
    columns = drawn(5.0)
    cone = profile_of(0.4, lambda s: (1.0 - 0.8 * s) ** 4)
    np.testing.assert_allclose(slopes(cone, *columns), slopes(profile_of(0.4, 1.0, 0.8), *columns), atol=1e-10)


def test_beyond_the_tip_a_rod_goes_on_as_at_its_tip():
    """Like a longer rod of which the last part has the rest curvature and rigidity of the tip."""
    psi1, _, force = drawn(4.0)
    extended = values(profile_of(0.5, 1.0, 0.5), psi1, 1.25, force)
    longer = RodAlong(profile_of(), lambda s: 0.625, lambda s: (1.0 - 0.5 * min(1.25 * s, 1.0)) ** 4, (0.8,), 1.0)
    expected = np.array([integrated_pose(longer, p, 1.0, f * 1.25**2) for p, f in zip(psi1, force, strict=True)])
    np.testing.assert_allclose(extended, expected * [1.25, 1.25, 1.0], atol=1e-11)


@pytest.mark.parametrize("name", ["arc", "cone", "both tables"])
def test_without_arc_length_nothing_is_between_contact_and_pivot(name):
    found = slopes(RODS[name].profile, np.array([0.3]), np.array([0.0]), np.array([2.0]))[0]
    np.testing.assert_array_equal(found[[0, 1, 3]], 0.0)
    np.testing.assert_allclose(found[2, :2], [math.cos(0.3), math.sin(0.3)])


def test_a_table_may_have_many_points():
    columns, s = drawn(5.0), np.linspace(0.0, 1.0, 2001)
    table, function = profile_of((s, s), (s, 1.0 - 0.3 * s)), profile_of(lambda s: s, lambda s: 1.0 - 0.3 * s)
    np.testing.assert_allclose(values(table, *columns), values(function, *columns), atol=1e-11)
    np.testing.assert_allclose(slopes(table, *columns), slopes(function, *columns), atol=1e-9)


def test_numbers_that_overflow_are_nan():
    for force in (1e200, math.inf, math.nan):
        assert np.isnan(values(profile_of(0.0), np.array([0.3]), np.array([1.0]), np.array([force]))).all()

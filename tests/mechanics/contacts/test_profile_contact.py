"""Step 2 of rods of any rest curvature and rigidity, the inverse of their poses, and their shapes."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from helpers.profiled_rods import drawn_rods, integrated
from tactile_bayes.mechanics.compiler import cached
from tactile_bayes.mechanics.contacts import states
from tactile_bayes.mechanics.poses import beam, profile_pose, profile_shape
from tactile_bayes.mechanics.poses.taylor import FARTHEST, workspace
from tactile_bayes.mechanics.rods.profile import profile_of

_pose, _contact, _closed = profile_pose.pose_along, states.contact_of, states.contact
_mirrored_by = beam.mirrored_by
_shape, _rest, _chord = profile_shape.shape_along, profile_shape.rest_along, profile_shape.chord_along
_bending = profile_shape.largest_bending_along

RODS = drawn_rods()
WORK = workspace()


@cached
def pose(profile, psi1, arclength, force, work):
    return _pose(profile, psi1, arclength, force, work)


@cached
def _found(varied, wrench, delta):
    return _contact(_mirrored_by(varied.profile.sign, varied, 0.0), wrench[0], wrench[1], wrench[2], wrench[3], delta)


def contact(profile, wrench, delta, work):
    return _found(beam.varied(profile)._replace(work=work), wrench, delta)[:5]


@cached
def closed(wrench, delta):
    return _closed(wrench[0], wrench[1], wrench[2], wrench[3], delta)


@cached
def shape(profile, wrench, end, arclengths, x, y, work):
    _shape(profile, wrench[0], wrench[1], wrench[2], wrench[3], end, arclengths, x, y, work)


@cached
def bending(profile, wrench, end, work):
    return _bending(profile, wrench[0], wrench[1], wrench[2], wrench[3], end, work)


@cached
def rest(profile, arclength, work):
    return _rest(profile, 0.0, arclength, work)


@cached
def chord(profile, distance, work):
    return _chord(profile, 0.0, distance, work)


@functools.cache
def states_of(name, count=20):
    """Wrenches of contacts, with contact point, normal angle, arc length and slope at the contact."""
    rod, rng = RODS[name], np.random.default_rng(3)
    found = []
    while len(found) < count:
        psi1, beta = rng.uniform(-0.7, 1.5), rng.uniform(-1.5, 1.5)
        arclength = 1.0 if rng.random() < 0.4 else rng.uniform(0.1, 1.0)
        force = rng.uniform(0.1, 3.5) ** 2 / rod.softness
        if not _is_first(rod, psi1, arclength, force):
            continue
        u, v, turn = pose(rod.profile, psi1, arclength, force, WORK)
        cos, sin = math.cos(beta), math.sin(beta)
        wrench = np.array([beta + psi1 + turn, force * u, -force * sin, force * cos])
        found.append((wrench, u * cos - v * sin, u * sin + v * cos, beta, arclength, beta + psi1))
    return found


def _is_first(rod, psi1, arclength, force):
    """Return whether the moment vanishes nowhere before the contact, as in forward contacts."""
    state, at = [psi1, 0.0, 0.0, 0.0], arclength
    for s in np.linspace(arclength, 0.0, 30)[1:]:
        state, at = integrated(rod, state, at, s, force), s
        if state[1] >= 0.0:
            return False
    return True


@pytest.mark.parametrize("name", RODS)
def test_step_2_inverts_the_pose(name):
    for wrench, x, y, beta, arclength, tip_angle in states_of(name):
        found = contact(RODS[name].profile, wrench, 0.1, WORK)
        np.testing.assert_allclose(found, [x, y, beta - 0.1, arclength, tip_angle], rtol=0, atol=1e-10)


def test_a_straight_uniform_rod_has_its_closed_form():
    """Also beyond the tip, and without moment."""
    rng = np.random.default_rng(8)
    wrenches = np.column_stack([rng.uniform(0.0, 3.1, 200), rng.uniform(0.0, 3.0, 200), rng.normal(0.0, 3.0, (200, 2))])
    wrenches[:20, 1] = 0.0
    known = [(wrench, closed(wrench, 0.2)) for wrench in wrenches]
    some = [(wrench, expected) for wrench, expected in known if not expected.arclength > 3.9]
    assert sum(expected.arclength > 1.0 for _, expected in some) > 20
    assert sum(math.isnan(expected.arclength) for _, expected in some) > 20
    for wrench, expected in some:
        found = contact(profile_of(), wrench, 0.2, WORK)
        np.testing.assert_allclose(found, expected[:5], rtol=0, atol=1e-10, err_msg=str(wrench))


def test_a_wrench_that_no_contact_makes_is_nan():
    for wrench in ([1.0, 10.0, 0.0, 1.0], [1.0, 1.0, 0.0, 0.0], [1.0, -0.1, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]):
        assert np.isnan(contact(RODS["cone"].profile, np.array(wrench), 0.0, WORK)).all()
    assert np.isnan(contact(RODS["cone"].profile, np.array([1.0, math.nan, 0.0, 1.0]), 0.0, WORK)).all()


@pytest.mark.parametrize("load", [1e12, 1e300])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_march_under_an_absurd_load_ends(sign, load):
    """After tiny steps, and where series overflow."""
    profile, wrench = RODS["wavy"].profile, np.array([1.0, sign * load, 0.3, 1.0])
    x, y = np.empty((2, 3))
    shape(profile, wrench, 1.0, np.array([0.0, 0.5, 1.0]), x, y, WORK)
    assert np.isnan([x[1:], y[1:]]).all()
    assert np.isnan(contact(profile, wrench, 0.1, WORK)).all()
    assert math.isnan(bending(profile, wrench, 1.0, WORK))
    for at in (rest(profile_of(sign * load), 1.0, WORK), chord(profile_of(sign * load), 0.5, WORK)):
        assert np.isnan(at[1:4]).all()


@pytest.mark.parametrize("name", RODS)
def test_a_shape_is_the_integrated_one(name):
    """Up to the contact under the force, and beyond it as at rest."""
    rod = RODS[name]
    arclengths = np.linspace(0.0, 1.0, 21)
    for wrench, *_, arclength, _ in states_of(name)[:6]:
        x, y = np.empty((2, arclengths.size))
        shape(rod.profile, wrench, arclength, arclengths, x, y, WORK)
        force, beta = math.hypot(wrench[2], wrench[3]), math.atan2(-wrench[2], wrench[3])
        state, at, expected = np.array([wrench[0] - beta, -wrench[1], 0.0, 0.0]), 0.0, []
        for s in arclengths:
            if at < arclength <= s:
                state, at = integrated(rod, state, at, arclength, force), arclength
                assert abs(state[1]) < 1e-10
                state[1] = 0.0
            state = integrated(rod, state, at, s, force if s <= arclength else 0.0) if s > at else state
            at = s
            expected.append(complex(state[2], state[3]) * complex(math.cos(beta), math.sin(beta)))
        np.testing.assert_allclose(x + 1j * y, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("curvature", [0.0, 0.7, -2.0, 5.0])
def test_an_arc_at_rest_has_its_closed_form(curvature):
    profile = profile_of(curvature)
    half = 0.5 * curvature
    for s in (0.0, 0.3, 1.0):
        at = rest(profile, s, WORK)
        distance = s * np.sinc(half * s / np.pi)
        np.testing.assert_allclose(at, [s, distance, half * s if s else 0.0, curvature * s, curvature], atol=1e-14)
    most = math.pi / max(abs(curvature), 1e-9)
    farthest = min(FARTHEST, most)
    at = chord(profile, 10.0, WORK)
    np.testing.assert_allclose(at.distance, farthest * np.sinc(half * farthest / np.pi), atol=1e-13)
    assert min(abs(at.arclength - k * farthest) for k in (1, 3, 5)) < 1e-7  # the circle goes on
    for distance in (1e-3, 0.2, 0.39):
        at = chord(profile, distance, WORK)
        angle = math.asin(half * distance)
        np.testing.assert_allclose([at.distance, at.bearing, at.slope], [distance, angle, 2.0 * angle], atol=1e-13)
        np.testing.assert_allclose(at.arclength, 2.0 * angle / curvature if curvature else distance, atol=1e-13)


@pytest.mark.parametrize("name", ["wavy", "both tables", "parabolic"])
def test_a_rod_at_rest_is_the_integrated_one(name):
    rod = RODS[name]
    for s in (0.2, 0.77, 1.0):
        at = rest(rod.profile, s, WORK)
        psi, _, u, v = integrated(rod, np.zeros(4), 0.0, s, 0.0)
        expected = [s, math.hypot(u, v), math.atan2(v, u), psi, float(rod.curvature(s))]
        np.testing.assert_allclose(at, expected, rtol=0, atol=1e-12)
        np.testing.assert_allclose(chord(rod.profile, at.distance, WORK), at, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", RODS)
def test_the_largest_bending_is_that_of_close_points(name):
    rod = RODS[name]
    for wrench, *_, arclength, _ in states_of(name)[:4]:
        found = bending(rod.profile, wrench, arclength, WORK)
        force, beta = math.hypot(wrench[2], wrench[3]), math.atan2(-wrench[2], wrench[3])
        state, at, strain = np.array([wrench[0] - beta, -wrench[1], 0.0, 0.0]), 0.0, []
        for s in np.linspace(0.0, arclength, 200):
            state, at = (integrated(rod, state, at, s, force) if s > at else state), s
            strain.append(abs(state[1]) / float(rod.rigidity(s)) * (1.0 - rod.profile.taper * s))
        np.testing.assert_allclose(found, max(strain), rtol=1e-3)

"""Branches of equilibria of rods with constant rest curvature."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.contours_drawn import mirrored
from helpers.integration import rod
from tactile_bayes.contours import Circle, Ellipse, Joined, Parabola, PowerLaw
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.mechanics.paths import trace
from tactile_bayes.mechanics.phases import NONE, TIP
from tactile_bayes.mechanics.reachability import Reachability

COUNT = 30
RNG = np.random.default_rng(11)
SIZES, Q, X_C = np.exp(RNG.normal(0.0, 0.5, COUNT)), RNG.uniform(0.2, 0.8, COUNT), RNG.normal(0.0, 0.15, COUNT)
CONTOURS = {
    "parabola": Parabola(SIZES, Q, X_C),
    "circle": Circle(0.5 * SIZES, Q, X_C),
    "ellipse": Ellipse(SIZES, 0.5 * SIZES[::-1], Q, X_C),
    "sharp power": PowerLaw(SIZES, RNG.uniform(1.3, 1.9, COUNT), Q, X_C),
    "joined": Joined(Parabola(SIZES, Q, X_C), Circle(0.5 * SIZES[::-1], Q, X_C)),
}
ANGLES = np.linspace(-1.0, 4.5, 56)


def traced(contour, curvature, *, backward=False, friction=0.0, compliance=0.0, **options):
    contour, zero = contour.broadcast_to((COUNT,)), np.zeros(COUNT)
    sweep_frame = SweepFrame(contour, zero, zero, 1.0, 0.0, np.full(COUNT, backward), curvature)
    return trace(
        sweep_frame,
        friction_angle=np.arctan(friction),
        suspension_compliance=compliance,
        drive_angles=ANGLES,
        **options,
    )


def integrated(state, curvature, **options):
    """x, y, slope and curvature of the rod from the pivot to the contact, from the drive angle and loads of a state."""
    return rod(state[5:9], state[9], rest=curvature, **options).y


@pytest.mark.parametrize("curvature", [-0.8, 0.05, 0.6])
@pytest.mark.parametrize("name", CONTOURS)
@pytest.mark.parametrize(("backward", "friction"), [(False, 0.0), (True, 0.3)])
def test_states_satisfy_the_integrated_equations(name, curvature, backward, friction):
    """From the pivot, with drive angle and loads, the rod ends at the contact, with its rest curvature there."""
    paths = traced(CONTOURS[name], curvature, backward=backward, friction=friction)
    assert np.count_nonzero(paths.reach == Reachability.TOUCHES) > COUNT // 5  # the others touch twice, or not at all
    states = paths.sampled[paths.sampled[..., 0] != NONE]
    own = -curvature if backward else curvature
    for state in states[:: max(1, len(states) // 8)]:
        phase, _, x, y, alpha, _, _, force_x, force_y, arclength, tip_angle = state[:11]
        gamma, sticks = state[12:14]
        end = integrated(state, own)[:, -1]
        assert end == pytest.approx([x, y, tip_angle, own], abs=1e-10)
        assert np.arctan2(-force_x, force_y) == pytest.approx(alpha + gamma, abs=1e-12)
        assert abs(gamma) <= np.arctan(friction) if sticks else abs(gamma) == np.arctan(friction)
        assert arclength == 1.0 if phase == TIP else tip_angle == pytest.approx(alpha, abs=1e-12)


@pytest.mark.parametrize("curvature", [-0.5, 0.5])
@pytest.mark.parametrize("name", CONTOURS)
def test_a_backward_sweep_is_the_forward_one_of_the_mirror_image(name, curvature):
    forward = traced(CONTOURS[name], curvature, friction=0.1, compliance=0.05)
    backward = traced(mirrored(CONTOURS[name]), -curvature, backward=True, friction=0.1, compliance=0.05)
    np.testing.assert_array_equal(backward.reach, forward.reach)
    for event in ("first_angle", "snap_angle"):
        np.testing.assert_allclose(getattr(backward, event), getattr(forward, event), atol=1e-10)
    np.testing.assert_allclose(backward.sampled[..., 6:9], forward.sampled[..., 6:9], atol=1e-9)


@pytest.mark.parametrize("name", CONTOURS)
def test_a_straight_rod_is_the_limit(name):
    """Linearly in the curvature: the difference for 1e-6 is ten times that for 1e-7."""
    straight, small, smaller = (traced(CONTOURS[name], curvature) for curvature in (0.0, 1e-5, 1e-6))
    there = straight.reach == Reachability.TOUCHES
    far, near = (np.abs(one.snap_angle - straight.snap_angle)[there] for one in (small, smaller))
    assert far.max() < 1e-4
    np.testing.assert_allclose(near, 0.1 * far, atol=1e-3 * far.max())


def _inside(contour, i, x, y):
    """Whether points are within the object, between the contour and its ends."""
    low, high = (float(np.broadcast_to(end, (COUNT,))[i]) for end in contour.domain)
    contour = contour.take(np.array([i]))
    locus = contour.locate(np.linspace(max(low, -1.55), min(high, 1.55), 20001))
    below_top = y < min(locus.y[0], locus.y[-1])
    return below_top & (np.interp(x, locus.x, locus.y, left=np.inf, right=np.inf) < y - 1e-6)


@pytest.mark.parametrize("curvature", [0.5, 1.5])
@pytest.mark.parametrize("name", ["parabola", "circle", "ellipse"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_rod_curved_toward_the_object_is_outside_of_it(name, curvature, friction):
    """All of the rod, integrated from its base, in contact wherever a path is followed."""
    paths = traced(CONTOURS[name], curvature, friction=friction)
    there = np.flatnonzero(paths.reach == Reachability.TOUCHES)
    assert (paths.reach == Reachability.TOUCHES_TWICE).any() == ((name, curvature) != ("circle", 0.5))
    for i in there[:8]:
        states = paths.sampled[i][paths.sampled[i, :, 0] != NONE]
        for state in states[:: max(1, len(states) // 4)]:
            loaded = integrated(state, curvature, max_step=0.02)
            x, y, phi = loaded[:3, -1]
            free = np.linspace(0.0, 1.0 - state[9], 50)
            x = np.append(loaded[0], x + (np.sin(phi + curvature * free) - np.sin(phi)) / curvature)
            y = np.append(loaded[1], y - (np.cos(phi + curvature * free) - np.cos(phi)) / curvature)
            assert not np.any(_inside(CONTOURS[name], i, x, y))


def test_a_rod_more_curved_than_a_circle_touches_it_twice():
    """And one less curved does not, where it comes to lie along it."""
    radius, count = 0.5, 6
    contour, zero = Circle(np.full(count, radius), np.linspace(0.45, 0.5, count), 0.0), np.zeros(count)
    for curvature, reach in ((1.9, Reachability.TOUCHES), (2.1, Reachability.TOUCHES_TWICE)):
        for sign, backward in ((1.0, False), (-1.0, True)):
            mirrored_too = np.full(count, backward)
            paths = trace(SweepFrame(contour, zero, zero, 1.0, 0.0, mirrored_too, sign * curvature))
            assert set(paths.reach.tolist()) == {reach}
            assert np.all(np.isnan(paths.snap_angle)) == (reach != Reachability.TOUCHES)


@pytest.mark.parametrize("name", CONTOURS)
def test_loads_as_accurate_as_noise_requires_are_near_the_exact_ones(name):
    noise = np.array([0.02, 0.05, 0.05])
    likely, exact = traced(CONTOURS[name], -0.4, tolerance=0.1 * noise), traced(CONTOURS[name], -0.4)
    np.testing.assert_array_equal(likely.reach, exact.reach)
    off = np.abs(likely.observables(ANGLES) - exact.observables(ANGLES)) / noise
    assert np.quantile(off, 0.999) < 0.01
    np.testing.assert_allclose(likely.snap_angle, exact.snap_angle, atol=1e-5)

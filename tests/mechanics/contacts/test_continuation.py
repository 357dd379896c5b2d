"""Single states of rods that vary along their length: against integration, closed forms, differences, and in limits."""

import numpy as np
import pytest

from helpers.profiled_rods import given_rod, given_rods, integrated
from helpers.single_states import assert_slopes_are_differences
from tactile_bayes.mechanics.elastica import contact_from_wrench, wrench_from_contact
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.mechanics.rods.profile import profile_of

RODS = given_rods()


def contacts(count=16, seed=1):
    """x, y, slope angles and friction angles, half of them zero; forward ones."""
    rng = np.random.default_rng(seed)
    distance, bearing = rng.uniform(0.4, 0.97, count), rng.uniform(0.9, 1.7, count)
    slope, delta = rng.uniform(-0.2, 0.6, count), np.where(rng.random(count) < 0.5, 0.0, rng.uniform(0.1, 0.5, count))
    return distance * np.cos(bearing), distance * np.sin(bearing), slope, delta


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("name", RODS)
def test_wrenches_integrate_to_their_contacts(name, side):
    """From the pivot on, with the moment at the pivot; and with the tip, or along the contour."""
    x, y, alpha, delta = contacts()
    profile, plain = RODS[name].plain.profile, RODS[name].in_sweep(side)
    out = wrench_from_contact(side * x, y, side * alpha, delta, side=side, profile=profile)
    some = np.flatnonzero(out.phase != NONE)
    assert some.size >= 8
    assert TANGENTIAL in out.phase[some]
    assert TIP in out.phase[some] or name == "cone"  # its tip is so soft that it lies along the contour
    for k in some:
        beta = alpha[k] + delta[k]
        force = np.hypot(out.force_x[k], out.force_y[k])
        assert np.arctan2(-side * out.force_x[k], out.force_y[k]) == pytest.approx(beta, abs=1e-12)
        angles = np.array([out.drive_angle[k], out.tip_angle[k]])
        phi0, phi1 = angles if side > 0 else np.pi - angles
        start = [phi0 - beta, -side * out.holding_moment[k], 0.0, 0.0]
        psi1, moment, u, v = integrated(plain, start, 0.0, out.contact_arclength[k], force)
        right = [phi1 - beta, 0.0, x[k] * np.cos(beta) + y[k] * np.sin(beta), y[k] * np.cos(beta) - x[k] * np.sin(beta)]
        np.testing.assert_allclose([psi1, moment, u, v], right, atol=1e-9)
        if out.phase[k] == TIP:
            assert out.contact_arclength[k] == 1.0
            assert psi1 >= -delta[k]
        else:
            assert out.contact_arclength[k] <= 1.0
            assert phi1 == pytest.approx(alpha[k], abs=1e-12)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("curvature", [-0.6, 0.0, 0.6])
def test_uniform_rods_are_those_of_closed_forms(curvature, side):
    """Where the line of force has not passed the pivot: a straight rod then lets go."""
    given = np.array(contacts(200))
    x, y, alpha, delta = given[:, given[0] * np.cos(given[2] + given[3]) + given[1] * np.sin(given[2] + given[3]) > 0.0]
    known = wrench_from_contact(side * x, y, side * alpha, delta, side=side, rest_curvature=curvature)
    found = wrench_from_contact(side * x, y, side * alpha, delta, side=side, profile=profile_of(curvature))
    np.testing.assert_array_equal(found.phase, known.phase)
    assert np.mean(found.phase != NONE) > 0.8
    for name in ("drive_angle", "holding_moment", "force_x", "force_y", "contact_arclength", "tip_angle"):
        np.testing.assert_allclose(getattr(found, name), getattr(known, name), atol=1e-9)


def test_a_straight_uniform_rod_is_the_limit():
    """Linearly in taper and curvature."""
    x, y, alpha, delta = contacts(100)
    straight = wrench_from_contact(x, y, alpha, delta)
    far, near = (
        wrench_from_contact(
            x, y, alpha, delta, phase=straight.phase, profile=profile_of(lambda s, e=e: e * np.sin(3.0 * s), 1.0, e)
        ).drive_angle
        - straight.drive_angle
        for e in (1e-5, 1e-6)
    )
    some = straight.phase != NONE
    assert np.abs(far[some]).max() < 1e-3
    np.testing.assert_allclose(near[some], 0.1 * far[some], atol=1e-9 + 1e-3 * np.abs(far[some]).max())


@pytest.mark.parametrize("name", ["cone", "curved to its tip", "wavy", "tables"])
def test_derivatives_of_the_drive_angle_are_those_of_differences(name):
    assert_slopes_are_differences(*contacts(60), atol=1e-5, profile=RODS[name].plain.profile)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("name", RODS)
def test_step2_gives_the_contacts_back(name, side):
    """Not where the tip points away from the force: the moment there vanishes at an earlier point too."""
    x, y, alpha, delta = contacts(60, seed=2)
    profile = RODS[name].plain.profile
    out = wrench_from_contact(side * x, y, side * alpha, delta, side=side, profile=profile)
    tip_angle = out.tip_angle if side > 0 else np.pi - out.tip_angle
    some = tip_angle - alpha - delta < 0.5 * np.pi
    assert some.sum() > 30
    back = contact_from_wrench(*(column[some] for column in out[:4]), delta[some], side=side, profile=profile)
    np.testing.assert_allclose(np.array(back[:3]), [side * x[some], y[some], side * alpha[some]], atol=1e-9)


def test_contacts_out_of_reach_have_no_wrench():
    profile = given_rod(lambda s: 0.4 * s, taper=0.5).rod.profile
    out = wrench_from_contact([0.9, 0.2, np.nan, 0.05], [0.6, 0.98, 0.5, -0.5], 0.1, profile=profile)
    np.testing.assert_array_equal(out.phase, NONE)
    assert np.isnan(out.drive_angle).all()

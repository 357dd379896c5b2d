"""The shape of the rod: closed form against integration."""

import numpy as np
import pytest

from helpers.integration import rod
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.mechanics.elastica import wrench_from_contact
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP

POINTS = 41
ARCLENGTHS = np.linspace(0.0, 1.0, POINTS)


def integrated(wrench, arclength):
    """The rod up to the contact by integration, in the world's frame, then straight on."""
    bent = ARCLENGTHS[arclength >= ARCLENGTHS]
    end = min(arclength, 1.0)
    path = rod(wrench, end, dense_output=True)
    x, y, phi, curvature = path.y[:, -1]
    assert abs(curvature) < 1e-9 or arclength > 1.0
    rest = ARCLENGTHS[bent.size :] - end
    inner = path.sol(bent)
    return np.append(inner[0], x + rest * np.cos(phi)), np.append(inner[1], y + rest * np.sin(phi))


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("contact", "phase"),
    [
        ((0.2, 0.6, 0.1), TIP),
        ((0.2, 0.6, 0.2), TANGENTIAL),
        ((0.05, 0.3, 0.05), TANGENTIAL),
        ((0.5, 0.86, 0.3), TIP),
        ((-0.05, 0.4, 0.3), TANGENTIAL),
        ((0.3, 0.55, 0.45, 0.3), TANGENTIAL),
    ],
)
def test_rod_is_what_integration_gives(contact, phase, side):
    x, y, alpha, *friction = contact
    w = wrench_from_contact(side * x, y, side * alpha, *friction, side=side)
    assert w.phase == phase
    wrench = [float(a) for a in w[:4]]
    np.testing.assert_allclose(
        rod_shape(*wrench, points=POINTS), integrated(wrench, float(w.contact_arclength)), atol=1e-9, rtol=0
    )


def test_wrench_of_a_contact_beyond_the_tip_is_followed_to_the_tip():
    w = wrench_from_contact(0.2, 0.6, 0.1)
    wrench = float(w.drive_angle), 0.9 * float(w.holding_moment), 0.5 * float(w.force_x), 0.5 * float(w.force_y)
    np.testing.assert_allclose(rod_shape(*wrench, points=POINTS), integrated(wrench, 1.5), atol=1e-9)


def test_light_load_bends_little():
    angle = 1.0
    load = np.geomspace(1e-30, 1e-6, 9)
    x, y = rod_shape(angle, load, load * np.cos(angle + np.pi / 2), load * np.sin(angle + np.pi / 2))
    s = np.linspace(0.0, 1.0, x.shape[-1])
    # With force f across the rod at its tip, Euler and Bernoulli: deflection f (s²/2 − s³/6).
    sag = load[:, None] * (s**2 / 2 - s**3 / 6)
    np.testing.assert_allclose(x, s * np.cos(angle) + sag * np.sin(angle), atol=1e-11)
    np.testing.assert_allclose(y, s * np.sin(angle) - sag * np.cos(angle), atol=1e-11)


def test_unloaded_rods_are_straight_as_are_those_loaded_along_them():
    angle = np.array([0.3, 0.4, 0.5, 0.6, 1.0])
    moment, force_x = [0.0, np.nan, np.nan, 0.0, 0.0], [0.0, np.nan, 0.1, np.nan, 0.0]
    x, y = rod_shape(angle, moment, force_x, [0.0, np.nan, 0.1, 0.2, 1.0], points=3)
    np.testing.assert_allclose(x, np.cos(angle)[:, None] * [0.0, 0.5, 1.0])
    np.testing.assert_allclose(y, np.sin(angle)[:, None] * [0.0, 0.5, 1.0])


def test_wrench_that_no_contact_makes_is_nan():
    x, y = rod_shape([1.0, 1.0], [0.0, 10.0], 0.0, [0.0, 1.0])
    assert np.isfinite(x[0]).all()
    assert np.isnan(x[1]).all()
    assert np.isnan(y[1]).all()


def test_states_broadcast():
    x, y = rod_shape(np.full((3, 1), 1.0), np.zeros(2), 0.0, 0.0, points=7)
    assert x.shape == y.shape == (3, 2, 7)


def test_one_point_is_refused():
    with refused(ParameterError, "2 points"):
        rod_shape(1.0, 0.0, 0.0, 0.0, points=1)

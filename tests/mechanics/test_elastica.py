"""The exact rod against integration, a hundred-digit judge, and itself."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from helpers import exact_rod
from helpers.exact_rod import Shape
from helpers.integration import contact_end, rod
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.elastica import MAX_FRICTION_ANGLE, contact_from_wrench, wrench_from_contact
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP

EPS = np.finfo(float).eps
# Agreement of closed form and integration that is asked for; the integration itself is good to some 1e-13.
CLOSE = 1e-10
FRICTION = (0.0, 0.3, 0.65)
NORMALS = (-0.9, -0.1, 0.4)

TANGENTIAL_SHAPES = [
    Shape(chi, -delta, beta, s1, delta)
    for chi in (1e-4, 0.03, 0.6, 1.3, 2.2, 2.9, np.pi - 1e-4)
    for delta in FRICTION
    for beta, s1 in zip(NORMALS, (0.999, 0.2, 0.7), strict=True)
]
TIP_SHAPES = [
    Shape(chi, psi1, beta, 1.0, delta)
    for chi in (0.05, 0.6, 1.3, 2.2, 2.9, np.pi - 1e-4)
    for delta in FRICTION
    for psi1, beta in zip((-delta + 0.02, 0.7, 1.5), NORMALS, strict=True)
]
# Force nearly along the rod: nearly straight whatever the force, up to Euler's load at χ = π.
THRUST_SHAPES = [
    Shape(chi, np.pi / 2 - chord_angle, 0.2, 1.0, delta)
    for chi in (0.5, 1.5, 2.6, 3.1)
    for chord_angle in (1e-2, 1e-4)
    for delta in (0.0, 0.3)
]
# The tip has just touched: chord 1 − 1e-8, at several leans of the rod over the contour's tangent.
TIP_ONSETS = [
    ((1 - 1e-8) * np.cos(alpha + lean), (1 - 1e-8) * np.sin(alpha + lean), alpha, delta)
    for alpha, lean in ((-0.4, 0.3), (0.2, 1.2), (0.7, 0.01), (-1.2, 1.5))
    for delta in (0.0, 0.3)
]
# The rod has just come to lie along the contour, with its tip 1e-8 beyond the contact.
TANGENTIAL_ONSETS = [
    ((1 - 1e-8) * np.cos(alpha + lean), (1 - 1e-8) * np.sin(alpha + lean), alpha, delta)
    for alpha, lean in ((-0.4, 1e-6), (0.7, 1e-9), (0.2, 1e-5))
    for delta in (0.0, 0.3)
]
CONTACTS = [exact_rod.contact(s) for s in TANGENTIAL_SHAPES + TIP_SHAPES + THRUST_SHAPES]
CONTACTS += TIP_ONSETS + TANGENTIAL_ONSETS


def mirrored(x, y, alpha, delta, side):
    return side * x, y, side * alpha, delta


def wrench_of(out):
    return tuple(float(v) for v in out[:4])


# --- against integration ---------------------------------------------------------------------------------------------


def test_the_states_asked_for_are_in_the_phase_they_were_made_for():
    phases = wrench_from_contact(*np.transpose(CONTACTS)).phase
    made = [TANGENTIAL] * len(TANGENTIAL_SHAPES) + [TIP] * (len(TIP_SHAPES) + len(THRUST_SHAPES))
    made += [TIP] * len(TIP_ONSETS) + [TANGENTIAL] * len(TANGENTIAL_ONSETS)
    np.testing.assert_array_equal(phases, made)


EVERY = slice(None)
# Half of the states: there are nine of each amplitude, so that what one leaves out its neighbour has.
ODD, EVEN = slice(1, None, 2), slice(0, None, 2)


@pytest.mark.parametrize(
    ("side", "chosen"),
    [
        (1, EVEN),
        (-1, ODD),
        pytest.param(1, EVERY, marks=pytest.mark.slow),
        pytest.param(-1, EVERY, marks=pytest.mark.slow),
    ],
)
def test_the_base_wrench_integrates_to_the_contact(side, chosen):
    for contact in CONTACTS[chosen]:
        x, y, alpha, delta = mirrored(*contact, side)
        out = wrench_from_contact(x, y, alpha, delta, side=side)
        force = np.hypot(out.force_x, out.force_y)
        assert side * out.holding_moment > 0
        # The force stands off the contour's normal by the friction angle, against the sliding.
        np.testing.assert_allclose(np.arctan2(-out.force_x, out.force_y), alpha + side * delta, atol=4 * EPS)

        path = rod(wrench_of(out), float(out.contact_arclength)).y
        end = path[:, -1]
        np.testing.assert_allclose(end[:2], [x, y], rtol=0, atol=CLOSE)
        np.testing.assert_allclose(end[2], out.tip_angle, rtol=0, atol=CLOSE)
        assert abs(end[3]) < CLOSE * np.max(np.abs(path[3]))
        assert np.all(side * path[3, :-1] < 0), "the contact is the first zero of curvature"
        outward = side * (end[2] - (alpha if side > 0 else alpha + np.pi))
        if out.phase == TANGENTIAL:
            assert abs(outward) < CLOSE
            assert out.contact_arclength <= 1
        else:
            assert outward > 0
            assert out.contact_arclength == 1
        assert force > 0


TINY_LOADS = [
    Shape(np.sqrt(f) * s1, psi1, beta, s1, delta)
    for f in (1e-10, 1e-7, 1e-4)
    for psi1, s1, delta in ((0.0, 0.4, 0.0), (-0.3, 0.9, 0.3), (0.5, 1.0, 0.0), (1.2, 1.0, 0.3))
    for beta in (-0.6, 0.3)
]


@pytest.mark.parametrize(
    ("side", "chosen"),
    [(1, EVEN), pytest.param(1, EVERY, marks=pytest.mark.slow), pytest.param(-1, EVERY, marks=pytest.mark.slow)],
)
def test_the_contact_is_where_integration_finds_no_curvature(side, chosen):
    for shape in (TANGENTIAL_SHAPES + TIP_SHAPES + TINY_LOADS)[chosen]:
        phi0, moment, fx, fy, delta = exact_rod.wrench(shape)
        wrench = (phi0, moment, fx, fy) if side > 0 else (np.pi - phi0, -moment, -fx, fy)
        s, (x, y, phi, _) = contact_end(wrench, 1.1)
        out = contact_from_wrench(*wrench, delta)
        found = [out.contact_x, out.contact_y, out.contact_arclength, out.tip_angle]
        np.testing.assert_allclose(found, [x, y, s, phi], rtol=0, atol=CLOSE)
        np.testing.assert_allclose(out.slope_angle, np.arctan2(-wrench[2], fy) - side * delta, rtol=0, atol=4 * EPS)


@pytest.mark.parametrize("phi0", [-1.0, 0.5, 2.0])
def test_a_curvature_that_never_vanishes_has_no_contact(phi0):
    """m ≥ 1: Kirchhoff's pendulum goes over the top."""
    beta, force = 0.2, 4.0
    just = 2 * np.sqrt(force) * np.abs(np.cos(np.pi / 4 - (phi0 - beta) / 2))
    for moment in (just * (1 + 1e-9), 2 * just):
        wrench = (phi0, moment, -force * np.sin(beta), force * np.cos(beta))
        out = contact_from_wrench(*wrench)
        assert out.modulus >= 1
        assert np.isnan([out.contact_x, out.contact_y, out.contact_arclength]).all()
        assert np.all(rod(wrench, 10.0).y[3] < 0)
    out = contact_from_wrench(phi0, just * (1 - 1e-9), -force * np.sin(beta), force * np.cos(beta))
    assert out.modulus < 1
    assert np.isfinite(out[:5]).all()


def test_without_force_or_a_channel_there_is_no_contact():
    assert np.isnan(contact_from_wrench([0.5, 0.5, 0.5], [0.0, 0.1, -0.1], 0.0, 0.0)).all()
    out = contact_from_wrench(*np.where(np.eye(4, dtype=bool), np.nan, [[1.0], [1.0], [-0.5], [3.0]]))
    assert np.isnan([out.contact_x, out.contact_y]).all()


# --- round trip ------------------------------------------------------------------------------------------------------


@st.composite
def contacts(draw):
    """Any contact within reach; distance to the pivot and lean over the tangent also close to their limits."""
    alpha, delta = draw(st.floats(-1.5, 1.5)), draw(st.sampled_from([0.0, 0.05, 0.3, MAX_FRICTION_ANGLE]))
    lean = draw(st.floats(1e-3, np.pi / 2 + delta - 1e-3) | st.floats(-8, -3).map(lambda k: 10.0**k))
    distance = draw(st.floats(0.05, 0.95) | st.floats(-8, -1).map(lambda k: 1 - 10.0**k))
    return distance * np.cos(alpha + lean), distance * np.sin(alpha + lean), alpha, delta


@settings(max_examples=5 * settings.default.max_examples // 2, deadline=None)
@given(contacts(), st.sampled_from([1, -1]))
def test_contact_to_wrench_and_back(contact, side):
    """Back to 1e-12 of the contact and of what relative changes of the wrench do to it (by central differences)."""
    x, y, alpha, delta = mirrored(*contact, side)
    out = wrench_from_contact(x, y, alpha, delta, side=side)
    assume(out.phase != NONE)
    wrench = np.array(out[:4], dtype=float)
    back = contact_from_wrench(*wrench, delta, side=side)

    step = 1e-4 * np.diag(np.append(np.abs(out.drive_angle - out.tip_angle), np.abs(wrench[1:])))
    ahead, behind = (contact_from_wrench(*(wrench[:, None] + s * step), delta, side=side) for s in (1, -1))
    size = np.array([1.0, *np.abs(wrench[1:])]) * np.array([np.pi, 1, 1, 1])
    width = np.where(np.diag(step) > 0, 2 * np.diag(step), np.inf)
    for name, value in {"contact_x": x, "contact_y": y, "slope_angle": alpha, "contact_arclength": None}.items():
        value = out.contact_arclength if value is None else value
        change = np.abs(getattr(ahead, name) - getattr(behind, name)) / width
        tolerance = 1e-12 * (1.0 + np.sum(change * size))
        assert abs(getattr(back, name) - value) <= tolerance, name


# --- rounding --------------------------------------------------------------------------------------------------------


def rounding_ratios(found, exact, bound):
    """Error of every output over what rounding of the inputs alone causes."""
    errors = {name: abs(exact_rod.mp.mpf(float(getattr(found, name))) - value) for name, value in exact.items()}
    return {name: float(error / bound[name]) if error else 0.0 for name, error in errors.items()}


def wrench_ratios(contact):
    contact = [float(v) for v in contact]
    out = wrench_from_contact(*contact)
    guess = float(out.drive_angle), float(out.holding_moment), float(np.hypot(out.force_x, out.force_y))
    exact, bound = exact_rod.judge_wrench(contact, guess if out.phase == TIP else None)
    # by_slope is 1 − ∂φ0/∂(polar angle), which may cancel: a quotient of sums of some ten terms of that size. It is
    # allowed 50 roundings of that size; no other output has such an allowance.
    bound["by_slope"] += 5 * EPS * (1 + abs(1 - exact["by_slope"]))
    return rounding_ratios(out, exact, bound)


def contact_ratios(wrench):
    wrench = [float(v) for v in wrench]
    return rounding_ratios(contact_from_wrench(*wrench), *exact_rod.judge_contact(wrench))


MOST = 10.0  # times what rounding of the inputs alone causes: the most that an output may be off
# θ0 → π/2 with the amplitude, → −π/2 where the line of force passes through the pivot.
AMPLITUDE_ENDS = [
    Shape(chi, psi1, beta, 0.8 if psi1 == -delta else 1.0, delta)
    for chi in (0.02, np.pi - 1e-2, np.pi - 1e-5)
    for psi1, delta in ((0.0, 0.0), (-0.3, 0.3), (0.3, 0.0), (1.2, 0.3))
    for beta in (-0.4, 0.03)
]
NEAR_STRAIGHT = [
    *(
        Shape(chi, np.pi / 2 - chord_angle, 0.3, 1.0, 0.0)
        for chi in (0.5, 1.5, 2.6, 3.1)
        for chord_angle in (1e-2, 1e-4)
    ),
    *(Shape(chi, 0.0, 0.3, 0.7, 0.0) for chi in (1e-2, 1e-3, 1e-5)),
]
# Where quadrature may give way to a closed form that still cancels.
MIDDLE = [
    Shape(chi, psi1, 0.2, 0.6 if psi1 == -delta else 1.0, delta)
    for chi in (0.45, 0.52, 0.7, 0.97, 1.03, 1.5, 1.6, 2.4)
    for psi1, delta in ((0.0, 0.0), (-0.3, 0.3), (0.4, 0.0))
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "states",
    [
        pytest.param(TIP_ONSETS, id="tip-onset"),
        pytest.param(TANGENTIAL_ONSETS, id="tangential-onset"),
        pytest.param([exact_rod.contact(s) for s in AMPLITUDE_ENDS], id="theta0-at-its-ends"),
        pytest.param([exact_rod.contact(s) for s in NEAR_STRAIGHT], id="near-straight"),
        pytest.param([exact_rod.contact(s) for s in MIDDLE], id="middle"),
    ],
)
def test_contact_to_wrench_loses_no_digits(states):
    """Nor do the derivatives of the drive angle."""
    for contact in states:
        ratios = wrench_ratios(contact)
        assert max(ratios.values()) <= MOST, (contact, ratios)


@pytest.mark.parametrize(
    "states",
    [
        pytest.param([(*wrench_from_contact(*c)[:4], c[3]) for c in TIP_ONSETS], id="tip-onset"),
        pytest.param([(*wrench_from_contact(*c)[:4], c[3]) for c in TANGENTIAL_ONSETS], id="tangential-onset"),
        pytest.param([exact_rod.wrench(s) for s in AMPLITUDE_ENDS], id="theta0-at-its-ends"),
        pytest.param([exact_rod.wrench(s) for s in NEAR_STRAIGHT], id="near-straight"),
        pytest.param([exact_rod.wrench(s) for s in MIDDLE], id="middle"),
        pytest.param([exact_rod.wrench(s) for s in TINY_LOADS], id="tiny-loads"),
    ],
)
def test_wrench_to_contact_loses_no_digits(states):
    for wrench in states:
        ratios = contact_ratios(wrench)
        assert max(ratios.values()) <= MOST, (wrench, ratios)


def test_the_judge_knows_legendre():
    """Its Landen transformation against mpmath's own integrals, to ninety digits."""
    mp = exact_rod.mp
    for theta, m in ((-1.5, 0.9), (-0.3, 0.5), (0.8, 1e-9), (1.57, 0.6)):
        theta, m = mp.mpf(theta), mp.mpf(m)
        difference, energy = exact_rod.complementary_arc(theta, m)
        assert abs(difference - (mp.ellipk(m) - mp.ellipf(theta, m))) < mp.mpf(10) ** -90
        assert abs(energy - (mp.ellipe(m) - mp.ellipe(theta, m))) < mp.mpf(10) ** -90


# --- phases ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("delta", [0.0, 0.3])
@pytest.mark.parametrize(("alpha", "lean"), [(0.3, 0.2), (-0.5, 0.9), (0.1, 1.4)])
def test_the_wrench_is_continuous_across_the_change_of_phase(alpha, lean, delta):
    """Lines through two states on either side, 1e-7 and 2e-7 away, meet: their error is of the order 1e-14."""
    direction = np.array([np.cos(alpha + lean), np.sin(alpha + lean)])
    corner = 1.0 / wrench_from_contact(*direction, alpha, delta).tangential_arclength
    away = np.array([-2e-7, -1e-7, 1e-7, 2e-7])
    out = wrench_from_contact(*(direction[:, None] * corner * (1 + away)), alpha, delta)
    np.testing.assert_array_equal(out.phase, [TANGENTIAL, TANGENTIAL, TIP, TIP])
    for values in out[:6]:
        below, above = 2 * values[1] - values[0], 2 * values[2] - values[3]
        assert abs(above - below) < 1e-11 * max(1.0, abs(below))
    np.testing.assert_allclose(out.tangential_arclength, 1 + away, rtol=0, atol=1e-14)


def test_no_contact_out_of_reach_or_at_the_contours_back():
    x = [1.0, 0.6, -0.1, 0.5, 0.5, np.nan, 0.2]
    y = [0.2, 0.9, 0.4, -0.1, 0.3, 0.5, 0.6]
    alpha = [0.1, 0.2, 0.0, 0.0, 1.6, 0.1, np.nan]
    #        beyond the rod,  |  leaning back, below the tangent, contour upright; missing
    out = wrench_from_contact(x, y, alpha)
    np.testing.assert_array_equal(out.phase, NONE)
    for name in set(out._fields) - {"phase", "tangential_arclength"}:
        assert np.isnan(getattr(out, name)).all(), name
    assert np.isfinite(out.tangential_arclength[:2]).all()


def test_first_touch_of_a_straight_rod():
    """A tip at distance one, and a rod along the tangent: no load, and the rod straight."""
    out = wrench_from_contact([1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [-0.5, 0.5, 0.0])
    np.testing.assert_array_equal(out.phase, [TIP, TIP, TANGENTIAL])
    np.testing.assert_allclose(out.drive_angle, [0.0, np.pi / 2, 0.0], rtol=0, atol=4 * EPS)
    np.testing.assert_array_equal(out.contact_arclength, [1.0, 1.0, 0.5])
    for load in (out.holding_moment, out.force_x, out.force_y):
        np.testing.assert_array_equal(load, 0.0)
    np.testing.assert_array_equal(out.by_distance, [-np.inf, -np.inf, 0.0])
    assert out.by_slope[2] == pytest.approx(-2.0, abs=4 * EPS)


# --- derivatives -----------------------------------------------------------------------------------------------------

SMOOTH = [
    Shape(chi, psi1, 0.2, 0.7 if psi1 == -delta else 1.0, delta)
    for chi in (1.2, 1.6, 2.0, 2.7)
    for psi1, delta in ((0.0, 0.0), (-0.3, 0.3), (0.4, 0.0), (1.0, 0.2))
]


@pytest.mark.parametrize("side", [1, -1])
def test_derivatives_against_differences(side):
    """Five-point differences: with steps of 1e-4 their truncation and rounding are both below 1e-10."""
    contact = np.transpose([exact_rod.contact(s) for s in SMOOTH])
    x, y, alpha, delta = mirrored(*contact, side)
    r2, polar = x * x + y * y, np.arctan2(y, x)
    h = 1e-4

    def difference(f):
        return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h)

    def drive(r2, polar, alpha):
        r = np.sqrt(r2)
        return wrench_from_contact(r * np.cos(polar), r * np.sin(polar), alpha, delta, side=side).drive_angle

    out = wrench_from_contact(x, y, alpha, delta, side=side)
    by_slope = difference(lambda d: drive(r2, polar, alpha + d))
    by_polar = difference(lambda d: drive(r2, polar + d, alpha))
    by_distance = difference(lambda d: drive(r2 * (1 + d), polar, alpha)) / r2
    np.testing.assert_allclose(out.by_slope, by_slope, rtol=0, atol=1e-8)
    np.testing.assert_allclose(1 - out.by_slope, by_polar, rtol=0, atol=1e-8)
    np.testing.assert_allclose(out.by_distance, by_distance, rtol=1e-8, atol=1e-8)
    assert np.all(out.by_distance[out.phase == TANGENTIAL] == 0)


# --- interface -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [-1e-9, np.nextafter(MAX_FRICTION_ANGLE, 1), 1.5, np.nan, np.inf])
def test_impossible_friction_is_refused(bad):
    with refused(ParameterError, "friction angle"):
        wrench_from_contact(0.2, 0.6, 0.1, [0.0, bad])
    with refused(ParameterError, "friction angle"):
        contact_from_wrench(2.0, 1.0, -0.5, 3.0, [0.0, bad])
    wrench_from_contact(0.2, 0.6, 0.1, [0.0, MAX_FRICTION_ANGLE])


def test_shapes_broadcast():
    x, y = np.full((3, 1, 1), 0.2), np.full((4, 1), 0.6)
    alpha, delta = np.linspace(0.0, 0.4, 5), 0.1
    out = wrench_from_contact(x, y, alpha, delta)
    assert {v.shape for v in out} == {(3, 4, 5)}
    one = wrench_from_contact(0.2, 0.6, alpha[3], delta)
    assert {np.shape(v) for v in one} == {()}
    for many, single in zip(out, one, strict=True):
        assert np.all(many[..., 3] == single)
    back = contact_from_wrench(*out[:4], delta)
    assert {v.shape for v in back} == {(3, 4, 5)}
    assert {np.shape(v) for v in contact_from_wrench(*one[:4], delta)} == {()}
    assert {v.shape for v in wrench_from_contact([], 0.5, 0.1)} == {(0,)}
    assert {v.shape for v in contact_from_wrench([], 0.5, 0.1, 1.0)} == {(0,)}


def test_a_phase_that_is_known_is_not_questioned():
    x, y, alpha = np.array([0.2, 1.0]), np.array([0.6, 0.2]), 0.1
    free = wrench_from_contact(x, y, alpha)
    np.testing.assert_array_equal(free.phase, [TIP, NONE])
    lying = wrench_from_contact(x, y, alpha, phase=TANGENTIAL)
    np.testing.assert_array_equal(lying.phase, TANGENTIAL)
    np.testing.assert_array_equal(lying.contact_arclength, free.tangential_arclength)
    ending = wrench_from_contact(x, y, alpha, phase=[TIP, TIP])
    np.testing.assert_array_equal(ending.phase, [TIP, NONE])
    assert ending.drive_angle[0] == free.drive_angle[0]
    assert np.isnan(ending.tangential_arclength).all()


def test_backward_contacts_mirror_forward_ones_exactly():
    x, y, alpha, delta = np.transpose(CONTACTS)
    forward = wrench_from_contact(x, y, alpha, delta)
    backward = wrench_from_contact(-x, y, -alpha, delta, side=-1)
    for name in ("drive_angle", "tip_angle"):
        np.testing.assert_array_equal(getattr(backward, name), np.pi - getattr(forward, name))
    for name in ("holding_moment", "force_x", "by_distance"):
        np.testing.assert_array_equal(getattr(backward, name), -getattr(forward, name))
    for name in ("force_y", "contact_arclength", "phase", "by_slope", "tangential_arclength"):
        np.testing.assert_array_equal(getattr(backward, name), getattr(forward, name))
    both = wrench_from_contact(
        [x, -x], y, [alpha, -alpha], delta, side=np.array([[1], [-1]])
    )  # sides may be mixed in one call
    np.testing.assert_array_equal(both.drive_angle, [forward.drive_angle, backward.drive_angle])

    # π − φ0 is not exact, so the way back is begun from one backward wrench: told by side, or by its sign.
    wrench = np.pi - forward.drive_angle, -forward.holding_moment, -forward.force_x, forward.force_y
    ahead = contact_from_wrench(np.pi - wrench[0], forward.holding_moment, forward.force_x, forward.force_y, delta)
    for behind in (contact_from_wrench(*wrench, delta), contact_from_wrench(*wrench, delta, side=-1)):
        for name in ("contact_x", "slope_angle"):
            np.testing.assert_array_equal(getattr(behind, name), -getattr(ahead, name))
        for name in ("contact_y", "contact_arclength", "modulus"):
            np.testing.assert_array_equal(getattr(behind, name), getattr(ahead, name))
        np.testing.assert_array_equal(behind.tip_angle, np.pi - ahead.tip_angle)

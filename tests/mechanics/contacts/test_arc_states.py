"""Single states of rods whose rest shape is a circular arc, against integration, against one another, and in limits."""

import numpy as np
import pytest

from helpers import integrated_step2
from helpers.integration import rod
from helpers.single_states import assert_slopes_are_differences
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.mechanics.contacts.contact_coordinates import (
    DRIVE_ANGLE,
    PSI1,
    contact_states,
    contact_states_and_slopes,
    place_by_wrench,
)
from tactile_bayes.mechanics.elastica import (
    contact_from_wrench,
    largest_curvature,
    tangential_arclength,
    wrench_from_contact,
)
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP


class Arcs:
    """Contacts of both phases, half of them with friction, with slope angles between −1 and 1."""

    def __init__(self, count=120, *, seed=1, least=0.05, most=3.5, curvatures=(-2.0, 2.0)):
        rng = np.random.default_rng(seed)
        self.delta = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(0.05, 0.65, count))
        self.tip = rng.random(count) < 0.5
        self.curvature = rng.uniform(*curvatures, count)
        psi1 = np.where(self.tip, rng.uniform(0.01 - self.delta, 1.4), -self.delta)
        arclength = np.where(self.tip, 1.0, rng.uniform(0.05, 1.0, count))
        self.z = np.stack([rng.uniform(least, most, count) ** 2, psi1, arclength, np.zeros(count)], axis=-1)
        self.z[:, DRIVE_ANGLE] = rng.uniform(-1.0, 1.0, count) - self.states().place[2]
        keep = np.isfinite(self.states().loads[0])
        assert keep.mean() > 0.8
        for name in ("delta", "tip", "curvature", "z"):
            setattr(self, name, getattr(self, name)[keep])
        self.loads, self.place, *_ = self.states()

    def states(self):
        return contact_states(self.z, self.delta, self.curvature)

    def found(self, side=1):
        """Contacts of the wrenches of one side."""
        moment, force_x, force_y = self.loads
        angle = self.z[:, DRIVE_ANGLE]
        wrench = angle if side > 0 else np.pi - angle, side * moment, side * force_x, force_y
        return contact_from_wrench(*wrench, self.delta, side=side, rest_curvature=side * self.curvature)


def integrated(wrench, curvature, arclengths):
    """x, y, slope and curvature at arc lengths, from the pivot."""
    return rod(wrench, arclengths[-1], rest=curvature, t_eval=arclengths).y


# --- Contact coordinates → wrench and place -----------------------------------------------------------------------


def test_loads_and_place_are_those_of_the_integrated_rod():
    arcs = Arcs(300)
    loads, place = integrated_step2.touched(arcs.z, arcs.delta, arcs.curvature)
    np.testing.assert_allclose(arcs.loads.T, loads.real, atol=1e-11)
    np.testing.assert_allclose(arcs.place.T, place.real, atol=1e-12)


def test_slopes_are_those_of_the_integrated_rod():
    arcs = Arcs()
    _, slopes = contact_states_and_slopes(arcs.z, arcs.delta, arcs.curvature)
    curvature = np.tile(arcs.curvature, 4)
    for number, found in enumerate(slopes):

        def values(z, delta, number=number):
            return integrated_step2.touched(z, delta, curvature)[number]

        right = integrated_step2.slopes(values, arcs.z, arcs.delta)
        np.testing.assert_allclose(found, right, atol=1e-10)


def test_volumes_are_determinants_of_slopes():
    arcs = Arcs()
    rod, slopes = contact_states_and_slopes(arcs.z, arcs.delta, arcs.curvature)
    for volume, free in ((rod.volume_tip, [0, 1, 3]), (rod.volume_tangential, [0, 2, 3])):
        determinant = np.abs(np.linalg.det(slopes.place[:, :3][:, :, free]))
        np.testing.assert_allclose(volume, determinant, atol=1e-12)


def test_rods_that_would_wind_are_no_contacts():
    """Beyond a period of the elastica, swinging and turning over, and where the line of force has passed the pivot."""
    swinging = np.array([[60.0, 0.2, 1.0, 0.0], [60.0, 0.2, 30.0, 0.0]])
    assert np.isnan(contact_states(swinging, 0.0, 0.5).loads).all()
    turning = np.array([[1.0, 0.2, 1.0, 0.0], [1.0, 0.2, 9.0, 0.0], [1.0, 0.2, 1e9, 0.0]])
    np.testing.assert_array_equal(np.isnan(contact_states(turning, 0.0, 3.0).loads[0]), [False, True, True])
    assert np.isnan(contact_states(turning, 0.0, np.nan).loads).all()


# --- Step 2 -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1, -1])
def test_step2_gives_contacts_back(side):
    arcs = Arcs(2000)
    found = arcs.found(side)
    x, y, alpha, arclength = arcs.place
    np.testing.assert_allclose(found[:4], [side * x, y, side * alpha, arclength], atol=1e-12)
    slope = alpha + arcs.delta + arcs.z[:, PSI1]
    np.testing.assert_allclose(found.tip_angle, slope if side > 0 else np.pi - slope, atol=1e-12)


def test_step2_is_that_of_the_integrated_rod():
    """The rod ends at the contact with its rest curvature, which it has nowhere before if the moment is positive."""
    arcs = Arcs()
    found = arcs.found()
    for k, arclength in enumerate(found.contact_arclength):
        wrench = arcs.z[k, DRIVE_ANGLE], *arcs.loads[:, k]
        x, y, slope, curvature = integrated(wrench, arcs.curvature[k], np.linspace(0.0, arclength, 50))
        end = [x[-1], y[-1], slope[-1], curvature[-1]]
        right = [found.contact_x[k], found.contact_y[k], found.tip_angle[k], arcs.curvature[k]]
        np.testing.assert_allclose(end, right, atol=1e-10)
        assert arcs.loads[0, k] < 0.0 or (curvature[:-1] < arcs.curvature[k]).all()


def test_slopes_of_step2_are_those_of_the_integrated_rod():
    arcs = Arcs(seed=2)
    some = arcs.loads[0] > 0.1
    z, delta, curvature = arcs.z[some], arcs.delta[some], arcs.curvature[some]
    wrench = np.concatenate([z[:, [DRIVE_ANGLE]], arcs.loads.T[some]], axis=1)

    def values(wrench, delta):
        return integrated_step2.step2(wrench, delta, np.tile(curvature, len(wrench) // len(curvature)))

    np.testing.assert_allclose(values(wrench, delta).real, arcs.place.T[some], atol=1e-11)
    right = integrated_step2.slopes(values, wrench, delta)
    scale = np.abs(right).max(axis=1, keepdims=True)
    np.testing.assert_array_less(np.abs(place_by_wrench(z, curvature) - right), 1e-10 * scale + np.zeros(right.shape))


@pytest.mark.parametrize("off", [-1e-3, -1e-7, -1e-12, 0.0, 1e-12, 1e-7, 1e-3])
@pytest.mark.parametrize("curvature", [-1.3, 1.3])
def test_step2_is_regular_where_the_parameter_is_one(curvature, off):
    """There the pendulum that the rod is stops to swing and begins to turn over."""
    psi1 = np.linspace(-0.6, 1.4, 21)
    force = curvature**2 / (2.0 * (1.0 + np.sin(psi1)) + 4.0 * off)
    z = np.stack([force, psi1, np.linspace(0.2, 1.0, 21), np.full(21, 1.5)], axis=-1)
    rod = contact_states(z, 0.0, curvature)
    found = contact_from_wrench(z[:, DRIVE_ANGLE], *rod.loads, side=1, rest_curvature=curvature)
    np.testing.assert_allclose(found.modulus, 1.0 + off, atol=1e-14)
    np.testing.assert_allclose(found[:4], rod.place, atol=1e-12)


@pytest.mark.parametrize("curvature", [-0.8, 1e-7, 0.8])
def test_step2_is_regular_where_the_load_vanishes(curvature):
    arcs = Arcs(500, least=1e-9, most=1e-3, curvatures=(curvature, curvature))
    np.testing.assert_allclose(arcs.found()[:4], arcs.place, atol=1e-12)


def test_a_straight_rod_is_the_limit():
    """Linearly in the curvature, in both directions."""
    arcs = Arcs(500, curvatures=(0.0, 0.0))
    for sign in (1.0, -1.0):
        far, near = (
            np.array(contact_from_wrench(arcs.z[:, 3], *arcs.loads, arcs.delta, side=1, rest_curvature=sign * k)[:4])
            - arcs.found()[:4]
            for k in (1e-6, 1e-7)
        )
        assert np.abs(far).max() < 1e-4
        np.testing.assert_allclose(near, 0.1 * far, atol=1e-10 + 1e-3 * np.abs(far).max())


@pytest.mark.parametrize(
    ("drive_angle", "moment", "force", "curvature"),
    [
        (1.0, 0.5, 0.0, 0.4),  # no force
        (1.0, 3.0, 1.0, 1.0),  # the rod is bent the other way, and turns over
        (1.0, -0.1, 1.0, 0.4),  # the moment grows from the pivot
        (1.0, 1.5, 0.01, 2.0),  # nowhere along the rod is it bent so little
        (1.0, 0.5, np.inf, 0.4),
        (1.0, np.nan, 1.0, 0.4),
        (1.0, 0.5, 1.0, np.nan),
        (1.0, 0.5, 1.0, np.inf),
    ],
)
def test_wrenches_without_a_contact(drive_angle, moment, force, curvature):
    found = contact_from_wrench(drive_angle, moment, 0.0, force, side=1, rest_curvature=curvature)
    assert np.isnan(found[:5]).all()


# --- Contact → wrench ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1, -1])
def test_wrenches_integrate_to_their_contacts(side):
    """From the pivot on, with the moment κ0 − κ; and with the tip, or along the contour."""
    arcs = Arcs(60, seed=3)
    x, y, alpha, _ = arcs.place
    own = side * arcs.curvature
    out = wrench_from_contact(side * x, y, side * alpha, arcs.delta, side=side, rest_curvature=own)
    assert (out.phase != NONE).all()
    assert {TIP, TANGENTIAL} == set(out.phase)
    for k, arclength in enumerate(out.contact_arclength):
        end = integrated([values[k] for values in out[:4]], own[k], [arclength])[:, -1]
        np.testing.assert_allclose(end, [side * x[k], y[k], out.tip_angle[k], own[k]], atol=1e-10)
        slope = side * alpha[k] if side > 0 else np.pi - alpha[k]
        assert arclength == 1.0 if out.phase[k] == TIP else end[2] == pytest.approx(slope, abs=1e-10)
    np.testing.assert_allclose(np.arctan2(-side * out.force_x, out.force_y), alpha + arcs.delta, atol=1e-12)


def test_wrenches_are_those_of_which_there_is_one_only():
    """In tangential contact, and of rods that are curved as the load curves them unless it passes the pivot."""
    arcs = Arcs(1000, seed=4)
    phase = np.where(arcs.tip, TIP, TANGENTIAL)
    known = wrench_from_contact(*arcs.place[:3], arcs.delta, rest_curvature=arcs.curvature, phase=phase)
    single = ~arcs.tip | ((arcs.curvature < 0.0) & (arcs.loads[0] > 0.0))
    angle = np.array([known.drive_angle, known.holding_moment])[:, single]
    np.testing.assert_allclose(angle, [arcs.z[single, DRIVE_ANGLE], arcs.loads[0, single]], rtol=1e-9, atol=1e-9)
    found = wrench_from_contact(*arcs.place[:3], arcs.delta, rest_curvature=arcs.curvature)
    np.testing.assert_array_equal(found.phase[single], phase[single])


def test_straight_wrenches_are_the_limit():
    arcs = Arcs(500, seed=5, curvatures=(0.0, 0.0))
    straight, near = (wrench_from_contact(*arcs.place[:3], arcs.delta, rest_curvature=k) for k in (0.0, 1e-9))
    np.testing.assert_array_equal(straight.phase, near.phase)
    for name in ("drive_angle", "holding_moment", "by_slope", "by_distance", "tangential_arclength"):
        right = getattr(straight, name)
        np.testing.assert_allclose(getattr(near, name), right, rtol=1e-5, atol=1e-6)


def test_derivatives_of_the_drive_angle_are_those_of_differences():
    arcs = Arcs(300, seed=6, curvatures=(-2.0, 0.3))
    assert_slopes_are_differences(*arcs.place[:3], arcs.delta, atol=1e-6, rest_curvature=arcs.curvature)


def test_contacts_out_of_reach_have_no_wrench():
    """Beyond the rod; where it is straightened before it reaches; and where it is already curved away further."""
    out = wrench_from_contact([0.9, 0.2, 0.05], [0.6, 0.979, 0.3], [0.1, 0.1, 0.05], rest_curvature=[0.2, 1.9, -30.0])
    np.testing.assert_array_equal(out.phase, NONE)
    assert np.isnan(out.drive_angle).all()
    assert np.isnan(wrench_from_contact(0.2, 0.6, 0.1, rest_curvature=[np.nan, np.inf]).drive_angle).all()


def test_a_rod_curved_toward_the_contour_lies_along_it_above_its_tangent():
    """A straight rod cannot; the moment of the load straightens the arc."""
    point = 0.7, -0.05, 0.0
    assert np.isnan(tangential_arclength(*point))
    length = tangential_arclength(*point, rest_curvature=0.5)
    assert 0.7 < length < 1.0
    assert np.isnan(tangential_arclength(*point, rest_curvature=0.1))


# --- Shape and strain ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1, -1])
def test_the_rod_between_pivot_and_contact_is_the_integrated_one_and_beyond_it_an_arc(side):
    arcs = Arcs(40, seed=7)
    moment, force_x, force_y = arcs.loads
    angle = arcs.z[:, DRIVE_ANGLE] if side > 0 else np.pi - arcs.z[:, DRIVE_ANGLE]
    wrenches = np.stack([angle, side * moment, side * force_x, force_y])
    own = side * arcs.curvature
    x, y = rod_shape(*wrenches, points=21, side=side, rest_curvature=own)
    s = np.linspace(0.0, 1.0, 21)
    for k, arclength in enumerate(arcs.place[3]):
        until = np.append(s[s < arclength], arclength)
        inner = integrated(wrenches[:, k], own[k], until)
        (end_x, end_y, start, _), end = inner[:, -1], inner[2, -1] + own[k] * (s[s >= arclength] - arclength)
        right_x = np.append(inner[0, :-1], end_x + (np.sin(end) - np.sin(start)) / own[k])
        right_y = np.append(inner[1, :-1], end_y - (np.cos(end) - np.cos(start)) / own[k])
        np.testing.assert_allclose([x[k], y[k]], [right_x, right_y], atol=1e-10)


def test_an_unloaded_rod_has_its_rest_shape():
    x, y = rod_shape([0.3, 0.3], 0.0, 0.0, 0.0, points=11, rest_curvature=[0.0, 0.8])
    s = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(x, [s * np.cos(0.3), (np.sin(0.3 + 0.8 * s) - np.sin(0.3)) / 0.8], atol=1e-15)
    np.testing.assert_allclose(y, [s * np.sin(0.3), (np.cos(0.3) - np.cos(0.3 + 0.8 * s)) / 0.8], atol=1e-15)


@pytest.mark.parametrize("side", [1, -1])
def test_the_largest_change_of_curvature_is_that_of_the_integrated_rod(side):
    arcs = Arcs(120, seed=8, least=0.5, curvatures=(-2.0, 3.0))
    some = arcs.loads[0] > 0.0
    x, y, alpha, _ = arcs.place[:, some]
    own, delta = side * arcs.curvature[some], arcs.delta[some]
    out = wrench_from_contact(side * x, y, side * alpha, delta, side=side, rest_curvature=own)
    found = largest_curvature(out, own)
    for k, arclength in enumerate(out.contact_arclength):
        wrench = [values[k] for values in out[:4]]
        change = integrated(wrench, own[k], np.linspace(0.0, arclength, 400))[3] - own[k]
        assert found[k] == pytest.approx(np.abs(change).max(), rel=1e-4)

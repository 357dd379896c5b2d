"""The touching rod in its own coordinates, against integration, and derivatives by the complex step."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.special import ellipkinc

from helpers import integrated_step2
from tactile_bayes.mechanics.contacts.contact_coordinates import (
    ARCLENGTH,
    DRIVE_ANGLE,
    FORCE,
    PSI1,
    ContactStates,
    contact_states,
    contact_states_and_slopes,
    place_by_wrench,
)
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP

PHASES = pytest.mark.parametrize("phase", [TIP, TANGENTIAL], ids=["tip", "tangential"])
FREE = {TIP: [FORCE, PSI1, DRIVE_ANGLE], TANGENTIAL: [FORCE, ARCLENGTH, DRIVE_ANGLE]}

# Amplitudes χ at the pivot; at π the line of force passes through it.
BENT = (0.3, 0.8, 1.6, 2.4, 3.0, np.pi - 1e-3, np.pi - 1e-6)
WEAK = (1e-4, 1e-3, 0.02)  # amplitudes of loads of about χ² EI/L²


class Rods(NamedTuple):
    coordinates: np.ndarray
    delta: np.ndarray


def some_rods(phase, amplitudes, *, seed, count=70, shortest=0.02):
    """Rods of one phase, half of them with friction, of these amplitudes and ones between."""
    rng = np.random.default_rng(seed)
    delta = np.where(rng.random(count) < 0.5, 0.0, rng.uniform(0.0, 0.65, count))
    chi = rng.choice(amplitudes, count)
    between = rng.uniform(min(amplitudes), max(amplitudes), count)
    chi = np.where(rng.random(count) < 0.5, chi, between)
    psi1, arclength = -delta, np.ones(count)
    if phase == TIP:
        psi1 = psi1 + rng.uniform(0.02, 1.0, count) * (1.5 + delta)
    else:
        arclength = np.exp(rng.uniform(np.log(shortest), np.log(0.999), count))
    force = (ellipkinc(chi, 0.5 * (1.0 - np.sin(psi1))) / arclength) ** 2
    beta = delta + rng.uniform(-1.5, 1.5, count)
    drive_angle = np.zeros(count)
    coordinates = np.stack([force, psi1, arclength, drive_angle], axis=-1)
    coordinates[:, DRIVE_ANGLE] = beta - contact_states(coordinates, delta).place[2] - delta
    return Rods(coordinates, delta)


def assert_slopes_agree(found, right, tolerance):
    """Relative to the largest derivative by the same coordinate, (n, outputs, coordinates)."""
    scale = np.broadcast_to(np.abs(right).max(axis=1, keepdims=True), right.shape)
    np.testing.assert_array_less(np.abs(found - right), tolerance * scale + 1e-300)


# --- Loads and place ----------------------------------------------------------------------------------------------


@PHASES
def test_integration_agrees(phase):
    rods = some_rods(phase, BENT + WEAK, seed=3, count=200)
    loads, place = integrated_step2.touched(*rods)
    rod = contact_states(*rods)
    force = rods.coordinates[:, FORCE, None]
    np.testing.assert_allclose(rod.loads.T / force, loads.real / force, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(rod.place.T, place.real, rtol=0.0, atol=1e-12)


def test_slopes_come_with_the_same_values_and_friction_may_be_one_number():
    z = some_rods(TIP, BENT, seed=4).coordinates
    right = contact_states(z, np.full(70, 0.3))
    for other in (contact_states_and_slopes(z, np.full(70, 0.3))[0], contact_states(z, 0.3)):
        for found, expected in zip(other, right, strict=True):
            np.testing.assert_array_equal(found, expected)


def test_what_is_no_rod_is_nan_and_leaves_the_others():
    good = some_rods(TANGENTIAL, BENT, seed=6).coordinates
    wrong = [
        (-1.0, 0.0, 1.0, 1.0),
        (np.nan, 0.0, 1.0, 1.0),
        (2.0, 0.0, 0.0, 1.0),
        (2.0, 0.0, -0.5, 1.0),
        (2.0, np.nan, 1.0, 1.0),
        (1e6, 0.0, 1.0, 1.0),  # the rod would turn round and round
    ]
    alone, alone_slopes = contact_states_and_slopes(good, 0.1)
    mixed, slopes = contact_states_and_slopes(np.concatenate([wrong, good]), 0.1)
    for rows in (mixed.loads.T, mixed.place.T[:, :3], slopes.loads):
        assert np.isnan(rows[: len(wrong)]).reshape(len(wrong), -1).any(axis=1).all()
    for found, right in zip(mixed, alone, strict=True):
        np.testing.assert_array_equal(found[..., len(wrong) :], right)
    for found, right in zip(slopes, alone_slopes, strict=True):
        np.testing.assert_array_equal(found[len(wrong) :], right)


# --- Slopes -------------------------------------------------------------------------------------------------------


@PHASES
@pytest.mark.parametrize("amplitudes", [BENT, WEAK], ids=["bent", "weak"])
def test_slopes_are_those_of_the_integrated_rod(phase, amplitudes):
    rods = some_rods(phase, amplitudes, seed=7)
    _, slopes = contact_states_and_slopes(*rods)
    for number, found in enumerate(slopes):

        def integrated(coordinates, delta, number=number):
            return integrated_step2.touched(coordinates, delta)[number]

        right = integrated_step2.slopes(integrated, *rods)
        assert_slopes_agree(found, right, 1e-11)


@PHASES
def test_volumes_are_the_determinants_of_the_slopes(phase):
    """The volume of a sheet is found in polar coordinates of the contact, the slopes are not."""
    rods = some_rods(phase, BENT, seed=8, count=300)
    rod, slopes = contact_states_and_slopes(*rods)
    determinant = np.abs(np.linalg.det(slopes.place[:, :3][:, :, FREE[phase]]))
    volume = rod.volume_tip if phase == TIP else rod.volume_tangential
    size = np.prod(np.linalg.norm(slopes.place[:, :3][:, :, FREE[phase]], axis=1), axis=1)
    np.testing.assert_array_less(np.abs(volume - determinant), 1e-13 * size)
    assert (volume > 0.0).all()


# --- Slopes of Step 2 ---------------------------------------------------------------------------------------------


def wrench_of(rod: ContactStates, rods: Rods):
    return np.concatenate([rods.coordinates[:, [DRIVE_ANGLE]], rod.loads.T], axis=-1)


def test_contacts_of_step2_beyond_the_tip_have_slopes_too():
    rods = some_rods(TANGENTIAL, (0.3, 0.8, 1.6, 2.4), seed=12)
    longer = rods.coordinates.copy()
    longer[:, ARCLENGTH] *= 3.0
    longer[:, FORCE] /= 9.0
    longer[:, PSI1] += 0.2
    rods = Rods(longer, rods.delta)
    rod = contact_states(*rods)
    right = integrated_step2.slopes(integrated_step2.step2, wrench_of(rod, rods), rods.delta)
    assert_slopes_agree(place_by_wrench(rods.coordinates), right, 1e-10)


@pytest.mark.slow
@PHASES
def test_slopes_of_step2_are_those_of_the_integrated_one(phase):
    """From the pivot on, to the first zero of curvature: relative to the largest slope by the same number."""
    rods = some_rods(phase, BENT + WEAK, seed=13, count=1000, shortest=1e-3)
    rod = contact_states(*rods)
    wrench = wrench_of(rod, rods)
    np.testing.assert_allclose(integrated_step2.step2(wrench, rods.delta).real, rod.place.T, rtol=0.0, atol=1e-11)
    right = integrated_step2.slopes(integrated_step2.step2, wrench, rods.delta)
    assert_slopes_agree(place_by_wrench(rods.coordinates), right, 1e-10)

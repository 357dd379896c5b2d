"""Step 2 and contact posteriors of rods whose rest shape is a circular arc."""

from typing import NamedTuple

import numpy as np
import pytest
import xarray as xr

from helpers.arc_sweeps import loaded_states
from tactile_bayes.contours import Parabola
from tactile_bayes.inference.contact_posterior import infer_contacts
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.phases import PHASE_NAMES
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.reconstruction import reconstruct, samples, samples_of
from tactile_bayes.rig import Rig, make_record

CURVATURES = (-0.7, 0.4)
NAMES = ("contact_x", "contact_y", "slope_angle", "contact_arclength")
UNITS = {"dimensionless": Rod(), "SI": Rod(length=0.2, flexural_rigidity=2.4e-3)}
FRICTION = 0.2


class Swept(NamedTuple):
    record: xr.Dataset
    truth: np.ndarray  # columns by `NAMES`
    phase: np.ndarray
    rod: Rod


def swept(curvature: float, units: str = "dimensionless") -> Swept:
    """Loaded samples of a double sweep along a parabola, with friction."""
    plain = UNITS[units]
    rod = Rod(plain.length, plain.flexural_rigidity, rest_curvature=curvature / plain.length)
    angles = np.linspace(-0.5, 4.0, 120)
    sweep, states = loaded_states(Parabola(0.5, 0.5), [False, True], curvature, FRICTION, angles)
    sign, wrench = np.where(sweep == 1, -1.0, 1.0), states.wrench
    forces = np.stack([sign * wrench.force_x, wrench.force_y]) * rod.force_unit
    columns = {
        "sweep": sweep,
        "direction": np.where(sweep == 1, "backward", "forward"),
        "drive_angle": np.where(sign < 0.0, np.pi - wrench.drive_angle, wrench.drive_angle),
        "holding_moment": sign * wrench.holding_moment * rod.moment_unit,
        "force_x": forces[0],
        "force_y": forces[1],
    }
    place = [sign * states.x, states.y, sign * states.slope_angle, wrench.contact_arclength]
    truth = np.array(place) * np.array([rod.length, rod.length, 1.0, rod.length])[:, None]
    return Swept(make_record(columns, Rig(rod=rod)), truth, np.array(PHASE_NAMES)[wrench.phase], rod)


@pytest.fixture
def with_rest_curvature(monkeypatch):
    """Function that makes a rod the one of every record."""

    def state(rod: Rod) -> None:
        monkeypatch.setattr(samples, "rod_of", lambda record: rod)

    return state


def cell_of(rod: Rod, share: float = 1.0) -> LoadCell:
    return LoadCell(force_noise=0.05 * share * rod.force_unit, moment_noise=0.02 * share * rod.moment_unit)


def values(contacts: xr.Dataset) -> np.ndarray:
    return np.array([contacts[name].values for name in NAMES])


def test_the_rest_curvature_is_mirrored_with_its_sample(with_rest_curvature):
    made = swept(0.4, "SI")
    with_rest_curvature(made.rod)
    found = samples_of(made.record, LoadCell())
    np.testing.assert_allclose(found.rods.curvature, 0.4 * found.side, rtol=1e-15)
    some = found.take(np.array([0, found.side.size - 1]))
    np.testing.assert_allclose(some.rods.curvature, [0.4, -0.4], rtol=1e-15)


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("curvature", CURVATURES)
def test_a_record_without_noise_gives_its_contacts_back(with_rest_curvature, curvature, units):
    made = swept(curvature, units)
    with_rest_curvature(made.rod)
    contacts = reconstruct(made.record, rig=Rig(unknown={"friction": FRICTION}))
    assert (contacts.status == "ok").all()
    np.testing.assert_array_equal(contacts.contact_phase.values, made.phase)
    inward = slides_inward(contacts, made, curvature)
    np.testing.assert_allclose(values(contacts)[:, inward], made.truth[:, inward], atol=1e-10)
    np.testing.assert_allclose(values(contacts)[[0, 1, 3]], made.truth[[0, 1, 3]], atol=1e-10)


def slides_inward(contacts, made, curvature):
    """Where the slope is the true one: all but a few samples of a rod that is curved toward the object, where it is
    the other end of those that friction allows."""
    slope, truth = contacts.slope_angle.values, made.truth[2]
    inward = np.abs(slope - truth) < 1e-6
    other = contacts.least_slope_angle.values + contacts.greatest_slope_angle.values - slope
    np.testing.assert_allclose(other[~inward], truth[~inward], atol=1e-9)
    assert np.count_nonzero(~inward) <= (10 if curvature > 0.0 else 0)
    return inward


@pytest.mark.parametrize("curvature", CURVATURES)
def test_constrained_contacts_of_a_record_without_noise_are_the_true_ones(with_rest_curvature, curvature):
    made = swept(curvature)
    with_rest_curvature(made.rod)
    contacts = reconstruct(
        made.record, method="constrained", rig=Rig(load_cell=cell_of(made.rod, 1e-3), unknown={"friction": FRICTION})
    )
    # Elsewhere the rod slides outward, or sticks.
    inward = slides_inward(reconstruct(made.record, rig=Rig(unknown={"friction": FRICTION})), made, curvature)
    np.testing.assert_allclose(values(contacts)[:, inward], made.truth[:, inward], atol=1e-7)
    np.testing.assert_array_less(contacts.misfit.values[inward], 1e-6)
    assert abs(contacts.attrs["axial_score"]) < 1e-2
    clear = contacts.edge_distance.values > 1.0
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(contacts.contact_phase.values[clear], made.phase[clear])


@pytest.mark.parametrize("curvature", CURVATURES)
def test_misfits_are_those_of_noise_and_tell_of_a_rod_that_is_curved(with_rest_curvature, curvature):
    """False alarms: 1 in 1000 of each number."""
    made = swept(curvature)
    cell = cell_of(made.rod, 0.3)
    measured = cell.measure(made.record, rng=1)
    known = {"method": "constrained", "rig": Rig(load_cell=cell, unknown={"friction": FRICTION})}
    with_rest_curvature(Rod())
    straight = reconstruct(measured, **known)
    assert straight.attrs["misfit_probability"] < 1e-6
    with_rest_curvature(made.rod)
    contacts = reconstruct(measured, **known)
    assert contacts.attrs["misfit_samples"] > 40
    assert 5e-4 < contacts.attrs["misfit_probability"] < 1.0 - 5e-4
    assert abs(contacts.attrs["axial_score"]) < 3.3
    ok = contacts.status.values == "ok"
    off = (values(contacts) - made.truth)[:2] / [contacts.contact_x_sd.values, contacts.contact_y_sd.values]
    assert ok.sum() > 30
    # The mean of squares of standard normal numbers, twice, as few as they are.
    assert 0.5 < np.mean(off[:, ok] ** 2) < 1.7


def test_contact_posteriors_are_near_the_constrained_contacts(with_rest_curvature):
    """Where errors are small; the mean of 1000 draws is near the most likely contact, and so is their spread."""
    made = swept(-0.7)
    cell = cell_of(made.rod, 0.1)
    measured = cell.measure(made.record.isel(sample=slice(None, None, 12)), rng=2)
    with_rest_curvature(made.rod)
    fitted = reconstruct(measured, method="constrained", rig=Rig(load_cell=cell, unknown={"friction": FRICTION}))
    tree = infer_contacts(measured, rig=Rig(load_cell=cell, unknown={"friction": FRICTION}), rng=1)
    ok = fitted.status.values == "ok"
    assert ok.sum() >= 4
    assert tree["sample_stats"].converged.values[ok].all()
    for name in NAMES[:3]:
        draws = tree["posterior"][name].stack(all=("chain", "draw")).values[ok]
        sd = fitted[f"{name}_sd"].values[ok]
        np.testing.assert_array_less(np.abs(draws.mean(axis=1) - fitted[name].values[ok]), 0.35 * sd)
        np.testing.assert_allclose(draws.std(axis=1), sd, rtol=0.25)

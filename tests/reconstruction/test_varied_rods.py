"""Contacts of rods that vary along their length: from scans back to the truth, in either direction."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tactile_bayes as tb
from helpers.integration import ATOL, RTOL
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.mechanics.contacts.contact_coordinates import (
    contact_states,
    contact_states_and_slopes,
    place_by_wrench,
)
from tactile_bayes.mechanics.elastica import contact_from_wrench
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig import Rig

RODS = {
    "tapered": tb.Rod(diameter=0.04, taper=0.5),
    "tapered and curved": tb.Rod(taper=0.9, rest_curvature=-0.4),
    "curved along it": tb.Rod(rest_curvature=lambda s: 0.8 * s - 0.5),
    "measured": tb.Rod(
        rest_curvature=([0.0, 0.4, 1.0], [0.1, -0.2, -0.5]), rigidity_profile=lambda s: np.exp(-2.0 * s)
    ),
}
CELL = tb.LoadCell(force_noise=1e-9, moment_noise=1e-9)
TRUTHS = ("contact_x", "contact_y", "slope_angle", "contact_arclength")


def swept(name, friction=0.0):
    return tb.scan(
        tb.contours.Circle(0.3, 0.5),
        rig=Rig(rod=RODS[name], unknown={"friction": friction}),
        drive_step=np.radians(4.0),
    ).record


@pytest.mark.parametrize("method", ["raw", "constrained"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("name", RODS)
def test_a_scan_without_noise_gives_its_contacts_back(name, friction, method):
    record = swept(name, friction)
    found = tb.reconstruct(record, method=method, rig=Rig(load_cell=CELL, unknown={"friction": friction}))
    loaded = record["truth_contact_phase"].values != "none"
    assert set(found["status"].values[loaded]) <= {"ok", "between phases"}
    ends = [found[f"{end}_slope_angle"].values[loaded] for end in ("least", "greatest")]
    slope = record["truth_slope_angle"].values[loaded]
    assert np.all((ends[0] - 1e-9 <= slope) & (slope <= ends[1] + 1e-9))
    inward = np.abs(found["slope_angle"].values[loaded] - slope) < 1e-9  # elsewhere it slides outward at first
    assert np.mean(inward) > 0.9
    for truth in TRUTHS:
        where = inward if truth == "slope_angle" or method == "constrained" else np.ones_like(inward)
        expected = record[f"truth_{truth}"].values[loaded][where]
        np.testing.assert_allclose(found[truth].values[loaded][where], expected, atol=1e-9)


@pytest.mark.parametrize("name", ["tapered", "curved along it"])
def test_an_si_record_states_all_that_step_2_takes(name):
    own = RODS[name]
    rod = tb.Rod(0.1, 1.2e-5, taper=own.taper, rest_curvature=lambda s: 10.0 * _values(own, 10.0 * s))
    record = tb.scan(
        tb.contours.Circle(0.03, 0.05), rig=Rig(rod=rod), drive_step=np.radians(4.0), direction="forward"
    ).record
    found = tb.reconstruct(record, rig=Rig(load_cell=tb.LoadCell(force_noise=1e-12, moment_noise=1e-13)))
    loaded = record["truth_contact_phase"].values != "none"
    np.testing.assert_allclose(found["contact_x"].values[loaded], record["truth_contact_x"].values[loaded], atol=1e-10)


def _values(rod, s):
    curvature = rod.rest_curvature
    return curvature(s) if callable(curvature) else np.full(np.shape(s), curvature)


def _coordinates(record, side):
    """Coordinates of the contacts of the sweeps of one side, mirrored to forward ones."""
    loaded = (record["truth_contact_phase"].values != "none") & (
        record["direction"].values == ("forward" if side > 0.0 else "backward")
    )
    part = record.isel(sample=loaded)
    force = np.hypot(part["force_x"], part["force_y"]).values
    tip_angle, angle = part["truth_tip_angle"].values, part["drive_angle"].values
    if side < 0.0:
        tip_angle, angle = np.pi - tip_angle, np.pi - angle
    psi1 = tip_angle - np.arctan2(-side * part["force_x"].values, part["force_y"].values)
    z = np.stack([force, psi1, part["truth_contact_arclength"].values, angle], axis=1)
    return z[force > 1e-3], part.isel(sample=force > 1e-3)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("name", RODS)
def test_states_follow_from_their_coordinates(name, side):
    record = swept(name)
    z, part = _coordinates(record, side)
    rods = RODS[name].mirrored(np.full(len(z), side))
    found, slopes = contact_states_and_slopes(z, 0.0, rods)
    for k, channel in enumerate(CHANNELS):
        sign = 1.0 if channel == "force_y" else side
        np.testing.assert_allclose(found.loads[k], sign * part[channel].values, rtol=1e-8, atol=1e-9)
    h = 1e-6
    for c in range(4):
        step = h * np.eye(4)[c]
        more, less = (contact_states(z + sign * step, 0.0, rods) for sign in (1.0, -1.0))
        by = (more.loads - less.loads).T / (2.0 * h)
        scale = 1.0 + np.abs(slopes.loads[:, :, c])
        inside = np.isfinite(by).all(axis=1)
        assert inside.mean() > 0.8
        np.testing.assert_array_less(np.abs(by - slopes.loads[:, :, c])[inside], 2e-5 * scale[inside])


@pytest.mark.parametrize("name", RODS)
def test_derivatives_of_step_2_are_its_differences(name):
    z, part = _coordinates(swept(name), 1.0)
    found = place_by_wrench(z, RODS[name].mirrored(np.ones(len(z))))
    wrench = np.stack([part["drive_angle"].values, *(part[channel].values for channel in CHANNELS)])
    h = 1e-7
    for c in range(4):
        step = h * np.eye(4)[c][:, None]
        more, less = (
            contact_from_wrench(*(wrench + sign * step), side=1.0, profile=RODS[name].profile) for sign in (1.0, -1.0)
        )
        for k, field in enumerate(TRUTHS):
            by = (getattr(more, field) - getattr(less, field)) / (2.0 * h)
            scale = 1.0 + np.abs(found[:, k]).max(axis=1)
            good = np.isfinite(by) & (scale < 1e3)
            assert good.mean() > 0.7
            np.testing.assert_array_less(np.abs(by - found[:, k, c])[good], 1e-4 * scale[good])


@pytest.mark.parametrize("name", RODS)
@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_the_shape_is_the_integrated_one(name, direction):
    """Up to the contact, and beyond it the rest shape."""
    rod, record = RODS[name], swept(name)
    side = 1.0 if direction == "forward" else -1.0
    chosen = (record["truth_contact_phase"].values == "tangential") & (record["direction"].values == direction)
    state = record.isel(sample=np.flatnonzero(chosen)[::6])
    wrench = [state[column].values for column in ("drive_angle", *CHANNELS)]
    x, y = rod_shape(*wrench, points=21, side=side, rods=rod.mirrored(side))
    given = zip(*wrench, state["truth_contact_arclength"].values, strict=True)
    for i, (angle, moment, force_x, force_y, arclength) in enumerate(given):

        def slope(s, z, force_x=force_x, force_y=force_y, arclength=arclength):
            stiffness = (1.0 - rod.taper * s) ** 4
            stiffness *= 1.0 if rod.rigidity_profile is None else float(rod.rigidity_profile(s))
            bending = z[3] / stiffness if s < arclength else 0.0
            rate = force_y * np.cos(z[2]) - force_x * np.sin(z[2])
            return [np.cos(z[2]), np.sin(z[2]), float(_values(rod, s)) + bending, rate]

        ends = np.linspace(0.0, 1.0, 21)
        found = np.concatenate(
            [
                solve_ivp(
                    slope,
                    (0.0, arclength),
                    [0.0, 0.0, angle, -moment],
                    "DOP853",
                    ends[ends < arclength],
                    rtol=RTOL,
                    atol=ATOL,
                )
                .y[:2]
                .T,
                _free_end(slope, angle, moment, arclength, ends),
            ]
        )
        np.testing.assert_allclose(np.stack([x[i], y[i]], axis=1), found, atol=1e-8)


def _free_end(slope, angle, moment, arclength, ends):
    at_contact = solve_ivp(slope, (0.0, arclength), [0.0, 0.0, angle, -moment], "DOP853", rtol=RTOL, atol=ATOL).y[:, -1]
    beyond = ends[ends >= arclength]
    start = [*at_contact[:3], 0.0]
    return solve_ivp(slope, (arclength, 1.0), start, "DOP853", beyond, rtol=RTOL, atol=ATOL).y[:2].T


def test_a_contact_posterior_of_a_tapered_rod_holds_the_truth():
    record = tb.scan(tb.contours.Circle(0.3, 0.5), rig=Rig(rod=RODS["tapered"]), drive_step=np.radians(10.0)).record
    cell = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
    measured = cell.measure(record, rng=3)
    contacts = tb.infer_contacts(measured, rig=Rig(load_cell=cell), rng=1)["posterior"].to_dataset()
    contacts = contacts.isel(sample=np.isfinite(contacts["contact_x"].values).all(axis=(0, 1)))
    truth = record["truth_contact_x"].values[contacts["sample"].values]
    low, high = contacts["contact_x"].quantile([0.005, 0.995], dim=("chain", "draw")).values
    assert truth.size > 10
    assert np.mean((low <= truth) & (truth <= high)) > 0.85

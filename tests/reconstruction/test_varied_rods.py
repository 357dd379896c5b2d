"""Contacts of rods that are curved or vary along their length: from scans back to the truth, in either direction."""

import numpy as np
import pytest

import tactile_bayes as tb
from tactile_bayes.mechanics.contacts.contact_coordinates import (
    contact_states,
    contact_states_and_slopes,
    place_by_wrench,
)
from tactile_bayes.mechanics.elastica import contact_from_wrench
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig import Rig

RODS = {
    "arc": tb.Rod(rest_curvature=-0.7),
    "arc toward the object": tb.Rod(rest_curvature=0.4),
    "tapered": tb.Rod(diameter=0.04, taper=0.5),
    "tapered and curved": tb.Rod(taper=0.9, rest_curvature=-0.4),
    "curved along it": tb.Rod(rest_curvature=lambda s: 0.8 * s - 0.5),
    "measured": tb.Rod(
        rest_curvature=([0.0, 0.4, 1.0], [0.1, -0.2, -0.5]), rigidity_profile=lambda s: np.exp(-2.0 * s)
    ),
}
VARIED = [name for name, rod in RODS.items() if rod.profile is not None]
CELL = tb.LoadCell(force_noise=1e-9, moment_noise=1e-9)
NOISY = tb.LoadCell(force_noise=5e-3, moment_noise=2e-3)
TRUTHS = ("contact_x", "contact_y", "slope_angle", "contact_arclength")


def swept(name, friction=0.0):
    rig = Rig(rod=RODS[name], unknown={"friction": friction})
    return tb.scan(tb.contours.Circle(0.3, 0.5), rig=rig, drive_step=np.radians(4.0)).record


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
    phase, true_phase = (of.values[loaded][inward] for of in (found["contact_phase"], record["truth_contact_phase"]))
    assert method == "constrained" or (phase == true_phase).all()
    for truth in TRUTHS:
        where = inward if truth == "slope_angle" or method == "constrained" else np.ones_like(inward)
        expected = record[f"truth_{truth}"].values[loaded][where]
        np.testing.assert_allclose(found[truth].values[loaded][where], expected, atol=1e-9)


@pytest.mark.parametrize("name", ["arc", "tapered", "curved along it"])
def test_an_si_record_states_all_that_step_2_takes(name):
    bent = RODS[name].rest_curvature
    bent = (lambda s, own=bent: 10.0 * own(10.0 * s)) if callable(bent) else 10.0 * bent
    rod = tb.Rod(0.1, 1.2e-5, taper=RODS[name].taper, rest_curvature=bent)
    record = tb.scan(
        tb.contours.Circle(0.03, 0.05), rig=Rig(rod=rod), drive_step=np.radians(4.0), direction="forward"
    ).record
    found = tb.reconstruct(record, rig=Rig(load_cell=tb.LoadCell(force_noise=1e-12, moment_noise=1e-13)))
    loaded = record["truth_contact_phase"].values != "none"
    np.testing.assert_allclose(found["contact_x"].values[loaded], record["truth_contact_x"].values[loaded], atol=1e-10)


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
@pytest.mark.parametrize("name", VARIED)
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


@pytest.mark.parametrize("name", VARIED)
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


@pytest.mark.parametrize("name", ["arc", pytest.param("tapered", marks=pytest.mark.slow)])
def test_contact_posteriors_are_near_the_constrained_contacts(name):
    """Where errors are small and the edge is far: the mean of 1000 draws, and their spread."""
    rig = Rig(load_cell=NOISY, unknown={"friction": 0.2})
    measured = NOISY.measure(swept(name, 0.2), rng=2)
    forward = np.flatnonzero(measured["holding_moment"].values > 0.1)
    measured = measured.isel(sample=forward[::4])
    fitted = tb.reconstruct(measured, method="constrained", rig=rig)
    tree = tb.infer_contacts(measured, rig=rig, rng=1)
    ok = (fitted["status"].values == "ok") & (fitted["edge_distance"].values > 3.0)
    assert ok.sum() >= 4
    assert tree["sample_stats"]["converged"].values[ok].all()
    for truth in TRUTHS[:3]:
        draws = tree["posterior"][truth].stack(all=("chain", "draw")).values[ok]
        deviation = fitted[f"{truth}_sd"].values[ok]
        np.testing.assert_array_less(np.abs(draws.mean(axis=1) - fitted[truth].values[ok]), 0.35 * deviation)
        np.testing.assert_allclose(draws.std(axis=1), deviation, rtol=0.25)

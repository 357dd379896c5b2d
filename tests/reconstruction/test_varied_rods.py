"""Contacts of rods that are curved or vary along their length: from scans back to the truth, in either direction."""

import numpy as np
import pytest

import tactile_bayes as tb
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

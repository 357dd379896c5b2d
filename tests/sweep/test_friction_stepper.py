"""The stepper of rods with friction against the package where friction has no history, and against itself elsewhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from helpers.friction_cases import drawn_case, scanned
from helpers.friction_contact import Flexible
from helpers.friction_stepper import step_through

LOADS = ("holding_moment", "force_x", "force_y")
PARABOLA = {"family": "parabola", "a": 0.6, "q": 0.45, "x_c": 0.1}
TAPERED = {"taper": 0.5, "curvature": (-0.2, 0.3)}
TURNED = [[0.0, 0.0, 0.4], [0.0, 0.0, 2.2]]
CARRIED = [[0.8, -0.1, 1.2], [-0.4, -0.15, 1.5]]


def case_of(rod, friction, poses, step=0.02):
    return {"rod": rod, "contour": PARABOLA, "friction": friction, "poses": poses, "step": step}


def agree(case, tolerance):
    """Loads at all samples, and the travels of first contact and of the end."""
    scan, found = scanned(case), step_through(case)
    record, (sweep,) = scan.record, scan.sweeps
    n = min(record.sizes["sample"], found["travel"].size)
    touching = found["kind"][:n] != "none"
    assert touching.any()
    for name in LOADS:
        np.testing.assert_allclose(found[name][:n], record[name].values[:n], atol=tolerance)
    phase = np.where(record.truth_contact_phase.values[:n] == "tip", "tip", "flank")
    assert np.array_equal(found["kind"][:n][touching], phase[touching])
    assert found.events[0][0] == pytest.approx(sweep.first_contact.travel, abs=1e-9)
    ends = [t for t, word in found.events if word in ("snap-off", "release")]
    if sweep.snap_off.kind != "never":
        assert ends[0] == pytest.approx(sweep.snap_off.travel, abs=2e-6)
    else:
        assert not ends


@pytest.mark.parametrize("poses", [TURNED, CARRIED], ids=["turned", "carried"])
@pytest.mark.parametrize("rod", [{}, TAPERED], ids=["straight", "tapered and curved"])
@pytest.mark.parametrize("friction", [0.0, 0.6])
def test_one_way_it_slides_as_the_package_says(rod, friction, poses):
    agree(case_of(rod, friction, poses), 1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_states_are_equilibria_inside_the_cone(seed):
    case = drawn_case(np.random.default_rng(seed))
    found, delta = step_through(case), math.atan(case["friction"])
    off = found["force_angle"] - found["slope_angle"]
    for name, sign in (("stick", 0.0), ("slip+", -1.0), ("slip-", 1.0)):
        chosen = off[found["mode"] == name]
        assert np.all(np.abs(chosen) <= delta + 1e-9) if name == "stick" else np.allclose(chosen, sign * delta)
    assert np.all(found["clearance"] > -1e-7)
    assert np.all(np.diff(found["dissipated"]) >= -1e-12)
    for i in np.flatnonzero(found["kind"] != "none")[::40]:
        assert np.allclose(integrated_end(case, found, i), 0.0, atol=1e-8)


def integrated_end(case, found, i):
    """Miss of the contact point, its bending moment and, in flank contact, the slope there, by integration."""
    rod, (fx, fy) = Flexible(**case["rod"]), (found["force_x"][i], found["force_y"][i])

    def bend(s, z):
        flexible, _, curved, _ = rod.along(np.asarray(s))
        return [math.cos(z[2]), math.sin(z[2]), curved + flexible * z[3], fy * math.cos(z[2]) - fx * math.sin(z[2])]

    start = [found[name][i] for name in ("base_x", "base_y", "drive_angle")] + [-found["holding_moment"][i]]
    x, y, slope, moment = solve_ivp(
        bend, (0.0, found["contact_arclength"][i]), start, method="DOP853", rtol=1e-11, atol=1e-12
    ).y[:, -1]
    tangent = math.sin(slope - found["slope_angle"][i]) if found["kind"][i] == "flank" else 0.0
    return [x - found["contact_x"][i], y - found["contact_y"][i], moment, tangent]


@pytest.mark.parametrize("rod", [{}, TAPERED], ids=["straight", "tapered and curved"])
def test_work_is_stored_or_dissipated(rod):
    """To second order in the step, on a way that slips, sticks, and slips back."""
    poses = [TURNED[0], TURNED[1], [0.0, 0.0, 1.2], TURNED[1]]
    steps = (0.02, 0.01)
    coarse, fine = (np.abs(step_through(case_of(rod, 0.4, poses, step)).imbalance).max() for step in steps)
    assert fine < 3e-4
    assert fine < 0.4 * coarse

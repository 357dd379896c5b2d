"""Objects that yield along their normal: rods integrated apart, and the work of the drive."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq

from helpers.integration import rod
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.mechanics.branches.line import lines_through
from tactile_bayes.mechanics.paths import trace
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import Motion, Translation, scan
from tactile_bayes.sweep.path import to_sweep_frame

COMPLIANCE = 0.02
# An upright rod whose tip sticks where the drive turns back, if there is friction.
THERE = np.r_[np.linspace(-0.6, 0.1, 71), np.linspace(0.095, -0.2, 60)]
BACK = Motion(x=THERE, y=0.0 * THERE, drive_angle=0.5 * np.pi + 0.0 * THERE)


def rod_under(state):
    """Position and direction along a rod that the loads at its base bend, by integration of its equation."""
    wrench = [float(state[name]) for name in ("drive_angle", "holding_moment", "force_x", "force_y")]
    found = rod(wrench, 1.0, dense_output=True, max_step=0.02).sol
    return found, lambda s: -found(s)[3]


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize(
    ("contour", "options"),
    [
        (Circle(0.4, q=0.6), {}),
        (Parabola(0.5, q=0.5), {"direction": "backward"}),
        (Parabola(1.5, q=0.5), {"drive": Translation((0.9, -0.1), 3.1416, 1.4, 1.8)}),
        (Circle(0.3, q=0.82), {"drive": BACK}),
    ],
)
def test_the_rod_lies_on_the_contour_as_far_as_that_has_yielded(contour, options, friction):
    rig = Rig(unknown={"contact_compliance": COMPLIANCE, "friction": friction})
    swept = scan(contour, rig, **({} if "drive" in options else {"drive_step": 0.05}), **options).record
    loaded = swept.isel(sample=np.flatnonzero(swept.truth_contact_phase.values != "none"))
    assert loaded.sizes["sample"] > 20
    farthest = 0.0
    for k in range(0, loaded.sizes["sample"], max(1, loaded.sizes["sample"] // 25)):
        state = loaded.isel(sample=k)
        along, curvature = rod_under(state)
        is_tip = str(state.truth_contact_phase.values) == "tip"
        s = 1.0 if is_tip else brentq(curvature, 0.02, 1.0, xtol=1e-14)
        slope = float(state.truth_slope_angle)
        normal = np.array([-np.sin(slope), np.cos(slope)])
        pressed = COMPLIANCE * abs(normal @ [float(state.force_x), float(state.force_y)])
        farthest = max(farthest, pressed)
        at = along(s)
        place = np.array([float(state.truth_contact_x), float(state.truth_contact_y)]) + pressed * normal
        base = np.array([float(state.base_x), float(state.base_y)])
        np.testing.assert_allclose(base + at[:2], place, rtol=0, atol=2e-9)
        assert abs(curvature(s)) < 1e-8
        if not is_tip:
            assert abs(np.sin(at[2] - slope)) < 2e-8
    assert farthest > 0.01


def test_the_work_of_the_drive_is_in_the_rod_and_in_the_object():
    rig = Rig(unknown={"contact_compliance": COMPLIANCE, "friction": 0.0})
    swept = scan(Parabola(0.5, q=0.5), rig, direction="forward", drive_step=0.002).record
    loaded = swept.isel(sample=np.flatnonzero(swept.truth_contact_phase.values != "none"))
    work = cumulative_trapezoid(loaded.holding_moment, loaded.drive_angle, initial=0.0)
    stored = []
    for k in (0, 200, 400, 600):
        state = loaded.isel(sample=k)
        _, curvature = rod_under(state)
        tip = str(state.truth_contact_phase.values) == "tip"
        end = 1.0 if tip else brentq(curvature, 0.02, 1.0, xtol=1e-14)
        s = 0.5 * end * (np.polynomial.legendre.leggauss(40)[0] + 1.0)
        bent = 0.25 * end * np.polynomial.legendre.leggauss(40)[1] @ np.array([curvature(x) ** 2 for x in s])
        force = np.hypot(float(state.force_x), float(state.force_y))
        stored.append(bent + 0.5 * COMPLIANCE * force**2)
    np.testing.assert_allclose(np.diff(stored), np.diff(work[[0, 200, 400, 600]]), rtol=1e-5)


def test_an_object_that_does_not_yield_is_the_limit_of_one_that_hardly_does():
    rigs = [Rig(unknown={"contact_compliance": c, "friction": 0.2}) for c in (0.0, 1e-9)]
    stiff, hardly = (scan(Circle(0.4, q=0.6), rig, drive_step=0.1).record for rig in rigs)
    np.testing.assert_allclose(hardly.force_y, stiff.force_y, rtol=0, atol=1e-6)


def test_legs_of_a_rod_that_rolls_on_an_object_that_yields_are_as_accurate_as_others():
    angle = np.r_[np.linspace(0.4, 2.0, 120), np.linspace(1.99, 0.4, 120)]
    line = lines_through(np.stack([0.0 * angle, 0.0 * angle, angle], axis=1), 1.0, backward=False)
    frame = to_sweep_frame(Parabola(0.5, q=0.3), (0.0, 0.0), "forward", Rod())
    for compliance in (0.0, 0.002, 0.005):
        options = {"friction_angle": np.arctan(0.3), "contact_compliance": compliance, "lines": line.lines[None]}
        fine, coarse = (trace(frame, tolerance=tolerance, **options) for tolerance in (None, np.full(3, 1e-4)))
        assert [mode.sticks and not mode.tip for mode in fine.modes()[0]] == [False, True, False]
        loads = fine.observables(line.travels)
        assert np.abs(loads).max() > 10.0
        np.testing.assert_allclose(coarse.observables(line.travels), loads, rtol=0, atol=1e-5)

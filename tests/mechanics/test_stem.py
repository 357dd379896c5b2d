"""Rods on a rigid stem, against integration from the pivot and rods with a stiff first piece."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tactile_bayes as tb
from helpers.integration import ATOL, RTOL
from helpers.refusals import refused
from helpers.single_states import assert_slopes_are_differences
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.errors import ContourError, ParameterError, ReachError
from tactile_bayes.mechanics.branches.line import lines_through
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.mechanics.contacts.contact_coordinates import (
    contact_states,
    contact_states_and_slopes,
    place_by_wrench,
)
from tactile_bayes.mechanics.elastica import contact_from_wrench, wrench_from_contact
from tactile_bayes.mechanics.paths import trace
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP
from tactile_bayes.mechanics.rods.along import Along
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import Rig

STEM = 0.15
CIRCLE = tb.contours.Circle(0.3, 0.6)
RODS = {
    "straight": Rod(stem=STEM),
    "arc": Rod(rest_curvature=-0.5, stem=STEM),
    "traced": Rod(rest_curvature=lambda s: 0.4 * s * s - 0.2, taper=0.3, stem=STEM),
}
CARRIED = np.array([[0.9, 0.0, 1.2], [-0.9, 0.1, 1.5]])
SHIFTED = np.array([[1.0, 0.0, 1.3], [-0.9, 0.0, 1.3]])


def ends(rod, state):
    """Contact point, slope and moment there, by integration of the stem and the rod from a state at the pivot."""
    drive_angle, moment, force_x, force_y = state[5:9]

    def rates(s, z):
        rigidity = (1.0 - rod.taper * max(s, 0.0)) ** 4
        rest = rod.rest_curvature(s) if isinstance(rod.rest_curvature, Along) else rod.rest_curvature
        curvature = rest + z[3] / rigidity if s >= 0.0 else 0.0
        return [np.cos(z[2]), np.sin(z[2]), curvature, force_y * np.cos(z[2]) - force_x * np.sin(z[2])]

    z = [0.0, 0.0, drive_angle, -moment]
    for part in ((-rod.stem, -1e-300), (0.0, state[9])):
        z = solve_ivp(rates, part, z, method="DOP853", rtol=RTOL, atol=ATOL).y[:, -1]
    return z


@pytest.mark.parametrize("drive", ["turned", "carried", "shifted"])
@pytest.mark.parametrize("name", RODS)
def test_states_satisfy_the_integrated_equations(name, drive):
    """With friction and a compliant suspension, which yields at the pivot: the rod ends at the contact, unbent."""
    rod, compliance, friction, base = RODS[name], 0.08, 0.2, np.zeros((1, 2))
    poses = {"carried": CARRIED, "shifted": SHIFTED}.get(drive)
    lines = None if poses is None else lines_through(poses, 1.0)
    if lines is not None:
        base = poses[:1, :2]
    frame = SweepFrame(
        CIRCLE.broadcast_to((1,)), *base.T, 1.0, 0.0, np.array([False]), rod.arc_curvature, rod.taper, rod.stem
    )
    known = {"friction_angle": friction, "suspension_compliance": compliance, "profile": rod.profile}
    known |= {} if lines is None else {"lines": lines.lines[None]}
    bounds = trace(frame, **known)
    travels = np.linspace(bounds.first_angle[0], bounds.snap_angle[0], 12)[1:-1]
    states = trace(frame, drive_angles=travels, **known).sampled[0]
    assert {TIP, TANGENTIAL} >= set(states[:, 0]) > set()
    for travel, state in zip(travels, states, strict=True):
        assert state[0] != NONE
        whole = 0.0 if poses is None else travel / np.linalg.norm(poses[1] - poses[0])
        driven = travel if poses is None else poses[0, 2] + whole * (poses[1, 2] - poses[0, 2])
        at = base[0] + (0.0 if poses is None else whole * (poses[1] - poses[0])[:2])
        assert state[5] + compliance * state[6] == pytest.approx(driven, abs=2e-10)
        x, y, slope, moment = ends(rod, state)
        surface = CIRCLE.point(state[4])
        assert (at[0] + x, at[1] + y) == pytest.approx((float(surface[0]), float(surface[1])), abs=1e-9)
        assert slope == pytest.approx(state[10], abs=1e-9)
        assert moment == pytest.approx(0.0, abs=2e-9)
        assert abs(np.arctan2(-state[7], state[8]) - state[4]) == pytest.approx(friction, abs=1e-10)
        assert (state[9] == 1.0) if state[0] == TIP else (slope == pytest.approx(state[4], abs=1e-9))


@pytest.mark.parametrize("curvature", [0.0, -0.4])
@pytest.mark.parametrize("drive", [None, tb.Translation((1.0, 0.0), np.pi, 1.3, 1.9, drive_step=0.02)])
def test_a_stiff_first_piece_is_a_stem(curvature, drive):
    """Of a rod that is ten million times as stiff there: whole sweeps agree, first contact and snap-off too."""
    stiff, whole = 1e7, 1.0 + STEM
    long = Rod(
        whole,
        stiff,
        rest_curvature=Along((0.0, STEM, whole), ((0.0,), (curvature,))),
        rigidity_profile=Along((0.0, STEM, whole), ((1.0,), (1.0 / stiff,))),
    )
    own = Rod(rest_curvature=curvature, stem=STEM)
    options = {"direction": "forward", "drive_step": 0.02} if drive is None else {"drive": drive}
    one, other = (tb.scan(CIRCLE, rig=Rig(rod=rod, unknown={"friction": 0.1}), **options) for rod in (own, long))
    for name in ("first_contact", "snap_off"):
        found, expected = (getattr(scan.sweeps[0], name) for scan in (one, other))
        assert found.drive_angle == pytest.approx(expected.drive_angle, abs=1e-5)
        assert (found.base_x, found.contact_x) == pytest.approx((expected.base_x, expected.contact_x), abs=1e-4)
    if drive is None:
        angles = np.linspace(1.0, 2.4, 80)
        one, other = (
            tb.scan(CIRCLE, Rig(rod=rod, unknown={"friction": 0.1}), direction="forward", drive_angles=angles)
            for rod in (own, long)
        )
    for name in ("holding_moment", "force_x", "force_y"):
        assert np.abs(one.record[name]).max() > 0.1
        np.testing.assert_allclose(one.record[name], other.record[name], atol=1e-4)


def test_backward_sweeps_are_mirror_images():
    forward, backward = (
        tb.scan(
            CIRCLE, rig=Rig(rod=tb.Rod(rest_curvature=bend, stem=STEM), unknown={"friction": 0.1}), direction=way
        ).sweeps[0]
        for bend, way in ((0.4, "forward"), (-0.4, "backward"))
    )
    for name in ("first_contact", "snap_off"):
        one, other = getattr(forward, name), getattr(backward, name)
        assert other.drive_angle == pytest.approx(np.pi - one.drive_angle, abs=1e-12)
        assert other.contact_x == pytest.approx(-one.contact_x, abs=1e-12)


def slides_inward(record, direction, friction):
    """Whether friction acts as on a straight rod."""
    off = np.arctan2(-record.force_x, record.force_y) - record.truth_slope_angle
    side = 1.0 if direction == "forward" else -1.0
    return np.abs(off.values - side * np.arctan(friction)) < 1e-9


@pytest.mark.parametrize("name", RODS)
def test_equilibria_and_step_2_are_those_of_the_sweep(name):
    """Slope angles of a scan give its states again, and its loads its contacts, of either method and any side."""
    rod = RODS[name]
    for direction in ("forward", "backward"):
        scan = tb.scan(CIRCLE, rig=Rig(rod=rod, unknown={"friction": 0.1}), direction=direction, drive_step=0.06)
        record = scan.record.isel(sample=slides_inward(scan.record, direction, 0.1))
        states = tb.equilibria(
            CIRCLE, record.truth_slope_angle, direction=direction, rig=Rig(rod=rod, unknown={"friction": 0.1})
        )
        assert np.mean(states.contact_phase.values == record.truth_contact_phase.values) > 0.9
        for column in ("drive_angle", "holding_moment", "force_x", "force_y"):
            np.testing.assert_allclose(states[column], record[column], atol=1e-7, err_msg=column)
        cell = tb.LoadCell(force_noise=1e-4, moment_noise=1e-4)
        for method in ("raw", "constrained"):
            found = tb.reconstruct(record, method=method, rig=Rig(load_cell=cell, unknown={"friction": 0.1}))
            good = np.isfinite(found.contact_x.values)
            assert good.sum() > 0.8 * good.size
            np.testing.assert_allclose(found.contact_x[good], record.truth_contact_x[good], atol=2e-4)
            np.testing.assert_allclose(found.contact_y[good], record.truth_contact_y[good], atol=2e-4)


@pytest.mark.parametrize("name", RODS)
def test_derivatives_of_contacts_are_differences(name):
    rod = RODS[name].mirrored(np.ones(1))
    z = np.array([[2.0, 0.3, 1.0, 2.0]]) if name != "arc" else np.array([[2.0, 0.0, 0.9, 2.0]])
    here, slopes = contact_states_and_slopes(z, 0.1, rod)
    for k in range(4):
        aside = [contact_states(z + sign * 1e-6 * np.eye(4)[k], 0.1, rod) for sign in (1.0, -1.0)]
        by_loads, by_place = ((aside[0][i] - aside[1][i])[:, 0] / 2e-6 for i in (0, 1))
        np.testing.assert_allclose(slopes.loads[0, :, k], by_loads, atol=1e-7)
        np.testing.assert_allclose(slopes.place[0, :, k], by_place, atol=1e-7)
    wrench = np.array([z[0, 3], *here.loads[:, 0]])
    of_rod = {"rest_curvature": rod.curvature[0] if rod.profile is None else 0.0, "profile": rod.profile}

    def place(values):
        found = contact_from_wrench(*values, 0.1, side=1.0, stem=rod.stem, **of_rod)
        return np.array([found.contact_x, found.contact_y, found.slope_angle, found.contact_arclength])

    np.testing.assert_allclose(place(wrench), here.place[:, 0], atol=1e-10)
    by_wrench = np.stack([(place(wrench + e) - place(wrench - e)) / 2e-6 for e in 1e-6 * np.eye(4)], axis=1)
    np.testing.assert_allclose(place_by_wrench(z, rod)[0], by_wrench, rtol=1e-5, atol=1e-6)


def test_derivatives_of_the_drive_angle_are_differences():
    x, y = 0.7 * np.array([[np.cos(1.2)], [np.sin(1.2)]])
    assert_slopes_are_differences(x, y, 0.2, 0.1, rtol=1e-6, atol=0.0, rest_curvature=-0.3, stem=STEM)
    assert np.isnan(wrench_from_contact(0.8, 0.9, 0.1, stem=STEM).drive_angle)  # out of reach


@pytest.mark.parametrize("name", RODS)
def test_the_drawn_rod_goes_from_the_pivot_to_its_contact(name):
    rod = RODS[name]
    scan = tb.scan(CIRCLE, rig=Rig(rod=rod), direction="backward", drive_step=0.1)
    record = scan.record.isel(sample=scan.record.truth_contact_phase.values == "tip")
    loads = (record[n].values for n in ("drive_angle", "holding_moment", "force_x", "force_y"))
    x, y = rod_shape(*loads, side=-1.0, rods=rod.mirrored(-1.0))
    assert x.shape == (record.sizes["sample"], 102)
    np.testing.assert_allclose(x[:, 0], 0.0)
    np.testing.assert_allclose(np.hypot(x[:, 1], y[:, 1]), STEM)
    np.testing.assert_allclose(x[:, -1], record.truth_contact_x, atol=1e-8)
    np.testing.assert_allclose(y[:, -1], record.truth_contact_y, atol=1e-8)


def test_the_stem_is_told_if_there_is_one():
    rod = Rod(0.05, 1e-8, 2e-4, rest_curvature=lambda s: -200.0 * s, stem=4e-3)
    assert "rod_stem" not in tb.scan(CIRCLE, drive_step=0.1).record.attrs
    assert "stem=0.004" in repr(rod)
    assert rod.shape_in_words("1/m")[0] == "stem 0.004 m"


def test_contact_on_the_stem_is_refused():
    with refused(ContourError, "0.17", "stem"):
        tb.scan(tb.contours.Circle(0.3, 0.1), rig=Rig(rod=Rod(stem=STEM)))
    with refused(ReachError, "stem of 0.15"):
        tb.scan(tb.contours.Circle(0.3, 1.2), rig=Rig(rod=Rod(stem=STEM)))
    for stem in (-0.1, 1.1, np.nan):
        with refused(ParameterError, "stem"):
            Rod(stem=stem)
    with refused(ParameterError, "pivot"):
        Rod(rest_curvature=3.0, stem=0.5)

"""Drives that carry the base: values, scans, the side that the rod touches, and records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Joined, Parabola, PowerLaw
from tactile_bayes.errors import ContourError, ParameterError, ReachError
from tactile_bayes.record import carried_sweeps
from tactile_bayes.rig import Rig

CIRCLE = Circle(0.3, 0.8)
THERE = tb.Translation(base=(0.8, 0.0), heading=np.pi, drive_angle=1.2, travel=1.6)
BACK = tb.Translation(base=(-0.8, 0.0), heading=0.0, drive_angle=np.pi - 1.2, travel=1.6)
RAISED = tb.Translation((0.0, -0.5), 0.5 * np.pi, 0.5 * np.pi, 1.0)
COMBINED = tb.Motion(x=[0.8, -0.8], y=0.0, drive_angle=[0.9, 1.7])


def test_poses_lie_on_straight_lines():
    np.testing.assert_allclose(THERE.poses, [[0.8, 0.0, 1.2], [-0.8, 0.0, 1.2]], atol=1e-15)
    motion = tb.Motion(x=[0.0, 3.0, 3.0], y=[0.0, 4.0, 5.0], drive_angle=[0.0, 0.5, 1.0])
    np.testing.assert_allclose(motion.travels, [0.0, 5.0, 6.0])
    np.testing.assert_allclose(motion.at([2.5, 5.5]), [[1.5, 2.0, 0.25], [3.0, 4.5, 0.75]])
    turning = tb.Motion(x=0.1, y=0.0, drive_angle=[0.2, 1.0])
    np.testing.assert_allclose(turning.travels, [0.0, 0.8])


@pytest.mark.parametrize(
    ("make", "values"),
    [
        (lambda: tb.Translation((0, 0), heading=180.0, drive_angle=1.0, travel=1.0), ["heading", "180"]),
        (lambda: tb.Translation((0, 0), heading=np.pi, drive_angle=1.0, travel=0.0), ["travel", "0"]),
        (lambda: tb.Translation((0, 0, 0), heading=np.pi, drive_angle=1.0, travel=1.0), ["base"]),
        (lambda: tb.Rotation("here"), ["base", "here"]),
        (lambda: tb.Motion([0.0, 1.0], [0.0, 1.0, 2.0], 1.0), ["(2,)", "(3,)"]),
        (lambda: tb.Motion(0.0, 0.0, 1.0), ["two poses"]),
        (lambda: tb.Motion([0.0, 0.0], 0.0, 1.0), ["0 and 1"]),
        (lambda: tb.Motion([0.0, 1.0], 0.0, 90.0), ["90"]),
        (lambda: tb.Motion([0.0, 1.0], 0.0, 1.0, drive_step=-0.1), ["drive_step", "-0.1"]),
        (lambda: replace(THERE, drive_step=0.0), ["drive_step", "0"]),
        (lambda: replace(THERE, drive_step=1e-9), ["drive_step", "1.6e-06"]),
        (lambda: tb.Rotation(drive_step=2.0), ["drive_step", "2", "0.5"]),
        (lambda: tb.Rotation(direction="left"), ["direction", "left"]),
        (lambda: tb.Rotation(drive_angles=[]), ["drive_angles"]),
        (lambda: tb.Rotation(drive_angles=[90.0]), ["drive_angles"]),
        (lambda: tb.Rotation(drive_step=0.1, drive_angles=[1.0]), ["drive_step", "drive_angles"]),
    ],
)
def test_drives_that_are_none_are_refused(make, values):
    with refused(ParameterError, *values):
        make()


@pytest.mark.parametrize(
    "more", [{}, {"direction": "forward", "drive_step": 0.1}, {"drive_angles": [2.0, 1.0, 1.5, 2.0]}], ids=str
)
def test_a_rotation_is_what_the_short_forms_are_short_for(more):
    by_base = tb.scan(CIRCLE, base=(0.1, 0.0), **more)
    by_drive = tb.scan(CIRCLE, drive=tb.Rotation((0.1, 0.0), **more))
    assert by_base.record.identical(by_drive.record)
    assert by_base.sweeps == by_drive.sweeps
    assert by_drive.events["forward"].snap_off.travel == by_drive.events["forward"].snap_off.drive_angle


@pytest.mark.parametrize("drive", [THERE, COMBINED])
def test_a_scan_records_where_the_base_is(drive):
    scan = tb.scan(CIRCLE, drive=replace(drive, drive_step=0.01))
    record, events = scan.record, scan.events["forward"]
    travels = 0.01 * np.arange(161)
    np.testing.assert_allclose(
        np.stack([record[name].values for name in ("base_x", "base_y", "drive_angle")], axis=-1), drive.at(travels)
    )
    loaded = record.truth_contact_phase.values != "none"
    first, snap = events.first_contact, events.snap_off
    np.testing.assert_array_equal(loaded, (travels >= first.travel) & (travels <= snap.travel))
    np.testing.assert_allclose([snap.base_x, snap.base_y, snap.drive_angle], drive.at(snap.travel), atol=1e-12)
    assert first.holding_moment == 0.0
    assert carried_sweeps(record) == (0,)


def test_drives_of_one_record_have_grids_of_their_own():
    drives = [tb.Rotation(direction="backward", drive_step=0.1), tb.Rotation(drive_angles=[1.0, 1.2, 1.4]), THERE]
    found = tb.scan(CIRCLE, drive=[*drives, replace(THERE, drive_step=0.4)])
    record = found.record
    parts = [record.isel(sample=record.sweep.values == number) for number in range(5)]
    assert [sweep.direction for sweep in found.sweeps] == ["backward", "forward", "backward", "forward", "forward"]
    np.testing.assert_allclose(np.diff(parts[0].drive_angle), -0.1)
    np.testing.assert_array_equal(parts[1].drive_angle, parts[2].drive_angle[::-1])
    assert [part.sizes["sample"] for part in parts[1:]] == [3, 3, 161, 5]


def test_the_other_side_is_a_backward_sweep():
    forward, backward = tb.scan(CIRCLE, drive=THERE), tb.scan(CIRCLE, drive=BACK)
    one, other = forward.events["forward"], backward.events["backward"]
    assert other.snap_off.travel == pytest.approx(one.snap_off.travel, abs=1e-12)
    assert other.snap_off.contact_x == pytest.approx(-one.snap_off.contact_x, abs=1e-12)
    np.testing.assert_allclose(backward.record.holding_moment, -forward.record.holding_moment, atol=1e-9)


def test_turned_here_and_carried_there_is_one_record():
    both = tb.scan(CIRCLE, drive=[tb.Rotation(), THERE, BACK])
    assert [sweep.direction for sweep in both.sweeps] == ["forward", "backward", "forward", "backward"]
    assert carried_sweeps(both.record) == (2, 3)
    turned = both.record.isel(sample=both.record.sweep.values < 2)
    assert turned.identical(tb.scan(CIRCLE).record)


@pytest.mark.parametrize("drive", [COMBINED, [tb.Rotation(), THERE]])
@pytest.mark.parametrize("rod", [tb.Rod(), tb.Rod(rest_curvature=-0.3), tb.Rod(taper=0.5)])
def test_step_2_brings_the_contacts_back(drive, rod):
    record = tb.scan(CIRCLE, drive=drive, rig=Rig(rod=rod)).record
    found = tb.reconstruct(record)
    loaded = np.hypot(record.force_x, record.force_y) > 1e-6
    assert loaded.sum() > 20
    for name in ("contact_x", "contact_y"):
        np.testing.assert_allclose(found[name].values[loaded], record[f"truth_{name}"].values[loaded], atol=1e-9)


def test_lengths_are_in_metres_with_a_rod_in_si():
    rod = tb.Rod(length=0.1, flexural_rigidity=1.2e-5)
    drive = tb.Translation(base=(0.08, 0.0), heading=np.pi, drive_angle=1.2, travel=0.16)
    scan = tb.scan(Circle(0.03, 0.08), drive=drive, rig=Rig(rod=rod))
    plain = tb.scan(CIRCLE, drive=THERE)
    np.testing.assert_allclose(scan.record.base_x, 0.1 * plain.record.base_x, atol=1e-15)
    np.testing.assert_allclose(scan.record.force_y, rod.force_unit * plain.record.force_y, rtol=1e-9, atol=1e-15)
    assert scan.events["forward"].snap_off.travel == pytest.approx(0.1 * plain.events["forward"].snap_off.travel)


def test_a_motion_of_many_poses_is_sampled_at_them():
    x = np.linspace(0.8, -0.8, 33)
    record = tb.scan(CIRCLE, drive=tb.Motion(x, 0.02 * np.sin(3.0 * x), 1.2)).record
    np.testing.assert_allclose(record.base_x, x)
    np.testing.assert_allclose(record.base_y, 0.02 * np.sin(3.0 * x), atol=1e-15)


def test_a_drive_that_ends_in_contact_says_so():
    short = tb.Translation(base=(0.8, 0.0), heading=np.pi, drive_angle=1.2, travel=1.1)
    events = tb.scan(CIRCLE, drive=short).events["forward"]
    assert events.snap_off.kind == "never"
    assert events.snap_off.travel == pytest.approx(1.1)


@pytest.mark.parametrize(
    ("error", "arguments", "values"),
    [
        (ReachError, {"drive": tb.Translation((0.8, -1.0), np.pi, 1.2, 1.6)}, ["does not touch"]),
        (ContourError, {"drive": tb.Translation((-0.2, 0.0), np.pi, 1.2, 1.0)}, ["from the beginning"]),
        (ReachError, {"drive": RAISED, "rig": Rig(unknown={"friction": 0.2})}, ["friction", "head-on"]),
        (ParameterError, {"drive": THERE, "direction": "backward"}, ["direction"]),
        (ParameterError, {"drive": THERE, "drive_angles": [0.1, 0.2]}, ["drive_angles"]),
        (ParameterError, {"drive": THERE, "base": (0.1, 0.0)}, ["base"]),
        (ParameterError, {"drive": [THERE, tb.Rotation()], "drive_step": 0.1}, ["drive_step"]),
        (ParameterError, {"drive": tb.Rotation(), "drive_angles": [1.0, 1.5]}, ["drive_angles"]),
        (ParameterError, {"drive": "left"}, ["drive", "left"]),
        (ParameterError, {"drive": []}, ["drive"]),
    ],
)
def test_what_cannot_be_scanned_is_refused(error, arguments, values):
    with refused(error, *values):
        tb.scan(CIRCLE, **arguments)


@pytest.mark.parametrize("k", range(8))
def test_a_released_rod_is_clear_however_its_last_touch_is_rounded(k):
    contour = Circle(*(np.array([1.01660456, 0.38756071, -0.80086393]) * (1.0 + 1e-9 * k)))
    carried = tb.Translation((-0.9, 0.0), 0.0, np.pi - 1.0, 1.8, 0.01)
    found = tb.scan(contour, drive=carried, rig=Rig(rod=tb.Rod(rest_curvature=0.4), unknown={"friction": 0.0177}))
    assert found.events["backward"].snap_off.kind == "release"
    assert found.record.sizes["sample"] == 181


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("taper", [0.0, 0.5, 0.7, 0.8])
def test_a_tip_that_is_dragged_touches_with_the_side_to_which_it_is_turned(taper, side):
    """Until that side lies along the contour: the tip never folds into the object."""
    heading, angle = (0.05, 1.0) if side > 0.0 else (np.pi - 0.05, np.pi - 1.0)
    drive = tb.Translation(base=(-0.87 * side, -0.06), heading=heading, drive_angle=angle, travel=2.5)
    contour = Parabola(1.0, 0.65, 0.24 * side)
    scan = tb.scan(contour, drive=drive, rig=Rig(rod=tb.Rod(taper=taper)))
    assert scan.sweeps[0].direction == ("backward" if side > 0.0 else "forward")
    turn = (scan.record.truth_tip_angle - scan.record.truth_slope_angle).values
    turn = turn[np.isfinite(turn)]
    assert turn.size > 10
    assert turn.min() > -1e-9
    assert turn.max() < np.pi + 1e-9


@pytest.mark.parametrize("contour", [Parabola(0.02, 0.8), PowerLaw(0.02, 2.5, 0.8)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_contact_goes_as_far_as_the_drive_carries_it(contour, side):
    """Farther than the rod reaches from where it touches first."""
    (sweep,) = tb.scan(contour, drive=tb.Motion([2.0 * side, 2.0 * side, -2.0 * side], [-0.3, 0.0, 0.0], 1.0)).sweeps
    assert sweep.snap_off.kind == "release"
    assert sweep.snap_off.contact_x == pytest.approx(-sweep.first_contact.contact_x, abs=1e-9)
    assert abs(sweep.snap_off.contact_x) > 1.3


@pytest.mark.parametrize("diameter", [0.0, 0.038])
def test_a_contact_beyond_the_end_from_which_the_rod_comes_is_refused(diameter):
    drive = tb.Motion([-0.835, -0.201], [-0.143, 0.207], 0.969)
    with refused(ContourError, "beyond the contour's left end", "vertical"):
        tb.scan(Circle(0.544, 0.203, 0.343), drive=drive, rig=Rig(rod=tb.Rod(diameter=diameter)))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_wall_is_touched_from_beside_the_object(side):
    """Its other end faces away from the base."""
    halves = [Parabola(2.0, 0.4, -0.3 * side), Parabola(1.0, -1.83, -1.7 * side)]
    contour = Joined(*halves[:: int(side)], x=-0.2 * side)
    heading, angle = (-2.12, 3.03) if side > 0.0 else (np.pi + 2.12, np.pi - 3.03)
    (sweep,) = tb.scan(contour, drive=tb.Translation((1.75 * side, 3.4), heading, angle, 1.24)).sweeps
    assert sweep.direction == ("backward" if side > 0.0 else "forward")
    assert sweep.first_contact.kind == "tip"
    x, y = sweep.first_contact.contact_x, sweep.first_contact.contact_y
    assert y == pytest.approx(float(contour.height(x)), abs=1e-9)


@pytest.mark.parametrize("angle", [-0.32, np.pi + 0.32])
def test_a_drive_into_the_object_is_not_too_far_from_it(angle):
    side = 1.0 if angle < 0.0 else -1.0
    with refused(ContourError, "cuts the path"):
        tb.scan(Circle(0.29, 0.32, -0.17 * side), drive=tb.Motion([-0.19 * side, 0.32 * side], [0.03, 1.9], angle))

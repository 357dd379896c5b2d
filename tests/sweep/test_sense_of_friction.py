"""The sense of friction: it opposes the slip in every state that a scan hands out, or there is no scan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.handed_out import violations
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.errors import ReachError
from tactile_bayes.rig import Rig
from tactile_bayes.sweep.scanning_many import scan_many

PARABOLA = Parabola(0.6, 0.45, 0.1)
UPRIGHT = 0.5 * np.pi
TURNED_BACK = {
    "turned": tb.Motion(0.0, 0.0, [0.4, 2.2, 0.4]),
    "turned from the other side": tb.Motion(0.0, 0.0, [2.9, 1.2, 2.9]),
    "carried": tb.Motion([1.2, 0.1, 1.2], -0.2, 1.5),
    "carried and turned": tb.Motion([1.2, 0.1, 1.2], -0.2, [1.3, 1.6, 1.3]),
    "a little": tb.Motion(0.0, 0.0, [0.4, 2.0, 1.9, 3.2]),
}


@pytest.mark.parametrize("drive", TURNED_BACK.values(), ids=TURNED_BACK)
def test_a_drive_that_turns_back_in_contact_needs_no_friction(drive):
    with refused(ReachError, "friction", "friction = 0", "split"):
        tb.scan(PARABOLA, drive=drive, rig=Rig(unknown={"friction": 0.3}))
    scan = tb.scan(PARABOLA, drive=replace(drive, drive_step=0.02))
    assert violations(scan, tb.Rod(), 0.0) == {}


def test_without_friction_the_way_back_repeats_the_way_forth():
    record = tb.scan(PARABOLA, drive=replace(TURNED_BACK["turned"], drive_step=0.01)).record
    for name in ("holding_moment", "force_x", "force_y"):
        np.testing.assert_allclose(record[name].values, record[name].values[::-1], atol=1e-8)


def test_parts_of_a_drive_that_go_one_way_have_friction():
    scan = tb.scan(PARABOLA, drive=tb.Motion(0.0, 0.0, [0.4, 2.2], drive_step=0.02), rig=Rig(unknown={"friction": 0.3}))
    assert scan.sweeps[0].snap_off.kind == "never"
    assert violations(scan, tb.Rod(), 0.3) == {}


@pytest.mark.parametrize(("side", "heading"), [(1.0, np.pi), (-1.0, 0.0)])
@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_a_tip_that_is_carried_head_on_does_not_slide_at_first(side, heading, friction):
    drive = tb.Translation((side * 0.6, 0.0), heading, UPRIGHT, 1.2)
    with refused(ReachError, "friction", "friction = 0"):
        tb.scan(Circle(0.3, 0.9), drive=drive, rig=Rig(unknown={"friction": friction}))
    assert violations(tb.scan(Circle(0.3, 0.9), drive=drive), tb.Rod(), 0.0) == {}


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_a_rod_that_is_straightened_first_slides_outward(direction):
    sign = 1.0 if direction == "forward" else -1.0
    toward, away = (tb.Rod(rest_curvature=sign * curvature) for curvature in (0.4, -0.4))
    scan = tb.scan(PARABOLA, rig=Rig(rod=toward, unknown={"friction": 0.3}), direction=direction, drive_step=0.002)
    (sweep,), record = scan.sweeps, scan.record
    stuck = sign * (sweep.slides_from - sweep.first_contact.drive_angle)
    assert stuck > 0.01
    step = sign * np.diff(record.drive_angle.values)
    assert step.max() == pytest.approx(stuck, abs=0.005)
    assert violations(scan, toward, 0.3) == {}
    for rod, friction in ((toward, 0.0), (away, 0.3)):
        scan = tb.scan(PARABOLA, rig=Rig(rod=rod, unknown={"friction": friction}), direction=direction)
        assert scan.sweeps[0].slides_from == scan.sweeps[0].first_contact.drive_angle
        assert violations(scan, rod, friction) == {}


def test_scan_many_says_which_contours_friction_would_hold():
    contours, angles = Parabola(np.array([0.4, 0.6]), 0.45), np.linspace(0.3, 3.3, 40)
    many = scan_many(contours, angles, rig=Rig(rod=tb.Rod(rest_curvature=0.4), unknown={"friction": 0.3}))
    assert many.status.values.tolist() == ["held by friction"] * 2
    assert np.isnan(many.snap_off_drive_angle.values).all()
    assert (
        scan_many(
            contours, angles, rig=Rig(rod=tb.Rod(rest_curvature=-0.4), unknown={"friction": 0.3})
        ).status.values.tolist()
        == ["ok"] * 2
    )

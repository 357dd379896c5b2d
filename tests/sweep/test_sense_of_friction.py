"""The sense of friction: it opposes the slip in every state that a scan hands out, or there is no scan."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.friction_cases import drawn_case, scanned
from helpers.friction_stepper import step_through
from helpers.handed_out import violations
from tactile_bayes import Rig
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.errors import ClearanceWarning, ContourError, ReachError
from tactile_bayes.sweep import scan_many

PARABOLA = Parabola(0.6, 0.45, 0.1)
UPRIGHT = 0.5 * np.pi
TURNED_BACK = {
    "turned": tb.Motion(0.0, 0.0, [0.4, 2.2, 0.4]),
    "turned from the other side": tb.Motion(0.0, 0.0, [2.9, 1.2, 2.9]),
    "carried": tb.Motion([1.2, 0.1, 1.2], -0.2, 1.5),
    "carried and turned": tb.Motion([1.2, 0.1, 1.2], -0.2, [1.3, 1.6, 1.3]),
    "a little": tb.Motion(0.0, 0.0, [0.4, 2.0, 1.9, 3.2]),
}


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("drive", TURNED_BACK.values(), ids=TURNED_BACK)
def test_a_drive_may_turn_back_in_contact(drive, friction):
    scan = tb.scan(PARABOLA, drive=replace(drive, drive_step=0.02), rig=Rig(unknown={"friction": friction}))
    assert violations(scan, tb.Rod(), friction) == {}
    assert ("stick" in [change.kind for change in scan.sweeps[0].transitions]) == (friction > 0.0)


def test_without_friction_the_way_back_repeats_the_way_forth():
    record = tb.scan(PARABOLA, drive=replace(TURNED_BACK["turned"], drive_step=0.01)).record
    for name in ("holding_moment", "force_x", "force_y"):
        np.testing.assert_allclose(record[name].values, record[name].values[::-1], atol=1e-8)


@pytest.mark.parametrize(("side", "heading"), [(1.0, np.pi), (-1.0, 0.0)])
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.5])
def test_the_tip_of_an_upright_rod_slides_to_the_lowest_point(side, heading, friction):
    """To second order in the travel d: the tip falls by 0.6 d², and the force is 3 d over the sine of its direction."""
    drive = tb.Translation((side * 0.6, 0.0), heading, UPRIGHT, 1.2, drive_step=0.002)
    scan = tb.scan(Circle(0.3, 0.9), drive=drive, rig=Rig(unknown={"friction": friction}))
    assert violations(scan, tb.Rod(), friction) == {}
    assert [change.kind for change in scan.sweeps[0].transitions] == []
    record, first = scan.record, scan.sweeps[0].first_contact
    way = np.abs(record.base_x.values - first.base_x)
    at = int(np.argmin(np.abs(way - 0.03) + 9.0 * (record.truth_contact_phase.values == "none")))
    d, slope = way[at], abs(first.slope_angle) + np.arctan(friction)
    assert first.contact_y - record.truth_contact_y.values[at] == pytest.approx(0.6 * d * d, rel=0.05)
    force = np.hypot(record.force_x.values[at], record.force_y.values[at])
    assert force == pytest.approx(3.0 * d / np.sin(slope), rel=0.1)


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_a_rod_that_is_straightened_first_slides_outward_sticks_and_comes_back(direction):
    sign = 1.0 if direction == "forward" else -1.0
    rod = tb.Rod(rest_curvature=sign * 0.4)
    scan = tb.scan(PARABOLA, rig=Rig(rod=rod, unknown={"friction": 0.3}), direction=direction, drive_step=0.002)
    outward, inward = ("right", "left") if direction == "forward" else ("left", "right")
    kinds = [change.kind for change in scan.sweeps[0].transitions]
    assert kinds[:2] == ["stick", f"slip {inward}"]
    assert violations(scan, rod, 0.3) == {}
    side = scan.record.truth_contact_x.values - scan.sweeps[0].first_contact.contact_x
    assert np.nanmax(side if outward == "right" else -side) > 1e-3


def test_scan_many_has_the_same_phases():
    contours, angles = Parabola(np.array([0.4, 0.6]), 0.45), np.linspace(0.3, 3.3, 40)
    many = scan_many(contours, angles, rig=Rig(rod=tb.Rod(rest_curvature=0.4), unknown={"friction": 0.3}))
    assert many.status.values.tolist() == ["ok"] * 2
    assert many.phases.values[1].startswith("A-a-A")


@pytest.mark.parametrize(
    "seed", [pytest.param(seed, marks=() if seed in (1, 72, 195) else pytest.mark.slow) for seed in range(206)]
)
def test_any_rod_on_any_drive_is_where_small_steps_lead(seed):
    """Drives that turn back up to twice; friction up to 0.8."""
    case = drawn_case(np.random.default_rng(seed))
    stepped = step_through(case)
    words = {word for _, word in stepped.events}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ClearanceWarning)
        try:
            record = scanned(case).record
        except (ReachError, ContourError):  # grazed, touched twice, or met head-on
            record = None
    assert record is not None or words & {"release", "touches twice", "jammed"}
    if record is None:
        return
    count = min(record.sizes["sample"], stepped["travel"].size)
    loads = ("holding_moment", "force_x", "force_y")
    off = np.max([np.abs(record[name].values[:count] - stepped[name][:count]) for name in loads], axis=0)
    off /= max(1.0, np.abs(stepped["force"]).max())
    assert np.mean(off < 1e-7) > 0.9  # the others are within a step in which the mode changes
    assert off.max() < 1e-4

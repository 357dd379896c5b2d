"""Unloaded rods after contact: clear of the object or not, and brought to it again or not."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import tactile_bayes as tb
from helpers import drawn_sweeps
from helpers.rest_lines import depth, rest_line
from tactile_bayes.errors import ClearanceWarning, ContourError
from tactile_bayes.rig import Rig

PARABOLA = tb.contours.Parabola(0.6, 0.45, 0.1)

_ROUNDING = 5e-4  # depth [L] that the oracle's polygons leave undecided


def inside(contour, rod, x, y, angle):
    """Depth of the unloaded rod in the object."""
    return depth(contour, *rest_line(rod, x, y, angle))


def carried_snap_offs(seed, count):
    """Scans of drawn rods that leave their contour before the end of the drive, with what was drawn and said."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        contour, rod, drive = drawn_sweeps.contour(rng), drawn_sweeps.rod(rng), drawn_sweeps.carried_drive(rng)
        if len(found) % 2:  # back again, a little higher
            drive = tb.Motion(*np.vstack([drive.poses, drive.poses[:1] + np.array([0.0, 0.1, 0.0])]).T)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                scan = tb.scan(contour, drive=drive, rig=Rig(rod=rod))
            except ContourError:
                continue
        if scan.sweeps[0].snap_off.kind != "never":
            found.append((scan, rod, drive, [one.category for one in said]))
    return found


def test_carried_rods_are_clear_where_they_are_in_many_points():
    met = 0
    for scan, rod, drive, said in carried_snap_offs(20, 16):
        (sweep,), contour, record = scan.sweeps, scan.contour, scan.record
        snap = sweep.snap_off
        at_snap = inside(contour, rod, snap.base_x, snap.base_y, snap.drive_angle)
        if abs(at_snap) > _ROUNDING:
            assert sweep.clear == (at_snap < 0.0)
        again = sweep.touches_again
        assert (ClearanceWarning in said) == (not sweep.clear or np.isfinite(again))
        phases = record.truth_contact_phase.values
        rest = np.arange(1 + np.flatnonzero(phases != "none").max(initial=0), phases.size)
        poses = (record[name].values[rest[::3]] for name in ("base_x", "base_y", "drive_angle"))
        assert max((inside(contour, rod, *pose) for pose in zip(*poses, strict=True)), default=0.0) < _ROUNDING
        if np.isfinite(again):
            met += 1
            assert abs(inside(contour, rod, *drive.at(again))) < _ROUNDING
    assert met > 0


def test_a_rod_at_rest_beyond_an_edge_is_not_clear():
    x, y = -0.072336, 0.335094
    halves = (
        tb.contours.Parabola(a, y - a * (x - x_c) ** 2, x_c) for a, x_c in ((0.320793, 0.332778), (0.709683, -0.865715))
    )
    contour = tb.contours.Joined(*halves, x=x)
    drive = tb.Motion([1.309425, -1.215013], [-0.387158, -0.215746], [1.370559, 1.686247])
    for stem in (0.0, 0.1, 0.2):
        rod = tb.Rod(stem=stem)
        with pytest.warns(ClearanceWarning, match="snaps at base"):
            scan = tb.scan(contour, drive=drive, rig=Rig(rod=rod))
        (sweep,) = scan.sweeps
        snap = sweep.snap_off
        assert inside(contour, rod, snap.base_x, snap.base_y, snap.drive_angle) > 0.01
        assert not sweep.clear
        assert scan.record.base_x.values[-1] >= snap.base_x


def test_a_rod_that_is_brought_back_touches_again():
    there_and_back = tb.Motion(0.0, 0.0, [0.4, 3.6, 0.4], 0.01)
    backward = tb.scan(PARABOLA).events["backward"]
    with pytest.warns(ClearanceWarning, match="again"):
        scan = tb.scan(PARABOLA, drive=there_and_back)
    (sweep,) = scan.sweeps
    assert sweep.clear
    assert 7.2 - 0.4 - sweep.touches_again == pytest.approx(backward.first_contact.drive_angle, abs=1e-5)
    assert scan.record.sizes["sample"] == 1 + int(sweep.touches_again / 0.01)


def test_without_another_contact_nothing_is_left_out():
    there_and_back = tb.Motion(0.0, 0.0, [0.4, 2.2, 0.4], 0.01)
    scan = tb.scan(PARABOLA, drive=there_and_back)
    assert np.isnan(scan.sweeps[0].touches_again)
    assert scan.record.sizes["sample"] == 361


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_a_rotation_of_more_than_a_turn_comes_back(direction):
    angles = np.linspace(-6.28, 6.28, 400)
    with pytest.warns(ClearanceWarning, match="turn"):
        scan = tb.scan(PARABOLA, direction=direction, drive_angles=angles)
    free = scan.record.truth_contact_phase.values == "none"
    assert free.any()
    assert max(inside(PARABOLA, tb.Rod(), 0.0, 0.0, angle) for angle in scan.record.drive_angle.values[free]) < 0.0

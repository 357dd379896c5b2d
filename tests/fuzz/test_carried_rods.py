"""Scans of carried drives: no rod lies in the object or came through it, and it touches with the side outside."""

import warnings
from collections import Counter
from dataclasses import replace

import numpy as np

import tactile_bayes as tb
from helpers import drawn_sweeps
from helpers.handed_out import violations
from helpers.rest_lines import depth, rest_line
from tactile_bayes.errors import ClearanceWarning, ContourError, TactileBayesError, TactileBayesWarning
from tactile_bayes.rig import Rig

DEEP = 1e-6  # depth [L] from which on a rod lies in the object: the oracle finds less of states that are right
ROUNDING = 2e-3  # depth [L] that the points of the check leave undecided at edges and along thick rods


def depths(contour, rod, drive, travels):
    """Depth of the unloaded rod in the object along a drive."""
    return np.array([depth(contour, *rest_line(rod, *pose)) for pose in drive.at(travels)])


def depth_before(scan, rod, drive):
    """Greatest depth of the unloaded rod in the object on its way to first contact."""
    return depths(scan.contour, rod, drive, np.linspace(0.0, scan.sweeps[0].first_contact.travel, 60)[:-1]).max()


def scanned(rng, contour, rod, drive):
    """Friction, the scan and the categories of its warnings."""
    friction = float(rng.choice([0.0, rng.uniform(0.0, 0.8)]))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        scan = tb.scan(contour, rig=Rig(rod=rod, unknown={"friction": friction}), drive=drive)
    return friction, scan, [one.category for one in said]


def test_an_object_in_the_way_is_found():
    """Of a scan beside an object that is 0.01 lower, both checks say that the rod is in it."""
    drive = tb.Translation((0.9, -0.3), np.pi, 1.5, 1.8)
    scan = tb.scan(tb.contours.Parabola(0.5, 0.5), drive=drive)
    assert violations(scan, tb.Rod(), 0.0) == {}
    assert depth_before(scan, tb.Rod(), drive) < DEEP
    lower = replace(scan, contour=tb.contours.Parabola(0.5, 0.49))
    assert violations(lower, tb.Rod(), 0.0)["inside, loaded"] > 0.005
    assert depth_before(lower, tb.Rod(), drive) > 0.001


def test_a_carried_rod_is_never_in_the_object(fuzz_seed):
    rng, ends, scans = np.random.default_rng([fuzz_seed, 4]), Counter(), 4
    while ends["scanned"] < scans:
        contour, rod, drive = drawn_sweeps.contour(rng), drawn_sweeps.rod(rng), drawn_sweeps.carried_drive(rng)
        try:
            friction, scan, said = scanned(rng, contour, rod, drive)
        except ContourError:
            ends["refused"] += 1
            continue
        ends["scanned"] += 1
        assert all(issubclass(category, TactileBayesWarning) for category in said)
        assert violations(scan, rod, friction) == {}, (contour, rod, friction, drive)
        assert depth_before(scan, rod, drive) < DEEP, (contour, rod, friction, drive)
    assert ends["refused"] < 10 * scans


# --- Any heading ----------------------------------------------------------------------------------------------------


def into_the_object(rng):
    """Contour, rod and drive that begins free and carries the unloaded rod into the object."""
    while True:
        contour, rod = drawn_sweeps.contour(rng), drawn_sweeps.rod(rng, 0.9)
        drive = drawn_sweeps.aimed_drive(rng, contour)
        found = depths(contour, rod, drive, np.linspace(0.0, drive.travels[-1], 9))
        if found[0] < 0.0 and found.max() > 10.0 * ROUNDING:
            return contour, rod, drive


def faults_at_tip(scan):
    """Contacts with the other side of the rod, and beyond the ends of the contour."""
    record, domain = scan.record, scan.contour.domain
    tip = record.truth_contact_phase.values == "tip"
    turned = (record.truth_tip_angle - record.truth_slope_angle).values[tip]
    if np.any((turned < -1e-7) | (turned > np.pi + 1e-7)):
        yield "side"
    slope = record.truth_slope_angle.values
    least, most = (scan.contour.locate(np.asarray(end, float)).slope_angle for end in domain)
    if np.any((slope < least - 1e-7) | (slope > most + 1e-7)):
        yield "beyond the end"


def faults_at_rest(scan, rod, drive, said):
    """What is wrong about an unloaded rod before contact and after it."""
    (sweep,), end = scan.sweeps, drive.travels[-1]
    along = scan.contour, rod, drive
    if depths(*along, np.linspace(0.0, sweep.first_contact.travel, 24)).max() > ROUNDING:
        yield "inside before"
    if sweep.snap_off.kind == "never":
        return
    snap, again = sweep.snap_off.travel, sweep.touches_again
    after = depths(*along, np.linspace(snap, again if np.isfinite(again) else end, 24))
    if abs(after[0]) > ROUNDING and sweep.clear != (after[0] < 0.0):
        yield "clear"
    if sweep.clear and after.max() > ROUNDING:
        yield "inside after"
    if np.isfinite(again) and abs(after[-1]) > ROUNDING:
        yield "again"
    if (ClearanceWarning in said) != (not sweep.clear or np.isfinite(again)):
        yield "warning"


def test_a_carried_rod_touches_with_the_side_that_is_outside(fuzz_seed):
    rng, ends, scans = np.random.default_rng([fuzz_seed, 7]), Counter(), 8
    for _ in range(scans):
        contour, rod, drive = into_the_object(rng)
        try:
            friction, scan, said = scanned(rng, contour, rod, drive)
        except TactileBayesError as error:
            ends["not found" if "does not touch" in str(error) else "refused"] += 1
            continue
        ends["scanned"] += 1
        found = [*faults_at_tip(scan), *faults_at_rest(scan, rod, drive, said)]
        found += [name for name in violations(scan, rod, friction) if "inside" in name]
        assert not found, (contour, rod, friction, drive)
    assert ends["not found"] == 0
    assert ends["scanned"] >= scans // 3

"""Carried rods of any heading: the whole rod before, in and after contact, against many points of the contour."""

import warnings
from collections import Counter

import numpy as np

import tactile_bayes as tb
from helpers import drawn_sweeps
from helpers.handed_out import violations
from helpers.rest_lines import depth, rest_line
from tactile_bayes.errors import ClearanceWarning, TactileBayesError
from tactile_bayes.rig import Rig

SCANS, LOOKS, POSES = 8, 9, 24  # number of drives that a seed checks, and of poses by which they are chosen and checked
ROUNDING = 2e-3  # depth [L] that the points of the check leave undecided at edges and along thick rods


def depths(contour, rod, drive, begin, end, count):
    """Depth of the unloaded rod in the object along a drive."""
    return np.array([depth(contour, *rest_line(rod, *pose)) for pose in drive.at(np.linspace(begin, end, count))])


def into_the_object(rng):
    """Contour, rod and drive that begins free and carries the unloaded rod into the object."""
    while True:
        contour, rod = drawn_sweeps.contour(rng), drawn_sweeps.rod(rng, 0.9)
        drive = drawn_sweeps.aimed_drive(rng, contour)
        found = depths(contour, rod, drive, 0.0, drive.travels[-1], LOOKS)
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
    if depths(*along, 0.0, sweep.first_contact.travel, POSES).max() > ROUNDING:
        yield "inside before"
    if sweep.snap_off.kind == "never":
        return
    snap, again = sweep.snap_off.travel, sweep.touches_again
    after = depths(*along, snap, again if np.isfinite(again) else end, POSES)
    if abs(after[0]) > ROUNDING and sweep.clear != (after[0] < 0.0):
        yield "clear"
    if sweep.clear and after.max() > ROUNDING:
        yield "inside after"
    if np.isfinite(again) and abs(after[-1]) > ROUNDING:
        yield "again"
    if (ClearanceWarning in said) != (not sweep.clear or np.isfinite(again)):
        yield "warning"


def test_a_carried_rod_touches_with_the_side_that_is_outside(fuzz_seed):
    rng, ends = np.random.default_rng([fuzz_seed, 7]), Counter()
    for _ in range(SCANS):
        contour, rod, drive = into_the_object(rng)
        friction = float(rng.choice([0.0, rng.uniform(0.0, 0.8)]))
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                scan = tb.scan(contour, rig=Rig(rod=rod, unknown={"friction": friction}), drive=drive)
            except TactileBayesError as error:
                ends["not found" if "does not touch" in str(error) else "refused"] += 1
                continue
        ends["scanned"] += 1
        found = [*faults_at_tip(scan), *faults_at_rest(scan, rod, drive, [one.category for one in said])]
        found += [name for name in violations(scan, rod, friction) if "inside" in name]
        assert not found, (contour, rod, friction, drive)
    assert ends["not found"] == 0
    assert ends["scanned"] >= SCANS // 3

"""Scans of carried drives: no rod that is handed out lies in the object, nor has one come through it."""

import warnings
from collections import Counter
from dataclasses import replace

import numpy as np

import tactile_bayes as tb
from helpers import drawn_sweeps
from helpers.handed_out import violations
from helpers.rest_lines import depth, rest_line
from tactile_bayes.errors import ContourError, TactileBayesWarning
from tactile_bayes.rig import Rig

SCANS, POSES = 4, 60  # number of scans that a seed checks, and of poses before contact in each
DEEP = 1e-6  # depth [L] from which on a rod lies in the object: the oracle finds less of states that are right


def depth_before(scan, rod, drive):
    """Greatest depth of the unloaded rod in the object on its way to first contact."""
    way = np.linspace(0.0, scan.sweeps[0].first_contact.travel, POSES)[:-1]
    return max(depth(scan.contour, *rest_line(rod, *pose)) for pose in drive.at(way))


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
    rng, ends = np.random.default_rng([fuzz_seed, 4]), Counter()
    while ends["scanned"] < SCANS:
        contour, rod, drive = drawn_sweeps.contour(rng), drawn_sweeps.rod(rng), drawn_sweeps.carried_drive(rng)
        friction = float(rng.choice([0.0, rng.uniform(0.0, 0.8)]))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TactileBayesWarning)
            try:
                scan = tb.scan(contour, rig=Rig(rod=rod, unknown={"friction": friction}), drive=drive)
            except ContourError:
                ends["refused"] += 1
                continue
        ends["scanned"] += 1
        assert violations(scan, rod, friction) == {}, (contour, rod, friction, drive)
        assert depth_before(scan, rod, drive) < DEEP, (contour, rod, friction, drive)
    assert ends["refused"] < 10 * SCANS

"""Calibration of records in which the drive carries the base."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from tactile_bayes.calibration.calibrate import experiment_of

FAMILY = tb.Family("circle", r=stats.uniform(0.25, 0.1), q=stats.uniform(0.75, 0.1), x_c=stats.norm(0.0, 0.02))
DRIVE = [tb.Translation((0.8, 0.0), np.pi, 1.1, 1.6), tb.Motion([-0.8, 0.8], 0.0, [2.2, 1.6])]
OPTIONS = {"family": FAMILY, "rig": tb.Rig(unknown="nothing"), "rng": 1, "drive": DRIVE}


@pytest.mark.slow
def test_a_replicate_is_scored_by_the_travel_of_its_end():
    replicate = tb.calibration.calibration_replicate(0, **OPTIONS)
    assert replicate.outcome.message.startswith("converged")
    assert {"snap_off_forward", "snap_off_backward"} <= replicate.outcome.ranks.keys()
    measured = replicate.measured
    assert np.unique(measured.sweep.values).tolist() == [0, 1]
    assert measured.direction.values[[0, -1]].tolist() == ["forward", "backward"]
    np.testing.assert_allclose(measured.base_x.values[[0, 120, 121, 241]], [0.8, -0.8, -0.8, 0.8], atol=1e-12)


def test_the_drives_are_part_of_what_a_calibration_is():
    identity = experiment_of(**OPTIONS).identity
    assert identity["drives"] != experiment_of(**{**OPTIONS, "drive": DRIVE[:1]}).identity["drives"]
    assert identity["drives"] != experiment_of(**{**OPTIONS, "drive": None}).identity["drives"]


@pytest.mark.slow
@pytest.mark.parametrize("family", ["parabola", "circle"])
def test_intervals_hold_at_the_default_priors(family):
    drive = [
        tb.Translation((0.9, 0.0), np.pi, 1.0, 1.8),
        tb.Translation((-0.9, 0.0), 0.0, np.pi - 1.0, 1.8),
    ]
    found = tb.calibrate(family, rng=3, replicates=60, drive=drive, workers=2)
    assert found.attrs["conclusion"] == "calibrated", found.attrs["verdict"]

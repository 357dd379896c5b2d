"""Priors of which nothing is within reach: whether friction is the reason is tried, and said."""

import numpy as np
import pytest
from scipy import stats

from tactile_bayes.contours import Circle
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.family import Family
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.rig import NOTHING, Rig
from tactile_bayes.sweep import Translation, scan

CELL = LoadCell(force_noise=0.05, moment_noise=0.02)
RUBBING = Rig(load_cell=CELL, unknown={**NOTHING, "friction": "default"})


@pytest.fixture(scope="module")
def upright():
    """A rod that is carried upright against a circle, in both directions: its tip would stick."""
    drives = [
        Translation((side * -0.5, 0.0), 0.0 if side > 0 else np.pi, 0.5 * np.pi, travel=1.0, drive_step=0.05)
        for side in (1, -1)
    ]
    return CELL.measure(scan(Circle(0.3, q=0.8), drive=drives).record, rng=1)


def test_friction_that_excludes_every_path_is_named_with_the_way_out(upright, monkeypatch):
    model = Experiment(upright, RUBBING, "circle").model
    usable = RecordLikelihood.usable

    def sticking(self, contours, rig):
        return usable(self, contours, rig) & (np.asarray(rig.friction) == 0.0)

    monkeypatch.setattr(RecordLikelihood, "usable", sticking)
    with pytest.raises(ReachError, match="friction = 0 under"):
        model.draw_prior(np.random.default_rng(1), 100)


def test_friction_is_not_blamed_for_what_is_out_of_reach(upright):
    model = Experiment(upright, RUBBING, Family("circle", q=stats.uniform(5.0, 1.0))).model
    with pytest.raises(ReachError, match="rod length") as refusal:
        model.draw_prior(np.random.default_rng(1), 100)
    assert "friction = 0" not in str(refusal.value)


def test_a_scan_that_sticks_says_whether_it_has_a_path_without_friction():
    drive = Translation(base=(-0.5, 0.0), heading=0.0, drive_angle=0.5 * np.pi, travel=1.0)
    with pytest.raises(ReachError, match="friction = 0 under"):
        scan(Circle(0.3, q=0.8), drive=drive, rig=Rig(unknown={"friction": 0.2}))

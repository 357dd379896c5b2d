"""Which draws of a prior are within reach, with friction."""

import numpy as np
import pytest
from scipy import stats

from tactile_bayes.contours import Circle
from tactile_bayes.errors import ReachError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.family import Family
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.rig import NOTHING, Rig
from tactile_bayes.sweep import Translation, scan

CELL = LoadCell(force_noise=0.05, moment_noise=0.02)
RUBBING = Rig(load_cell=CELL, unknown={**NOTHING, "friction": "default"})


@pytest.fixture(scope="module")
def upright():
    """A rod that is carried upright against a circle, in both directions."""
    drives = [
        Translation((side * -0.5, 0.0), 0.0 if side > 0 else np.pi, 0.5 * np.pi, travel=1.0, drive_step=0.05)
        for side in (1, -1)
    ]
    return CELL.measure(scan(Circle(0.3, q=0.8), drive=drives).record, rng=1)


def test_friction_leaves_paths_of_an_upright_rod_that_is_carried_both_ways(upright):
    """Within reach are as many draws as without friction, in the accuracy of the likelihood as in the exact one."""
    near = {name: stats.uniform(middle - 0.02, 0.04) for name, middle in (("r", 0.3), ("q", 0.8), ("x_c", 0.0))}
    model = Experiment(upright, RUBBING, Family("circle", **near)).model
    points = model.prior_points(np.random.default_rng(1), 300)
    contours, rig = model.contours(points), model.rig(points)
    usable = model.likelihood.usable(contours, rig)
    model.likelihood.exact = True
    exactly = model.likelihood.usable(contours, rig)
    without = model.likelihood.usable(contours, rig._replace(friction=0.0))
    assert np.count_nonzero(without) > 50
    assert np.count_nonzero(usable != exactly) <= 0.02 * np.count_nonzero(exactly)
    assert np.count_nonzero(exactly) >= 0.9 * np.count_nonzero(without)


def test_what_is_out_of_reach_is_refused(upright):
    model = Experiment(upright, RUBBING, Family("circle", q=stats.uniform(5.0, 1.0))).model
    with pytest.raises(ReachError, match="rod length"):
        model.draw_prior(np.random.default_rng(1), 100)

"""Which draws of a prior are within reach, with friction."""

import numpy as np
from scipy import stats

from helpers.contour_posteriors import CELL, only
from tactile_bayes.contours import Circle
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.family import Family
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import Translation, scan


def test_friction_leaves_paths_of_an_upright_rod_that_is_carried_both_ways():
    """Within reach are as many draws as without friction, in the accuracy of the likelihood as in the exact one."""
    drives = [
        Translation((side * -0.5, 0.0), 0.0 if side > 0 else np.pi, 0.5 * np.pi, travel=1.0, drive_step=0.05)
        for side in (1, -1)
    ]
    upright = CELL.measure(scan(Circle(0.3, q=0.8), drive=drives).record, rng=1)
    near = {name: stats.uniform(middle - 0.02, 0.04) for name, middle in (("r", 0.3), ("q", 0.8), ("x_c", 0.0))}
    rubbing = Rig(load_cell=CELL, unknown=only("friction"))
    model = Experiment(upright, rubbing, Family("circle", **near)).model
    points = model.prior_points(np.random.default_rng(1), 300)
    contours, rig = model.contours(points), model.rig(points)
    usable = model.likelihood.usable(contours, rig)
    model.likelihood.exact = True
    exactly = model.likelihood.usable(contours, rig)
    without = model.likelihood.usable(contours, rig._replace(friction=0.0))
    assert np.count_nonzero(without) > 50
    assert np.count_nonzero(usable != exactly) <= 0.02 * np.count_nonzero(exactly)
    assert np.count_nonzero(exactly) >= 0.9 * np.count_nonzero(without)

"""Modes of posteriors, and which optimum belongs to one that is known."""

from dataclasses import replace

import numpy as np

from helpers.contour_posteriors import CELL, only
from tactile_bayes.contours import Parabola
from tactile_bayes.inference.contour_problem import contour_problem
from tactile_bayes.inference.deadline import NEVER
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.starts.modes import Modes
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import scan


def test_an_optimum_is_known_that_lies_near_that_of_a_mode():
    """Even if the mode's proposal has moved away from it, as along a bent ridge."""
    measured = CELL.measure(scan(Parabola(0.6, q=0.5, x_c=0.05), drive_step=0.1).record, rng=1)
    model = contour_problem(Experiment(measured, Rig(load_cell=CELL, unknown=only("friction")))).model
    searched = Modes(model, np.random.default_rng(1), NEVER)
    (mode,) = searched.found_by_search()
    spread = mode.proposal.root.diagonal()
    away = replace(mode.proposal, mean=mode.proposal.mean + 100.0 * spread)
    searched.found[:] = [mode._replace(proposal=away)]
    own = searched.model.coordinates
    deviations = np.sqrt(mode.optimum.covariance.diagonal())
    for distance, is_near in ((0.0, True), (1.0, True), (50.0, False)):
        moved = own.of(mode.optimum.point[None]) + distance * deviations * np.eye(deviations.size)[0]
        assert searched._is_known(mode.optimum._replace(point=own.parameters(moved)[0][0])) == is_near

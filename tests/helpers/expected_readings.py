"""What inference expects a load cell to read at the truth."""

from dataclasses import replace

import numpy as np

from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.record import loads_of


def assert_expected(record, rig, truth, tolerance):
    """The readings are those that are expected of a circle, to a tolerance over the largest of a channel."""
    noisy = replace(rig.load_cell, force_noise=1.0, moment_noise=1.0)
    model = Experiment(record, replace(rig, load_cell=noisy), "circle").model
    model.likelihood.exact = True
    point = np.array([[{**truth, "noise_scale": 1.0}[name] for name in model.names]])
    loads, reached = model.likelihood.predict(model.contours(point), model.rig(point))
    assert reached.all()
    own = model.likelihood.load_cell
    sensed = model.unknowns.sensed(loads, model.values(point), own)
    expected = own.expected(sensed)[0] * model.likelihood.rod.load_units
    readings = loads_of(record)
    largest = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(readings / largest, expected / largest, rtol=0, atol=tolerance)

"""Where searches lead, of records that say little."""

from itertools import islice

import numpy as np
import pytest

from helpers.contour_posteriors import CELL
from tactile_bayes.contours import Parabola
from tactile_bayes.inference.contour_problem import contour_problem
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.starts.contour_optimum import contact_fit, event_brackets, optima_of
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import scan

TRUTH = {"a": 1.484, "q": 0.686, "x_c": -0.8774, "friction": 0.45}


@pytest.fixture(scope="module")
def brief():
    """Exact sweeps in which contact lasts for two samples each, and the model of a record of them."""
    angles = np.radians(np.arange(-30.0, 211.0, 2.0))
    contour = Parabola(TRUTH["a"], TRUTH["q"], TRUTH["x_c"])
    scanned = scan(contour, drive_angles=angles, rig=Rig(unknown={"friction": TRUTH["friction"]}))
    touched = (scanned.record.holding_moment != 0.0).groupby(scanned.record.sweep).sum()
    assert touched.values.tolist() == [2, 2]
    return scanned, contour_problem(Experiment(CELL.measure(scanned.record, rng=3), Rig(load_cell=CELL))).model


def test_contact_of_a_few_samples_brackets_its_events(brief):
    scanned, model = brief
    assert not model.found["contact"].any()
    brackets = event_brackets(model)
    sweeps = scanned.events
    forward, backward = ([s.first_contact.drive_angle, s.snap_off.drive_angle] for s in sweeps.values())
    events = np.array([[forward, np.pi - np.array(backward)]])
    assert brackets.segment.tolist() == [0, 0, 1, 1]
    assert np.all(brackets.missed(events) == 0.0)


@pytest.mark.slow
def test_searches_find_what_explains_contact_of_a_few_samples(brief):
    _, model = brief
    usual = {"rigidity_scale": 1.0, "noise_scale": 1.0}
    truth = np.array([[TRUTH.get(name, usual.get(name, 0.0)) for name in model.names]])
    found = np.concatenate([one.point[None] for one in islice(optima_of(model, np.random.default_rng(1)), 6)])
    assert model.log_probability(found).max() > model.log_probability(truth)[0] - 5.0


def test_a_rig_that_corrects_the_record_to_none_fits_no_contour(brief):
    """As a search may try, from a prior draw that is far out."""
    _, model = brief
    assert contact_fit(model, {"drive_angle_offset": -9.0}) is None

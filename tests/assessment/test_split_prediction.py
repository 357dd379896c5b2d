import numpy as np
import pytest
import xarray as xr

from helpers.contour_posteriors import CELL, SOUND, infer_as_stated, measured, posterior, swept
from helpers.refusals import refused
from tactile_bayes.assessment.split_prediction import parts_of, split_prediction
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour import infer_contour
from tactile_bayes.inference.experiment import Experiment, experiment_of
from tactile_bayes.rig import NOTHING, Rig


def found_of(tree):
    return split_prediction(tree, experiment_of(tree).model)


def test_parts_of_a_record_of_the_model_agree():
    found = found_of(posterior())
    assert found.attrs["passed"] == 1  # a false alarm has a probability of 1 %; the seed is fixed
    assert found["part"].values.tolist() == ["sweep 1", "sweep 2", "earlier half", "later half", "noise"]
    assert (np.abs(found["moves"].values[:-1]) < 4.0).all()


@pytest.mark.slow
def test_friction_shows_as_a_disagreement_of_early_and_late_contacts():
    record = CELL.measure(swept(Parabola(0.5, 0.5), friction=0.007), rng=3)
    found = found_of(infer_as_stated(record, load_cell=CELL, rng=1, settings=SOUND))
    assert found.attrs["passed"] == 0
    assert float(found["sd"].sel(part="earlier half")) > 5.0


@pytest.mark.slow
def test_a_zero_that_moves_between_sweeps_shows_though_zeros_are_not_inferred():
    record = measured().copy(deep=True)
    course = np.linspace(-1.0, 1.0, record.sizes["sample"])
    record["force_x"] = record.force_x + xr.DataArray(0.05 * course, dims="sample")
    assert found_of(infer_as_stated(record, load_cell=CELL, rng=1, settings=SOUND)).attrs["passed"] == 0


@pytest.mark.slow
def test_noise_that_is_known_and_larger_than_stated_shows():
    louder = type(CELL)(force_noise=1.25 * CELL.force_noise, moment_noise=1.25 * CELL.moment_noise)
    record = louder.measure(swept(Parabola(0.5, 0.5)), rng=4)
    rig = Rig(load_cell=CELL, unknown={**NOTHING, "noise_scale": 1.0})
    found = found_of(infer_contour(record, rig=rig, rng=1, settings=SOUND))
    assert found.attrs["passed"] == 0
    assert float(found["sd"].sel(part="noise")) > 4.0


def test_parts_are_sweeps_pivots_and_halves():
    record = swept(Parabola(0.5, 0.5), bases=((0.0, 0.0), (0.2, 0.0)), step=0.1)
    rig = Rig(load_cell=CELL, unknown="nothing")
    parts = parts_of(Experiment(record, rig=rig).model)
    sweeps = [f"sweep {number}" for number in (1, 2, 3, 4)]
    assert list(parts) == [*sweeps, "pivot 1", "pivot 2", "earlier half", "later half"]
    assert (parts["pivot 1"] == (record.base_x.values == 0.0)).all()
    assert (parts["earlier half"] == ~parts["later half"]).all()
    one = record.isel(sample=record.sweep.values == record.sweep.values[0])
    assert list(parts_of(Experiment(one, rig=rig).model)) == ["earlier half", "later half"]


def test_too_few_predictions_are_refused():
    tree = posterior().copy()
    tree["posterior_predictive"] = tree["posterior_predictive"].to_dataset().isel(draw=slice(0, 10))
    with refused(InferenceError, "20 predictions"):
        found_of(tree)

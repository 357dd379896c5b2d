"""Runs that are stopped and go on."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from helpers.contour_posteriors import CELL, TRUTH, infer_as_stated, swept
from helpers.refusals import refused
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.ensembles import SamplerSettings

SHORT = SamplerSettings(ensembles=2, walkers=12, block_steps=10, max_steps=30, min_ess=1e9)


@cache
def coarse():
    """A record of few samples, that is not to be changed."""
    return CELL.measure(swept(Parabola(**TRUTH), step=0.15), rng=5)


def infer(checkpoint=None, **options):
    options = {"load_cell": CELL, "rng": 1, "settings": SHORT} | options
    return infer_as_stated(coarse(), checkpoint=checkpoint, **options)


def test_a_run_that_goes_on_gives_the_draws_of_one_that_was_not_stopped(tmp_path):
    whole = infer()
    infer(tmp_path / "run", settings=replace(SHORT, max_steps=10))
    rest = infer(tmp_path / "run")
    assert rest["sample_stats"].attrs["steps_run"] == 30
    for group in ("posterior", "prior", "posterior_predictive", "events"):
        for name, values in whole[group].data_vars.items():
            np.testing.assert_array_equal(rest[group][name].values, values.values)


@pytest.mark.slow
def test_a_run_out_of_time_goes_on_from_the_same_start(tmp_path):
    """However little time there is, the search for it is not cut short."""
    for steps in (1, 2, 3):
        hasty = infer(tmp_path, settings=replace(SHORT, max_seconds=1e-9))
        assert hasty["sample_stats"].attrs["steps_run"] == steps
    whole = infer(settings=replace(SHORT, max_steps=3))
    for name, values in whole["posterior"].data_vars.items():
        np.testing.assert_array_equal(hasty["posterior"][name].values, values.values)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"family": "circle"}, "family"),
        ({"settings": replace(SHORT, events=False)}, "events"),
        ({"unknown": {"rigidity_scale": "default"}}, "nuisances"),
        ({"unknown": {"friction": 0.2}}, "friction"),
        ({"load_cell": replace(CELL, force_noise=0.06)}, "load_cell_force_noise"),
    ],
)
def test_another_run_is_refused_and_told_what_differs(tmp_path, change, words):
    infer(tmp_path, settings=replace(SHORT, max_steps=10))
    with refused(InferenceError, words):
        infer(tmp_path, **change)

"""Families compared while a record grows, against streams of each and the comparison of the whole record."""

import json

import numpy as np
import pytest
import xarray as xr
from scipy.special import softmax

import tactile_bayes as tb
from helpers.load_cells import CELL
from helpers.refusals import refused
from tactile_bayes.errors import InferenceError, RecordError
from tactile_bayes.inference.parameters.priors import matched_priors

RIG = tb.Rig(load_cell=CELL, unknown="nothing")
OPTIONS = {"rig": RIG, "rng": 1, "particles": 200}
FAMILIES = ["circle", "ellipse", "parabola"]
X = [-0.1, 0.0, 0.1]


@pytest.fixture(scope="module")
def measured():
    scan = tb.scan(tb.contours.Circle(0.4, q=0.5), drive_step=0.08)
    return CELL.measure(scan.record, rng=3)


def fed(streams, measured, blocks):
    parts = np.array_split(np.arange(measured.sizes["sample"]), blocks)
    return [streams.update(measured.isel(sample=part)) for part in parts]


@pytest.fixture(scope="module")
def compared(measured):
    streams = tb.comparison.StreamComparison(
        families=FAMILIES, x=X, stop=lambda now: now.probability.max() > 0.9, **OPTIONS
    )
    return streams, fed(streams, measured, 3)


@pytest.mark.slow
def test_each_family_is_a_stream_of_its_own(compared, measured):
    alone = tb.Stream(family=tb.Family("ellipse", **matched_priors("ellipse", 1.0)), **OPTIONS)
    for now, own in zip(compared[1], fed(alone, measured, 3), strict=True):
        assert float(now.log_evidence.sel(family="ellipse")) == float(own.log_evidence)
        finite = np.isfinite(now.log_evidence.values)
        expected = np.where(finite, softmax(np.where(finite, now.log_evidence.values, -np.inf)), 0.0)
        np.testing.assert_allclose(now.probability.values, expected)
    xr.testing.assert_identical(
        compared[0].posterior("ellipse")["posterior"].dataset, alone.posterior()["posterior"].dataset
    )


@pytest.mark.slow
def test_the_last_evidences_agree_with_those_of_the_whole_record(measured):
    quick = tb.SamplerSettings(ensembles=2, min_ess=400, max_r_hat=1.05)
    options = {"rig": RIG, "rng": 1, "leave_one_out": False, "settings": quick}
    whole = tb.compare_families(measured, families=FAMILIES[:2], **options)
    streams = tb.comparison.StreamComparison(families=FAMILIES[:2], **(OPTIONS | {"particles": 1000}))
    now = fed(streams, measured, 3)[-1]
    np.testing.assert_allclose(now.log_evidence, whole.log_evidence, atol=1.5)
    assert now.attrs["most_probable"] == whole.attrs["most_probable"] == "circle"


@pytest.mark.slow
def test_a_family_far_behind_is_given_up_and_a_condition_ends_it_near_the_truth(compared):
    streams, (*_, now) = compared
    assert set(json.loads(now.attrs["lost"])) == {"parabola"}
    assert float(now.probability.sel(family="parabola")) == 0.0
    with pytest.raises(InferenceError, match="parabola"):
        streams.posterior("parabola")
    band, truth = tb.contour_band(now, X), tb.contours.Circle(0.4, q=0.5).height(np.array(X))
    assert np.all((band["lower"].values < truth) & (truth < band["upper"].values))
    assert bool(now.may_stop)


def test_heights_are_averaged_over_families_and_a_refusal_leaves_all_streams_as_they_were(measured):
    streams = tb.comparison.StreamComparison(families=FAMILIES[:2], x=X, **(OPTIONS | {"particles": 100}))
    now = streams.update(measured.isel(sample=slice(0, 20)))
    band = tb.contour_band(now, X)
    np.testing.assert_allclose(now.height.sel(level=0.025), band["lower"], rtol=1e-12)
    np.testing.assert_allclose(now.height.sel(level=0.975), band["upper"], rtol=1e-12)
    with pytest.raises(RecordError):
        streams.update(measured.isel(sample=slice(0, 12)))
    assert streams.record.sizes["sample"] == 20


@pytest.mark.slow
def test_resumed_streams_go_on_with_the_same_numbers(measured, tmp_path):
    first, block = measured.isel(sample=slice(0, 10)), measured.isel(sample=slice(10, 14))
    options = OPTIONS | {"particles": 100}
    streams = tb.comparison.StreamComparison(families=FAMILIES[:2], **options)
    for early in (lambda: streams.save(tmp_path / "streams.nc"), streams.latest, lambda: streams.posterior("circle")):
        with pytest.raises(InferenceError):
            early()
    streams.update(first)
    streams.save(tmp_path / "streams.nc")
    resumed = tb.comparison.StreamComparison.resume(tmp_path / "streams.nc", measured, families=FAMILIES[:2], **options)
    xr.testing.assert_identical(resumed.latest(), streams.latest())
    one, other = (each.update(block) for each in (streams, resumed))
    xr.testing.assert_identical(one.drop_vars("seconds"), other.drop_vars("seconds"))
    for changed in ({"families": FAMILIES[1:]}, {"families": FAMILIES[:2], "rng": 2}):
        with pytest.raises(InferenceError):
            tb.comparison.StreamComparison.resume(tmp_path / "streams.nc", **(options | changed))
    with refused(InferenceError, "streams.nc"):
        tb.Stream.resume(tmp_path / "streams.nc", **options)


def test_families_of_which_something_is_said(measured):
    """What is known is a constant among the draws."""
    families = [tb.Family("circle", q=0.5), tb.Family("ellipse", b=0.4)]
    streams = tb.comparison.StreamComparison(families, x=X, **(OPTIONS | {"particles": 100}))
    draws = streams.update(measured).contour_draws.values
    np.testing.assert_array_equal(draws[0, :, 1], 0.5)  # r, q, x_c
    np.testing.assert_array_equal(draws[1, :, 1], 0.4)  # a, b, q, x_c
    assert np.ptp(draws[1, :, 0]) > 0.0

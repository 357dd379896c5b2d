"""The posterior of a growing record, against the posterior of the whole record."""

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from tactile_bayes.errors import InferenceError, ParameterError, RecordError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.contour_evidence import contour_evidence
from tactile_bayes.inference.contour_problem import contour_problem
from tactile_bayes.inference.experiment import Experiment

CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
X = [-0.2, 0.0, 0.2]


@pytest.fixture(scope="module")
def measured():
    scan = tb.scan(tb.contours.paper_profile("II", q=0.5), drive_step=0.1)
    return CELL.measure(scan.record, seed=1)


def stream_of(**changes):
    return tb.Stream(**({"load_cell": CELL, "nuisances": [], "seed": 1, "particles": 500, "x": X} | changes))


def fed(stream, measured, blocks):
    parts = np.array_split(np.arange(measured.sizes["sample"]), blocks)
    return [stream.update(measured.isel(sample=part)) for part in parts]


@pytest.fixture(scope="module")
def streamed(measured):
    stream = stream_of(stop=lambda now: now.samples > 50)
    return stream, fed(stream, measured, 4)


@pytest.fixture(scope="module")
def whole(measured):
    problem = contour_problem(Experiment(measured, "parabola", CELL, nuisances=[]))
    return problem, sampled(problem, seed=2, settings=tb.SamplerSettings(min_ess=1000))


def test_the_last_update_agrees_with_the_whole_record(streamed, whole):
    last, draws = streamed[1][-1], whole[1].draws.samples.reshape(-1, 4)
    expected, deviation = np.quantile(draws, last.level.values, axis=0), draws.std(axis=0)
    assert np.abs((last.parameters.values - expected) / deviation)[1:-1].max() < 0.25
    assert np.abs((last.parameters.values - expected) / deviation).max() < 0.5
    band = tb.contour_band(whole[1].tree, X)
    width = band["upper"].values - band["lower"].values
    assert np.abs(last.height.sel(level=0.025).values - band["lower"].values).max() < 0.15 * width.max()
    assert np.abs(last.height.sel(level=0.975).values - band["upper"].values).max() < 0.15 * width.max()
    assert last.correlation < 0.2


def test_the_evidence_agrees_with_bridge_sampling(streamed, whole):
    problem, found = whole
    expected = contour_evidence(problem.model, found, np.random.default_rng(3)).log_evidence[1]
    assert abs(float(streamed[1][-1].log_evidence) - expected) < 1.5


def test_one_block_and_many_agree(streamed, measured):
    (once,) = fed(stream_of(seed=5), measured, 1)
    last = streamed[1][-1]
    spread = once.parameters.sel(level=0.975) - once.parameters.sel(level=0.025)
    assert float((abs(once.parameters - last.parameters).sel(level=0.5) / spread).max()) < 0.1
    assert abs(float(once.log_evidence - last.log_evidence)) < 1.5


def test_the_result_grows_with_the_record(streamed, measured):
    results = streamed[1]
    assert [int(now.samples) for now in results] == [28, 56, 84, measured.sizes["sample"]]
    assert [bool(now.may_stop) for now in results] == [False, True, True, True]
    assert all(now.seconds > 0.0 and 0.0 < now.effective_number <= 500.0001 for now in results)
    xr.testing.assert_equal(streamed[0].record.drive_angle.drop_vars("sample", errors="ignore"), measured.drive_angle)


def test_the_posterior_is_one_of_a_contour(streamed, measured):
    tree = streamed[0].posterior()
    assert tree["posterior"].sizes == {"chain": 1, "draw": 500}
    assert tree.attrs["converged"] == 1
    assert tb.contour_band(tree, [0.0])["median"].values == pytest.approx([0.5], abs=0.005)
    assert tb.gap(tree).sizes["stroke"] == 2
    tb.to_arviz(tree)


def test_samples_without_contact_are_informative(measured):
    stream = stream_of(particles=200)
    now = stream.update(measured.isel(sample=slice(0, 5)))
    assert np.isfinite(float(now.log_evidence))


def test_a_seed_reproduces(measured):
    one, other = (fed(stream_of(particles=100), measured.isel(sample=slice(0, 20)), 2)[-1] for _ in range(2))
    xr.testing.assert_identical(one.drop_vars("seconds"), other.drop_vars("seconds"))


def spoilt(block):
    return block.assign(force_x=block.force_x.where(np.arange(block.sizes["sample"]) != 1))


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (spoilt, "force_x"),
        (lambda block: block.isel(sample=slice(None, None, -1)), "drive angle"),
        (lambda block: block.drop_vars("holding_moment"), "holding_moment"),
        (lambda block: block.assign_attrs(load_cell_frame="turning"), "load_cell_frame"),
        (lambda block: None, "xarray"),
    ],
)
def test_a_refusal_leaves_the_stream_as_it_was(measured, change, what):
    stream, untouched = stream_of(particles=100), stream_of(particles=100)
    first, block = measured.isel(sample=slice(0, 12)), measured.isel(sample=slice(12, 20))
    stream.update(first)
    untouched.update(first)
    with pytest.raises(RecordError, match=what):
        stream.update(change(block))
    one, other = stream.update(block), untouched.update(block)
    xr.testing.assert_identical(one.drop_vars("seconds"), other.drop_vars("seconds"))


def test_samples_that_come_twice_or_late_are_refused(measured):
    stream = stream_of(particles=100)
    stream.update(measured.isel(sample=slice(0, 12)))
    with pytest.raises(RecordError, match="behind the last one"):
        stream.update(measured.isel(sample=slice(4, 12)))


def test_arguments_are_checked():
    with pytest.raises(ParameterError, match="particles"):
        stream_of(particles=10)
    with pytest.raises(ParameterError, match="stop"):
        stream_of(stop=1)
    with pytest.raises(InferenceError, match="no samples"):
        stream_of().posterior()


def test_the_backlash_enters_with_the_second_direction(measured):
    stream = stream_of(nuisances=["standard"], particles=100)
    turns = int((measured.direction.values == "forward").sum())
    before = stream.update(measured.isel(sample=slice(0, turns)))
    now = stream.update(measured.isel(sample=slice(turns, turns + 20)))
    assert "backlash" not in before.parameter.values
    assert "backlash" in now.parameter.values

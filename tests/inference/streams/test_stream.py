"""The posterior of a growing record, against the posterior of the whole record."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers.contour_posteriors import CELL
from helpers.refusals import refused
from tactile_bayes import Rig
from tactile_bayes.errors import InferenceError, ParameterError, RecordError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.evidence import contour_evidence
from tactile_bayes.inference.experiment import Experiment, contour_problem
from tactile_bayes.inference.streams import particles
from tactile_bayes.inference.streams.stream_state import read_tree, surprise_after
from tactile_bayes.record.netcdf import write_netcdf

STATED = Rig(load_cell=CELL, unknown="nothing")
PROFILE = tb.contours.paper_profile("II", q=0.5)
X = [-0.2, 0.0, 0.2]


@pytest.fixture(scope="module")
def measured():
    return CELL.measure(tb.scan(PROFILE, drive_step=0.1).record, rng=1)


def stream_of(**changes):
    return tb.Stream(**({"rig": STATED, "rng": 1, "particles": 500, "x": X} | changes))


def fed(stream, measured, blocks):
    parts = np.array_split(np.arange(measured.sizes["sample"]), blocks)
    return [stream.update(measured.isel(sample=part)) for part in parts]


@pytest.fixture(scope="module")
def streamed(measured):
    stream = stream_of(stop=lambda now: now.samples > 50)
    return stream, fed(stream, measured, 4)


@pytest.fixture(scope="module")
def whole(measured):
    problem = contour_problem(Experiment(measured, STATED))
    return problem, sampled(problem, seed=2, settings=tb.SamplerSettings(min_ess=1000))


@pytest.mark.slow
def test_the_last_update_agrees_with_the_whole_record(streamed, whole):
    """In quantiles, the band, and the evidence, against that of bridge sampling."""
    last, draws = streamed[1][-1], whole[1].draws.samples.reshape(-1, 4)
    expected, deviation = np.quantile(draws, last.level.values, axis=0), draws.std(axis=0)
    assert np.abs((last.parameters.values - expected) / deviation)[1:-1].max() < 0.25
    assert np.abs((last.parameters.values - expected) / deviation).max() < 0.5
    band = tb.contour_band(whole[1].tree, X)
    width = band["upper"].values - band["lower"].values
    assert np.abs(last.height.sel(level=0.025).values - band["lower"].values).max() < 0.15 * width.max()
    assert np.abs(last.height.sel(level=0.975).values - band["upper"].values).max() < 0.15 * width.max()
    assert last.correlation < 0.2
    evidence = contour_evidence(whole[0].model, whole[1], np.random.default_rng(3)).log_evidence[1]
    assert abs(float(last.log_evidence) - evidence) < 1.5


@pytest.mark.slow
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
    assert tb.gap(tree).sizes["segment"] == 2
    tb.to_arviz(tree)


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "converged"), [(40, 1), (2, 0)])
def test_particles_that_have_lost_the_posterior_find_it_again_or_tell(
    streamed, measured, monkeypatch, steps, converged
):
    """They climb towards it as soon as they move, for as many steps as they have."""
    last = streamed[1][-1]
    assert abs(float(last.log_density_rise)) < 0.2
    assert 0.0 < float(last.log_density_shift) < 1.0
    stream = stream_of(particles=200)
    stream.update(measured.isel(sample=slice(0, 40)))
    assert stream.posterior().attrs["converged"] == 1
    monkeypatch.setattr(particles, "_MOST_STEPS", steps)
    state = stream._state
    lost = state.points + [4.0, 0.0, 0.0, 0.0] * state.points.std(axis=0)
    stream._state = replace(state, points=lost, values=state.experiment.model.log_probability(lost))
    assert stream.update(measured.isel(sample=slice(40, None))).steps > 0
    latest, posterior = stream.latest(), stream.posterior()
    assert float(latest.log_density_shift) > 1.2
    assert (float(latest.log_density_rise) < 0.4) == posterior.attrs["converged"] == converged
    assert ("they had lost the posterior" in posterior.attrs["message"]) != converged


@pytest.mark.slow
def test_a_wrong_model_shows_early_and_a_right_one_never(streamed):
    assert all(float(now.e_value) < 2.0 for now in streamed[1])
    sliding = tb.scan(PROFILE, drive_step=0.05, rig=Rig(unknown={"friction": 0.2})).record
    first, *_, last = fed(stream_of(particles=200), CELL.measure(sliding, rng=1).isel(sample=slice(0, 60)), 4)
    assert float(first.e_value) < 2.0
    assert float(last.e_value) > 1000.0


def test_an_e_value_is_of_the_blocks_since_the_model_went_wrong():
    """Against the sum over all blocks from which it may be wrong."""
    ratios = np.random.default_rng(1).normal(-0.5, 1.0, (6, 3))
    state, largest = None, -np.inf
    for count in range(1, 7):
        products, surprise = surprise_after(state, ratios[count - 1])
        weights = [1.0 / (k * (k + 1.0)) for k in range(1, count + 1)]
        value = sum(w * np.exp(ratios[k:count].sum(axis=0)).mean() for k, w in enumerate(weights)) + 1.0 - sum(weights)
        largest = max(largest, value)
        assert np.exp(surprise) == pytest.approx(largest, rel=1e-12)
        state = SimpleNamespace(updates=count - 1, log_products=products, surprise=surprise)


REFUSED = {
    "force_x": lambda block: block.assign(force_x=block.force_x.where(np.arange(block.sizes["sample"]) != 1)),
    "drive angle": lambda block: block.isel(sample=slice(None, None, -1)),
    "holding_moment": lambda block: block.drop_vars("holding_moment"),
    "load_cell_frame": lambda block: block.assign_attrs(load_cell_frame="turning"),
    "xarray": lambda block: None,
}


def test_refusals_leave_the_stream_as_it_was(measured):
    """As a seed reproduces it; samples that come twice or late are refused as well."""
    stream, untouched = stream_of(particles=100), stream_of(particles=100)
    first, block = measured.isel(sample=slice(0, 12)), measured.isel(sample=slice(12, 20))
    stream.update(first)
    untouched.update(first)
    for what, refusal in REFUSED.items():
        with pytest.raises(RecordError, match=what):
            stream.update(refusal(block))
    with pytest.raises(RecordError, match="behind the last one"):
        stream.update(measured.isel(sample=slice(4, 12)))
    one, other = stream.update(block), untouched.update(block)
    xr.testing.assert_identical(one.drop_vars("seconds"), other.drop_vars("seconds"))


@pytest.mark.parametrize(
    ("call", "kind", "named"),
    [
        (lambda: stream_of(particles=10), ParameterError, "particles"),
        (lambda: stream_of(stop=1), ParameterError, "stop"),
        (lambda: stream_of().posterior(), InferenceError, "no samples"),
        (lambda: stream_of().save("stream.nc"), InferenceError, "no samples yet"),
    ],
)
def test_what_a_stream_cannot_do_is_refused(call, kind, named):
    with refused(kind, named):
        call()


@pytest.mark.slow
def test_the_backlash_enters_with_the_second_direction(measured):
    stream = stream_of(rig=Rig(load_cell=CELL), particles=100)
    turns = int((measured.direction.values == "forward").sum())
    before = stream.update(measured.isel(sample=slice(0, turns)))
    now = stream.update(measured.isel(sample=slice(turns, turns + 20)))
    assert "backlash" not in before.parameter.values
    assert "backlash" in now.parameter.values


# --- The file of a stream -------------------------------------------------------------------------------------------

SAVED = {"rig": STATED, "rng": 1, "particles": 100}


@pytest.fixture(scope="module")
def saved(measured, tmp_path_factory):
    """A file after two blocks, and the result of a third one, of the stream that wrote the file."""
    path, stream = tmp_path_factory.mktemp("stream") / "stream.nc", tb.Stream(**SAVED)
    fed(stream, measured.isel(sample=slice(0, 30)), 2)
    stream.save(path)
    return path, stream.update(measured.isel(sample=slice(30, 45))), stream.posterior()


@pytest.mark.parametrize("with_record", [False, True])
def test_a_stream_that_goes_on_has_the_numbers_of_one_that_was_not_stopped(measured, saved, with_record):
    path, expected, posterior = saved
    stream = tb.Stream.resume(path, measured if with_record else None, **SAVED)
    now = stream.update(measured.isel(sample=slice(30, 45)))
    xr.testing.assert_identical(now.drop_vars("seconds"), expected.drop_vars("seconds"))
    for group in ("posterior", "events", "posterior_predictive"):
        xr.testing.assert_equal(stream.posterior()[group].to_dataset(), posterior[group].to_dataset())
    assert stream.posterior().attrs["data_sha256"] == posterior.attrs["data_sha256"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rng": 2}, "seed is 1, pool of 4 there and 2, pool of 4 here"),
        ({"family": "circle"}, "family is parabola there and circle here"),
        ({"particles": 200}, "particles is 100 there and 200 here"),
        ({"rig": STATED.with_unknown(friction="default")}, "nuisances"),
        ({"rig": replace(STATED, load_cell=replace(CELL, force_noise=0.06))}, "load_cell_force_noise"),
        ({"family": tb.Family("parabola", q=stats.norm(0.5, 0.1))}, "priors"),
        ({"record": "shorter"}, "samples is 30 there and 20 here"),
        ({"record": "another"}, "record (its SHA-256)"),
    ],
)
def test_the_file_of_another_stream_is_refused_with_what_differs(measured, saved, change, words):
    records = {"shorter": measured.isel(sample=slice(0, 20)), "another": measured.assign(force_x=-measured.force_x)}
    change = {**change, "record": records.get(change.get("record"))}
    with refused(InferenceError, words):
        tb.Stream.resume(saved[0], **(SAVED | change))


class Mine:
    """A prior that does not state its numbers."""

    def __init__(self, centre):
        prior = stats.norm(centre, 0.05)
        self.logpdf, self.rvs, self.std = prior.logpdf, prior.rvs, prior.std

    def __repr__(self):
        return "mine"


def test_a_prior_that_differs_in_nothing_that_is_written_is_refused(measured, tmp_path):
    one, other = (tb.Family("parabola", q=Mine(centre)) for centre in (0.5, 0.5000004))
    stream = tb.Stream(**SAVED, family=one)
    stream.update(measured.isel(sample=slice(0, 20)))
    stream.save(tmp_path / "stream.nc")
    with refused(InferenceError, "log-density of the particles"):
        tb.Stream.resume(tmp_path / "stream.nc", **SAVED, family=other)


def test_a_file_that_is_damaged_or_no_state_is_refused(measured, saved, tmp_path):
    path = tmp_path / "stream.nc"
    path.write_bytes(saved[0].read_bytes()[:-3000])
    for where, words in ((path, "is damaged"), (tmp_path / "none.nc", "there is no file")):
        with refused(InferenceError, words):
            tb.Stream.resume(where, **SAVED)
    tb.write_record(measured, path)
    with refused(InferenceError, "holds no state of a stream"):
        tb.Stream.resume(path, **SAVED)
    newer = read_tree(saved[0])
    newer.attrs["format"] = 3
    write_netcdf(newer, path)
    with refused(InferenceError, path, "format 3"):
        tb.Stream.resume(path, **SAVED)


def test_columns_of_the_users_own_survive_the_file(measured, tmp_path):
    more = measured.assign(note=("sample", ["", "å"] * 10 + [""] * (measured.sizes["sample"] - 20)))
    more = tb.make_record(dict(more.data_vars), attrs=more.attrs)
    stream = tb.Stream(**SAVED)
    stream.update(more.isel(sample=slice(0, 12)))
    stream.save(tmp_path / "stream.nc")
    resumed = tb.Stream.resume(tmp_path / "stream.nc", **SAVED)
    xr.testing.assert_equal(resumed.record, stream.record)
    assert resumed.update(more.isel(sample=slice(12, 14))).samples == 14

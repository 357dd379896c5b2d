from functools import cache

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers.contour_posteriors import CELL, SOUND, infer_as_stated, measured, posterior, swept
from tactile_bayes.assessment.trust import _corrected, draws_digest, trust
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.result import write_result


@cache
def right():
    return trust(posterior(), rng=1, replicates=0, assumptions=False)


def test_a_record_of_the_model_holds_and_says_so():
    found = right()
    assert found.attrs["conclusion"] == "holds"
    assert found.attrs["summary"].startswith("The band of probability 0.95 holds")
    words = found.attrs["words"].splitlines()
    assert f" agree (p = {float(found.split_p_value):.2g}" in words[0]
    assert found.set_by.sel(quantity=["band in_gap", "band beside"]).values.tolist() == ["record", "record"]
    assert [line.rpartition(" by ")[2] for line in words[1:3]] == ["the record."] * 2
    assert "% of its width (" in words[-1]
    assert found.attrs["draws_sha256"] == draws_digest(posterior())
    np.testing.assert_allclose(found["lower"], tb.contour_band(posterior(), found.x.values)["lower"])


def test_a_posterior_that_has_not_converged_is_judged_without_replicates_and_assumptions(monkeypatch, tmp_path):
    for name in ("posterior_calibration", "band_by_assumption"):
        monkeypatch.setattr(f"tactile_bayes.assessment.trust.{name}", None)
    found = trust(with_attrs(converged=0), rng=1, out=tmp_path)
    assert found.attrs["conclusion"] == "do not rely on it"
    assert "the ensembles have not converged" in found.attrs["summary"]
    assert "left out" in found.attrs["words"].splitlines()[-1]
    assert found.attrs["replicates"] == 0
    assert not {"assumption", "claim"} & set(found.dims)


@pytest.mark.slow
def test_a_wrong_family_is_not_to_be_relied_on():
    record = CELL.measure(swept(tb.contours.paper_profile("III", q=0.5)), rng=2)
    tree = infer_as_stated(record, load_cell=CELL, rng=1, settings=SOUND)
    found = trust(tree, rng=1, replicates=0, assumptions=False)
    assert found.attrs["conclusion"] == "do not rely on it"
    assert f"(p = {float(found.split_p_value):.2g} for all parts)" in found.attrs["summary"]


@pytest.mark.slow
def test_a_narrow_prior_of_the_vertex_sets_the_gap():
    deviation = float(posterior()["posterior"]["q"].std())
    family = tb.Family("parabola", q=stats.norm(0.5, 0.2 * deviation))
    tree = infer_as_stated(measured(), load_cell=CELL, family=family, rng=1, settings=SOUND)
    found = trust(tree, rng=1, replicates=0, assumptions=False)
    assert found.attrs["conclusion"] == "holds, but the prior sets the gap"
    assert found.set_by.sel(quantity="band in_gap") == "prior"
    (line,) = [line for line in found.attrs["words"].splitlines() if line.startswith("The band in")]
    assert line.endswith("of the contour.")
    *_, said, _ = tb.check(tree, trust=found).messages  # the last one names q, of which the record adds little
    assert (said.kind, said.details) == ("reservation", {"summary": found.attrs["summary"]})
    assert "0.95 holds beside" in said


@pytest.mark.slow
def test_replicates_give_ranks_coverage_and_factors():
    found = trust(posterior(), rng=1, replicates=2, assumptions=False, workers=1)
    assert found.attrs["calibration"] == "too few"
    assert {"rank_p_value", "coverage", "factor", "corrected"} <= set(found.data_vars)
    assert "corrected_lower" not in found


def test_the_check_uses_it():
    found = right()
    assert tb.check(posterior(), trust=found).messages == tb.check(posterior()).messages
    against = found.assign_attrs(conclusion="do not rely on it", summary="Because of this.")
    first, *_ = tb.check(posterior(), trust=against).messages
    assert (first.kind, first.details) == ("not reliable", {"summary": "Because of this."})


def test_a_band_is_corrected_about_its_median_where_it_is_too_narrow():
    x = np.linspace(-1.0, 1.0, 5)
    band = {name: ("x", np.full(5, value)) for name, value in (("lower", -1.0), ("median", 0.0), ("upper", 2.0))}
    regions = {"factor": ("region", [1.5, 3.0]), "corrected": ("region", [1, 0])}
    found = xr.Dataset({**band, **regions}, coords={"x": x, "region": ["in_gap", "beside"]})
    regions = {"in_gap": np.array([-0.6, 0.6])}
    wider = _corrected(found, regions)
    assert wider["corrected_lower"].values.tolist() == [-1.0, -1.5, -1.5, -1.5, -1.0]
    assert wider["corrected_upper"].values.tolist() == [2.0, 3.0, 3.0, 3.0, 2.0]
    assert _corrected(found.assign(corrected=("region", [0, 0])), regions) == {}


@pytest.mark.slow
def test_a_run_and_its_file_are_taken(tmp_path):
    write_result(posterior(), tmp_path / "posterior.nc")
    assert trust(tmp_path, rng=1, replicates=0, assumptions=False).equals(right())


def with_attrs(**attrs):
    tree = posterior().copy()
    tree.attrs = {**tree.attrs, **attrs}
    return tree


def of_few_loaded_samples():
    tree = posterior().copy()
    events = tree["events"].to_dataset()
    tree["events"] = xr.DataTree(events.assign(snap_off_drive_angle=events["first_drive_angle"]))
    return tree


@pytest.mark.parametrize(
    ("run", "options", "error", "named"),
    [
        (lambda: "no such folder", {}, InferenceError, "no such folder"),
        (lambda: 3, {}, ParameterError, "run_or_posterior is 3"),
        (posterior, {"replicates": -1}, ParameterError, "replicates"),
        (lambda: with_attrs(events=0), {}, InferenceError, "events=False"),
        pytest.param(of_few_loaded_samples, {}, InferenceError, "too few to judge", marks=pytest.mark.slow),
    ],
)
def test_what_cannot_be_judged_is_refused(run, options, error, named):
    with pytest.raises(error, match=named):
        trust(run(), rng=1, **({"replicates": 0, "assumptions": False} | options))


@pytest.mark.slow
def test_a_distribution_that_is_none_of_scipys_has_to_be_given_again():
    """A histogram of q: the posterior states that it was one, and not its numbers."""
    heights = stats.rv_histogram(np.histogram(np.linspace(0.3, 0.7, 50), bins=5), density=True)()
    family = tb.Family("parabola", q=heights)
    tree = infer_as_stated(measured(), load_cell=CELL, family=family, rng=1, settings=SOUND)
    with pytest.raises(ParameterError, match="does not state its family"):
        trust(tree, rng=1, replicates=0, assumptions=False)
    assert trust(tree, rng=1, family=family, replicates=0, assumptions=False).attrs["conclusion"] == "holds"

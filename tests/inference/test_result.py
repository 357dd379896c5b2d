"""What a posterior carries, its file, and its form for ArviZ."""

import json
import sys
import types

import arviz_stats
import numpy as np
import xarray as xr

from helpers.contour_posteriors import posterior
from helpers.refusals import refused
from tactile_bayes import SamplerSettings, read_result, to_arviz, write_result
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.ensembles import sample
from tactile_bayes.inference.result import posterior_draws, provenance, sample_stats

SETTINGS = SamplerSettings(ensembles=2, walkers=4, block_steps=8, max_steps=8)


def test_sample_stats_and_provenance_are_those_of_the_draws():
    start = np.random.default_rng(1).normal(size=(2, 4, 1))
    some = sample(lambda x: -0.5 * x[:, 0] ** 2, start, names=["x"], seed=1, settings=SETTINGS)
    group = sample_stats(some)
    np.testing.assert_array_equal(group.lp.values, some.log_probability)
    np.testing.assert_array_equal(group.r_hat.sel(parameter="x"), some.r_hat[0])
    assert group.attrs["steps_run"] == 8
    attrs = provenance(
        some, seed=np.random.SeedSequence(7, spawn_key=(1,)), settings=SETTINGS, data_sha256="ab", more=2
    )
    assert attrs["seed"] == "7, spawn key (1,)"
    assert json.loads(attrs["settings"])["walkers"] == 4
    assert attrs["converged"] == 0
    assert attrs["message"] == some.message
    assert (attrs["data_sha256"], attrs["more"]) == ("ab", 2)


def test_a_file_holds_the_whole_result(tmp_path):
    result = posterior()
    write_result(result, tmp_path / "posterior.nc")
    again = read_result(tmp_path / "posterior.nc")
    xr.testing.assert_identical(again, result)
    assert again.attrs == result.attrs
    assert [path.name for path in tmp_path.iterdir()] == ["posterior.nc"]


def test_what_is_no_result_is_refused(tmp_path):
    with refused(InferenceError, tmp_path / "none.nc"):
        read_result(tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("no NetCDF")
    with refused(InferenceError, "text.nc", "NetCDF"):
        read_result(tmp_path / "text.nc")
    other = xr.DataTree.from_dict({"prior": xr.Dataset({"a": 1.0})})
    other.to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with refused(InferenceError, "'posterior'", "prior"):
        read_result(tmp_path / "other.nc")


def test_draws_of_a_tree_and_of_a_dataset():
    dataset = posterior()["posterior"].to_dataset()
    xr.testing.assert_identical(posterior_draws(posterior()), dataset)
    assert posterior_draws(dataset) is dataset
    with refused(InferenceError, "'posterior'"):
        posterior_draws(xr.DataTree())


def test_arviz_from_one_on_takes_a_tree(monkeypatch):
    """It answers for the names of former versions, by warnings or in vain: none is to be asked for."""

    def refuse(name):
        raise AssertionError(f"{name} is of a former version")

    arviz = types.ModuleType("arviz")
    arviz.__version__, arviz.__getattr__ = "1.3.0", refuse
    monkeypatch.setitem(sys.modules, "arviz", arviz)
    handed = to_arviz(posterior())
    assert isinstance(handed, xr.DataTree)
    assert set(handed.children) == set(posterior().children)
    assert handed.attrs == posterior().attrs


def test_what_arviz_is_made_of_from_one_on_reads_the_file(tmp_path):
    """Its summary has our means, and its effective sample sizes are those that we stopped by."""
    write_result(posterior(), tmp_path / "posterior.nc")
    with xr.open_datatree(tmp_path / "posterior.nc", engine="h5netcdf") as tree:
        summary = arviz_stats.summary(tree, round_to="none")
    draws, stats = (posterior()[group].to_dataset() for group in ("posterior", "sample_stats"))
    names = list(draws.data_vars)
    assert list(summary.index) == names
    means = [float(draws[name].mean()) for name in names]
    np.testing.assert_allclose(summary["mean"].astype(float), means, rtol=1e-6)
    np.testing.assert_allclose(summary["ess_bulk"].astype(float), stats.ess_bulk.sel(parameter=names), rtol=0.01)

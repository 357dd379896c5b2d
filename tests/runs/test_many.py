"""Many records of one rig: a folder of a run for each, and one table of all."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.refusals import refused
from helpers.report_pages import FEW, analysed_quickly, coarse_record, undrawn
from tactile_bayes.errors import ParameterError
from tactile_bayes.record.netcdf import read_netcdf
from tactile_bayes.runs import many

STATED = tb.Rig(unknown="nothing")
OPTIONS = {"rng": 3, "settings": FEW, "workers": 1}


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    folder = tmp_path_factory.mktemp("records")
    record = coarse_record()
    tb.write_record(record, folder / "one.csv")
    tb.write_record(record.isel(sample=slice(1, None)), folder / "two.nc")
    (folder / "broken.csv").write_text("drive_angle,force_x\n1,2\n", encoding="utf-8")
    (folder / "notes.txt").write_text("not a record", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def made(records, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs")
    with undrawn():
        return many.infer_contours(records, STATED, out=out, **OPTIONS), out


def test_each_record_is_a_row_and_what_fails_has_its_reason(made):
    table, out = made
    assert sorted(table.record.values) == ["broken", "one", "two"]
    assert "no column" in str(table.error.sel(record="broken").values)
    assert not (out / "broken").exists()
    whole = table.sel(record=["one", "two"])
    assert not any(whole.error.values)
    assert all(whole.verdict.values)
    near = whole.sel(quantity="q")
    assert np.all((near.lower < near["median"]) & (near["median"] < near.upper))
    assert abs(near["median"] - 0.1).max() < 0.01
    assert np.isnan(table["median"].sel(record="broken")).all()
    assert str(table.unit.sel(quantity="q").values) == "m"
    head = (out / "runs.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert {"record", "verdict", "error", "seconds", "band_width", "q", "q_lower", "q_upper"} <= set(head)


def test_a_run_is_that_of_the_record_alone(made, records, tmp_path):
    _, out = made
    alone = analysed_quickly(many.read_record(records / "one.csv"), tmp_path, rig=STATED, rng=3)
    assert tb.read_result(out / "one" / "posterior.nc")["posterior"].equals(alone.posterior["posterior"])


def test_what_is_done_is_not_made_again_and_records_may_be_added(made, records, monkeypatch):
    table, out = made
    seen = []
    monkeypatch.setattr(many, "_analysed", lambda task: seen.append(task.path.name) or {"error": "x", "seconds": 0.0})
    again = many.infer_contours(records, STATED, out=out, **OPTIONS)
    assert seen == ["broken.csv"]  # what failed is tried again
    assert again["median"].sel(record="one").equals(table["median"].sel(record="one"))


@pytest.mark.parametrize(
    ("rig", "other", "said"),
    [
        (STATED, {"rng": 4}, "seed is"),
        (tb.Rig(unknown={"lever": 0.0}), {}, "rig is"),
        (STATED, {"family": "circle"}, "family is"),
        (STATED, {"probability": 0.9}, "probability is 0.95 there and 0.9 here"),
        (STATED, {"settings": replace(FEW, max_steps=FEW.max_steps + 1)}, "settings is"),
    ],
)
def test_a_run_that_was_made_otherwise_is_not_replaced(made, records, rig, other, said):
    _, out = made
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    with refused(ParameterError, str(out / "one"), said, "--out", "remove"):
        many.infer_contours(records / "one.csv", rig, out=out, **(OPTIONS | other))
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_a_later_call_adds_to_the_table_and_renames_nothing(made, records, tmp_path, monkeypatch):
    """In a copy of the runs, of a new record with the name of one of them."""
    out, later = shutil.copytree(made[1], tmp_path / "runs"), tmp_path / "later" / "one.csv"
    later.parent.mkdir()
    tb.write_record(coarse_record().isel(sample=slice(2, None)), later)
    row = {"error": "", "seconds": 1.0, "verdict": "All is well."}
    seen = []
    monkeypatch.setattr(many, "_analysed", lambda task: seen.append(task.out.name) or row)
    table = many.infer_contours(later, STATED, out=out, **OPTIONS)
    assert seen == ["later-one"]
    assert sorted(table.record.values) == ["broken", "later-one", "one", "two"]
    kept = table.sel(record=["one", "two"])
    for name in ("median", "verdict", "seconds", "band_width"):
        assert np.array_equal(kept[name].values, made[0].sel(record=["one", "two"])[name].values)
    assert read_netcdf(out / "runs.nc", xr.open_dataset, ValueError).equals(table)
    assert len((out / "runs.csv").read_text(encoding="utf-8").splitlines()) == 5
    seen.clear()
    again = many.infer_contours([records / "one.csv", later], STATED, out=out, **OPTIONS)
    assert seen == ["later-one"]  # its run has not been written
    assert sorted(again.record.values) == sorted(table.record.values)
    (out / "one" / many.ROW).unlink()  # as of a run that was made alone, which keeps its folder
    seen.clear()
    many.infer_contours(records / "one.csv", STATED, out=out, **OPTIONS)
    assert seen == [f"{records.name}-one"]


def test_folders_differ_also_where_letters_of_both_cases_are_the_same(tmp_path):
    names = many._names([tmp_path / "x" / "One.csv", tmp_path / "y" / "one.csv"], tmp_path)
    assert names == ["x-One", "y-one"]


def test_what_cannot_be_is_refused(records, tmp_path):
    one, empty, spoilt = records / "one.csv", tmp_path / "empty", tmp_path / "spoilt"
    for folder in (empty, spoilt):
        folder.mkdir()
    (spoilt / "runs.nc").write_bytes(b"no table")
    for given, out, named in (
        ([], tmp_path, []),
        (3, tmp_path, []),
        (empty, tmp_path, ["holds no record"]),
        ([one, one], tmp_path, ["one", "rename"]),
        (one, spoilt, ["runs.nc", "remove it"]),
        ([one, records / "runs.nc"], records, ["runs.nc", "would replace"]),
    ):
        with refused(ParameterError, *named):
            many.infer_contours(given, STATED, out=out, **OPTIONS)

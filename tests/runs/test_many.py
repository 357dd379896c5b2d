"""Many records of one rig: a folder of a run for each, and one table of all."""

import numpy as np
import pytest

from helpers.refusals import refused
from helpers.report_pages import FEW, coarse_record
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.result import read_result
from tactile_bayes.record import write_record
from tactile_bayes.rig import Rig
from tactile_bayes.runs import contour, many
from tactile_bayes.runs.contour import analyse

STATED = Rig(unknown="nothing")
OPTIONS = {"rng": 3, "settings": FEW, "workers": 1}


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    folder = tmp_path_factory.mktemp("records")
    record = coarse_record()
    write_record(record, folder / "one.csv")
    write_record(record.isel(sample=slice(1, None)), folder / "two.nc")
    (folder / "broken.csv").write_text("drive_angle,force_x\n1,2\n", encoding="utf-8")
    (folder / "notes.txt").write_text("not a record", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def made(records, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(contour, "_draw", lambda *_: {})
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
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(contour, "_draw", lambda *_: {})
        alone = analyse(many.read_record(records / "one.csv"), tmp_path, rig=STATED, rng=3, settings=FEW)
    assert read_result(out / "one" / "posterior.nc")["posterior"].equals(alone.posterior["posterior"])


def test_what_is_done_is_not_made_again_and_records_may_be_added(made, records, monkeypatch):
    table, out = made
    seen = []
    monkeypatch.setattr(many, "_analysed", lambda task: seen.append(task.path.name) or {"error": "x", "seconds": 0.0})
    again = many.infer_contours(records, STATED, out=out, **OPTIONS)
    assert seen == ["broken.csv"]  # what failed is tried again
    assert again["median"].sel(record="one").equals(table["median"].sel(record="one"))
    seen.clear()
    many.infer_contours(records / "one.csv", STATED, out=out, **(OPTIONS | {"rng": 4}))
    many.infer_contours(records / "one.csv", Rig(unknown={"lever": 0.0}), out=out, **OPTIONS)
    assert seen == ["one.csv", "one.csv"]


def test_names_that_are_the_same_take_those_of_their_folders(records, tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "one.csv").write_bytes((records / "one.csv").read_bytes())
    assert many._names([tmp_path / "a" / "one.csv", tmp_path / "b" / "one.csv"]) == ["a-one", "b-one"]
    with refused(ParameterError, "a-one", "rename"):
        many._names([tmp_path / "a" / "one.csv", tmp_path / "a" / "one.csv"])


def test_a_record_is_not_replaced(records):
    with refused(ParameterError, "runs.nc", "would replace"):
        many.infer_contours([records / "one.csv", records / "runs.nc"], STATED, out=records, **OPTIONS)


@pytest.mark.parametrize("given", [[], 3])
def test_no_records_are_refused(given, tmp_path):
    with pytest.raises(ParameterError):
        many.infer_contours(given, STATED, out=tmp_path, **OPTIONS)
    with refused(ParameterError, "holds no record"):
        many.infer_contours(tmp_path, STATED, out=tmp_path, **OPTIONS)

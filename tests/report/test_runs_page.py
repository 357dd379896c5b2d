"""The page of several runs, and another contour over a run."""

import re
import shutil

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.refusals import refused
from helpers.report_pages import FEW, Page, coarse_record, undrawn
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.runs import many
from tactile_bayes.uncertainty import overlay_distance, read_overlay
from tactile_bayes.uncertainty.rod_reach import reach

STATED = tb.Rig(unknown="nothing")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder of two runs and a record that failed."""
    records, out = tmp_path_factory.mktemp("records"), tmp_path_factory.mktemp("runs") / "my runs"
    tb.write_record(coarse_record(), records / "one.csv")
    tb.write_record(coarse_record().isel(sample=slice(1, None)), records / "t<wo.csv")
    (records / "broken.csv").write_text("drive_angle,force_x\n1,2\n", encoding="utf-8")
    with undrawn():
        many.infer_contours(records, STATED, out=out, rng=3, settings=FEW, workers=1)
    return out


@pytest.fixture(scope="module")
def points(tmp_path_factory):
    path = tmp_path_factory.mktemp("points") / "true.csv"
    x = np.linspace(-150, 150, 301)
    lines = [f"{a},{b}" for a, b in zip(x, 2.5e-3 * x**2 + 100.2, strict=True)]
    path.write_text("\n".join(["x [mm],y [mm]", *lines]), encoding="utf-8")
    return path


def refuse(*_):
    raise ValueError("path is on mount 'D:', start on mount 'C:'")


def page_of(path):
    return Page(path.read_text(encoding="utf-8"))


def test_runs_are_side_by_side_and_what_fails_has_its_reason(runs):
    path = tb.write_report(runs)
    assert path == runs / "report.html"
    page = page_of(path)
    assert page.open == []
    assert [heading.startswith("my runs: ") for heading in page.texts["h1"]] == [True]
    head, *rows = page.table("Estimates are medians")
    assert [row[0] for row in rows] == ["broken", "one", "t<wo"]
    assert "no column" in rows[0][1]
    assert set(rows[0][2:]) == {"–"}
    parts = dict(zip(head, rows[1], strict=True))
    assert [float(number) for number in re.findall(r"[\d.]+", parts["q [m]"])] == pytest.approx([0.1] * 3, abs=0.01)
    assert parts["family"] == "parabola"
    assert parts["rms distance [µm]"] == "–"  # from itself
    assert dict(zip(head, rows[2], strict=True))["rms distance [µm]"] != "–"
    assert {attrs["id"] for attrs in page.all("svg")} == {"runs-map", "runs-0"}
    assert [attrs["href"] for attrs in page.all("a")] == ["one", "t%3Cwo"]
    tb.write_report(runs / "one")
    assert page_of(tb.write_report(runs)).all("a")[0]["href"] == "one/report.html"
    with pytest.MonkeyPatch.context() as patch:  # between drives of Windows no way leads
        patch.setattr("os.path.relpath", refuse)
        assert page_of(tb.write_report(runs)).all("a")[0]["href"] == (runs / "one" / "report.html").resolve().as_uri()
    (runs / "one" / "report.html").unlink()


def test_the_distance_of_each_is_in_the_table(runs, points, tmp_path):
    page = page_of(tb.write_report([runs / "one", runs / "t<wo"], tmp_path / "two.html", overlay=points))
    head, *rows = page.table("Estimates are medians")
    for row in rows:
        posterior = tb.read_result(runs / row[0] / "posterior.nc")
        band = tb.contour_band(posterior, reach(posterior))
        found = overlay_distance(band, read_overlay(points, posterior))
        parts = dict(zip(head, row, strict=True))
        assert float(parts["rms distance [µm]"]) == pytest.approx(1e6 * found.rms, rel=5e-3)
        assert parts["inside the band"] == f"{100 * round(found.share_inside, 3):.6g}\u00a0%"
    assert len([attrs for attrs in page.all("path") if attrs["class"] == "overlay"]) == 2


def test_of_many_runs_each_has_a_panel(runs, tmp_path):
    for number in range(7):
        (tmp_path / f"run{number}").mkdir()
        shutil.copy(runs / "one" / "posterior.nc", tmp_path / f"run{number}")
    page = page_of(tb.write_report(tmp_path))
    assert page.texts["h3"] == [f"run{number}" for number in range(7)]
    assert len(page.all("svg")) == 8
    ids = [attrs["id"] for _, attrs in page.elements if "id" in attrs]
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize("kind", ["points", "run"])
def test_another_contour_is_drawn_over_a_run_with_its_distance(runs, points, tmp_path, kind):
    given = points if kind == "points" else runs / "t<wo"
    page = page_of(tb.write_report(runs / "one", tmp_path / "page.html", overlay=given))
    posterior = tb.read_result(runs / "one" / "posterior.nc")
    found = overlay_distance(tb.contour_band(posterior, reach(posterior)), read_overlay(given, posterior))
    (row,) = page.table("Distance of the median")[1:]
    assert row[0] == given.name
    assert float(row[1]) == pytest.approx(1e6 * found.rms, rel=5e-3)
    assert float(row[2]) == pytest.approx(1e6 * found.largest, rel=5e-3)
    classes = [attrs.get("class") for attrs in page.all("path")]
    assert classes.count("overlay") == 2
    assert classes.count("overlay-band") == (2 if kind == "run" else 0)


def test_a_unit_that_is_assumed_and_an_overlay_elsewhere_are_said(runs, tmp_path):
    path = tmp_path / "far.csv"
    path.write_text("10,3\n11,4\n", encoding="utf-8")
    text = tb.write_report(runs / "one", tmp_path / "page.html", overlay=path).read_text(encoding="utf-8")
    assert "taken as metres" in text
    assert "covers nothing" in text


def test_what_cannot_be_reported_is_refused(runs, points, tmp_path):
    one, two, page = runs / "one", runs / "t<wo", tmp_path / "p.html"
    for arguments, options, word in (
        ([[one, two]], {}, "say --out"),
        ([[]], {}, "no runs"),
        ([[one, two], page], {"compare": one}, "compare is for one run"),
        ([[one, one / ".." / "one"], page], {}, "give each once"),
        ([one, points], {"overlay": points}, "would replace"),
    ):
        with refused(ParameterError, word):
            tb.write_report(*arguments, **options)
    with refused(InferenceError, "holds no posterior.nc"):
        tb.write_report([one, tmp_path], page)

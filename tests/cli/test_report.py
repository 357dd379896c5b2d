"""The command report."""

import shlex
from functools import partial

import pytest

import tactile_bayes as tb
from helpers import commands
from helpers.report_pages import Page, analysed_quickly, coarse_record
from tactile_bayes.uncertainty import contour_band, overlay_distance, read_overlay
from tactile_bayes.uncertainty.rod_reach import reach

call = partial(commands.call, "report")
answered = partial(commands.answered, "report")
succeed = partial(commands.succeed, "report")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli") / "run"
    analysed_quickly(coarse_record(), folder, rig=tb.Rig(unknown="nothing"))
    return folder


def test_it_writes_the_page_into_the_run_or_where_it_is_told(folder, tmp_path):
    result = succeed(folder)
    path, out = folder / "report.html", tmp_path / "page.html"
    assert result.stdout.startswith(f"{path} ({path.stat().st_size / 1e3:.0f} kB): ")
    assert path.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    result = call(folder, "--out", out, "--quiet")
    assert result.stdout == f"{out}\n"
    assert out.read_bytes() == path.read_bytes()
    answer = answered(folder, "--out", out)
    assert answer == {"report": str(out), "bytes": out.stat().st_size}


@pytest.mark.usefixtures("quick")
def test_infer_states_its_file_and_its_words(as_stated, tmp_path):
    path, out = tmp_path / "my record.csv", tmp_path / "run"
    tb.write_record(coarse_record(), path)
    words = ["infer", str(path), "--rig", str(as_stated), "--out", str(out), "--quiet"]
    assert commands.call(*words).exit_code == 0
    assert call(out).exit_code == 0
    page = Page((out / "report.html").read_text(encoding="utf-8"))
    assert page.texts["code"][0] == shlex.join(["tactile-bayes", *words])
    assert [heading.endswith(" my record.csv") for heading in page.texts["h1"]] == [True]


def test_a_contour_is_laid_over_it_and_drawn_beside_the_page(folder, tmp_path):
    """The file stays as it is where the figure would replace it."""
    points = tmp_path / "drawn.csv"
    points.write_text("x,y\n" + "".join(f"{x / 10},0.5\n" for x in range(-5, 6)), encoding="utf-8")
    figure = tmp_path / "overlay.png"
    said = answered(folder, "--overlay", points, "--out", tmp_path / "page.html")["overlay"]
    assert said["figure"] == str(figure)
    posterior = tb.read_result(folder / "posterior.nc")
    band = contour_band(posterior, reach(posterior), 0.95)
    exact = overlay_distance(band, read_overlay(points, posterior))
    assert said["distances"][folder.name] == pytest.approx(exact._asdict())
    assert said["unit"] == band["x"].attrs["units"]
    lines = call(folder, "--overlay", points, "--out", tmp_path / "page.html").stdout.splitlines()
    assert lines[1].startswith(f"{folder.name} from drawn.csv: rms distance ")
    assert lines[1].endswith("inside the band")
    assert f"{1e3 * exact.largest:.3g} [mm]" in lines[1]
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert "drawn.csv" in (tmp_path / "page.html").read_text(encoding="utf-8")
    points.replace(figure)
    before = figure.read_bytes()
    assert call(folder, "--overlay", figure, "--out", tmp_path / "page.html").exit_code != 0
    assert figure.read_bytes() == before


def test_what_is_wrong_is_said_in_a_line(folder, tmp_path):
    for arguments, message in (
        ([folder, "--compare", tmp_path], f"{tmp_path} holds no comparison.nc"),
        ([folder, "--out", tmp_path / "no" / "page.html"], f"{tmp_path / 'no'}: No such file or directory"),
    ):
        commands.assert_refused(call(*arguments), message)

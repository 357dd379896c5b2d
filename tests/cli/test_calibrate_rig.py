"""The command `calibrate-rig`, and `infer --rig`, which takes its result over."""

import numpy as np
import pytest

from helpers.commands import answered, assert_refused, call, succeed
from helpers.contour_posteriors import CELL, swept
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.inference.result import read_result
from tactile_bayes.record import write_record

PIN = ("--family", "circle", "--parameter", "r=0.2", "--parameter", "q=0.5")
KNOWN = "".join(f"{name} = 0.0\n" for name in ("drive_angle_offset", "bias", "lever", "backlash", "friction"))
ONE = f'[unknown]\nrigidity_scale = "default"\n{KNOWN}'  # a rig of which the stiffness alone is unknown


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """Records of a pin from two pivots, and of a parabola, by a rod that is 4 % stiffer than stated."""
    folder = tmp_path_factory.mktemp("records")
    sources = {
        "pin": swept(Circle(r=0.2, q=0.5), step=0.05),
        "again": swept(Circle(r=0.2, q=0.5), step=0.05, bases=((0.1, 0.15),)),
        "object": swept(Parabola(0.7, 0.45), step=0.05),
    }
    for seed, (name, ideal) in enumerate(sources.items(), start=1):
        for channel in ("holding_moment", "force_x", "force_y"):
            ideal[channel] = 1.04 * ideal[channel]
        write_record(CELL.measure(ideal, rng=seed), folder / f"{name}.nc")
    (folder / "rig.toml").write_text(ONE, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def calibrated(records, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rig") / "made"
    return call("calibrate-rig", records / "pin.nc", *PIN, "--rig", records / "rig.toml", "--out", folder, "-q"), folder


def test_words_come_first_then_the_table_then_the_files(calibrated):
    result, folder = calibrated
    assert result.exit_code == 0, result.output
    words, table, files = result.stdout.split("\n\n")
    assert words.startswith("All is well")
    assert "take over rigidity_scale," in words.splitlines()[-1]
    rows = {line.split()[0]: line.split()[1:] for line in table.splitlines()}
    assert list(rows) == ["quantity", "rigidity_scale", "noise_scale"]
    estimate, low, high = map(float, rows["rigidity_scale"][:3])
    assert low < estimate < high
    assert abs(estimate - 1.04) < 1.5 * (high - low)  # six standard deviations
    assert {path.name for path in folder.iterdir()} == {"rig.toml", "rig.nc", "summary.txt", "summary.csv"}
    assert {line.split(maxsplit=1)[1] for line in files.splitlines()} == {str(path) for path in folder.iterdir()}
    assert (folder / "summary.txt").read_text(encoding="utf-8").startswith(words)


@pytest.mark.slow
def test_several_records_add_up(records, calibrated, tmp_path):
    """At once, or one after the other with --rig: the same numbers."""
    asked = ("calibrate-rig", records / "pin.nc", records / "again.nc", *PIN, "--rig", records / "rig.toml")
    said = answered(*asked, "--out", tmp_path / "both")
    succeed("calibrate-rig", asked[2], *PIN, "-q", "--rig", calibrated[1] / "rig.toml", "--out", tmp_path / "added")
    assert [word[:10] for word in said["words"][:2]] == ["Record 1: ", "Record 2: "]
    assert said["converged"]
    assert said["gauge"] == repr(Circle(r=0.2, q=0.5))
    assert said["files"]["rig"] == str(tmp_path / "both" / "rig.toml")
    both, after, first = (
        read_result(folder / "rig.nc") for folder in (tmp_path / "both", tmp_path / "added", calibrated[1])
    )
    assert both.attrs["rig_data_sha256"] == first.attrs["data_sha256"]
    np.testing.assert_array_equal(both["posterior"].rigidity_scale, after["posterior"].rigidity_scale)
    # The second record has as many sweeps as the first: the deviation falls by about the root of two.
    assert both["posterior"].rigidity_scale.std() < 0.85 * first["posterior"].rigidity_scale.std()


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_infer_takes_the_rig_over(records, calibrated, tmp_path):
    folder = calibrated[1]
    options = ("--rig", folder / "rig.toml", "--out", tmp_path, "--quiet")
    succeed("infer", records / "object.nc", *options)
    run = read_result(tmp_path / "posterior.nc")
    assert list(run["posterior"].data_vars) == ["a", "q", "x_c", "rigidity_scale", "noise_scale"]
    assert run.attrs["rig_data_sha256"] == read_result(folder / "rig.nc").attrs["data_sha256"]
    page = call("report", tmp_path)
    assert page.exit_code == 0, page.output
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "rig=tb.Rig.of(stored)" in text
    assert "prior of your own" not in text


@pytest.mark.slow
def test_a_wrong_gauge_is_the_first_thing_said(records, tmp_path):
    wrong = ("--family", "circle", "--parameter", "r=0.3", "--parameter", "q=0.5")
    result = succeed(
        "calibrate-rig", records / "pin.nc", *wrong, "--rig", records / "rig.toml", "--out", tmp_path, "-q"
    )
    first = result.stdout.splitlines()[0]
    assert [part for part in ("The gauge", "not describe", "use this rig", "size of the") if part not in first] == []


def test_the_same_record_twice_is_refused(records, calibrated, tmp_path):
    rig, out = calibrated[1] / "rig.toml", ("--out", tmp_path / "no", "--quiet")
    assert_refused(call("calibrate-rig", records / "pin.nc", *PIN, "--rig", rig, *out), "this very record")
    assert not (tmp_path / "no").exists()

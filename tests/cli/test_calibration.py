"""The commands `calibrate` and `calibrate-rig`, and `infer --rig`, which takes a calibrated rig over."""

import importlib
import json

import numpy as np
import pytest
import xarray as xr

from helpers.commands import answered, assert_files, assert_refused, call, succeed
from helpers.contour_posteriors import CELL, swept
from tactile_bayes.calibration.replicate import REPLICATES
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.errors import CalibrationError
from tactile_bayes.inference.result import read_result
from tactile_bayes.record import write_record
from tactile_bayes.rig import NOTHING

making = importlib.import_module("tactile_bayes.calibration.replicate")

QUICK = ("--drive-step", "8", "--workers", "1", "-q")

pytestmark = pytest.mark.usefixtures("coarse_pictures")


@pytest.fixture(scope="module")
def asked(as_stated):
    return ("calibrate", "--rig", as_stated, *QUICK)


@pytest.fixture(scope="module")
def done(asked, tmp_path_factory, coarse_pictures):
    """Two replicates, and what was said of them."""
    out = tmp_path_factory.mktemp("calibration") / "run"
    return out, succeed(*asked, "--out", out, "--replicates", 2)


def test_the_verdict_comes_first_then_what_holds_then_the_files(done):
    out, result = done
    lines = result.stdout.splitlines()
    assert [part for part in ("Too few", " 2 posteriors", " 20 ") if part not in lines[0]] == []
    assert lines[0] == (out / "verdict.txt").read_text(encoding="utf-8").strip()
    assert lines[2].split() == ["stated", "with", "90%", "holds", "in", "of", "replicates"]
    assert any(line.startswith("band, in the gap") for line in lines)
    assert_files(result, out, {REPLICATES.file, "calibration.nc", "verdict.txt", "ranks.png", "coverage.png"})
    with xr.open_dataset(out / "calibration.nc", engine="h5netcdf") as found:
        assert found.sizes["replicate"] == 2
        assert (found.attrs["family"], found.attrs["calibrated"]) == ("parabola", 0)


def test_the_same_command_makes_nothing_again_and_another_is_refused(asked, done):
    out, result = done
    before = (out / REPLICATES.file).read_bytes()
    assert call(*asked, "--out", out, "--replicates", 2).stdout == result.stdout
    result = call(*asked, "--out", out, "--replicates", 2, "--seed", 2)
    assert_refused(result, out, "seed is 1 there and 2 here")
    assert (out / REPLICATES.file).read_bytes() == before


def test_the_rig_of_the_truth_is_passed_on(asked, tmp_path, rig_file, monkeypatch):
    given = []

    def calibrate_into(out, **options):
        given.append(options)
        raise CalibrationError("that is enough")

    monkeypatch.setattr("tactile_bayes.runs.verdicts.calibrate_into", calibrate_into)
    truth = rig_file("[unknown]\nfriction = 0.3\nbase_2_x = 0.01\n", "truth.toml")
    assert_refused(call(*asked, "--out", tmp_path, "--truth", truth), "that is enough")
    (options,) = given
    assert options["truth"].known == {"friction": 0.3, "base_2_x": 0.01}
    assert options["rig"].entries == dict(NOTHING)
    assert options["workers"].where == 1


def fail(*arguments, **options):
    raise ZeroDivisionError("nothing left")


def test_a_replicate_again_is_the_one_of_the_run(asked, done):
    out, _ = done
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    result = succeed(*asked, "--out", out, "--replicates", 2, "--replicate", 1)
    row = json.loads((out / REPLICATES.file).read_text(encoding="utf-8"))["replicates"][1]
    lines = result.stdout.splitlines()
    assert lines[0] == f"Replicate 1 is done: {row['message']}."
    said = {line.split()[0]: line.split()[1:] for line in lines[1:] if line}
    for name, rank in row["ranks"].items():
        assert said[name][-1] == str(rank)
    numbers = {name: value for name, value in row["numbers"].items() if name != "seconds" and value is not None}
    assert {name: said[name] for name in numbers} == {name: [f"{value:.6g}"] for name, value in numbers.items()}
    told = answered(*asked, "--out", out, "--replicate", 1)
    assert (told["number"], told["lost"], told["ranks"], told["message"]) == (1, False, row["ranks"], row["message"])
    assert list(told["truth"]) == ["a", "q", "x_c", "noise_scale"]
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_a_lost_replicate_is_said_to_be(asked, tmp_path, monkeypatch):
    monkeypatch.setattr(making, "sampled", fail)
    result = succeed(*asked, "--out", tmp_path / "out", "--replicate", 3)
    lines = result.stdout.splitlines()
    assert [one for one in ("Replicate 3", "ZeroDivisionError: nothing left", "--debug") if one not in lines[0]] == []
    assert [line.split()[0] for line in lines[3:7]] == ["a", "q", "x_c", "noise_scale"]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("words", [("calibrate", "--debug"), ("--debug", "calibrate")])
def test_debug_lets_its_error_through(as_stated, tmp_path, monkeypatch, words):
    monkeypatch.setattr(making, "sampled", fail)
    options = ("--out", tmp_path, "--rig", as_stated, "--replicate", 3, *QUICK)
    result = call(*words, *options)
    assert result.exit_code == 1
    assert "Traceback (most recent call last)" in result.stderr
    assert "in make_replicate" in result.stderr
    assert result.stderr.splitlines()[-1].endswith("ZeroDivisionError: nothing left")


def test_lost_replicates_end_no_run(asked, tmp_path, monkeypatch):
    monkeypatch.setattr(making, "sampled", fail)
    result = succeed(*asked, "--out", tmp_path, "--replicates", 2)
    said = ("2 lost", "0, 1 (ZeroDivisionError)", "--replicate 0 --debug")
    assert [part for part in said if part not in result.stdout] == []
    told = answered(*asked, "--out", tmp_path, "--replicates", 2)
    assert (told["conclusion"], told["lost"], told["claims"]) == ("too few", 2, [])


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
    words, table, _ = result.stdout.split("\n\n")
    assert words.startswith("All is well")
    assert "take over rigidity_scale," in words.splitlines()[-1]
    rows = {line.split()[0]: line.split()[1:] for line in table.splitlines()}
    assert list(rows) == ["quantity", "rigidity_scale", "noise_scale"]
    estimate, low, high = map(float, rows["rigidity_scale"][:3])
    assert low < estimate < high
    assert abs(estimate - 1.04) < 1.5 * (high - low)  # six standard deviations
    assert_files(result, folder, {"rig.toml", "rig.nc", "summary.txt", "summary.csv"})
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

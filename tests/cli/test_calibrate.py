"""The command `calibrate`, as a user calls it."""

import importlib
import json

import pytest
import xarray as xr

from helpers.commands import answered, assert_refused, call, succeed
from tactile_bayes.calibration.replicate import REPLICATES
from tactile_bayes.errors import CalibrationError
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
    result = succeed(*asked, "--out", out, "--replicates", 2)
    return out, result.stdout


def test_the_verdict_comes_first_then_what_holds_then_the_files(done):
    out, said = done
    lines = said.splitlines()
    assert [part for part in ("Too few", " 2 posteriors", " 20 ") if part not in lines[0]] == []
    assert lines[0] == (out / "verdict.txt").read_text(encoding="utf-8").strip()
    assert lines[2].split() == ["stated", "with", "90%", "holds", "in", "of", "replicates"]
    assert any(line.startswith("band, in the gap") for line in lines)
    for what in ("replicates", "calibration", "verdict", "ranks", "coverage"):
        path = next(line.split()[-1] for line in lines if line.startswith(f"{what} "))
        assert path.startswith(str(out))
    names = {REPLICATES.file, "calibration.nc", "verdict.txt", "ranks.png", "coverage.png"}
    assert {path.name for path in out.iterdir()} == names
    with xr.open_dataset(out / "calibration.nc", engine="h5netcdf") as found:
        assert found.sizes["replicate"] == 2
        assert (found.attrs["family"], found.attrs["calibrated"]) == ("parabola", 0)


def test_the_same_command_makes_nothing_again_and_another_is_refused(asked, done):
    out, said = done
    before = (out / REPLICATES.file).read_bytes()
    assert call(*asked, "--out", out, "--replicates", 2).stdout == said
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

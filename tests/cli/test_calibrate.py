"""The command `calibrate`, as a user calls it."""

import importlib
import json
from functools import partial

import pytest
import xarray as xr

from helpers import commands
from tactile_bayes.calibration.replicate import REPLICATES
from tactile_bayes.errors import CalibrationError
from tactile_bayes.rig import NOTHING

making = importlib.import_module("tactile_bayes.calibration.replicate")

QUICK = ("--drive-step", "8", "--workers", "1", "-q")

pytestmark = pytest.mark.usefixtures("coarse_pictures")


@pytest.fixture(scope="module")
def call(as_stated):
    return partial(commands.call, "calibrate", "--rig", as_stated)


@pytest.fixture(scope="module")
def done(call, tmp_path_factory, coarse_pictures):
    """Two replicates, and what was said of them."""
    out = tmp_path_factory.mktemp("calibration") / "run"
    result = call("--out", out, "--replicates", 2, *QUICK)
    assert result.exit_code == 0, result.output
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
    assert {path.name for path in out.iterdir()} == {
        REPLICATES.file,
        "calibration.nc",
        "verdict.txt",
        "ranks.png",
        "coverage.png",
    }
    with xr.open_dataset(out / "calibration.nc", engine="h5netcdf") as found:
        assert found.sizes["replicate"] == 2
        assert (found.attrs["family"], found.attrs["calibrated"]) == ("parabola", 0)


def test_the_same_command_makes_nothing_again(call, done):
    out, said = done
    before = (out / REPLICATES.file).read_bytes()
    again = call("--out", out, "--replicates", 2, *QUICK)
    assert again.stdout == said
    assert (out / REPLICATES.file).read_bytes() == before


def test_another_experiment_is_refused(call, done):
    out, _ = done
    result = call("--out", out, "--replicates", 2, "--seed", 2, *QUICK)
    commands.assert_refused(result, out, "seed is 1 there and 2 here")


def test_the_rig_of_the_truth_is_passed_on(call, tmp_path, rig_file, monkeypatch):
    asked = []

    def calibrate_into(out, **options):
        asked.append(options)
        raise CalibrationError("that is enough")

    monkeypatch.setattr("tactile_bayes.runs.calibration.calibrate_into", calibrate_into)
    truth = rig_file("[unknown]\nfriction = 0.3\nbase_2_x = 0.01\n", "truth.toml")
    commands.assert_refused(call("--out", tmp_path, "--truth", truth, *QUICK), "that is enough")
    (options,) = asked
    assert options["truth"].known == {"friction": 0.3, "base_2_x": 0.01}
    assert options["rig"].entries == dict(NOTHING)
    assert options["workers"].where == 1


# ---- one replicate again


def fail(*arguments, **options):
    raise ZeroDivisionError("nothing left")


def test_a_replicate_again_is_the_one_of_the_run(call, done):
    out, _ = done
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    result = call("--out", out, "--replicates", 2, "--replicate", 1, *QUICK)
    assert result.exit_code == 0, result.output
    row = json.loads((out / REPLICATES.file).read_text(encoding="utf-8"))["replicates"][1]
    lines = result.stdout.splitlines()
    assert lines[0] == f"Replicate 1 is done: {row['message']}."
    said = {line.split()[0]: line.split()[1:] for line in lines[1:] if line}
    for name, rank in row["ranks"].items():
        assert said[name][-1] == str(rank)
    numbers = {name: value for name, value in row["numbers"].items() if name != "seconds" and value is not None}
    assert {name: said[name] for name in numbers} == {name: [f"{value:.6g}"] for name, value in numbers.items()}
    told = json.loads(call("--out", out, "--replicate", 1, "--json", *QUICK).stdout)
    assert (told["number"], told["lost"], told["ranks"], told["message"]) == (1, False, row["ranks"], row["message"])
    assert list(told["truth"]) == ["a", "q", "x_c", "noise_scale"]
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_a_lost_replicate_is_said_to_be(call, tmp_path, monkeypatch):
    monkeypatch.setattr(making, "sampled", fail)
    result = call("--out", tmp_path / "out", "--replicate", 3, *QUICK)
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert [one for one in ("Replicate 3", "ZeroDivisionError: nothing left", "--debug") if one not in lines[0]] == []
    assert [line.split()[0] for line in lines[3:7]] == ["a", "q", "x_c", "noise_scale"]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("words", [("calibrate", "--debug"), ("--debug", "calibrate")])
def test_debug_lets_its_error_through(as_stated, tmp_path, monkeypatch, words):
    monkeypatch.setattr(making, "sampled", fail)
    options = ("--out", tmp_path, "--rig", as_stated, "--replicate", 3, *QUICK)
    result = commands.call(*words, *options)
    assert result.exit_code == 1
    assert "Traceback (most recent call last)" in result.stderr
    assert "in make_replicate" in result.stderr
    assert result.stderr.splitlines()[-1].endswith("ZeroDivisionError: nothing left")


def test_lost_replicates_end_no_run(call, tmp_path, monkeypatch):
    monkeypatch.setattr(making, "sampled", fail)
    result = call("--out", tmp_path, "--replicates", 2, *QUICK)
    assert result.exit_code == 0, result.output
    said = ("2 lost", "0, 1 (ZeroDivisionError)", "--replicate 0 --debug")
    assert [part for part in said if part not in result.stdout] == []
    told = json.loads(call("--out", tmp_path, "--replicates", 2, "--json", *QUICK).stdout)
    assert (told["conclusion"], told["lost"], told["claims"]) == ("too few", 2, [])

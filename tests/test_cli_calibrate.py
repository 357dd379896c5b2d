"""The command `calibrate`, as a user calls it."""

from __future__ import annotations

import importlib
import json

import pytest
import xarray as xr
from typer.testing import CliRunner

from tactile_bayes.calibration.ledger import REPLICATES
from tactile_bayes.calibration.replicate import Outcome
from tactile_bayes.cli.app import app

QUICK = ("--as-stated", "--drive-step", "8", "--workers", "1", "-q")

pytestmark = pytest.mark.usefixtures("coarse_pictures")


def call(*words):
    return CliRunner().invoke(app, ["calibrate", *map(str, words)])


@pytest.fixture(scope="module")
def done(tmp_path_factory, coarse_pictures):
    """Two replicates, and what was said of them."""
    out = tmp_path_factory.mktemp("calibration") / "run"
    result = call("--out", out, "--replicates", 2, *QUICK)
    assert result.exit_code == 0, result.output
    return out, result.stdout


def test_the_verdict_comes_first_then_what_holds_then_the_files(done):
    out, said = done
    lines = said.splitlines()
    assert lines[0].startswith("Too few replicates to judge: 2 posteriors, and 20 are the least.")
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


def test_the_file_holds_what_was_found(done):
    out, _ = done
    with xr.open_dataset(out / "calibration.nc", engine="h5netcdf") as found:
        assert found.sizes["replicate"] == 2
        assert found.attrs["family"] == "parabola"
        assert found.attrs["calibrated"] == 0


def test_the_same_command_makes_nothing_again(done):
    out, said = done
    before = (out / REPLICATES.file).read_bytes()
    again = call("--out", out, "--replicates", 2, *QUICK)
    assert again.stdout == said
    assert (out / REPLICATES.file).read_bytes() == before


def test_another_experiment_is_refused(done):
    out, _ = done
    result = call("--out", out, "--replicates", 2, "--seed", 2, *QUICK)
    assert result.exit_code == 2
    assert "holds replicates of another experiment: seed is 1 there and 2 here" in result.stderr


def test_a_world_is_told_and_kept(tmp_path, monkeypatch):
    made = []

    def replicate(task):
        made.append(task[0].world)
        return Outcome({"a": 50}, {"seconds": 0.0, "converged": 1.0, "check_passed": 1.0}, "converged")

    monkeypatch.setattr(importlib.import_module("tactile_bayes.calibration.calibrate"), "replicate", replicate)
    worlds = ("--world", "friction=0.3", "--world", "base_shift=0.01,-0.02")
    result = call("--out", tmp_path, "--replicates", 1, *worlds, *QUICK)
    assert result.exit_code == 0, result.output
    words = json.loads((tmp_path / REPLICATES.file).read_text(encoding="utf-8"))["experiment"]
    assert [(world.friction, tuple(world.base_shift)) for world in made] == [(0.3, (0.01, -0.02))]
    assert (words["world_friction"], words["world_base_shift"]) == ("0.3", "(0.01, -0.02)")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--world", "friktion=1"], "--world friktion=1: write NAME=VALUE, with one of friction, rigidity_scale"),
        (["--world", "bias=1,2"], "--world bias is '1,2': give 3 numbers with commas between them"),
        (["--base", "0"], "--base is '0': give 2 numbers with commas between them"),
        (["--force-noise", "0.1"], "--force-noise and --moment-noise go together"),
        (["--length", "0.2"], "--length and --flexural-rigidity go together"),
        (["--family", "cube"], "cube"),
        (["--scheduler", "tcp://a:1"], "--workers and --scheduler exclude each other"),
    ],
)
def test_refusals(tmp_path, options, words):
    result = call("--out", tmp_path / "out", *options, *QUICK)
    assert result.exit_code == 2
    assert words in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()

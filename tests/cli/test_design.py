"""The command design, and the figure."""

import csv
import re

import numpy as np
import pytest
import xarray as xr

from helpers.commands import answered, call, succeed
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting import design as draw

pytestmark = pytest.mark.usefixtures("coarse_pictures")

ASKED = ["design", "--base", "0,0", "--base", "0.2,0", "--drive-step", "6", "--draws", "2"]


@pytest.fixture(scope="module")
def asked(as_stated):
    return (*ASKED, "--rig", as_stated, "--workers", 1)


@pytest.fixture(scope="module")
def made(asked, tmp_path_factory, coarse_pictures):
    out = tmp_path_factory.mktemp("design")
    return succeed(*asked, "--out", out, "--quiet"), out


def test_it_says_where_and_writes_what_it_found(made):
    result, out = made
    assert result.stdout.startswith("Put the pivot at (")
    assert sorted(path.name for path in out.iterdir()) == ["candidates.csv", "design.nc", "design.png", "words.txt"]
    found = xr.load_dataset(out / "design.nc", engine="h5netcdf")
    table = np.genfromtxt(out / "candidates.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["width"], found.width.values, rtol=1e-8)
    np.testing.assert_allclose(table["base_x"], [0.0, 0.2])


def test_drives_that_carry_the_base_are_candidates(asked, tmp_path):
    poses = tmp_path / "poses.csv"
    poses.write_text("x,y,drive_angle\n0.8,0,65\n0,0.05,85\n-0.8,0,115\n")
    answer = answered(*asked, "--carry", "0.8,0,180,65,1.6", "--carry", poses, "--out", tmp_path)
    candidates = answer["candidates"]
    assert answer["words"][0].startswith("Put the pivot")
    assert [one["is_pivot"] for one in candidates] == [True, True, False, False]
    assert candidates[0]["nested_width"] is None
    assert candidates[3]["drive"] == "carried from (0.8, 0) to (-0.8, 0) at 65° to 115°"
    assert candidates[0]["samples"] > candidates[2]["samples"] > 20
    with (tmp_path / "candidates.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["drive"] for row in rows] == [one["drive"] for one in candidates]
    np.testing.assert_allclose([float(row["width"]) for row in rows], [one["width"] for one in candidates], rtol=1e-8)


@pytest.mark.parametrize(
    ("nested", "told"),
    [([], "nothing was written.*starts again"), (["--nested"], "no further candidate.*resumes")],
)
def test_an_interrupt_says_what_the_same_command_does(asked, tmp_path, monkeypatch, nested, told):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("tactile_bayes.runs.plans.design_into", interrupted)
    result = call(*asked, "--out", tmp_path, *nested)
    assert result.exit_code == 130
    assert re.fullmatch(f"tactile-bayes: interrupted, {told}\n", result.stderr)


def test_the_figure_of_something_else_is_refused():
    with refused(ParameterError, "design"):
        draw(xr.Dataset())

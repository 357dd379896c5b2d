"""The commands `sensitivity` and `design`, as a user calls them."""

import csv
import importlib
import re
from functools import partial

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers import commands
from tactile_bayes.planning.error_map import CellOutcome
from tactile_bayes.runs import plans as sensitivity_run

error_map_module = importlib.import_module("tactile_bayes.planning.error_map")

QUICK = ("--drive-step", "6", "-q")
STUDY = ("--noise-factor", "0.3", "--noise-factor", "1", "--replicates", "1", "--workers", "1")

pytestmark = pytest.mark.usefixtures("coarse_pictures")

FIGURES = {"amplification.png", "information.png", "noise_shares.png", "required_noise.png"}


call = partial(commands.call, "sensitivity")
answered = partial(commands.answered, "sensitivity")
succeed = partial(commands.succeed, "sensitivity")


@pytest.fixture(scope="module", autouse=True)
def few_samples():
    """Few samples for shares of the variance."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sensitivity_run, "sensitivity", partial(sensitivity_run.sensitivity, samples=8))
        yield


@pytest.fixture(scope="module")
def done(tmp_path_factory, coarse_pictures):
    """An analysis with a study, and what was said of it."""
    out = tmp_path_factory.mktemp("sensitivity") / "run"
    return out, succeed("--out", out, *STUDY, *QUICK)


@pytest.fixture(scope="module")
def analysed():
    return tb.sensitivity(rng=1, drive=tb.Rotation(drive_step=float(np.radians(6.0))), samples=8)


@pytest.fixture
def asked(monkeypatch, analysed):
    """What the library is asked for; it answers at once, in short, and nothing is drawn."""
    given = {}

    def answer(**options):
        given["sensitivity"] = options
        short = xr.DataTree.from_dict({n: analysed[n].to_dataset() for n in ("information", "required_noise")})
        short.attrs = analysed.attrs
        return short

    def cell(task):
        given.setdefault("cells", []).append(task)
        return CellOutcome({"constrained_rms_across": 0.01}, "ok")

    monkeypatch.setattr(sensitivity_run, "sensitivity", answer)
    monkeypatch.setattr(sensitivity_run.Folder, "draw", lambda *arguments: None)
    monkeypatch.setattr(error_map_module, "error_cell", cell)
    return given


def test_words_come_first_then_bounds_then_the_files(done, analysed):
    out, result = done
    words, table, _ = result.stdout.split("\n\n")
    assert words.splitlines() == (out / "words.txt").read_text(encoding="utf-8").splitlines()
    assert words == analysed.attrs["words"]
    rows = [line.split() for line in table.splitlines()]
    assert rows[0] == ["parameter", "value", "known", "to", "±", "unit"]
    told = analysed["information"].to_dataset()
    assert [row[0] for row in rows[1:]] == list(told.parameter.values)
    for row in rows[1:]:
        of = told.sel(parameter=row[0])
        scale = np.degrees(1.0) if row[-1] == "°" else 1.0
        assert row[1:3] == [f"{scale * float(of.value):.3g}", f"{scale * float(of.bound_with_priors):.3g}"]
    assert rows[1 + list(told.parameter.values).index("drive_angle_offset")][-1] == "°"
    names = {"sensitivity.nc", "words.txt", "cells.json", "study.nc", "study.png"} | FIGURES
    commands.assert_files(result, out, names)


def test_files_hold_what_was_found(done, analysed):
    out, _ = done
    with xr.open_datatree(out / "sensitivity.nc", engine="h5netcdf") as kept:
        assert kept.attrs["words"] == analysed.attrs["words"]
        for name, group in analysed.children.items():
            xr.testing.assert_allclose(kept[name].to_dataset(), group.to_dataset())
    with xr.open_dataset(out / "study" / "study.nc", engine="h5netcdf") as study:
        assert dict(study.sizes) == {"contour": 1, "distance": 1, "noise_factor": 2, "reconstruction": 2}
        assert np.isfinite(study.rms_across.values).all()
        assert study.attrs["replicates"] == 1


def test_json_has_the_words_and_the_numbers(asked, analysed, tmp_path):
    answer = answered("--out", tmp_path, *STUDY)
    assert answer["words"] == analysed.attrs["words"].splitlines()
    told = analysed["information"].to_dataset()
    assert answer["parameters"]["a"] == {
        "value": 0.5,
        "bound": float(told.bound.sel(parameter="a")),
        "bound_with_priors": float(told.bound_with_priors.sel(parameter="a")),
        "unit": "1",
    }
    assert answer["band"] == {"touched": float(told.touched_width), "gap": float(told.gap_width), "probability": 0.95}
    needed = analysed["required_noise"].to_dataset()
    assert [row["force_noise"] for row in answer["required_noise"]] == list(needed.force_noise.values)
    assert answer["files"]["words"] == str(tmp_path / "words.txt")
    assert [cell["noise_factor"] for cell in answer["study"]] == [0.3, 1.0]
    assert {cell["rms_across"] for cell in answer["study"]} == {0.01}
    assert {cell["expected_gap_width"] for cell in answer["study"]} == {None}


def test_rig_and_options_arrive(asked, tmp_path, rig_file):
    rig = rig_file(
        '[load_cell]\nforce_noise = 0.1\nmoment_noise = 0.03\ndrive_angle_noise = "0.5 deg"\n'
        '[unknown]\nfriction = 0.2\ndiscrepancy = "default"\n'
    )
    options = ("--rig", rig, "--base", "0.1,0", "--base", "0.2,0", "--seed", 3)
    assert call("--out", tmp_path, *options, "--band-width", 0.01, "--band-width", 0.02).exit_code == 0
    options = asked["sensitivity"]
    cell = tb.LoadCell(force_noise=0.1, moment_noise=0.03, drive_angle_noise=float(np.radians(0.5)))
    assert options["rig"].load_cell == cell
    assert options["rig"].entries == {"friction": 0.2, "discrepancy": "default"}
    assert [drive.base for drive in options["drive"]] == [(0.1, 0.0), (0.2, 0.0)]
    assert options["rng"] == 3
    assert options["band_widths"] == [0.01, 0.02]


def test_the_study_is_of_the_profile_or_of_those_that_are_given(asked, tmp_path):
    assert call("--out", tmp_path / "one", "--profile", "III", "--distance", 0.6, *STUDY).exit_code == 0
    (study, _), *_ = asked["cells"]
    cells = [(cell.contour, cell.distance, cell.noise_factor) for cell in study.cells]
    assert cells == [("III", 0.6, 0.3), ("III", 0.6, 1.0)]
    assert study.replicates == 1
    asked["cells"].clear()
    more = ("--profile", "I", "--profile", "II", "--distance", 0.3, "--distance", 0.5)
    assert call("--out", tmp_path / "more", *STUDY, *more).exit_code == 0
    (study, _), *_ = asked["cells"]
    assert len(study.cells) == 8


@pytest.mark.slow
def test_the_best_rod_of_a_material_is_found(tmp_path, rig_file, monkeypatch):
    monkeypatch.setattr(sensitivity_run, "_LENGTHS", np.array([1.0]))
    monkeypatch.setattr(sensitivity_run, "_DIAMETERS", np.array([0.7, 1.0, 2.0]))
    rod = "length = 0.2\nflexural_rigidity = 2.4279e-3\ndiameter = 0.7e-3\nelastic_strain = 0.01\n"
    rig = rig_file(f"[rod]\n{rod}[load_cell]\nforce_noise = 3e-3\nmoment_noise = 0.25e-3\n")
    answer = answered("--out", tmp_path, "--rig", rig, "--best-rod", *QUICK)
    assert answer["rod"]["length"] == pytest.approx(0.2)
    assert answer["rod"]["diameter"] == pytest.approx(0.7e-3, rel=1e-3)  # of music wire of this stiffness
    said = ("3 rods", "(1 bent too far)", "200 mm", "0.7 mm")
    assert [part for part in said if part not in answer["words"][-1]] == []
    assert (tmp_path / "words.txt").read_text(encoding="utf-8").splitlines()[-1] == answer["words"][-1]
    assert (tmp_path / "required_rod.png").is_file()
    with xr.open_dataset(tmp_path / "rods.nc", engine="h5netcdf") as rods:
        assert rods.status.values.tolist() == [["ok", "ok", "bent too far"]]


def test_no_rod_that_serves_is_said():
    statuses = ["bent too far", "does not reach"]
    rods = xr.Dataset({"status": (("length", "diameter"), [statuses]), "best_width": ((), np.nan)})
    words = sensitivity_run.rod_message(rods)
    assert words.startswith("None of 2 rods ")
    assert words.endswith("(1 {}, 1 {}).".format(*statuses))


ASKED = ["design", "--base", "0,0", "--base", "0.2,0", "--drive-step", "6", "--draws", "2"]


@pytest.fixture(scope="module")
def drives_asked(as_stated):
    return (*ASKED, "--rig", as_stated, "--workers", 1)


@pytest.fixture(scope="module")
def made(drives_asked, tmp_path_factory, coarse_pictures):
    out = tmp_path_factory.mktemp("design")
    return commands.succeed(*drives_asked, "--out", out, "--quiet"), out


def test_it_says_where_and_writes_what_it_found(made):
    result, out = made
    assert result.stdout.startswith("Put the pivot at (")
    commands.assert_files(result, out, ["candidates.csv", "design.nc", "design.png", "words.txt"])
    found = xr.load_dataset(out / "design.nc", engine="h5netcdf")
    table = np.genfromtxt(out / "candidates.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["width"], found.width.values, rtol=1e-8)
    np.testing.assert_allclose(table["base_x"], [0.0, 0.2])


def test_drives_that_carry_the_base_are_candidates(drives_asked, tmp_path):
    poses = tmp_path / "poses.csv"
    poses.write_text("x,y,drive_angle\n0.8,0,65\n0,0.05,85\n-0.8,0,115\n")
    answer = commands.answered(*drives_asked, "--carry", "0.8,0,180,65,1.6", "--carry", poses, "--out", tmp_path)
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
def test_an_interrupt_says_what_the_same_command_does(drives_asked, tmp_path, monkeypatch, nested, told):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("tactile_bayes.runs.plans.design_into", interrupted)
    result = commands.call(*drives_asked, "--out", tmp_path, *nested)
    assert result.exit_code == 130
    assert re.fullmatch(f"tactile-bayes: interrupted, {told}\n", result.stderr)

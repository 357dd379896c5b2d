"""The commands `inspect` and `reconstruct`, and a laboratory's path from its own file to a contour."""

import math
import re
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import tactile_bayes as tb
from helpers.commands import answered, assert_files, assert_refused, call, succeed
from tactile_bayes.record import CHANNELS, write_record
from tactile_bayes.rig import Rig
from tactile_bayes.runs.demonstration import CONTOUR, LOAD_CELL, ROD
from tactile_bayes.runs.names import INSPECTION

pytestmark = pytest.mark.usefixtures("coarse_pictures")

COLUMNS = ("drive_angle=90-Winkel[deg]", "holding_moment=Mz", "force_x=-Fx[mN]", "force_y=Fy")
READING = [
    *("--length", ROD.length, "--flexural-rigidity", repr(ROD.flexural_rigidity), "--diameter", ROD.diameter),
    *(word for column in COLUMNS for word in ("--column", column)),
    "--split-sweeps",
]


def record_of_rig():
    cell = tb.LoadCell(force_noise=LOAD_CELL.force_noise, moment_noise=LOAD_CELL.moment_noise, bias=(1e-4, 4e-3, -2e-3))
    return cell.measure(tb.scan(CONTOUR, rig=Rig(rod=ROD), drive_step=math.radians(2.0)).record, rng=1)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A file as a rig writes it: names, units and signs of its own, semicolons, no sweeps, a zero that is off."""
    record = record_of_rig()
    lines = ["Winkel;Mz [mN m];Fx;Fy [mN];Temp / °C"]
    for angle, moment, x, y in zip(*(record[name].values for name in ("drive_angle", *CHANNELS)), strict=True):
        cells = (90.0 - math.degrees(angle), 1e3 * moment, -1e3 * x, 1e3 * y, 21.5)
        lines.append(";".join(f"{cell:.4f}".replace(".", ",") for cell in cells))
    path = tmp_path_factory.mktemp("rig") / "rig file.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_the_rigs_file_that_comes_with_the_package_is_like_it(rig):
    ours = Path(__file__).parents[2] / "data" / "synthetic" / "rig.csv"
    stored, made = (pd.read_csv(path, sep=";", decimal=",") for path in (ours, rig))
    assert list(stored.columns) == ["Angle", *made.columns[1:]]
    np.testing.assert_allclose(stored, made, rtol=0.0, atol=1.5e-4)


@pytest.fixture(scope="module")
def inspected(rig, tmp_path_factory, coarse_pictures):
    folder = tmp_path_factory.mktemp("inspected") / "inspection"
    return call("inspect", rig, *READING, "--out", folder), folder


def test_what_looks_wrong_comes_first_then_what_is_in_the_file(inspected, rig):
    result, folder = inspected
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    lines = result.stdout.splitlines()
    assert lines[:2] == ["Nothing looks wrong.", ""]
    told = {line[:12].strip(): line[12:] for line in lines[2:8]}
    assert told["samples"] == "198 in 2 sweeps"
    assert ", ".join(COLUMNS).replace("=", " = ") in told["columns"]
    assert told["others"] == "Temp [°C]"
    rod = ("L = 200 mm", "EI = 0.002428 N m²", "700 µm", "EI/L = 12.1 mN m")
    assert [part for part in ("SI", *rod) if part not in told["units"]] == []
    assert re.match("fixed, .*not stated, .*unloaded samples", told["load cell"])
    assert max(len(line) for block in result.stdout.split("\n\n")[2:4] for line in block.splitlines()) <= 80
    assert "\nRaw Step 2: " in result.stdout
    assert lines[-1].startswith("Next: tactile-bayes infer ")
    words = shlex.split(lines[-1].removeprefix("Next: tactile-bayes "))
    assert words == ["infer", str(rig), "--rig", str(folder / "rig.toml"), "--out", "run/"]


def test_the_folder_holds_words_tables_and_a_picture(inspected):
    result, folder = inspected
    assert (folder / "inspection.txt").read_text(encoding="utf-8").startswith("Nothing looks wrong.\n\nsamples ")
    samples = pd.read_csv(folder / "samples.csv", index_col="sample")
    assert len(samples) == 198
    assert samples[[name for name in samples if name.startswith(("outlier", "stuck", "cut_off"))]].to_numpy().sum() == 0
    assert pd.read_csv(folder / "sweeps.csv", index_col="sweep")["snap_off_before"].notna().all()
    assert pd.read_csv(folder / "channels.csv", index_col="channel").loc["force_x", "unit"] == "N"
    assert_files(result, folder, INSPECTION, block=-2)


def test_without_a_folder_the_next_command_writes_what_the_options_say(rig, record):
    last = call("inspect", rig, *READING).stdout.splitlines()[-1]
    words = shlex.split(last.removeprefix("Next: tactile-bayes "))
    assert words[:2] == ["inspect", str(rig)]
    assert words[-2:] == ["--out", "inspection/"]
    assert sorted(words[2:-2]) == sorted(str(word) for word in READING)
    noise = ("--force-noise", "0.003", "--moment-noise", "0.00025")
    said = call("inspect", record, *noise).stdout
    assert said.endswith(" ".join(("infer", str(record), *noise, "--out", "run/\n")))


def test_the_rigs_file_says_what_was_told_and_what_unloaded_samples_show(inspected, rig):
    _, folder = inspected
    found = tb.Rig.read(folder / "rig.toml")
    assert found.rod == ROD
    assert found.file.split_sweeps
    assert found.file.columns["drive_angle"] == "90-Winkel[deg]"
    assert found.load_cell.force_noise == pytest.approx(LOAD_CELL.force_noise, rel=0.2)
    assert found.load_cell.moment_noise == pytest.approx(LOAD_CELL.moment_noise, rel=0.2)
    as_measured = tb.read_record(rig, found)
    without_load = tb.inspect_record(as_measured).channels
    off = np.abs(without_load.bias / without_load.bias_uncertainty)
    np.testing.assert_array_less(off, [5.0, 0.05, 0.05])  # that of the moment was not clearly off before
    assert found.entries == {}


@pytest.mark.parametrize("option", [[], ["--frame", "turning"], ["--missing", "force_y"]])
def test_what_an_option_says_of_a_file_is_read_back_from_the_rigs_file(measured, tmp_path, option):
    names = ["force_y"] if "--missing" in option else []
    table = measured.drop_vars(names).to_dataframe()
    units = {"drive_angle": "drive_angle [rad]", "force_x": "force_x [N]", "force_y": "force_y [N]"}
    table = table.assign(Mz=table["holding_moment"] / 2).drop(columns="holding_moment").rename(columns=units)
    table.to_csv(tmp_path / "r.csv", index=False)
    rod = ("--length", ROD.length, "--flexural-rigidity", ROD.flexural_rigidity)
    column = ("--column", "holding_moment=2*Mz[N m]")
    succeed("inspect", tmp_path / "r.csv", *rod, *column, *option, "--out", tmp_path / "found")
    record = tb.read_record(tmp_path / "r.csv", tb.Rig.read(tmp_path / "found" / "rig.toml"))
    assert record.attrs.get("load_cell_frame", "fixed") == (option[1] if "--frame" in option else "fixed")
    zero = 2 * np.abs(tb.inspect_record(measured).channels.bias[0])
    np.testing.assert_allclose(record.holding_moment, measured.holding_moment, atol=float(zero) + 1e-12)


def test_a_rigs_file_that_was_edited_is_not_replaced(rig, tmp_path):
    path = tmp_path / "rig.toml"
    call("inspect", rig, *READING, "--out", tmp_path)
    first = path.read_text(encoding="utf-8")
    louder = ("--force-noise", 1, "--moment-noise", 1)
    assert call("inspect", rig, *READING, *louder, "--out", tmp_path).exit_code == 0
    assert tb.Rig.read(path).load_cell.force_noise == 1.0
    for edited in (first.replace("0.2", "0.3"), "[rod]\n", ""):
        path.write_text(edited, encoding="utf-8")
        assert_refused(call("inspect", rig, *READING, "--out", tmp_path), path, "was edited")
        assert path.read_text(encoding="utf-8") == edited


def test_json_has_the_same_in_numbers(rig):
    answer = answered("inspect", rig, *READING)
    assert answer["words"] == ["Nothing looks wrong."]
    assert answer["is_suspect"] is False
    assert answer["channels"][1]["bias"] == pytest.approx(4e-3, abs=5 * answer["channels"][1]["bias_uncertainty"])
    assert answer["channels"][0]["stated_noise"] is None
    assert answer["sweeps"][0]["snap_off_drive_angle"] == pytest.approx(np.radians([180.0, 182.0]), abs=1e-5)
    assert answer["suspicious_samples"]["repeated"] == []
    assert sum(answer["raw_step_2"].values()) == 198
    assert answer["files"] == {}


def test_what_is_wrong_is_the_first_line_and_a_comment_in_the_rigs_file(rig, tmp_path):
    signs = [word.replace("=-Fx", "=Fx") if isinstance(word, str) else word for word in READING]
    first, *_, last = call("inspect", rig, *signs, "--out", tmp_path).stdout.splitlines()
    assert '(force_x = "-Fx[mN]" under [file]' in first
    assert f"\n# {first}\n" in (tmp_path / "rig.toml").read_text(encoding="utf-8")
    assert tb.Rig.read(tmp_path / "rig.toml").file.columns["force_x"].startswith("Fx")
    assert "corrected: tactile-bayes infer " in last


def test_a_channel_that_is_not_connected_is_left_out_as_is_said(measured, tmp_path):
    write_record(measured.assign(force_x=("sample", np.full(measured.sizes["sample"], 0.1))), tmp_path / "dead.csv")
    said = call("inspect", tmp_path / "dead.csv").stdout.splitlines()[0]
    assert 'missing = ["force_x"] under [file]' in said
    table = pd.read_csv(tmp_path / "dead.csv", comment="#")
    header = [line for line in (tmp_path / "dead.csv").read_text().splitlines() if line.startswith("#")]
    for name, kept in {"empty.csv": table.assign(force_x=""), "removed.csv": table.drop(columns="force_x")}.items():
        (tmp_path / name).write_text("\n".join([*header, kept.to_csv(index=False)]))
        options = ["--missing", "force_x"] if name == "removed.csv" else []
        result = call("inspect", tmp_path / name, *options)
        assert "not there   force_x" in result.stdout, result.output
    gone = ("sample", np.full(measured.sizes["sample"], np.nan))
    write_record(measured.assign(force_x=gone, force_y=gone), tmp_path / "moment.csv")
    result = call("inspect", tmp_path / "moment.csv")
    assert "not there   force_x, force_y" in result.stdout, result.output
    assert "No Step 2" in result.stdout


def test_pivots_have_the_unit_of_the_record(tmp_path):
    for bases, rod, head in (
        ([(0.0, 0.0), (0.02, 0.01)], ROD, "base [m]"),
        ([(0.0, 0.0), (0.1, 0.0)], None, "base  samples"),
    ):
        contour = CONTOUR if rod else tb.contours.paper_profile("II", q=0.5)
        write_record(tb.scan(contour, base=bases, rig=Rig(rod=rod), drive_step=0.1).record, tmp_path / "r.csv")
        sweeps = call("inspect", tmp_path / "r.csv").stdout.split("\n\n")[2].splitlines()
        assert head in sweeps[0]
        assert f"{bases[1][0]:g},{bases[1][1]:g}" in sweeps[-1]
        assert max(map(len, sweeps)) <= 80


def test_contact_points_of_a_rigs_file(inspected, rig, tmp_path):
    result = succeed("reconstruct", rig, "--rig", inspected[1] / "rig.toml", "--out", tmp_path)
    assert "constrained method" in result.stdout.splitlines()[0]
    assert "noise explains" in result.stdout
    assert (tmp_path / "contacts.png").read_bytes().startswith(b"\x89PNG\r\n")
    contacts = pd.read_csv(tmp_path / "contacts.csv")
    good = contacts[contacts["status"] == "ok"]
    away = (good["contact_y"] - CONTOUR.height(good["contact_x"].to_numpy())) / good["normal_sd"]
    assert len(good) > 80
    assert np.sqrt(np.mean(away**2)) < 1.5


def test_a_data_sheet_tells_whether_noise_explains_the_misfit(measured, record, tmp_path):
    answer = answered("reconstruct", record, "--out", tmp_path)
    contacts = tb.reconstruct(measured, method="constrained")
    for name in ("misfit_sum", "misfit_samples", "misfit_probability", "axial_score"):
        assert answer[name] == pytest.approx(contacts.attrs[name])
    assert answer["samples"]["ok"] == int((contacts.status == "ok").sum())
    assert answer["load_cell_source"] == "data sheet"
    raw = call("reconstruct", record, "--method", "raw", "--out", tmp_path).stdout
    found = int(np.isfinite(tb.reconstruct(measured).contact_x).sum())
    assert re.match(f"{found} contact points .*raw method", raw)


def test_friction_that_is_not_stated_comes_first(tmp_path, rig_file):
    measured = LOAD_CELL.measure(tb.scan(CONTOUR, rig=Rig(rod=ROD, unknown={"friction": 0.3})).record, rng=1)
    write_record(measured, tmp_path / "r.csv")
    lines = call("reconstruct", tmp_path / "r.csv", "--out", tmp_path).stdout.splitlines()
    assert "contradict one another" in lines[0]
    assert "friction = 0.2 under [unknown]" in lines[1]
    rubbing = rig_file("[unknown]\nfriction = 0.3\n")
    mended = call("reconstruct", tmp_path / "r.csv", "--rig", rubbing, "--out", tmp_path)
    assert "noise explains" in mended.stdout
    assert "contradict" not in mended.stdout


def test_an_ideal_record_is_taken_at_its_word(tmp_path):
    write_record(tb.scan(CONTOUR, rig=Rig(rod=ROD), drive_step=0.05).record, tmp_path / "r.csv")
    result = call("reconstruct", tmp_path / "r.csv", "--out", tmp_path / "run")
    assert "by the raw method" in result.stdout
    assert "no standard deviations" in result.stdout
    refused = call("reconstruct", tmp_path / "r.csv", "--method", "constrained", "--out", tmp_path / "no")
    assert_refused(refused, "cell has none")
    assert not (tmp_path / "no").exists()


def test_noise_that_cannot_be_known_is_not_said_to_be_none(rig, tmp_path):
    lines = rig.read_text(encoding="utf-8").splitlines()
    loaded = [line for line in lines[1:] if abs(float(line.split(";")[1].replace(",", "."))) > 1.0]
    (tmp_path / "loaded.csv").write_text("\n".join([lines[0], *loaded]) + "\n", encoding="utf-8")
    inspected = call("inspect", tmp_path / "loaded.csv", *READING, "--out", tmp_path / "found")
    assert "too few unloaded samples" in inspected.stdout
    result = succeed(
        "reconstruct", tmp_path / "loaded.csv", "--rig", tmp_path / "found" / "rig.toml", "--out", tmp_path
    )
    assert re.search("too few .*--force-noise.*--moment", result.stdout)


@pytest.mark.slow
def test_the_command_that_inspect_names_ends_at_the_truth(inspected, tmp_path):
    """At full length: each interval of 95 % holds the truth, up to half its width."""
    last = inspected[0].stdout.splitlines()[-1].removeprefix("Next: tactile-bayes ")
    answer = answered(*(str(tmp_path / "run") if word == "run/" else word for word in shlex.split(last)))
    assert answer["converged"] is True
    rows = {row["quantity"]: row for row in answer["quantities"]}
    for name, truth in {"a": 2.5, "q": 0.1, "x_c": 0.0, "friction": 0.0}.items():
        lower, upper = rows[name]["lower"], rows[name]["upper"]
        assert abs(truth - 0.5 * (lower + upper)) < upper - lower


def test_inspect_lists_what_was_assumed_and_what_has_no_meaning(rig, tmp_path):
    text = rig.read_text(encoding="utf-8").replace("Mz [mN m]", "Mz").replace("Fy [mN]", "Fy")
    path = tmp_path / "rig.csv"
    path.write_text("# see log\n# serial: 4711\n" + text.rstrip("\n"), encoding="utf-8")
    reading = [word.replace("[mN]", "") if isinstance(word, str) else word for word in READING]
    found = answered("inspect", path, *reading)
    assert found["not_used"] == ["serial", "line 1: see log"]
    end, units = found["reading"]
    assert "has no end" in end
    assert [word for word in (*CHANNELS, "N m, N and N") if word not in units] == []
    said = call("inspect", path, *reading, "-q").stdout
    assert all(line in said for line in (f"reading     {end}", f"reading     {units}", "not used    serial"))

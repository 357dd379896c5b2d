"""No command replaces a file that it reads, under whatever name, and it refuses before anything is written."""

import os
import sys
from pathlib import Path

import pytest

from helpers import commands
from helpers.refusals import refused
from tactile_bayes import datasets
from tactile_bayes.errors import ParameterError
from tactile_bayes.report import write_report
from tactile_bayes.runs.contour import analyse

TEXT = "the only copy of a day's work"

# Names in braces are inputs that the output would replace; beside by.toml they are the shape of its rod, and beside
# like.toml the rig that it names.
GAUGE = "--family circle --parameter r=0.01 --parameter q=0.05"

CALLS = [
    "inspect {samples.csv} --out .",
    "inspect record.csv --rig {rig.toml} --out .",
    "reconstruct {contacts.csv} --out .",
    "infer {contacts.csv} --out .",
    "infer {trust.nc} --out .",
    "infer {checkpoint.npz} --out run --checkpoint .",
    "compare {comparison.nc} --out .",
    "watch {band.csv} --out . --idle 0",
    "watch record.csv --rig {stream.nc} --out . --idle 0",
    "measure {record.csv} --out record.csv --force-noise 1 --moment-noise 1",
    "scan --points {points.csv} --out points.csv",
    "scan --rig by.toml --out shape.csv {shape.csv}",
    "scan --rig like.toml --out rig.csv {rig.csv}",
    "scan --carry {poses.csv} --out poses.csv",
    "scan --points {points.svg} --figure points.svg --out scan.csv",
    "calibrate --rig by.toml --out . {verdict.txt}",
    "calibrate --truth {replicates.json} --out .",
    f"calibrate-rig {{summary.csv}} {GAUGE} --out .",
    f"calibrate-rig record.csv {{rig.nc}} {GAUGE} --out .",
    f"calibrate-rig record.csv --rig {{rig.toml}} {GAUGE} --out .",
    "sensitivity --rig {study/study.nc} --replicates 1 --out .",
    "design --carry {candidates.csv} --out .",
    "design {design.nc} --out .",
    "trust run --out {posterior.nc=trust.nc}",
    "report run --out {run/posterior.nc}",
    "report run --out {run/trust.nc}",
    "report run --compare other --out {other/comparison.nc}",
    "dataset generate {README.md} --out .",
    "dataset generate {manifest.json} --out .",
    "dataset record set 0 --out {set/shard-000000.nc}",
    "dataset record {set.csv} 0 --out set.csv",
]


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("words", CALLS)
def test_an_output_that_is_an_input_is_refused(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    start, end = words.index("{"), words.index("}")
    name = words[start + 1 : end]
    if "=" in name:  # a folder with a second name of the file in another folder
        first, second = name.split("=")
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / first).write_text(TEXT)
        (tmp_path / "out").mkdir()
        os.link(tmp_path / "run" / first, tmp_path / "out" / second)
        name = "out"
    else:
        for folder in (Path(name).parent, Path("run")):
            folder.mkdir(exist_ok=True)
        Path(name).write_text(TEXT)
    is_named = "by.toml" in words or "like.toml" in words
    if is_named:
        Path("by.toml").write_text(f'[rod]\nshape = "{name}"\n')
        Path("like.toml").write_text(f'rig = "{name}"\n')
    before = contents(tmp_path)
    result = commands.call(*(words[:start] + ("" if is_named else name) + words[end + 1 :]).split())
    commands.assert_refused(result, "would replace")
    assert contents(tmp_path) == before
    assert not [path for path in tmp_path.rglob("*") if path.suffix == ".tmp"]


def test_a_record_that_is_not_there_yet_is_not_replaced_either(tmp_path):
    result = commands.call("watch", tmp_path / "contacts.csv", "--out", tmp_path, "--idle", 0)
    commands.assert_refused(result, "would replace")


def test_a_folder_beside_the_inputs_is_taken(record, tmp_path):
    path = tmp_path / "samples.csv"
    path.write_bytes(record.read_bytes())
    commands.succeed("inspect", path, "--out", tmp_path / "inspection", "--quiet")
    assert path.read_bytes() == record.read_bytes()
    assert (tmp_path / "inspection" / "samples.csv").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="links take rights there")
def test_the_same_file_under_another_name_is_refused(tmp_path):
    own = tmp_path / "samples.csv"
    own.write_text(TEXT)
    (tmp_path / "sub").mkdir()
    (tmp_path / "symbolic.csv").symlink_to(own)
    (tmp_path / "hard.csv").hardlink_to(own)
    (tmp_path / "folder").symlink_to(tmp_path)
    for name in ("sub/../samples.csv", "symbolic.csv", "hard.csv", "folder/samples.csv"):
        result = commands.call("inspect", tmp_path / name, "--out", tmp_path)
        commands.assert_refused(result, f"{own} would replace {tmp_path / name}")
    assert own.read_text() == TEXT


def test_functions_that_know_both_refuse_as_well(tmp_path, measured):
    run, spec = tmp_path / "run", tmp_path / "README.md"
    run.mkdir()
    for path in (run / "posterior.nc", run / "contacts.csv", spec):
        path.write_text(TEXT)
    before = contents(tmp_path)
    for call in (
        lambda: write_report(run, run / "posterior.nc"),
        lambda: datasets.generate(spec, tmp_path),
        lambda: analyse(measured, run, record_file=run / "contacts.csv", rng=1),
    ):
        with refused(ParameterError, "would replace"):
            call()
    assert contents(tmp_path) == before

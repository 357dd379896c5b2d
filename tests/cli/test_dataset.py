"""The commands `dataset ...`, inside this process and as a stranger would start them."""

import json
import re
import signal
import subprocess
import sys
import time
import tomllib
from functools import partial

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers import commands
from helpers.commands import assert_refused
from tactile_bayes.contours.families import FAMILIES, FLANKS
from tactile_bayes.datasets.specification import left_out
from tactile_bayes.record import LOAD_CELL_UNITS

SMALL = """
name = "small"
records = 6
shard_records = 2
seed = 1

[[contours]]
family = "parabola"
a = { uniform = [0.3, 2.0] }
q = { uniform = [0.3, 0.7] }

[scan]
samples = 20

[load_cell]
force_noise = 0.05
moment_noise = 0.02
"""


call = partial(commands.call, "dataset")
succeed = partial(commands.succeed, "dataset")


@pytest.fixture
def specification(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A data set that the command has made, and what it said."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "small.toml").write_text(SMALL, encoding="utf-8")
    result = succeed("generate", folder / "small.toml", "--out", folder / "set", "--workers", 1)
    return folder / "set", result


@pytest.fixture(scope="module")
def example():
    result = call("example")
    assert result.exit_code == 0
    return result.stdout


def options_taken(text):
    """The text, with each block of options that are commented out taken once, and the first line of the block."""
    lines = text.splitlines()
    option = [bool(re.match(r"#[\w\[]", line)) for line in lines]
    starts = [i for i, is_option in enumerate(option) if is_option]
    for first in starts:
        last = first + 1
        together = lines[first].startswith(("#[", "#from_degrees", "#ornstein"))
        while together and last < len(lines) and option[last]:
            last += 1
        if lines[first].startswith(("#to_degrees", "#ornstein_uhlenbeck_moment", "#ornstein_uhlenbeck_time")) or (
            {"#[rod]", "#[unknown]"} & {*lines[:first]}
        ):
            continue
        yield lines[first], "\n".join([*lines[:first], *(line[1:] for line in lines[first:last]), *lines[last:]])


def test_the_example_is_a_specification_with_every_law(example):
    spec = tb.datasets.read_specification(tomllib.loads(example))
    kinds = {distribution.kind for _, distribution in spec.distributions}
    assert kinds == {"constant", "uniform", "log_uniform", "normal", "log_normal", "choice", "each"}
    assert spec.units == "dimensionless"


def test_every_option_of_the_example_is_taken_and_shown_with_what_it_is_when_left_out(example):
    whole = tb.datasets.read_specification(tomllib.loads(example))
    fields = ("shard_records", "single", "each_group", "bases", "directions", "drive", "groups", "frame")
    taken = list(options_taken(example))
    assert len(taken) > 20
    for line, text in taken:
        spec = tb.datasets.read_specification(tomllib.loads(text))
        assert tomllib.loads(text) != tomllib.loads(example), line
        assert spec.units == ("SI" if line == "#[rod]" else "dimensionless")
        if re.match(r"#(shard_records|precision|each_contour|bases|directions|margin|weight|frame)\b", line):
            assert all(getattr(spec, name) == getattr(whole, name) for name in fields), line


def test_the_example_names_every_key_family_and_entry(example):
    keys = "name description records seed shard_records precision each_contour friction bases directions samples"
    keys += " from_degrees to_degrees margin frame length flexural_rigidity diameter weight x_c"
    for key in keys.split():
        assert re.search(rf"^#?{key} = ", example, flags=re.MULTILINE), key
    for family in (*FLANKS, "shape-free", "parabola/circle"):
        for name in set(FAMILIES[family].parameters) - set(left_out(FAMILIES[family])):
            block = example.split(f'family = "{family}"')[1].split("[[")[0]
            assert re.search(rf"^{name} = ", block, flags=re.MULTILINE), (family, name)
    for entry in LOAD_CELL_UNITS:  # of those that there are for several channels, one stands for all
        stem = re.sub(r"(holding_moment|force_[xy]).*", "", entry)
        is_named = re.search(rf"^#?{stem}", example, flags=re.MULTILINE)
        assert bool(is_named) != stem.startswith("lag_seconds"), entry  # records of a data set have no times


def test_the_example_is_made_and_measured(example, tmp_path):
    path = tmp_path / "set.toml"
    path.write_text(example.replace("records = 1200", "records = 24"), encoding="utf-8")
    succeed("generate", path, "--out", tmp_path / "set", "--workers", 1)
    assert np.unique(tb.datasets.open(tmp_path / "set").truth_family).size > 3


def test_what_was_made_is_said_in_three_lines_and_not_made_again(small):
    folder, result = small
    assert result.stderr == ""
    first, *rest = result.stdout.splitlines()
    assert re.fullmatch(r"6 records in 3 files, 0\.\d MB: 6 made .* \S+ s, [\d,]+ .*/s", first)
    assert rest[-1] == f"{folder / 'README.md'} describes the files"
    assert len(list(folder.glob("shard-*.nc"))) == 3
    result = call("generate", folder.parent / "small.toml", "--out", folder)
    assert result.exit_code == 0
    assert re.search(r"existed already.* dataset verify ", result.stdout.splitlines()[0])


@pytest.mark.parametrize(
    ("words", "change", "named"),
    [
        ("generate {spec} --out {new}", ("a = ", "b = "), ["no key 'contours[0].b'"]),
        ("generate {spec} --out {new} --workers 1", ("[0.3, 0.7]", "[1.3, 1.7]"), ["drawn 1000 times"]),
        ("generate {spec} --out {new}", ("[scan]", "[scan"), ["small.toml: not TOML"]),
        ("generate {spec} --out {set}", ("seed = 1", "seed = 2"), ["set", "another specification"]),
        ("generate {new}/nowhere.toml --out {new}", None, ["nowhere.toml: No such file or directory"]),
        *((f"generate {{spec}} --out {{new}} --workers {few}", None, ["workers", few]) for few in ("many", "0", "-1")),
        ("verify {folder}", None, ["holds no data set", "manifest.json"]),
        ("record {set} 6 --out {new}/record.csv", None, ["no record 6", "0 to 5"]),
        ("record {set} 0 --out {new}/record.txt", None, ["record.txt", ".csv", ".nc"]),
        ("record {folder} 0 --out {new}/record.csv", None, ["holds no data set"]),
        ("record {new}/nowhere 0 --out {new}/record.csv", None, ["nowhere: No such file or directory"]),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(small, specification, tmp_path, words, change, named):
    if change is not None:
        assert change[0] in SMALL
        specification.write_text(SMALL.replace(*change), encoding="utf-8")
    places = {"spec": specification, "set": small[0], "folder": tmp_path, "new": tmp_path / "new"}
    assert_refused(call(*words.format(**places).split()), *named)


SLOW = """
import contextlib, time
from pathlib import Path
from tactile_bayes.cli import main
from tactile_bayes.datasets import production

made = production.write_shard
def write(task):
    if task[1] == {shard}:
        Path("begun").touch()
        with contextlib.suppress({suppressed}):
            time.sleep(60.0)
    return made(task)

production.write_shard = write
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals are others there")
@pytest.mark.usefixtures("specification")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("shard", "suppressed", "sent", "code", "word"),
    [(2, "ValueError", signal.SIGINT, 130, "interrupted"), (1, "KeyboardInterrupt", signal.SIGTERM, 143, "terminated")],
)
def test_control_c_says_how_to_go_on_and_the_same_command_does(
    tmp_path, monkeypatch, shard, suppressed, sent, code, word
):
    """At once, or after the shard if the interrupt was lost; so does a batch system's SIGTERM."""
    slow = SLOW.format(shard=shard, suppressed=suppressed)
    arguments = ["dataset", "generate", "small.toml", "--out", "set", "--workers", "1"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": tmp_path}
    with subprocess.Popen([sys.executable, "-c", slow, *arguments], **pipes) as process:
        while not (tmp_path / "begun").exists() and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(sent)
        out, errors = process.communicate(timeout=60)
    assert (process.returncode, out) == (code, "")
    assert re.fullmatch(f"tactile-bayes: {word}, 4 of 6 records .*set: .*resumes\n", errors)
    monkeypatch.chdir(tmp_path)
    done = call(*arguments[1:])
    assert done.exit_code == 0, done.output
    assert re.match("6 records in 3 files, .*: 2 made ", done.stdout)
    assert tb.datasets.verify(tmp_path / "set").records == 6


def test_what_was_drawn_again_strained_or_without_contact_is_counted(specification, tmp_path):
    rod = "\n[rod]\nlength = 1.0\nflexural_rigidity = 1.0\ndiameter = 0.2\n"
    text = SMALL.replace("samples = 20", "samples = 20\nfrom_degrees = 170\nto_degrees = 175") + rod
    specification.write_text(text.replace("[0.3, 0.7]", "[0.3, 1.5]"), encoding="utf-8")
    result = succeed("generate", specification, "--out", tmp_path / "set", "--workers", 1)
    stated = json.loads((tmp_path / "set" / "manifest.json").read_text())
    again, strained, untouched = sum(stated["redrawn"].values()), stated["strained"], stated["untouched"]
    assert min(again, strained, untouched) > 0
    assert re.search(rf"\n{again} contours .*again: .*\d+ out of reach", result.stdout)
    assert re.search(rf"\n{strained} records .*strained", result.stdout)
    assert re.search(rf"\n{untouched} sweeps without .*contact\n", result.stdout)


def test_a_whole_data_set_is_verified(small):
    folder, _ = small
    result = call("verify", folder, "--regenerate", 5)
    assert (result.exit_code, result.stderr) == (0, "")
    written, again = result.stdout.splitlines()
    assert written.startswith(f"{folder}: 6 records in 3 files, ")
    assert again.startswith("3 files made again")


@pytest.mark.parametrize(("source", "suffix"), [("set", "csv"), ("small.toml", "nc")])
def test_a_record_is_written_as_infer_takes_it(small, tmp_path, source, suffix):
    folder, _ = small
    path = tmp_path / f"record.{suffix}"
    result = call("record", folder.with_name(source), 3, "--out", path)
    assert result.stdout == f"record 3 of {folder.with_name(source)}, 40 samples: {path}\n"
    xr.testing.assert_equal(tb.read_record(path), tb.datasets.record(folder, 3))
    assert call("record", folder, 0, "--out", path, "--no-truth").exit_code == 0
    xr.testing.assert_equal(tb.read_record(path), tb.datasets.record(folder, 0, truth=False))

"""What is refused by each command: a line on stderr, exit code 2, and nothing is written."""

import shutil

import pytest

import tactile_bayes as tb
from helpers.commands import assert_misused, assert_refused, call

SI = "--length 0.1 --flexural-rigidity 1e-3"
CARRY = "--carry 0.8,0,180,68.75,1.6 --family circle --parameter r=0.3 --parameter q=0.8"
PIN = "--family circle --parameter r=0.2"
ROD = "[rod]\nlength = 0.2\nflexural_rigidity = 1e-3\ndiameter = 1e-3\n"
NOT_THERE = "No such file or directory"


@pytest.fixture(scope="module")
def files(record, bare, tmp_path_factory):
    """A record, one without header, an ideal one, tables that are none, and a folder."""
    folder = tmp_path_factory.mktemp("files")
    shutil.copy(record, folder / "record.csv")
    shutil.copy(bare, folder / "bare.csv")
    tb.write_record(tb.scan(tb.contours.Parabola(0.5, 0.5), drive_step=0.1).record, folder / "ideal.csv")
    (folder / "empty.csv").write_text("\n")
    (folder / "words.csv").write_text("x,y\n0,1\n1,b\n")
    (folder / "folder").mkdir()
    return folder


def refuse(files, tmp_path, monkeypatch, words, *named):
    """Call a command beside these files, with a new folder or file for what it writes, and see it refused."""
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    command, *more = words.split()
    if "--out" not in more and command not in ("rig", "report", "trust"):
        more += ["--out", "new.csv" if command in ("scan", "measure") else "new"]
    before = sorted(tmp_path.rglob("*"))
    assert_refused(call(command, *more), *named)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.filterwarnings("ignore:.*no unit is stated")
@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("scan --profile II --family circle", "--profile with --distance, --family and --points"),
        ("scan --parameter a=1", "--parameter is for a --family"),
        ("scan --family parabola --parameter q=0.5", "--family parabola takes a, q, x_c: give --parameter a=..."),
        ("scan --family parabola --parameter r=1", "--parameter r=1: write NAME=VALUE, with one of a, q, x_c"),
        ("scan --family parabola --parameter a=1 --parameter a=1", "--parameter a= is given twice"),
        ("scan --family parabola --parameter a=x", "--parameter a is 'x'"),
        ("scan --family shape-free", "--family shape-free: a few parameters"),
        ("scan --family blob", "no family 'blob'"),
        ("scan --distance 1.5", "out of reach"),
        ("scan --points none.csv", f"none.csv: {NOT_THERE}"),
        ("scan --points empty.csv", "empty.csv: there are no points in it"),
        ("scan --points words.csv", "words.csv: '1,b' is no point"),
        ("scan --figure scan.gif", "scan.gif: a figure is a .png, .pdf or .svg file"),
        ("scan --out r.txt", "r.txt: a record is a .csv or .nc file"),
        ("scan --out words.csv/no/r.csv", "words.csv is a file"),
        ("scan --carry 0.8,0,180", "5 numbers"),
        ("scan --carry none.csv", "poses"),
        ("scan --drive-step 1e-4", "0.001 to 28 degrees"),
        (f"scan {CARRY} --base 0,0 --drive-step 0.1", "one by one"),
        ("measure ideal.csv", "cell is ideal"),
        ("measure ideal.csv --force-noise -1", "force_noise is -1.0"),
        ("rig", "file of a rig"),
        ("rig", "--parameters"),
        ("inspect record.csv --column force_x", "--column force_x: write COLUMN=NAME[UNIT]"),
        ("inspect record.csv --column force_x=a --column force_x=b", "--column force_x= is given twice"),
        ("inspect record.csv --column force=Fx", "'force' is no column of a record: did you mean 'force_"),
        ("inspect record.csv --missing force_z", "'force_z' is no channel"),
        ("inspect record.csv --split-sweeps", "column 'sweep' is there already"),
        ("infer record.csv --length 0.1", "--length and --flexural-rigidity"),
        ("infer record.csv --diameter 0.001", "--diameter needs --length and --flexural-rigidity"),
        ("infer record.csv --length -1 --flexural-rigidity 1", "length is -1.0"),
        ("infer record.csv --length 0.3 --flexural-rigidity 1", "Rod(length=0.3, flexural_rigidity=1.0, diameter=0.0)"),
        ("infer record.csv --family blob --out folder", "no family 'blob'"),
        ("infer record.csv --probability 1", "probability is 1.0"),
        (f"infer bare.csv {SI} --force-noise 0.1", "--moment-noise"),
        (f"infer bare.csv {SI} --moment-noise 0.1", "--force-noise"),
        ("infer record.csv --rig words.csv", "not TOML"),
        ("infer record.csv --rig none.toml", f"none.toml: {NOT_THERE}"),
        ("infer none.csv", f"none.csv: {NOT_THERE}"),
        ("infer folder", "holds no record"),
        ("infer record.csv --out words.csv/run", "Not a directory"),
        ("compare record.csv --family circle", "families are circle"),
        ("compare record.csv --max-seconds 0", "max_seconds is 0.0"),
        ("calibrate --truth none.toml", f"none.toml: {NOT_THERE}"),
        ("calibrate --workers few", "workers is 'few'"),
        (f"calibrate-rig record.csv {PIN}", "give --parameter q=..."),
        ("sensitivity --base 0", "--base is '0'"),
        ("sensitivity --profile V", "no profile 'V': choose 'I', 'II', 'III' or 'IV'"),
        ("sensitivity --noise-factor 1", "--noise-factor is for a study: give --replicates"),
        ("sensitivity --distance 0.4 --distance 0.5", "more than one --distance is for a study"),
        ("design folder --rig words.csv", "a run has its rig"),
        ("design none.nc --rig none.toml", "a run has its rig"),
        ("watch record.csv --until-width 0.1", "like --between"),
        ("watch record.csv --until-width -1 --between 0,1", "until_width is -1.0"),
        ("watch record.csv --between 0.1", "--between is '0.1'"),
        ("watch record.csv --between 0.1,-0.1", "smaller one first"),
        ("watch record.csv --until-probability 0.9", "until_probability is for several"),
        ("watch folder", "is a folder"),
        ("watch record.nc", "only a .csv file"),
        ("figures --force-noise 0.1", "--force-noise and --moment-noise go together"),
        ("figures --only 3 --drive-step 90", "--drive-step is 90"),
        ("report none", "no folder none"),
        ("report folder", "folder holds no posterior.nc"),
        ("trust folder", "holds no posterior.nc"),
    ],
)
def test_options_and_files(files, tmp_path, monkeypatch, words, named):
    refuse(files, tmp_path, monkeypatch, words, named)


@pytest.mark.parametrize(
    ("words", "rig", "named"),
    [
        ("rig rig.toml", "[unknown]\nlevr = 0.0\n", "did you mean 'lever'?"),
        ("rig rig.toml", "[rod]\nlength = 0.2\n", "length and flexural_rigidity"),
        ("rig rig.toml", '[load_cell]\nforce_noise = "3 mm"\n', "'3 mm'"),
        ("rig rig.toml", "[rod", "not TOML"),
        ("rig rig.toml --parameters", "", "--parameters"),
        ("measure ideal.csv", "[load_cell]\nbias = [1, 2]\n", "give a list of 3"),
        (
            "measure ideal.csv",
            "[load_cell]\nrandom_walk_force = 1\nornstein_uhlenbeck_force = 1\n",
            "random walk or an Ornstein-Uhlenbeck",
        ),
        ("measure ideal.csv", "[load_cell]\nforce_range = -1\n", "force_range is -1.0"),
        *(
            (f"{command} record.csv", f"[file]\n{entry}\n", named)
            for command in ("inspect", "reconstruct", "infer")
            for entry, named in (
                ('missing = ["force_z"]', "'force_z' is no channel"),
                ('missing = ["force_x"]', "column 'force_x' has values"),
                ('force = "Fx"', "no key 'file.force': did you mean 'force_"),
                ('force_x = "Fx[mN]"', "no column 'Fx', which is given for 'force_x' (columns: sweep, "),
                ('force_x = "force_x[mm]"', "column 'force_x' is in [N], but [mm]"),
                ("split_sweeps = true", "column 'sweep' is there already: do without split_sweeps"),
            )
        ),
        (f"calibrate-rig record.csv {PIN} --parameter q=0.5", 'unknown = "nothing"\n', "rig is unknown"),
        ("sensitivity --best-rod", "", "state length, flexural_rigidity, diameter and elastic_strain under [rod]"),
        ("sensitivity --best-rod", ROD, "elastic_strain under [rod]"),
        ("sensitivity --best-rod", f"{ROD}elastic_strain = 0.01\n", "noise under [load_cell]"),
        ("watch record.csv --out folder", '[file]\nforce_x = "Fx"\n', "Fx"),
    ],
)
def test_rigs(files, tmp_path, monkeypatch, words, rig, named):
    (tmp_path / "rig.toml").write_text(rig, encoding="utf-8")
    command = words if words.startswith("rig ") else f"{words} --rig rig.toml"
    refuse(files, tmp_path, monkeypatch, command, named)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("infer record.csv --out run --famly circle", "No such option: --famly"),
        ("infer record.csv --out run --max-seconds many", "--max-seconds"),
        ("infer record.csv --out run --seed -1", "--seed"),
        ("infer record.csv --out run --probability 2", "--probability"),
        ("infer record.csv", "Missing option '--out'"),
        ("infer --out run", "Missing argument 'record'"),
        (f"infer record.csv --out {__file__}", "is a file"),
        ("calibrate-rig record.csv --out rig", "Missing option '--family'"),
        ("sing", "No such command 'sing'"),
        ("--quiet", "No such option: --quiet"),
    ],
)
def test_a_call_that_is_none_is_refused_with_the_usage(words, message):
    assert_misused(call(*words.split()), message)

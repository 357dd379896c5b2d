"""The command line, inside this process and as a stranger would start it."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer
import xarray as xr

from helpers.commands import answered, call, succeed
from helpers.interrupts import interrupted_while_sampling
from helpers.report_pages import FEW
from tactile_bayes import __version__, read_record
from tactile_bayes.cli import app
from tactile_bayes.cli.numbers import as_typed
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour import infer_contour
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import rod_of
from tactile_bayes.rig import NOTHING, Rig
from tactile_bayes.runs import contour as contour_run

HEAVY = {"scipy", "xarray", "matplotlib", "emcee", "numpy", "arviz_stats"}
# In the order in which a record goes through them.
COMMANDS = ["scan", "measure", "rig", "inspect", "reconstruct", "infer", "compare", "calibrate", "sensitivity"]


def start(*arguments, code=0, cwd=None):
    """The command in a process of its own; what it wrote to stdout and stderr."""
    command = [str(Path(sys.executable).with_name("tactile-bayes")), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", cwd=cwd, timeout=300)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout, done.stderr


@pytest.fixture(scope="session")
def posterior(record):
    """What that record is taken for, after few steps."""
    return infer_contour(read_record(record), rig=Rig(unknown="nothing"), rng=1, settings=FEW)


@pytest.fixture
def at_once(monkeypatch, posterior, undrawn):
    """Runs without figures to which the posterior is given, and of a misfit no cause."""
    none = {name: ("cause", []) for name in ("log_evidence", "describes", "remedy", "cause")}
    monkeypatch.setattr(contour_run, "causes", lambda *_, **__: xr.Dataset(none, attrs={"described": 0}))
    monkeypatch.setattr(contour_run, "infer_contour", lambda measured, **options: posterior.copy(deep=True))


def test_help_lists_the_commands_and_states_the_exit_codes():
    result = call("--help")
    assert result.exit_code == 0
    commands = result.stdout.split("Commands:")[1].split("\n\n")[0]
    found = [line.split()[0] for line in commands.splitlines() if line.startswith("  ") and line[2] != " "]
    assert found[: len(COMMANDS)] == COMMANDS
    assert {"demo", "dataset"} <= set(found)
    words = " ".join(result.stdout.split())
    assert re.search(r" 0 .*done.* 1 .*error.* 2 .*refused.* 130 .*Ctrl-C.* 143 .*terminated", words)


def commands_of(group, prefix=""):
    """Each command with its name, those of groups in groups too."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands_of(command, f"{name} ")
        else:
            yield prefix + name, command


ALL = dict(commands_of(typer.main.get_command(app)))


@pytest.mark.parametrize("name", ALL)
def test_every_command_has_an_example_at_most_15_options_can_be_quiet_and_answers_in_json(name):
    shown = call(*name.split(), "--help").stdout
    words = (f"Example: tactile-bayes {name} ", *(() if name == "dataset example" else ("--quiet", "--json")))
    assert [each for each in words if each not in shown] == []
    options = [each for each in ALL[name].params if each.param_type_name == "option" and each.name != "help"]
    assert len(options) <= 15


def test_version():
    assert start("--version") == (f"{__version__}\n", "")


@pytest.mark.parametrize(
    "code",
    [
        "import tactile_bayes",
        *(
            f"from tactile_bayes.cli import app; app({words})"
            for words in (["--help"], ["dataset", "generate", "--help"], ["dataset", "example"])
        ),
    ],
)
def test_what_is_heavy_is_loaded_when_used(code):
    """Importing the package and asking for help are quick because of what they do not import."""
    script = f"import atexit, sys\natexit.register(lambda: print(sorted({HEAVY} & set(sys.modules))))\n{code}"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.usefixtures("quick")
def test_an_answer_in_json_is_one_object_and_says_whether_it_is_to_be_trusted(record, tmp_path):
    answer = answered("infer", record, "--out", tmp_path / "run")
    assert answer["converged"] is False
    assert answer["message"].startswith("not converged")
    assert any(sentence.startswith("NOT CONVERGED") for sentence in answer["words"])
    table = {row["quantity"]: row for row in answer["quantities"]}
    assert table["a"]["lower"] < 2.5 < table["a"]["upper"]
    assert table["gap width"]["r_hat"] is None  # of which there is none
    assert sum(answer["samples"].values()) == len((tmp_path / "run" / "contacts.csv").read_text().splitlines()) - 1
    assert Path(answer["files"]["posterior"]).stat().st_size > 0


@pytest.mark.usefixtures("at_once")
def test_a_demonstration_explains_itself_and_compares_with_the_truth(tmp_path):
    result = succeed("demo", "--out", tmp_path / "demo")
    assert "\ntactile-bayes infer RECORD --rig rig.toml --out RUN\n" in result.stdout
    assert "truth" in result.stdout
    assert f"record       {tmp_path / 'demo' / 'record.csv'}" in result.stdout
    assert Rig.read(tmp_path / "demo" / "rig.toml").entries == dict(NOTHING)
    answer = answered("demo", "--out", tmp_path / "demo")
    assert {row["quantity"]: row["truth"] for row in answer["quantities"]}["a"] == 2.5
    assert answer["files"]["record"] == str(tmp_path / "demo" / "record.csv")


@pytest.mark.usefixtures("at_once")
def test_what_is_wrong_with_the_record_is_the_first_line(posterior, record, tmp_path, monkeypatch):
    large = posterior.copy(deep=True)
    large["observed_data"]["force_x"] *= 1e3
    large["observed_data"]["force_y"] *= 1e3
    monkeypatch.setattr(contour_run, "infer_contour", lambda measured, **options: large)
    result = succeed("infer", record, "--out", tmp_path / "run", "--quiet")
    assert result.stdout.startswith("Forces reach ")
    summary = (tmp_path / "run" / "summary.txt").read_text(encoding="utf-8")
    assert result.stdout.split("\n\n")[0] == summary.split("\n\n")[0]
    for word in ("Samples:", "a", "q", "x_c", "noise_scale", "gap width"):
        assert f"\n{word} " in result.stdout


@pytest.mark.usefixtures("at_once")
def test_what_cannot_be_made_of_a_posterior_is_told_and_no_refusal(record, tmp_path, monkeypatch):
    def broken(*arguments):
        raise RuntimeError("it broke")

    monkeypatch.setattr(contour_run, "contour_band", broken)
    result = succeed("infer", record, "--out", tmp_path / "run", "--quiet")
    assert re.search("(?m)^Left out: band.*: it broke$", result.stdout.split("\n\n")[0])
    assert re.fullmatch("tactile-bayes: .*band.*--debug.*\n", result.stderr)
    assert (tmp_path / "run" / "posterior.nc").exists()
    assert not (tmp_path / "run" / "band.csv").exists()
    traced = call("--debug", "infer", record, "--out", tmp_path / "run", "--json")
    assert traced.exit_code == 0
    answer = json.loads(traced.stdout)
    assert answer["left_out"] == {"band": "it broke"}
    assert any("RuntimeError: it broke" in words for words in answer["words"])
    assert "band" not in answer["files"]
    assert traced.stderr.startswith("Traceback (most recent call last):")
    assert "in broken" in traced.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_numbers_without_units_are_taken_as_dimensionless_and_that_is_said(tmp_path):
    path = tmp_path / "plain.csv"
    rows = [f"0,forward,{0.5 + 0.05 * i},{0.1 * (3 < i < 30)},,,0,0" for i in range(40)]
    names = "sweep,direction,drive_angle,holding_moment,force_x,force_y,base_x,base_y"
    path.write_text("\n".join([names, *rows]) + "\n", encoding="utf-8")
    result = succeed("infer", path, "--out", tmp_path / "run", "-q")
    assert re.match(r".*dimensionless.*--length.*--flexural-rigidity.*\[rod\]", result.stderr)
    assert "No contact points" in result.stdout


@pytest.mark.filterwarnings("ignore:.*no unit is stated")
def test_an_option_replaces_one_number_of_the_rigs_file(bare, rig_file, tmp_path, monkeypatch):
    """The others stay as they are in the file."""
    stated = rig_file(
        "[rod]\nlength = 0.1\nflexural_rigidity = 1e-3\ntaper = 0.2\n"
        "[load_cell]\nforce_noise = 0.1\nmoment_noise = 0.2\n[unknown]\nfriction = 0.1\n"
    )
    asked = []

    def analyse(measured, out, *, rig, **options):
        asked.append((rod_of(measured), rig))
        raise InferenceError("that is enough")

    monkeypatch.setattr(contour_run, "analyse", analyse)
    call("infer", bare, "--rig", stated, "--length", 0.2, "--force-noise", 0.3, "--out", tmp_path / "run")
    ((rod, rig),) = asked
    assert rod == rig.rod == Rod(0.2, 1e-3, taper=0.2)
    assert (rig.load_cell.force_noise, rig.load_cell.moment_noise) == (0.3, 0.2)
    assert rig.known == {"friction": 0.1}


def test_a_refusal_shows_where_it_comes_from_if_asked(tmp_path):
    result = call("--debug", "infer", tmp_path / "nowhere.csv", "--out", tmp_path)
    assert result.exit_code == 2
    assert result.stderr.startswith("Traceback (most recent call last):")
    assert result.stderr.splitlines()[-1] == f"tactile-bayes: {tmp_path / 'nowhere.csv'}: No such file or directory"


@pytest.mark.parametrize("debug", [False, True])
def test_an_error_that_nobody_foresaw_is_no_traceback_unless_asked(record, tmp_path, monkeypatch, debug):
    from tactile_bayes.runs import readings as reconstruction_run

    def broken(*arguments, **options):
        raise ZeroDivisionError("float division by zero\nand more")

    monkeypatch.setattr(reconstruction_run, "known_cell", broken)
    result = call(*(["--debug"] if debug else []), "reconstruct", record, "--out", tmp_path)
    assert result.exit_code == 1
    assert result.stdout == ""
    *before, last = result.stderr.splitlines()
    first = "ZeroDivisionError: float division by zero"
    if debug:
        assert before[0] == "Traceback (most recent call last):"
        assert last.endswith(first)
    else:
        assert [line.endswith(first) for line in before] == [True]
        assert "tactile-bayes --debug" in last


@pytest.mark.filterwarnings("always::tactile_bayes.errors.StrainWarning")
def test_a_warning_is_a_line(rig_file, tmp_path):
    rod = rig_file("[rod]\nlength = 0.2\nflexural_rigidity = 1e-2\ndiameter = 0.02\n")
    result = succeed(
        "scan", "--rig", rod, "--drive-step", 10, "--direction", "forward", "--out", tmp_path / "record.csv"
    )
    (line,) = result.stderr.splitlines()
    assert re.match(r"tactile-bayes: warning: .*forward.*\(0, 0\).*strained", line)


def test_shells_can_complete_options():
    """As the script that --show-completion prints asks for it."""
    asking = {"_TACTILE_BAYES_COMPLETE": "complete_bash", "COMP_WORDS": "tactile-bayes scan --fam", "COMP_CWORD": "2"}
    command = str(Path(sys.executable).with_name("tactile-bayes"))
    done = subprocess.run([command], env={**os.environ, **asking}, capture_output=True, text=True, timeout=100)
    assert done.stdout.split() == ["--family"], done.stderr


NO_FIGURES = """
from tactile_bayes.runs import contour as run

run._draw = lambda *arguments, **options: {}
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals are others there")
def test_control_c_while_sampling_keeps_what_there_is(record, tmp_path):
    code, out, errors = interrupted_while_sampling("infer", record, tmp_path, setup=NO_FIGURES)
    assert code == 130
    answer, end = errors.split("\n", 2)[1:]
    assert answer.startswith("tactile-bayes: stopping; ")
    assert re.fullmatch("tactile-bayes: interrupted, .*--checkpoint FOLDER.*\n", end)
    assert "NOT CONVERGED, interrupted" in out.split("\n\n")[0]
    names = {"posterior.nc", "contacts.csv", "band.csv", "summary.txt", "summary.csv"}
    assert {path.name for path in (tmp_path / "run").iterdir()} == names


def test_control_c_before_there_is_a_draw_says_so(record, tmp_path, monkeypatch):
    from tactile_bayes.inference import contour

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(contour, "sample", interrupted)
    result = call("infer", record, "--out", tmp_path, "-q")
    assert result.exit_code == 130
    assert re.fullmatch("tactile-bayes: interrupted, .*incomplete\n", result.stderr)
    assert list(tmp_path.iterdir()) == []


def test_settings_of_matplotlib_in_the_folder_do_not_end_a_command(record, tmp_path):
    """Neither those that need other programs, nor lines that are none, nor an encoding that cannot be read."""
    settings = b"text.usetex: True\nno colon\nlines.linewidth: thick\n# gr\xf6\xdfe\n"
    (tmp_path / "matplotlibrc").write_bytes(settings)
    _, errors = start("inspect", record, "--out", "inspection", "--quiet", cwd=tmp_path)
    assert errors == ""
    assert (tmp_path / "inspection" / "inspection.png").exists()


def test_dashes_that_programs_for_texts_make_are_read_as_typed():
    assert call("\N{EM DASH}version").stdout == call("--version").stdout
    assert list(map(as_typed, ["\N{EN DASH}q", "\N{MINUS SIGN}0.5,2", "a\N{EN DASH}b"])) == [
        "-q",
        "-0.5,2",
        "a\N{EN DASH}b",
    ]

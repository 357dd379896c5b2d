"""The README's blocks run as they stand."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

import tactile_bayes as tb
from tactile_bayes.cli import app

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


@pytest.mark.slow
def test_the_first_python_block_runs(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict = {}
    exec(compile(blocks("python")[0], "README.md", "exec"), names)
    assert names["posterior"].attrs["converged"], names["posterior"].attrs["message"]
    assert (names["band"]["lower"] < names["band"]["upper"]).all()
    assert "converged" in capsys.readouterr().out


def test_the_data_set_is_made_and_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With fewer records, as it would take a while."""
    monkeypatch.chdir(tmp_path)
    (specification,) = blocks("toml")
    assert "records = 10000\n" in specification
    Path("set.toml").write_text(specification.replace("records = 10000\n", "records = 8\n"), encoding="utf-8")
    commands = re.findall(r"^tactile-bayes (dataset [^#\n]*)", "".join(blocks("sh")), flags=re.MULTILINE)
    assert [command.split()[1] for command in commands] == ["generate", "verify", "record"]
    for command in commands:
        result = CliRunner().invoke(app, command.split())
        assert result.exit_code == 0, result.output
    assert tb.read_record("record.csv").attrs["load_cell_force_noise"] == 0.05
    _, of_data_set = blocks("python")
    names: dict = {"tb": tb}
    exec(compile(of_data_set, "README.md", "exec"), names)
    assert names["snap_off"].shape == (8, 2)
    assert (names["contacts"].status == "ok").sum() > 100


def test_a_rigs_file_says_what_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    section = README.split("## From a rig's file to a report\n")[1].split("\n## ")[0]
    shown = [text for language, text in re.findall(r"```(\w*)\n(.*?)```", section, flags=re.DOTALL) if not language]
    assert Path("data/synthetic/rig.csv").read_text(encoding="utf-8").startswith(shown[0])
    (asked,) = re.findall(r"^tactile-bayes (inspect .*?)(?<!\\)\n", section, flags=re.DOTALL | re.MULTILINE)
    words = [word.strip() for word in shlex.split(asked.replace("\\\n", " "))]
    first, *_ = CliRunner().invoke(app, words).stdout.splitlines(keepends=True)
    assert first == shown[1]
    words = [word.replace("force_x=Fx", "force_x=-Fx") for word in words]
    inspected = CliRunner().invoke(app, words).stdout
    for part in shown[2].split("\n\n"):
        assert part in inspected
    found = CliRunner().invoke(app, ["reconstruct", *words[1:], "--out", str(tmp_path)]).stdout
    assert found.startswith(shown[3])

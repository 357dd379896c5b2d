"""The README's blocks run as they stand."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

import tactile_bayes as tb
from tactile_bayes.cli import app

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


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

"""The README's Python block runs as it stands."""

import re
from pathlib import Path

import pytest


def test_the_python_block_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    names: dict = {}
    exec(compile(block, "README.md", "exec"), names)
    assert names["posterior"].attrs["converged"], names["posterior"].attrs["message"]
    assert (names["band"]["lower"] < names["band"]["upper"]).all()
    assert "converged" in capsys.readouterr().out

"""The README's example runs as it stands."""

import pytest

from helpers.pages import ROOT, blocks


@pytest.mark.slow
def test_the_python_block_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (example,) = (block for block in blocks(text) if block.language == "python")
    names: dict = {}
    exec(compile(example.code, "README.md", "exec"), names)
    assert names["posterior"].attrs["converged"], names["posterior"].attrs["message"]
    assert (names["band"]["lower"] < names["band"]["upper"]).all()
    assert "converged" in capsys.readouterr().out

"""Notebooks as they are kept: numbered, without outputs, each cell with a name."""

import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))


def test_they_are_numbered():
    assert [int(path.name.split("_")[0]) for path in NOTEBOOKS] == list(range(1, 14))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_begins_with_its_number_and_title_and_is_kept_without_outputs(path):
    book = json.loads(path.read_text(encoding="utf-8"))
    assert book["metadata"]["kernelspec"]["name"] == "python3"
    first = book["cells"][0]
    assert first["cell_type"] == "markdown"
    assert first["source"][0].startswith(f"# {int(path.name.split('_')[0])} · ")
    for cell in book["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None
    names = [cell["id"] for cell in book["cells"]]
    assert len(set(names)) == len(names)

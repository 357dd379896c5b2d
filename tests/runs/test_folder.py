"""The folder of a run: files are written whole, and listed by what they hold."""

import pytest
import xarray as xr

from tactile_bayes.runs.folder import Folder, panels


def test_files_are_listed_in_the_order_in_which_they_are_written(tmp_path):
    folder = Folder(tmp_path / "made" / "on the way")
    data = xr.Dataset({"x": ("place", [1.0, 2.0])}, coords={"place": [0, 1]})
    folder.write_netcdf("data", "data.nc", data)
    folder.write_table("table", "table.csv", data)
    folder.write_lines("words", "words.txt", ["one", "two"])
    folder.draw("figure", "figure.png", lambda height: panels(2, 1, 2.0, height), 3.0)
    assert list(folder.files) == ["data", "table", "words", "figure"]
    assert {path.name for path in folder.path.iterdir()} == {path.name for path in folder.files.values()}
    assert folder.files["table"].read_text(encoding="utf-8") == "place,x\n0,1.0\n1,2.0\n"
    assert folder.files["words"].read_text(encoding="utf-8") == "one\ntwo\n"
    assert folder.files["figure"].read_bytes()[16:24] == (400).to_bytes(4) + (600).to_bytes(4)  # of 200 dots an inch


def test_a_file_that_fails_is_not_listed_and_leaves_the_former_one(tmp_path):
    folder = Folder(tmp_path)
    (tmp_path / "words.txt").write_text("former", encoding="utf-8")

    def lines():
        yield "one"
        raise RuntimeError("it broke")

    with pytest.raises(RuntimeError, match="it broke"):
        folder.write_lines("words", "words.txt", lines())
    assert folder.files == {}
    assert [path.name for path in tmp_path.iterdir()] == ["words.txt"]
    assert (tmp_path / "words.txt").read_text(encoding="utf-8") == "former"


def test_a_figure_of_pyplot_is_closed(tmp_path):
    from matplotlib import pyplot as plt

    before = plt.get_fignums()
    Folder(tmp_path).draw("figure", "figure.png", lambda: plt.subplots(figsize=(1.0, 1.0))[1])
    assert plt.get_fignums() == before

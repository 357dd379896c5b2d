"""The folder of a run: the files of one run replace those of the former one together."""

import matplotlib as mpl
import pytest
import xarray as xr
from matplotlib import pyplot as plt

from tactile_bayes.runs.folder import Folder, panels

NAMES = ("words.txt", "data.nc", "table.csv", "figure.png")


def contents(folder):
    return {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}


def test_files_are_listed_in_the_order_in_which_they_are_written(tmp_path):
    data = xr.Dataset({"x": ("place", [1.0, 2.0])}, coords={"place": [0, 1]})
    with Folder(tmp_path / "made" / "on the way", NAMES) as folder:
        folder.write_netcdf("data", "data.nc", data)
        folder.write_table("table", "table.csv", data)
        folder.write_lines("words", "words.txt", ["one", "two"])
        folder.draw("figure", "figure.png", lambda height: panels(2, 1, 2.0, height), 3.0)
    assert list(folder.files) == ["data", "table", "words", "figure"]
    assert {path.name for path in folder.path.iterdir()} == {path.name for path in folder.files.values()}
    assert folder.files["table"].read_text(encoding="utf-8") == "place,x\n0,1.0\n1,2.0\n"
    assert folder.files["words"].read_text(encoding="utf-8") == "one\ntwo\n"
    assert folder.files["figure"].read_bytes()[16:24] == (300).to_bytes(4) + (450).to_bytes(4)  # of 150 dots an inch


def test_a_run_that_fails_leaves_the_former_one_and_another_replaces_it_and_nothing_else(tmp_path):
    former = dict.fromkeys((*NAMES, "notes.txt", "words.txt.bak"), "former")
    for name, text in former.items():
        (tmp_path / name).write_text(text, encoding="utf-8")

    def lines():
        yield "one"
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Folder(tmp_path, NAMES) as folder:
        folder.write_lines("words", "words.txt", lines())
    assert folder.files == {}
    assert contents(tmp_path) == former
    with Folder(tmp_path, NAMES) as folder:
        folder.write_lines("words", "words.txt", ["new"])
    assert contents(tmp_path) == {"words.txt": "new\n", "notes.txt": "former", "words.txt.bak": "former"}


def test_a_folder_in_place_of_a_file_is_kept(tmp_path):
    (tmp_path / "table.csv").mkdir()
    (tmp_path / "table.csv" / "years of work").touch()
    (tmp_path / "data.nc").write_text("former", encoding="utf-8")
    with pytest.raises(IsADirectoryError) as refusal, Folder(tmp_path, NAMES) as folder:
        folder.write_lines("words", "words.txt", ["new"])
    assert refusal.value.filename == str(tmp_path / "table.csv")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["data.nc", "table.csv", "years of work"]


ODD = {
    "LaTeX": {"text.usetex": True},
    "numbers": {"axes.formatter.use_locale": True, "axes.unicode_minus": False, "axes.formatter.limits": [0, 0]},
    "letters": {"font.family": ["NoSuchFont"], "font.size": 30.0},
    "layout": {"figure.constrained_layout.use": True, "figure.dpi": 30.0, "savefig.bbox": "tight", "savefig.dpi": 20.0},
    "colours": {"axes.facecolor": "black", "text.color": "white", "savefig.transparent": True},
    "lines": {"path.sketch": (3.0, 100.0, 2.0), "lines.linewidth": 9.0},
    "format": {"savefig.format": "pdf", "timezone": "Asia/Tokyo"},
}


@pytest.mark.parametrize("odd", ODD)
def test_settings_of_the_user_do_not_change_a_figure(tmp_path, odd):
    def axes():
        ax = panels(1, 1, 2.0, 1.5)[0, 0]
        ax.plot([-1e5, 1e5], [-1.0, 1.0])
        ax.set_xlabel("$x$ − y")
        return ax

    def drawn(folder):
        with Folder(folder, NAMES) as results:
            results.draw("figure", "figure.png", axes)
        return results.files["figure"].read_bytes()

    expected = drawn(tmp_path / "usual")
    with mpl.rc_context(ODD[odd]):
        before = mpl.rcParams.copy()
        assert drawn(tmp_path / "odd") == expected
        assert mpl.rcParams == before


def test_a_figure_of_pyplot_is_closed(tmp_path):
    before = plt.get_fignums()
    with Folder(tmp_path, NAMES) as folder:
        folder.draw("figure", "figure.png", lambda: plt.subplots(figsize=(1.0, 1.0))[1])
    assert plt.get_fignums() == before

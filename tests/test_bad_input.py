"""What a stranger may get wrong, from the file or the contour to the message."""

import numpy as np
import pytest

from helpers import commands
from helpers.refusals import refused
from tactile_bayes.contours import Ellipse, Parabola
from tactile_bayes.errors import ReachError, RecordError
from tactile_bayes.record import present_channels, write_record
from tactile_bayes.rig import Rig, read_record
from tactile_bayes.sweep import scan

NAMES = ["sweep", "direction", "base_x", "base_y", "drive_angle", "holding_moment", "force_x", "force_y"]


@pytest.fixture(scope="module")
def table(measured, tmp_path_factory):
    """Header and rows of a good file, rows as lists of cells."""
    path = tmp_path_factory.mktemp("good") / "record.csv"
    write_record(measured, path)
    lines = path.read_text(encoding="utf-8").splitlines()
    header = [line for line in lines if line.startswith("#") and "column" not in line]
    return header, [line.split(",") for line in lines if not line.startswith("#")][1:]


def written(path, header, names, rows):
    path.write_text("\n".join([*header, ",".join(names), *map(",".join, rows)]) + "\n", encoding="utf-8")
    return path


def edited(rows, row, column, text):
    rows = [list(cells) for cells in rows]
    rows[row][NAMES.index(column)] = text
    return rows


def mapped(rows, column, change):
    place = NAMES.index(column)
    return [[*cells[:place], change(cells[place]), *cells[place + 1 :]] for cells in rows]


def without_last(rows):
    return [cells[:-1] for cells in rows]


FIRST_ROW = 9  # the line of the first sample: seven of header and the names come before it
MISTAKES = {
    "a missing column": (
        lambda rows: (NAMES[:-1], without_last(rows)),
        ["column 'force_y'", "Rig(file={'force_y': 'NAME[UNIT]'})", 'force_y = "NAME[UNIT]"', 'missing = ["force_y"]'],
    ),
    "a misspelt column": (
        lambda rows: ([name.replace("drive_angle", "drive_angel") for name in NAMES], rows),
        ["column 'drive_angel'", "Rig(file={'drive_angle': 'drive_angel'})", 'drive_angle = "drive_angel"'],
    ),
    "text in a row": (
        lambda rows: (NAMES, edited(rows, 3, "force_x", "overload")),
        [f"line {FIRST_ROW + 3}, column 'force_x'", "'overload'"],
    ),
    "two segments in one sweep": (
        lambda rows: (NAMES, mapped(rows, "sweep", lambda cell: "0")),
        ["sweep 0", "'direction'", f"'forward' (line {FIRST_ROW})", "'backward' (line"],
    ),
}


@pytest.mark.parametrize(("mistake", "named"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_in_a_file_is_named_with_its_place(table, tmp_path, mistake, named):
    """By the library as an error, by the command as a line on stderr and exit code 2: the same words."""
    header, rows = table
    names, rows = mistake(rows)
    path = written(tmp_path / "record.csv", header, names, rows)
    with refused(RecordError, *named) as caught:
        read_record(path)
    assert str(caught.value).startswith(f"{path}: ")
    result = commands.call("infer", path, "--out", tmp_path / "run")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr == f"tactile-bayes: {caught.value}\n"
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("way", ["an empty column", "no column"])
def test_a_channel_wholly_missing_is_allowed(table, tmp_path, way):
    header, rows = table
    if way == "no column":
        path = written(tmp_path / "record.csv", header, NAMES[:-1], without_last(rows))
        missing = ["force_y"]
    else:
        path = written(tmp_path / "record.csv", header, NAMES, mapped(rows, "force_y", lambda cell: ""))
        missing = []
    assert present_channels(read_record(path, Rig(file={"missing": missing}))) == ("holding_moment", "force_x")
    (tmp_path / "rig.toml").write_text(f'unknown = "nothing"\n[file]\nmissing = {missing}\n')
    result = commands.call("infer", path, "--out", tmp_path / "run", "-q", "--rig", tmp_path / "rig.toml")
    assert result.exit_code == 0, result.output
    assert "No contact points" in result.stdout


# --- Contours -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_a_contour_that_is_hardly_touched_is_refused(direction):
    with refused(ReachError, "rounding"):
        scan(Ellipse(0.25, 8e5, 1.0 - 2e-11), direction=direction, rig=Rig(unknown={"friction": 0.3}))


def test_a_contour_at_the_end_of_reach_but_for_rounding_is_out_of_it():
    with refused(ReachError, "out of reach"):
        scan(Parabola(2.0, np.nextafter(1.0, 0.0)))

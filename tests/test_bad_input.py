"""What a stranger may get wrong, from the file or the contour to the message."""

import math

import numpy as np
import pytest

from helpers import commands
from helpers.refusals import refused
from tactile_bayes.contours import Ellipse, Parabola
from tactile_bayes.errors import ContourError, ReachError, RecordError
from tactile_bayes.mechanics.rod import Rod
from tactile_bayes.record import present_channels, read_record, write_record
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


FIRST_ROW = 9
"""The line of the first sample: seven of header and the names come before it."""

MISTAKES = {
    "a missing column": (
        lambda rows: (NAMES[:-1], without_last(rows)),
        ["column 'force_y'", "columns={'force_y': 'NAME[UNIT]'}", "--column 'force_y=NAME[UNIT]'", "--missing force_y"],
    ),
    "a misspelt column": (
        lambda rows: ([name.replace("drive_angle", "drive_angel") for name in NAMES], rows),
        ["column 'drive_angel'", "columns={'drive_angle': 'drive_angel'}", "--column drive_angle=drive_angel"],
    ),
    "text in a row": (
        lambda rows: (NAMES, edited(rows, 3, "force_x", "overload")),
        [f"line {FIRST_ROW + 3}, column 'force_x'", "'overload'"],
    ),
    "NaN in a row": (
        lambda rows: (NAMES, edited(rows, 5, "holding_moment", "nan")),
        [f"line {FIRST_ROW + 5}, column 'holding_moment'", "nan"],
    ),
    "an empty cell": (
        lambda rows: (NAMES, edited(rows, 5, "drive_angle", "")),
        [f"line {FIRST_ROW + 5}, column 'drive_angle'", "missing"],
    ),
    "a row too short": (
        lambda rows: (NAMES, [*rows[:4], rows[4][:-1], *rows[5:]]),
        [f"line {FIRST_ROW + 4}", "7 cells", "8 columns", ", ".join(NAMES)],
    ),
    "angles in degrees": (
        lambda rows: (NAMES, mapped(rows, "drive_angle", lambda cell: f"{math.degrees(float(cell)):.4f}")),
        ["degrees", "numpy.radians", "0.017453292519943295"],
    ),
    "a decreasing sweep labelled forward": (
        lambda rows: (NAMES, mapped(rows, "direction", lambda cell: "forward")),
        ["sweep 1", "'forward'", "decreases"],
    ),
    "two segments in one sweep": (
        lambda rows: (NAMES, mapped(rows, "sweep", lambda cell: "0")),
        ["sweep 0", "'direction'", f"'forward' (line {FIRST_ROW})", "'backward' (line"],
    ),
    "no load at all": (
        lambda rows: (NAMES, [[*cells[:5], "", "", ""] for cells in rows]),
        ["holding_moment, force_x, force_y"],
    ),
    "no samples": (lambda rows: (NAMES, []), ["no samples"]),
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


def test_semicolons_and_decimal_commas_are_read_but_not_commas_for_both(table, tmp_path):
    header, rows = table
    path = tmp_path / "record.csv"
    with_commas = [";".join(cells).replace(".", ",") for cells in rows]
    path.write_text("\n".join([*header, ";".join(NAMES), *with_commas]), encoding="utf-8")
    record = read_record(path)
    path.write_text("\n".join([*header, ",".join(NAMES), *map(",".join, rows)]), encoding="utf-8")
    assert record.identical(read_record(path))
    path.write_text("\n".join([*header, ",".join(NAMES), *(",".join(cells).replace(".", ",") for cells in rows)]))
    with refused(RecordError, f"line {FIRST_ROW}", "8 columns"):
        read_record(path)


def test_si_without_a_rod_says_how_to_state_one(table, tmp_path):
    path = written(tmp_path / "record.csv", ["# units: SI"], NAMES, table[1])
    result = commands.call("infer", path, "--out", tmp_path / "run")
    assert result.exit_code == 2
    assert "the record is SI, but rod_length and rod_flexural_rigidity of its rod are not stated: give " in (
        result.stderr
    )
    assert "on the command line --length and --flexural-rigidity" in result.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("way", ["an empty column", pytest.param("no column", marks=pytest.mark.slow)])
def test_a_channel_wholly_missing_is_allowed(table, tmp_path, way):
    header, rows = table
    if way == "no column":
        path = written(tmp_path / "record.csv", header, NAMES[:-1], without_last(rows))
        options = ["--missing", "force_y"]
    else:
        path = written(tmp_path / "record.csv", header, NAMES, mapped(rows, "force_y", lambda cell: ""))
        options = []
    assert present_channels(read_record(path, missing=options[1:])) == ("holding_moment", "force_x")
    result = commands.call("infer", path, "--out", tmp_path / "run", "-q", "--as-stated", *options)
    assert result.exit_code == 0, result.output
    assert "No contact points: Step 2 needs all three load channels." in result.stdout


# --- Contours -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("contour", "base", "rod", "named"),
    [
        (Parabola(0.5, 1.25), (0.0, 0.0), None, ["1.25 from the pivot", "(0, 0)", "1 long"]),
        (Parabola(2.5, 0.5), (0.0, 0.1), Rod(0.2, 2.4e-3), ["0.4 from the pivot", "(0, 0.1)", "0.2 long"]),
    ],
)
def test_a_contour_out_of_reach_says_how_far_and_how_long(contour, base, rod, named):
    with refused(ReachError, "out of reach", *named):
        scan(contour, base=base, rod=rod)


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_a_contour_that_is_hardly_touched_is_refused(direction):
    with refused(ReachError, "rounding"):
        scan(Ellipse(0.25, 8e5, 1.0 - 2e-11), direction=direction, friction=0.3)


def test_a_contour_at_the_end_of_reach_but_for_rounding_is_out_of_it():
    with refused(ReachError, "out of reach"):
        scan(Parabola(2.0, np.nextafter(1.0, 0.0)))


@pytest.mark.parametrize(
    ("q", "base", "named"),
    [
        (-0.2, (0.0, 0.0), ["x = 0", "y = -0.2", "y = 0"]),
        (0.3, (1.0, 1.0), ["x = 1", "y = 0.8", "y = 1"]),
        (0.0, (0.0, 0.0), ["x = 0", "y = 0"]),
    ],
)
def test_a_contour_that_cuts_the_base_is_refused(q, base, named):
    with refused(ContourError, "base", *named):
        scan(Parabola(0.5, q), base=base)

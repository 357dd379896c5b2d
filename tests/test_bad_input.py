"""What a stranger may get wrong, from the file or the contour to the message."""

import numpy as np
import pytest

import tactile_bayes as tb
from helpers import commands
from helpers.refusals import refused
from tactile_bayes.contours import Ellipse, Parabola
from tactile_bayes.errors import ReachError, RecordError
from tactile_bayes.record import present_channels


@pytest.fixture(scope="module")
def good(measured, tmp_path_factory):
    """Header of a good file, and its columns by name, as lists of cells."""
    path = tmp_path_factory.mktemp("good") / "record.csv"
    tb.write_record(measured, path)
    lines = path.read_text(encoding="utf-8").splitlines()
    header = [line for line in lines if line.startswith("#") and "column" not in line]
    names, *rows = [line.split(",") for line in lines if not line.startswith("#")]
    return header, dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def written(folder, header, columns):
    path = folder / "record.csv"
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([*header, ",".join(columns), *map(",".join, rows)]) + "\n", encoding="utf-8")
    return path


def without_force_y(columns):
    return {name: cells for name, cells in columns.items() if name != "force_y"}


def with_empty_force_y(columns):
    return columns | {"force_y": [""] * len(columns["force_y"])}


FIRST_ROW = 9  # the line of the first sample: seven of header and the names come before it
MISTAKES = {
    "a missing column": (
        without_force_y,
        ["column 'force_y'", "Rig(file={'force_y': 'NAME[UNIT]'})", 'force_y = "NAME[UNIT]"', 'missing = ["force_y"]'],
    ),
    "a misspelt column": (
        lambda columns: {name.replace("drive_angle", "drive_angel"): cells for name, cells in columns.items()},
        ["column 'drive_angel'", "Rig(file={'drive_angle': 'drive_angel'})", 'drive_angle = "drive_angel"'],
    ),
    "text in a row": (
        lambda columns: columns | {"force_x": [*columns["force_x"][:3], "overload", *columns["force_x"][4:]]},
        [f"line {FIRST_ROW + 3}, column 'force_x'", "'overload'"],
    ),
    "two segments in one sweep": (
        lambda columns: columns | {"sweep": ["0"] * len(columns["sweep"])},
        ["sweep 0", "'direction'", f"'forward' (line {FIRST_ROW})", "'backward' (line"],
    ),
}


@pytest.mark.parametrize(("mistake", "named"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_in_a_file_is_named_with_its_place(good, tmp_path, mistake, named):
    """By the library as an error, by the command as a line on stderr and exit code 2: the same words."""
    header, columns = good
    path = written(tmp_path, header, mistake(columns))
    with refused(RecordError, *named) as caught:
        tb.read_record(path)
    assert str(caught.value).startswith(f"{path}: ")
    result = commands.call("infer", path, "--out", tmp_path / "run")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr == f"tactile-bayes: {caught.value}\n"
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(("change", "missing"), [(with_empty_force_y, []), (without_force_y, ["force_y"])])
def test_a_channel_wholly_missing_is_allowed(good, tmp_path, change, missing):
    header, columns = good
    path = written(tmp_path, header, change(columns))
    assert present_channels(tb.read_record(path, tb.Rig(file={"missing": missing}))) == ("holding_moment", "force_x")
    (tmp_path / "rig.toml").write_text(f'unknown = "nothing"\n[file]\nmissing = {missing}\n')
    result = commands.call("infer", path, "--out", tmp_path / "run", "-q", "--rig", tmp_path / "rig.toml")
    assert result.exit_code == 0, result.output
    assert "No contact points" in result.stdout


RUBBED = tb.Rig(unknown={"friction": 0.3})


@pytest.mark.parametrize(
    ("contour", "options", "named"),
    [
        (Ellipse(0.25, 8e5, 1.0 - 2e-11), {"direction": "forward", "rig": RUBBED}, "rounding"),
        (Ellipse(0.25, 8e5, 1.0 - 2e-11), {"direction": "backward", "rig": RUBBED}, "rounding"),
        (Parabola(2.0, np.nextafter(1.0, 0.0)), {}, "out of reach"),
    ],
)
def test_a_contour_that_is_hardly_touched_is_refused(contour, options, named):
    with refused(ReachError, named):
        tb.scan(contour, **options)

"""The end of a CSV file: a row that is cut is left out, one that is whole is kept, and either is said."""

import pytest

from helpers.refusals import refused
from tactile_bayes.errors import RecordError, RecordWarning
from tactile_bayes.rig import read_record

NAMES = "sweep,direction,drive_angle,holding_moment,force_x,force_y"
ROWS = [f"0,forward,{1 + k / 100},0.1,0.2" for k in range(14)]


def written(path, cells, last, rows=ROWS):
    lines = [NAMES, *(f"{row},{cell}" for row, cell in zip(rows, cells, strict=False)), f"0,forward,1.5,0.1,0.2,{last}"]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


EXPONENTS = [f"{3.5 + k / 10:.4f}e-04" for k in range(14)]
DECIMALS = [f"{k / 10:.4f}" for k in range(14)]
SHORTEST = ["0.5", "0.25", "1", "0.125", "1.5", "0.0625", "2", "0.5", "0.75", "1.25", "1", "0.5", "0.375", "1"]


@pytest.mark.parametrize(
    ("cells", "last", "is_cut"),
    [
        *((EXPONENTS, "3.5600", True), (EXPONENTS, "3.56e-0", True), (EXPONENTS, "9.5600e-02", False)),
        *((DECIMALS, "1.4", True), (DECIMALS, "1", True), (DECIMALS, "140.0000", False)),
        *((SHORTEST, "75.125", True), (SHORTEST, "0.625", False), (["1", "2"], "3.5", False)),
    ],
)
def test_a_row_is_left_out_if_its_last_number_is_cut_and_kept_if_files_end_so_by_habit(tmp_path, cells, last, is_cut):
    path = written(tmp_path / "record.csv", cells, last)
    match = rf"line 16, .* '{last}'.* left out" if is_cut else r"no end: (?!.*left out)"
    with pytest.warns(RecordWarning, match=match):
        record = read_record(path)
    assert record.force_y.values.tolist() == [float(cell) for cell in (cells if is_cut else [*cells, last])]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\n\n", "\n,,,,,"])
def test_a_line_with_an_end_is_as_it_is(tmp_path, end):
    path = written(tmp_path / "record.csv", EXPONENTS, "3.5600")
    path.write_text(path.read_text(encoding="utf-8") + end, encoding="utf-8", newline="")
    if end.endswith(","):
        with refused(RecordError, "line 17"):
            read_record(path)
    else:
        assert read_record(path).force_y.values[-1] == 3.56


def test_text_at_the_end_of_a_row_is_kept(tmp_path):
    path = tmp_path / "record.csv"
    rows = [f"{row},0.5,{number}" for number, row in enumerate(ROWS)]
    path.write_text("\n".join(["# column note: text [1] a note", f"{NAMES},note", *rows, f"{ROWS[-1]},0.5,9999"]))
    with pytest.warns(RecordWarning, match="has no end"):
        assert read_record(path).note.values[-1] == "9999"


def test_what_a_power_failure_leaves_is_named(tmp_path):
    path = written(tmp_path / "record.csv", EXPONENTS, "3.5600")
    path.write_bytes(path.read_bytes() + b"\0" * 500)
    with refused(RecordError, "line 16", "power failure"):
        read_record(path)

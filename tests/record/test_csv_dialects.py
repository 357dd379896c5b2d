"""CSV files as rigs write them: rows of units, Windows-1252, decimal commas below any names."""

import numpy as np
import pytest

from helpers.record_tables import WIRE
from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record import record_hash
from tactile_bayes.rig import Rig, read_record

NAMES = "Winkel;Mz;Fx;Fy"
ROWS = ("60,0;0,1;1;2", "61,0;0,25;-1,5;40")
COLUMNS = {"drive_angle": "Winkel", "holding_moment": "Mz", "force_x": "Fx", "force_y": "Fy"}
STATED = {"drive_angle": "Winkel[deg]", "holding_moment": "Mz[N mm]", "force_x": "Fx[mN]", "force_y": "Fy[mN]"}


def read(tmp_path, *lines, columns=COLUMNS, encoding="utf-8", end="\n", rod=WIRE):
    path = tmp_path / "rig.csv"
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return read_record(path, Rig(rod=rod, file={**columns, "split_sweeps": True}))


@pytest.fixture
def plain(tmp_path):
    """The record, with its units given beside it."""
    return read(tmp_path, NAMES, *ROWS, columns=STATED)


@pytest.mark.parametrize("sign", [";", "\t"])
def test_decimal_commas_need_no_known_names_to_be_told_from_separators(tmp_path, sign):
    lines = ["Zeit;Winkel_grad;Mz_mNm;Fx_mN;Fy_mN", "0,00;74,0000;0,1864;-6,4649;-1,0087"]
    (tmp_path / "rig.csv").write_text("\n".join(lines).replace(";", sign), encoding="utf-8")
    with refused(RecordError, "column 'sweep'", "(columns: Zeit, Winkel_grad, Mz_mNm, Fx_mN, Fy_mN)", 'sweep = "NAME"'):
        read_record(tmp_path / "rig.csv")


def test_commas_in_names_part_no_columns_where_semicolons_do(tmp_path, plain):
    columns = {target: f"{name}, {STATED[target].partition('[')[2][:-1]}" for target, name in COLUMNS.items()}
    given = {target: f"{columns[target]}[{STATED[target].partition('[')[2]}" for target in COLUMNS}
    assert read(tmp_path, ";".join(columns.values()), *ROWS, columns=given).equals(plain)
    with refused(RecordError, "(columns: Winkel, deg, Mz, N mm, Fx, mN, Fy, mN)"):
        read(tmp_path, ";".join(columns.values()), *ROWS, columns={})


def test_a_count_of_rows_without_a_name_is_a_column_of_its_own(tmp_path, plain):
    """As pandas writes the index of a table."""
    rows = [f"{k};{row}" for k, row in enumerate(ROWS)]
    found = read(tmp_path, f";{NAMES}", *rows, columns=STATED)
    np.testing.assert_array_equal(found["index"], [0, 1])
    assert record_hash(found.drop_vars("index")) == record_hash(plain)


@pytest.mark.parametrize("names", ["Messung 4", "Messung 1,5 mm", "Messung;4"])
def test_lines_before_the_names_are_refused_whatever_signs_are_in_them(tmp_path, names):
    with refused(RecordError, "line 1", "(Messung"):
        read(tmp_path, names, NAMES, "60;0;1;2", columns={})
    with refused(RecordError, "in line 2"):
        read(tmp_path, names, NAMES, "60;0;1;2")


@pytest.mark.parametrize("units", ["°;mN m;mN;mN", "[deg];[N mm];(mN);[ mN ]", " ° ; mN·m ; mN ; mN "])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_row_of_units_is_what_units_in_names_are(tmp_path, plain, units, end):
    assert read(tmp_path, NAMES, units, *ROWS, end=end).equals(plain)
    in_names = "Winkel [°];Mz [mN m];Fx [mN];Fy [mN]"
    assert read(tmp_path, in_names, *ROWS).equals(plain)


def test_units_and_samples_are_told_apart_whatever_is_in_them(tmp_path, plain):
    """A unit that is not known is kept of a column that is not measured; 1 is a unit too, and N may be a remark."""
    record = read(tmp_path, NAMES + ";T", "°;mN m;mN;mN;°C", *(row + ";21,5" for row in ROWS))
    assert record["T"].values.tolist() == [21.5] * len(ROWS)
    assert record["T"].attrs["units"] == "°C"
    assert record.drop_vars("T").equals(plain)
    record = read(tmp_path, NAMES + ";note", "1;1;1;1;N", "1,5;1;1;1;N", rod=None)
    assert record.sizes["sample"] == 2
    assert record["note"].values.tolist() == ["N", "N"]


def test_a_row_of_units_also_tells_those_of_names_that_a_record_has(tmp_path):
    """Tabs behind commas are blanks."""
    names = "sweep,\tdirection,\tdrive_angle,\tholding_moment,\tforce_x,\tforce_y,\ttime"
    (tmp_path / "rig.csv").write_text(f"{names}\n-,,°,mN m,mN,\tmN,s\n3,forward,\t60,0.1,1,2,0.5\n", encoding="utf-8")
    record = read_record(tmp_path / "rig.csv", Rig(rod=WIRE))
    assert record["force_y"].values.tolist() == [0.002]
    assert record["force_y"].attrs["units"] == "N"
    np.testing.assert_allclose(record["drive_angle"], np.radians(60.0), rtol=1e-15)
    assert (record["sweep"].item(), record["time"].attrs["units"]) == (3, "s")


@pytest.mark.parametrize(
    ("lines", "named"),
    [
        ([NAMES + ";T", "°;mN m;mX;mN;°C", ROWS[0] + ";20"], ["line 2", "'mX'", "'Fx'"]),
        ([NAMES, "°;mN m;s;mN", *ROWS], ["line 2, column 'force_x'", "'Fx'", "[s]", "N, kN, mN"]),
        ([NAMES, ROWS[0], "°;mN m;mN;mN"], ["line 3, column 'Winkel'", "'°'"]),
        ([NAMES, "°;mN m;mN;mN", *ROWS, "62;x;1;1"], ["line 5, column 'Mz'", "'x'"]),
        ([NAMES, "°;mN m;mN", *ROWS], ["line 2", "3 cells", "4 columns"]),
        ([NAMES, "60,0;mN;1;2", *ROWS], ["line 2, column 'Mz'", "'mN'"]),
        ([NAMES, "1;1;-;-", *ROWS], ["line 2, column 'Fx'", "'-'"]),
        ([NAMES + ";", "°;mN m;mN;mN;s", ROWS[0] + ";"], ["line 1", "column 5"]),
        (["# column Fx: number [N]", NAMES, "°;mN m;mN;mN", *ROWS], ["line 3", "'Fx'", "[mN]", "[N] in line 1"]),
        ([NAMES + ";note", *[f"{ROWS[0]};a"] * 5000, "60,0;x;1;2;größer"], ["line 5002, column 'Mz'", "'x'"]),
        (["Fx;4", NAMES.replace("Fx", "Kraft"), "°;mN m;mN;mN", *ROWS], ["no column 'Winkel'"]),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_what_is_wrong_in_or_below_a_row_of_units_has_its_line(tmp_path, lines, named, encoding):
    with refused(RecordError, *named):
        read(tmp_path, *lines, encoding=encoding)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_windows_1252_is_read_as_such(tmp_path, plain, end):
    lines = ["# Prüfer: Jörg", "# Gerät: „Maß“", NAMES + ";Wärme", "°;µN m;µN;µN;", *(f"{row};1" for row in ROWS)]
    record = read(tmp_path, *lines, encoding="cp1252", end=end)
    assert record.identical(read(tmp_path, *lines, end=end))
    assert (record.attrs["Prüfer"], record.attrs["Gerät"]) == ("Jörg", "„Maß“")
    assert record["Wärme"].values.tolist() == [1, 1]
    same = read(tmp_path, NAMES, "°;mN m;mN;mN", *ROWS, encoding="cp1252")
    assert record_hash(same) == record_hash(plain)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (b"Winkel;Mz;Fx;Fy\n60;1;1;\x81\n", ["line 2", "UTF-8", "(byte 0x81)"]),
        (b"Winkel;Mz;Fx;Fy\n60;1;1;1\n60;1;1;\0\xb0\n", ["line 3", "UTF-8", "(byte 0xb0, '°' in Windows-1252)"]),
        ("# °ä\nWinkel;Mz;Fx;Fy\n60;1;1;".encode() + b"\xb0\n", ["line 3", "UTF-8", "(byte 0xb0"]),
        (b"\xef\xbb\xbf# \xb0\nWinkel;Mz;Fx;Fy\n60;1;1;1\n", ["line 1", "UTF-8", "(byte 0xb0"]),
    ],
    ids=["no sign of it", "NUL", "damaged UTF-8", "byte-order mark"],
)
def test_what_is_neither_utf8_nor_windows_1252_is_refused(tmp_path, content, named):
    (tmp_path / "rig.csv").write_bytes(content)
    with refused(RecordError, tmp_path / "rig.csv", *named):
        read_record(tmp_path / "rig.csv", Rig(file={**COLUMNS, "split_sweeps": True}))

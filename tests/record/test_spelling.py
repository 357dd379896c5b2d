"""Characters that look like others are read as what they stand for, or named."""

import os

import numpy as np
import pytest

from helpers.record_tables import WIRE
from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record.parsing import number_in
from tactile_bayes.rig import GrowingRecord, Rig, read_record

COLUMNS = {"holding_moment": "Mz[N mm]", "force_x": "Fx[mN]", "force_y": "Fy[mN]"}


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("\N{MINUS SIGN}1.5", -1.5),
        ("\N{EN DASH}1.5e\N{MINUS SIGN}3", -1.5e-3),
        ("1\N{NARROW NO-BREAK SPACE}234\N{NARROW NO-BREAK SPACE}567.5", 1234567.5),
        ("12\N{RIGHT SINGLE QUOTATION MARK}345", 12345.0),
        ("\N{ARABIC-INDIC DIGIT THREE}\N{ARABIC DECIMAL SEPARATOR}\N{ARABIC-INDIC DIGIT FIVE}", 3.5),
        ("\N{FULLWIDTH DIGIT ONE}\N{FULLWIDTH FULL STOP}\N{FULLWIDTH DIGIT FIVE}", 1.5),
        ("\N{ZERO WIDTH SPACE}2\N{NO-BREAK SPACE}", 2.0),
        ("1\N{THIN SPACE}23", None),
        ("1234\N{THIN SPACE}56", None),
        ("1_0", None),
    ],
)
def test_numbers(text, number):
    assert number_in(text) == number


@pytest.mark.parametrize("minus", ["\N{MINUS SIGN}", "\N{EN DASH}", "\N{FULLWIDTH HYPHEN-MINUS}"])
def test_origins_of_columns(tmp_path, minus):
    path = tmp_path / "rig.csv"
    path.write_text("Angle,M\N{ZERO WIDTH SPACE}z,Fx,Fy\n30,1,2,3\n29,1,2,3\n", encoding="utf-8")
    given = {**COLUMNS, "drive_angle": f"90{minus}Angle[\N{MASCULINE ORDINAL INDICATOR}]", "force_x": f"{minus}Fx[mN]"}
    record = read_record(path, Rig(rod=WIRE, file={**given, "split_sweeps": True}))
    np.testing.assert_allclose(record.drive_angle, np.radians([60, 61]))
    np.testing.assert_allclose(record.force_x, -2e-3)


def test_what_cannot_be_read_is_named(tmp_path):
    path = tmp_path / "rig.csv"
    path.write_text("Angle,Mz,Fx,Fy\n30,1,1\N{THIN SPACE}2,3\n", encoding="utf-8")
    with refused(RecordError, "line 2, column 'Fx'", "U+2009 THIN SPACE"):
        read_record(path, Rig(rod=WIRE, file={**COLUMNS, "drive_angle": "Angle[deg]", "split_sweeps": True}))


@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_what_can_be_read_once_only_is_refused_before_it_is_opened(tmp_path, kind):
    path = tmp_path / "record.csv"
    if kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero")
    for read in (read_record, GrowingRecord):
        with refused(RecordError, "record.csv is a pipe or a device"):
            read(path)

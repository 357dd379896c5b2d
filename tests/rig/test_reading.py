"""Records as their rig reads them: files, and tables of pandas."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError, RecordError, RecordWarning
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import rod_of, with_rod, write_record
from tactile_bayes.rig import FileFormat, GrowingRecord, Rig, make_record, read_record

RIG = Rig(
    rod=WIRE,
    load_cell=LoadCell(frame="turning"),
    file=FileFormat({"drive_angle": "phi[deg]", "holding_moment": "Mz[N mm]"}, split_sweeps=True, missing=("force_y",)),
)


@pytest.fixture
def path(tmp_path):
    angles = np.degrees(columns()["drive_angle"])
    rows = [f"{angle!r},{moment},1" for moment, angle in enumerate(angles.tolist())]
    path = tmp_path / "rig.csv"
    path.write_text("\n".join(["phi,Mz,force_x [N]", *rows, ""]), encoding="utf-8")
    return path


def test_a_file_is_read_as_its_rig_says(path):
    by_rig = read_record(path, RIG)
    table = {"drive_angle": "phi[deg]", "holding_moment": "Mz[N mm]", "split_sweeps": True, "missing": "force_y"}
    xr.testing.assert_identical(by_rig, read_record(path, Rig(WIRE, LoadCell(frame="turning"), file=table)))
    assert by_rig.attrs["load_cell_frame"] == "turning"
    xr.testing.assert_identical(GrowingRecord(path, RIG).poll().record, by_rig)


def test_a_rod_without_a_length_gives_the_shape_of_the_one_in_the_file(tmp_path):
    record = make_record(columns(), Rig(rod=WIRE))
    write_record(record, tmp_path / "record.csv")
    tapered = Rod(WIRE.length, WIRE.flexural_rigidity, WIRE.diameter, taper=0.4)
    assert rod_of(read_record(tmp_path / "record.csv", Rig(rod=Rod(taper=0.4)))) == tapered
    assert rod_of(with_rod(record, Rod(taper=0.4))) == tapered
    assert rod_of(with_rod(make_record(columns()), Rod(taper=0.4))) == Rod(taper=0.4)
    with refused(RecordError, "but"):
        read_record(tmp_path / "record.csv", Rig(rod=Rod(2 * WIRE.length, 1.0)))


def test_each_row_may_be_a_touch_and_a_condition_takes_rows(tmp_path):
    path = tmp_path / "touches.csv"
    path.write_text("x [mm],y [mm],M [N mm],ring,ok\n1,2,3,0,yes\n4,5,6,1,no\n7,8,9,2,yes\n-1,0,2,3,yes\n")
    columns = {"base_x": "x", "base_y": "y", "holding_moment": "M", "drive_angle": "1[rad]", "direction": "forward"}
    file = {**columns, "split_sweeps": "rows", "where": "ring >= 1 and ok == yes", "missing": ["force_x", "force_y"]}
    rig = Rig(WIRE, file=file)
    record = read_record(path, rig)
    assert record.sweep.values.tolist() == [0, 1]
    np.testing.assert_allclose(record.base_x, [7e-3, -1e-3])
    rig.write(tmp_path / "rig.toml")
    assert Rig.read(tmp_path / "rig.toml").format == rig.format
    xr.testing.assert_identical(read_record(path, Rig.read(tmp_path / "rig.toml")), record)


@pytest.mark.parametrize("where", ["ring", "rign > 0", "ring > 7", "ring > many"])
def test_a_condition_that_chooses_no_rows_is_refused(path, where):
    with refused(RecordError, "where"):
        read_record(path, Rig(WIRE, file={**RIG.format.table, "where": where}))


# --- Tables of pandas -------------------------------------------------------------------------------------------------


OF_TABLE = Rig(
    WIRE,
    LoadCell(frame="turning"),
    file={"drive_angle": "90-phi", "holding_moment": "-Mz", "split_sweeps": True, "missing": "force_y"},
)


def frame(**changes):
    """A table of `OF_TABLE`, in degrees, N mm and mN, with a further column."""
    table = {
        "phi [deg]": np.array([30.0, 29.0, 28.0, 27.0]),
        "Mz (N mm)": np.array([0.0, -0.5, -1.25, -2.0]),
        "force_x [mN]": np.array([0.0, 1.0, 2.0, 3.0]),
        "Temp / °C": np.array([21.0, 21.5, 22.0, 22.5]),
    }
    return pd.DataFrame(table | changes, index=[7, 7, "a", None])


def test_a_table_is_read_as_the_csv_file_of_it(tmp_path):
    table = frame()
    table.to_csv(tmp_path / "rig.csv", index=False)
    made = make_record(table, OF_TABLE)
    pd.testing.assert_frame_equal(table, frame())
    xr.testing.assert_identical(made, read_record(tmp_path / "rig.csv", OF_TABLE))
    np.testing.assert_allclose(made.drive_angle, np.radians([60.0, 61.0, 62.0, 63.0]))
    np.testing.assert_allclose(made.holding_moment, [0.0, 0.5e-3, 1.25e-3, 2e-3])
    np.testing.assert_allclose(made.force_x, [0.0, 1e-3, 2e-3, 3e-3])
    assert (made.attrs["load_cell_frame"], "Temp [°C]" in made) == ("turning", True)


def test_the_table_of_a_record_is_the_record():
    record = make_record(columns(note=list("abcdef")), Rig(WIRE))
    again = make_record(record.to_dataframe(), Rig(WIRE), attrs=record.attrs)
    np.testing.assert_equal(again.to_dataframe().to_numpy(), record.to_dataframe().to_numpy())
    assert again.attrs == record.attrs


def test_a_mapping_states_units_as_a_table_does():
    xr.testing.assert_identical(make_record(frame().to_dict("list"), OF_TABLE), make_record(frame(), OF_TABLE))


@pytest.mark.parametrize("kind", ["float32", "Float64", "object", "string"])
def test_numbers_may_have_any_type_of_pandas(kind):
    found = make_record(frame().astype({"Mz (N mm)": kind}), OF_TABLE)
    np.testing.assert_allclose(found.holding_moment, make_record(frame(), OF_TABLE).holding_moment)
    empty = frame(**{"Mz (N mm)": pd.array([None] * 4, dtype="Float64")})
    assert np.isnan(make_record(empty, OF_TABLE).holding_moment).all()


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("Mz (N mm)", pd.array([0.0, None, 1.0, 2.0], dtype="Float64"), ["sample 1", "'Mz (N mm)'", "missing"]),
        ("phi [deg]", [30.0, 29.0, np.nan, 27.0], ["sample 2", "'phi [deg]'", "nan"]),
        ("phi [deg]", [30.0, None, "up", 27.0], ["sample 2", "'phi [deg]'", "'up'"]),
        ("force_x [mN]", pd.Categorical(["1", "2", "x", "3"]), ["sample 2", "'force_x [mN]'", "'x'"]),
        ("force_x [mN]", pd.date_range("2020-01-01", periods=4), ["sample 0", "force_x", "time"]),
    ],
)
def test_what_is_no_number_is_refused_with_its_place(name, values, words):
    with refused(RecordError, *words):
        make_record(frame(**{name: values}), OF_TABLE)


@pytest.mark.parametrize(
    ("names", "word"), [(["a", "a"], "two columns 'a'"), ([1, "b"], "1"), ([("a", "b"), ("a", "c")], "('a', 'b')")]
)
def test_columns_without_names_of_their_own_are_refused(names, word):
    with refused(ParameterError, word):
        make_record(pd.DataFrame([[0.0, 1.0]], columns=names), OF_TABLE)


def test_numbers_without_units_are_taken_as_si_with_a_warning_and_other_units_are_refused():
    with pytest.warns(RecordWarning, match="for holding_moment: .* N m"):
        make_record(frame().rename(columns={"Mz (N mm)": "Mz"}), OF_TABLE)
    with refused(RecordError, "'Mz (mN)'", "N mm"):
        make_record(frame().rename(columns={"Mz (N mm)": "Mz (mN)"}), OF_TABLE)


@pytest.mark.parametrize(("name", "hint"), [("force", "did you mean 'force_x'?"), ("Q", "choose from sweep")])
def test_an_entry_of_the_file_that_is_no_column_is_refused_at_once(name, hint):
    with refused(ParameterError, f"columns: {name!r} is no column of a record", hint):
        Rig(file={name: "Fx"})

"""Records that are made of tables of pandas."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError, RecordError, RecordWarning
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.rig import Rig, make_record, read_record

RIG = Rig(
    WIRE,
    LoadCell(frame="turning"),
    file={"drive_angle": "90-phi", "holding_moment": "-Mz", "split_sweeps": True, "missing": "force_y"},
)


def frame(**changes):
    """A table of `RIG`, in degrees, N mm and mN, with a further column."""
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
    made = make_record(table, RIG)
    pd.testing.assert_frame_equal(table, frame())
    xr.testing.assert_identical(made, read_record(tmp_path / "rig.csv", RIG))
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
    xr.testing.assert_identical(make_record(frame().to_dict("list"), RIG), make_record(frame(), RIG))


@pytest.mark.parametrize("kind", ["float32", "Float64", "object", "string"])
def test_numbers_may_have_any_type_of_pandas(kind):
    found = make_record(frame().astype({"Mz (N mm)": kind}), RIG)
    np.testing.assert_allclose(found.holding_moment, make_record(frame(), RIG).holding_moment)
    empty = frame(**{"Mz (N mm)": pd.array([None] * 4, dtype="Float64")})
    assert np.isnan(make_record(empty, RIG).holding_moment).all()


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
        make_record(frame(**{name: values}), RIG)


@pytest.mark.parametrize(
    ("names", "word"), [(["a", "a"], "two columns 'a'"), ([1, "b"], "1"), ([("a", "b"), ("a", "c")], "('a', 'b')")]
)
def test_columns_without_names_of_their_own_are_refused(names, word):
    with refused(ParameterError, word):
        make_record(pd.DataFrame([[0.0, 1.0]], columns=names), RIG)


def test_numbers_without_units_are_taken_as_si_with_a_warning_and_other_units_are_refused():
    with pytest.warns(RecordWarning, match="for holding_moment: .* N m"):
        make_record(frame().rename(columns={"Mz (N mm)": "Mz"}), RIG)
    with refused(RecordError, "'Mz (mN)'", "N mm"):
        make_record(frame().rename(columns={"Mz (N mm)": "Mz (mN)"}), RIG)


@pytest.mark.parametrize(("name", "hint"), [("force", "did you mean 'force_x'?"), ("Q", "choose from sweep")])
def test_an_entry_of_the_file_that_is_no_column_is_refused_at_once(name, hint):
    with refused(ParameterError, f"columns: {name!r} is no column of a record", hint):
        Rig(file={name: "Fx"})

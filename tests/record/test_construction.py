"""Records made of columns."""

import numpy as np
import pytest
import xarray as xr

from helpers.record_tables import WIRE, columns
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import MEASURED, present_channels, rod_of, validate
from tactile_bayes.rig import Rig, make_record


def test_a_record_without_a_rod_is_dimensionless():
    record = make_record(columns())
    rod = {"rod_length": 1.0, "rod_flexural_rigidity": 1.0, "rod_diameter": 0.0}
    assert record.attrs == {"units": "dimensionless", **rod}
    assert tuple(record.data_vars) == MEASURED
    assert record["force_x"].attrs == {"units": "1", "long_name": "horizontal support reaction"}
    assert make_record(columns(), Rig(rod=Rod())).identical(record)


def test_a_record_with_a_rod_is_si():
    record = make_record(columns(), Rig(rod=WIRE))
    assert record.attrs["units"] == "SI"
    assert rod_of(record) == WIRE
    assert [record[name].attrs["units"] for name in MEASURED] == ["1", "1", "m", "m", "rad", "N m", "N", "N"]


def test_bases_are_zero_by_default_and_single_values_fill_a_column():
    record = make_record(columns(base_x=None, base_y=None, operator="somebody", temperature=21.5))
    assert not record["base_x"].values.any()
    assert not record["base_y"].values.any()
    assert set(record["operator"].values) == {"somebody"}
    assert set(record["temperature"].values) == {21.5}


def test_further_columns_are_kept_as_they_are():
    record = make_record(
        columns(
            count=np.arange(6, dtype=np.int16),
            loaded=[False, True, True, False, True, True],
            note=["", "a", "b,c", '"', "ß", "1"],
            truth_contact_x=[np.nan, 0.1, 0.2, np.nan, 0.3, 0.4],
            time=xr.DataArray(np.arange(6.0), dims="sample", attrs={"units": "s", "long_name": "time"}),
        )
    )
    assert record["count"].dtype == np.int64
    assert record["loaded"].values.tolist() == [0, 1, 1, 0, 1, 1]
    assert record["note"].values.tolist() == ["", "a", "b,c", '"', "ß", "1"]
    assert record["truth_contact_x"].attrs == {"units": "1", "long_name": "true horizontal position of the contact"}
    assert record["time"].attrs == {"units": "s", "long_name": "time"}
    assert record["count"].attrs["units"] == "unknown"


def test_the_record_does_not_share_memory_with_the_arrays_it_is_made_of():
    moment = np.array(columns()["holding_moment"])
    record = make_record(columns(holding_moment=moment))
    moment[:] = 7
    assert record["holding_moment"].values.max() == 0.2


def test_numbers_may_come_as_text_and_whole_numbers_as_floats():
    record = make_record(columns(sweep=np.array([0, 0, 0, 1, 1, 1.0]), force_x=["0", " 1e-3 ", "-.5", "0", "0", "0"]))
    assert record["sweep"].dtype == np.int64
    assert record["force_x"].values.tolist() == [0, 1e-3, -0.5, 0, 0, 0]


@pytest.mark.parametrize("empty", [np.full(6, np.nan), [None] * 6, [""] * 6, np.ma.masked_all(6)])
def test_a_channel_may_be_missing_as_a_whole(empty):
    assert present_channels(make_record(columns(force_x=empty))) == ("holding_moment", "force_y")


def test_a_channel_may_be_declared_missing():
    for missing in (("force_x",), ["force_x"], "force_x"):
        record = make_record(columns(force_x=None), Rig(file={"missing": missing}))
        assert present_channels(record) == ("holding_moment", "force_y")
        assert validate(record).identical(record)
    with refused(ParameterError, "'force_z'", "holding_moment, force_x, force_y"):
        make_record(columns(), Rig(file={"missing": ("force_z",)}))
    with refused(RecordError, "'force_x' has values", "declared missing"):
        make_record(columns(), Rig(file={"missing": ("force_x",)}))


def test_attributes_are_kept_as_plain_strings_and_numbers():
    attrs = {"load_cell_force_noise": np.float64(0.5), "rig": "bench 2", "run": np.int64(3)}
    record = make_record(columns(), attrs=attrs)
    assert [repr(record.attrs[name]) for name in attrs] == ["0.5", "'bench 2'", "3"]
    si = make_record(columns(), Rig(rod=WIRE))
    assert make_record(columns(), attrs=si.attrs).identical(si)

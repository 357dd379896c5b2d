"""NetCDF files of plain numbers: what is around the numbers may be of another file, and the numbers never are."""

import h5py
import numpy as np
import pytest
import xarray as xr

from tactile_bayes.datasets.shard import netcdf_of


def numbers(seed, **attrs):
    rng = np.random.default_rng(seed)
    variables = {
        "load": (("record", "sample"), rng.normal(size=(5, 4)), {"units": "1"}),
        "single": (("record", "sample"), rng.normal(size=(4, 5)).astype(np.float32).T, {}),
        "phase": (("record",), rng.integers(0, 3, 5).astype(np.int8), {"flag_values": np.arange(3, dtype=np.int8)}),
    }
    return xr.Dataset(variables, {"record": np.arange(5) + seed}, {"title": "numbers", **attrs})


@pytest.mark.parametrize("other", [numbers(2), numbers(1, friction=0.1), numbers(1).isel(record=slice(0, 3))])
def test_each_file_holds_its_own_numbers_and_attributes(other, tmp_path):
    one = numbers(1)
    for k, dataset in enumerate((one, other, one)):
        path = tmp_path / f"{k}.nc"
        path.write_bytes(b"".join(netcdf_of(dataset)))
        with xr.open_dataset(path, engine="h5netcdf") as read:
            xr.testing.assert_identical(read.load(), dataset)
        with h5py.File(path) as file:
            assert {name: file[name].dtype for name in dataset.variables} == dict(dataset.dtypes, record=np.int64)
    assert (tmp_path / "0.nc").read_bytes() == (tmp_path / "2.nc").read_bytes() != (tmp_path / "1.nc").read_bytes()


def test_attributes_that_differ_far_down_a_long_list_are_told_apart():
    long = [numbers(1, flags=np.arange(2000) + (np.arange(2000) == place)) for place in (900, 1000)]
    assert len({b"".join(netcdf_of(dataset)) for dataset in long}) == 2

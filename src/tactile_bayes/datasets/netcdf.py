"""NetCDF of plain numbers, made in a tenth of the time that a general writer takes."""

from __future__ import annotations

import h5py
import xarray as xr

__all__ = ["netcdf_of"]

_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable.{:10d}"


def netcdf_of(dataset: xr.Dataset) -> bytes:
    """A dataset of numbers as NetCDF 4: HDF5 with dimension scales, as the format's specification has it.

    It is made in memory: HDF5 that cannot write on, as when the disk is full, takes the process with it. The same
    dataset gives the same bytes with the same libraries.

    Parameters
    ----------
    dataset : xr.Dataset
        Variables of numbers; attributes are text, numbers or arrays of numbers.

    Returns
    -------
    bytes
        What a file of it contains.
    """
    name_in_memory = f"{id(dataset)}.nc"  # those that are made at a time by several threads need different ones
    with h5py.File(name_in_memory, "w", driver="core", backing_store=False, block_size=2**20, track_order=True) as file:
        for name, size in dataset.sizes.items():
            if name not in dataset.variables:
                scale = file.create_dataset(str(name), shape=(size,), dtype=">f4", track_times=False)
                scale.make_scale(_NO_VARIABLE.format(size))
        for name, variable in dataset.variables.items():
            stored = file.create_dataset(str(name), data=variable.values, track_times=False)
            stored.attrs.update(variable.attrs)
            if name in dataset.dims:
                stored.make_scale(str(name))
        for number, name in enumerate(dataset.dims):
            file[str(name)].attrs["_Netcdf4Dimid"] = number
        scales = {name: file[str(name)] for name in dataset.dims}
        for name, variable in dataset.variables.items():
            if name not in dataset.dims:
                stored = file[str(name)]
                for axis, dimension in enumerate(variable.dims):
                    stored.dims[axis].attach_scale(scales[dimension])
        file.attrs.update(dataset.attrs)
        file.flush()
        return bytes(file.id.get_file_image())

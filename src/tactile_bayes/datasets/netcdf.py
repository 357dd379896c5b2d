"""NetCDF of plain numbers: the structure is made once for all files that differ in the numbers only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import h5py
import numpy as np
import xarray as xr
from numpy.typing import NDArray

_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable.{:10d}"


def netcdf_of(dataset: xr.Dataset) -> list[memoryview]:
    """Return a dataset of numbers as NetCDF 4: HDF5 with dimension scales, as the specification of the format defines,
    made in memory, since HDF5 aborts the process if it cannot write. Equal datasets give equal bytes.
    """
    found = []
    for before, name in _frame(_Template(dataset)):
        found.append(before)
        if name is not None:
            found.append(_bytes_of(dataset[name].values))
    return found


class _Template:
    """A dataset without its numbers, equal to any other that differs in them only."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self.sizes, self.attrs = dict(dataset.sizes), dict(dataset.attrs)
        self.variables = {str(name): (v.dims, v.shape, v.dtype, v.attrs) for name, v in dataset.variables.items()}
        plain = [(name, *rest, _plain(attrs)) for name, (*rest, attrs) in self.variables.items()]
        self._written = repr((self.sizes, _plain(self.attrs), plain))

    def __hash__(self) -> int:
        return hash(self._written)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Template) and self._written == other._written


@lru_cache(maxsize=2)
def _frame(template: _Template) -> Sequence[tuple[memoryview, str | None]]:
    """Return the bytes before the numbers of each variable, in the order of the file, and the bytes at the end."""
    name_in_memory = f"{id(template)}.nc"  # files made by several threads at a time need different names
    with h5py.File(name_in_memory, "w", driver="core", backing_store=False, block_size=2**20, track_order=True) as file:
        for name, size in template.sizes.items():
            if name not in template.variables:
                scale = file.create_dataset(str(name), shape=(size,), dtype=">f4", track_times=False)
                scale.make_scale(_NO_VARIABLE.format(size))
        for name, (_, shape, dtype, attrs) in template.variables.items():
            stored = file.create_dataset(name, data=np.zeros(shape, dtype), track_times=False)
            stored.attrs.update(attrs)
            if name in template.sizes:
                stored.make_scale(name)
        for number, name in enumerate(template.sizes):
            file[str(name)].attrs["_Netcdf4Dimid"] = number
        scales = {name: file[str(name)] for name in template.sizes}
        for name, (dims, _, _, _) in template.variables.items():
            if name not in template.sizes:
                for axis, dimension in enumerate(dims):
                    file[name].dims[axis].attach_scale(scales[dimension])
        file.attrs.update(template.attrs)
        file.flush()
        image, end = memoryview(file.id.get_file_image()), 0
        found = list[tuple[memoryview, str | None]]()
        for begin, name in sorted((file[name].id.get_offset(), name) for name in template.variables):
            found.append((memoryview(bytes(image[end:begin])), name))
            end = begin + file[name].id.get_storage_size()
    return [*found, (memoryview(bytes(image[end:])), None)]


def _plain(attrs: Mapping[str, Any]) -> list[tuple[str, Any, Any]]:
    return [(name, np.asarray(value).dtype, np.asarray(value).tolist()) for name, value in attrs.items()]


def _bytes_of(values: NDArray[np.generic]) -> memoryview:
    return np.ascontiguousarray(values).reshape(-1).view(np.uint8).data

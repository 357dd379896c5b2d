"""A data set on disk, opened as one without reading it."""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import BackendArray
from xarray.core import indexing

from tactile_bayes.arrays import Index
from tactile_bayes.checks import check_path
from tactile_bayes.datasets.manifest import Manifest, read_manifest
from tactile_bayes.datasets.shard import Written, file_in
from tactile_bayes.errors import SpecificationError
from tactile_bayes.record.netcdf import read_netcdf, reading, refuse_unless
from tactile_bayes.record.netcdf_content import refuse_unsafe_variable


def open_dataset(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a data set as one xarray Dataset with dimensions record, sweep and sample; values are read when used.

    The SHA-256 of a file is compared with that in the manifest before anything is read from it. The first file is read
    at once.

    Parameters
    ----------
    path : path-like
        Folder of the data set. If it is not complete, the existing shards are opened.

    Returns
    -------
    xr.Dataset
        Select first, then load: `open(path).isel(record=slice(0, 100)).load()`. With Dask installed, `.chunk()` makes
        it parallel.

    Raises
    ------
    SpecificationError
        If the folder contains no data set, or no shard yet.

    Warns
    -----
    UserWarning
        If shards are still missing.

    Examples
    --------
    >>> import tempfile
    >>> from tactile_bayes.datasets import generate
    >>> spec = {"records": 2, "seed": 1, "contours": [{"family": "circle", "r": 0.5, "q": 0.3}]}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = open_dataset(generate(spec, folder, workers=1).parent).load()
    >>> made.sizes["record"], made.attrs["units"]
    (2, 'dimensionless')
    """
    folder = check_path("path", path, "give the folder of a data set")
    manifest = read_manifest(folder)
    if manifest.shards and not manifest.is_complete:
        missing = (
            f"{folder} has {manifest.made} of {manifest.records} records: run dataset generate again for the others"
        )
        warnings.warn(missing, UserWarning, stacklevel=2)
    return opened(folder, manifest)


def opened(folder: Path, manifest: Manifest) -> xr.Dataset:
    """Open the existing shards of a data set; see `open_dataset`."""
    if not manifest.shards:
        raise SpecificationError(f"{folder} holds no shard yet: run dataset generate again")
    first = read_shard(folder, manifest.shards[0])
    numbers = np.concatenate([np.arange(s.first, s.first + s.records) for s in manifest.shards])
    count = numbers.size
    variables: dict[Any, Any] = {}
    for name, variable in first.variables.items():
        if name == "record":
            variables[name] = ("record", numbers, variable.attrs)
        elif variable.dims[:1] == ("record",):
            array = _Shards(folder, manifest, str(name), (count, *variable.shape[1:]), variable.dtype)
            variables[name] = xr.Variable(variable.dims, indexing.LazilyIndexedArray(array), variable.attrs)
        else:
            variables[name] = variable
    return xr.Dataset(variables, attrs=first.attrs).set_coords(list(first.coords))


class _Shards(BackendArray):
    """A variable of all shards, concatenated; files are open only while they are read."""

    def __init__(
        self, folder: Path, manifest: Manifest, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]
    ) -> None:
        self.folder, self.name, self.shape, self.dtype = folder, name, shape, dtype
        self.shards = manifest.shards
        self.starts = np.cumsum([0, *(shard.records for shard in manifest.shards)])

    def __getitem__(self, key: indexing.ExplicitIndexer) -> NDArray[Any]:
        return np.asarray(
            indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)
        )

    def _read(self, key: tuple[Any, ...]) -> NDArray[Any]:
        wanted, *rest = (np.arange(size)[k] for size, k in zip(self.shape, key, strict=True))
        rows = np.atleast_1d(wanted)
        shard = np.searchsorted(self.starts, rows, side="right") - 1
        found = np.empty((rows.size, *(np.size(places) for places in rest)), dtype=self.dtype)
        if found.size:
            for run in np.split(np.arange(rows.size), np.flatnonzero(np.diff(shard)) + 1):
                number = int(shard[run[0]])
                found[run] = self._of_shard(number, [rows[run] - self.starts[number], *map(np.atleast_1d, rest)])
        return found.reshape([places.size for places in (wanted, *rest) if np.ndim(places)])

    def _of_shard(self, number: int, places: list[Index]) -> NDArray[Any]:
        """Read values at the outer product of indices, from one contiguous piece."""
        path = _unchanged(self.folder, self.shards[number])
        with reading(_refusal(path)), h5py.File(path, "r") as file:
            refuse_unsafe_variable(file, self.name, path.stat().st_size)
            stored = file[self.name]
            if (stored.shape, stored.dtype) != ((self.shards[number].records, *self.shape[1:]), self.dtype):
                raise ValueError(f"its {self.name} has another shape or type than that of the first file")
            span = stored[tuple(slice(int(p.min()), int(p.max()) + 1) for p in places)]
        return np.asarray(span[np.ix_(*(p - p.min() for p in places))])


def read_shard(folder: Path, shard: Written) -> xr.Dataset:
    """Read a shard, with numbers as they are stored."""
    path = _unchanged(folder, shard)
    found = read_netcdf(
        path, xr.open_dataset, _refusal(path), sha256=shard.sha256, decode_times=False, decode_timedelta=False
    )
    if found.sizes.get("record") != shard.records:
        raise _refusal(path)(f"has {found.sizes.get('record')} records in place of {shard.records}")
    return found


def _unchanged(folder: Path, shard: Written) -> Path:
    """Return the path of a shard that is as it was written."""
    path = file_in(folder, shard.file)
    try:
        stat = path.stat()
        if stat.st_size != shard.bytes:
            raise _refusal(path)(f"has {stat.st_size} bytes in place of {shard.bytes}")
        sha256 = _sha256(path, stat.st_ino, stat.st_size, stat.st_mtime_ns)
    except FileNotFoundError:
        raise SpecificationError(f"{path} is missing: dataset generate makes it again") from None
    refuse_unless(sha256 == shard.sha256, _refusal(path))
    return path


@lru_cache(maxsize=100_000)
def _sha256(path: Path, *stamp: int) -> str:
    """Return the SHA-256 of a file, computed once as long as inode, size and time of change are the same."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _refusal(path: Path) -> Callable[[str], SpecificationError]:
    return lambda what: SpecificationError(f"{path} {what}: run dataset verify")

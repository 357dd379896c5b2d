"""NetCDF files that show every damage: checksums in the file, one over all of it; and a record as one."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import xarray as xr

from tactile_bayes.record.table import Source, Table, table_of
from tactile_bayes.tasks import write_atomically

__all__ = ["read_netcdf", "read_netcdf_table", "reading", "write_netcdf", "write_netcdf_record"]

Content = TypeVar("Content", xr.Dataset, xr.DataTree)

_SEAL = b"\ntactile_bayes: SHA-256 of all bytes before this line "
_SEAL_BYTES = len(_SEAL) + 64 + 1

_SUPERBLOCK = 48
"""First bytes of an HDF5 file, among which is the number of all its bytes."""

_CHUNK = 1 << 22


def write_netcdf(
    content: xr.Dataset | xr.DataTree,
    path: str | os.PathLike[str],
    encoding: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Write a dataset or a tree to a NetCDF 4 file, whole or not at all, with checksums.

    Arrays of numbers and characters carry Fletcher-32 checksums, which every program that uses HDF5 checks. In HDF5,
    attributes, scalars, strings of different lengths and the structure of the file cannot have them. Therefore the last
    line of the file, beyond the end that HDF5 knows, is the SHA-256 of all bytes before it; `read_netcdf` checks it.
    Programs that open the file to change it drop that line.

    Parameters
    ----------
    content : xr.Dataset or xr.DataTree
    path : path-like
        Where to.
    encoding : mapping of str to mapping, optional
        Of the variables of a dataset, as xarray takes it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as directory:
    ...     write_netcdf(xr.Dataset({"q": ("draw", [0.5, 0.6])}), Path(directory) / "a.nc")
    ...     found = read_netcdf(Path(directory) / "a.nc", xr.open_dataset, ValueError)
    >>> found["q"].values.tolist()
    [0.5, 0.6]
    """
    encodings: Any
    if isinstance(content, xr.DataTree):
        encodings = {group.path: _with_checksums(group.to_dataset(inherit=False), {}) for group in content.subtree}
    else:
        encodings = _with_checksums(content, encoding or {})
    with write_atomically(path) as temporary:
        content.to_netcdf(temporary, engine="h5netcdf", encoding=encodings)
        with open(temporary, "r+b") as file:
            file.write(_seal(file, temporary.stat().st_size))


def _with_checksums(dataset: xr.Dataset, encoding: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """The encoding, with Fletcher-32 for all variables that can have it."""
    encodings = {name: dict(options) for name, options in encoding.items()}
    for name, variable in dataset.variables.items():
        options = encodings.setdefault(str(name), {})
        is_fixed = variable.dtype.kind in "biufS" or options.get("dtype") == "S1"
        if is_fixed and variable.ndim and variable.size:
            options["fletcher32"] = True
    return encodings


def read_netcdf(
    path: Path, opened: Callable[..., Content], refused: Callable[[str], Exception], **options: Any
) -> Content:
    """Read a NetCDF 4 file of this or any other program into memory.

    Parameters
    ----------
    path : Path
    opened : callable
        `xarray.open_dataset` or `xarray.open_datatree`.
    refused : callable
        Makes the error from what is wrong with the file; it has to name the file, and to say what to do.
    **options
        For `opened`.

    Raises
    ------
    Exception
        From `refused`, if the file is damaged or no NetCDF 4 file.
    OSError
        If it cannot be opened.
    """
    with reading(path, refused), opened(path, engine="h5netcdf", **options) as found:
        return found.load()


@contextmanager
def reading(path: Path, refused: Callable[[str], Exception]) -> Iterator[None]:
    """A block in which a NetCDF 4 file is read; whatever fails in it is raised as an error from `refused`.

    A file that ends with its SHA-256 is checked first, so that HDF5, which a damaged file may make crash or hang, sees
    none. Others, of another program or of an earlier version, are read as they are.
    """
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        known = size - _SEAL_BYTES
        is_sealed = known > 0 and known.to_bytes(8, "little") in file.read(_SUPERBLOCK)
        file.seek(max(known, 0))
        last = file.read()
        if (is_sealed or last.startswith(_SEAL)) and last != _seal(file, known):
            raise refused("is damaged, it is not as it was written (its SHA-256 differs)")
    try:
        yield
    except Exception as error:  # HDF5 and what reads with it fail in many ways over a damaged file
        what = " ".join(str(error).split()) or type(error).__name__
        raise refused(f"cannot be read, it is damaged or cut short, or no NetCDF 4 file ({what})") from error


def _seal(file: BinaryIO, size: int) -> bytes:
    """The last line of a file whose other bytes are the first `size` ones; it is left behind them."""
    file.seek(0)
    digest = hashlib.sha256()
    while size > 0 and (block := file.read(min(size, _CHUNK))):
        digest.update(block)
        size -= len(block)
    return _SEAL + digest.hexdigest().encode() + b"\n"


def read_netcdf_table(path: Path, columns: Mapping[str, str]) -> Table:
    """Read a table as it is in the file; all its columns are read, whichever are meant.

    The dimension of the samples may have any name, if all columns lie along it.
    """
    source = Source(str(path))
    record = read_netcdf(
        path,
        xr.open_dataset,
        lambda what: source.error(f"the file {what}: write it again, or put a copy of it back"),
        decode_times=False,
        decode_timedelta=False,
        decode_coords=False,
    )
    dimensions = {variable.dims for variable in record.variables.values()}
    shared = dimensions.pop() if len(dimensions) == 1 else ()
    return table_of(record, source, shared[0] if len(shared) == 1 else "sample")


def write_netcdf_record(record: xr.Dataset, path: Path) -> None:
    """Write a record that has been validated."""
    record = record.reset_coords([name for name in record.coords if name not in record.dims])
    encoding: dict[Any, dict[str, Any]] = {}
    taken = {*map(str, record.variables), "sample"}
    for name, variable in record.variables.items():
        if variable.dtype.kind == "U":  # as fixed-width characters, which every NetCDF library reads
            dimension = re.sub(r"\d", "_", f"{name}_length")  # a number in it would be taken for the length
            while dimension in taken:
                dimension += "_"
            taken.add(dimension)
            encoding[name] = {"dtype": "S1", "char_dim_name": dimension}
        elif variable.dtype.kind != "O":  # objects are texts of different lengths
            encoding[name] = {"_FillValue": None}
    write_netcdf(record, path, encoding)

"""NetCDF files with checksums in the file and one over all of it, which reveal any damage; records in such files."""

from __future__ import annotations

import hashlib
import io
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from signal import Signals
from typing import Any, TypeVar

import h5netcdf
import xarray as xr
from xarray.backends import H5NetCDFStore, InMemoryDataStore

from tactile_bayes.record import netcdf_content
from tactile_bayes.record.netcdf_content import FileGroup, UnsafeError, content_of, is_cut_short, received, time_limit
from tactile_bayes.record.schema import RECORD_FORMAT
from tactile_bayes.record.table import Source, Table, table_of
from tactile_bayes.tasks import check_format, write_atomically

Content = TypeVar("Content", xr.Dataset, xr.DataTree)

_SEAL = b"\ntactile_bayes: SHA-256 of all bytes before this line "
_SEAL_BYTES = len(_SEAL) + 64 + 1

# Newest formats that are read, by the attribute that states them.
RESULT_FORMAT = {"result_format": 1}
_FORMATS = {"record_format": RECORD_FORMAT, **RESULT_FORMAT}

_SUPERBLOCK = 48  # number of first bytes of an HDF5 file that contain the number of all its bytes


def write_netcdf(
    content: xr.Dataset | xr.DataTree,
    path: str | os.PathLike[str],
    encoding: Mapping[str, Mapping[str, Any]] | None = None,
) -> None:
    """Write a dataset or a tree to a NetCDF 4 file atomically, with checksums: those of HDF5 in arrays, and in a last
    line, beyond the end that HDF5 knows, the SHA-256 of all bytes before it, which programs that modify the file drop.
    """
    image = _image_of(content, encoding or {})
    with write_atomically(path) as temporary, open(temporary, "wb") as file:
        file.write(image)
        file.write(_seal(hashlib.sha256(image).hexdigest()))


def _image_of(content: xr.Dataset | xr.DataTree, encoding: Mapping[str, Mapping[str, Any]]) -> bytes:
    """Return the bytes of a file; they are made in memory, since HDF5 ends the process if it cannot write to a disk."""
    if isinstance(content, xr.DataTree):
        groups = {group.path: group.to_dataset(inherit=False) for group in content.subtree}
    else:
        groups = {"/": content}
    memory = io.BytesIO()
    with h5netcdf.File(memory, "w") as file:
        for group, dataset in groups.items():
            dataset.dump_to_store(H5NetCDFStore(file, group=group), encoding=_with_checksums(dataset, encoding))
    return memory.getvalue()


def _with_checksums(dataset: xr.Dataset, encoding: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Add Fletcher-32 to the encoding of all variables that can have it."""
    encodings = {name: dict(options) for name, options in encoding.items()}
    for name, variable in dataset.variables.items():
        options = encodings.setdefault(str(name), {})
        is_fixed = variable.dtype.kind in "biufS" or options.get("dtype") == "S1"
        if is_fixed and variable.ndim and variable.size:
            options["fletcher32"] = True
    return encodings


def read_netcdf(
    path: Path,
    opened: Callable[..., Content],
    refused: Callable[[str], Exception],
    sha256: str | None = None,
    **options: Any,
) -> Content:
    """Read a NetCDF 4 file into memory, by `xarray.open_dataset` or `open_datatree`, or raise `refused(what)`. Damage
    may make HDF5 crash, hang, or take all memory: a file without a checksum is read by a process with limits.
    """
    content = path.read_bytes()
    if sha256 is not None:
        refuse_unless(hashlib.sha256(content).hexdigest() == sha256, refused)
    is_known = sha256 is not None or _is_sealed(content, refused)
    with_groups: bool = opened is xr.open_datatree
    with reading(refused):
        groups = content_of(content, with_groups) if is_known else _content_elsewhere(content, with_groups)
        found = {name: _dataset(group, options) for name, group in groups.items()}
        result: Any = xr.DataTree.from_dict(found) if with_groups else found["/"]
    for name, reads in _FORMATS.items():
        check_format(result.attrs.get(name), reads, refused)
    return result


def _dataset(group: FileGroup, options: Mapping[str, Any]) -> xr.Dataset:
    variables = {
        name: xr.Variable(dims, values, attrs, {"dtype": str if values.dtype.kind == "O" else values.dtype})
        for name, (dims, values, attrs) in group.variables.items()
    }
    return xr.open_dataset(InMemoryDataStore(variables, dict(group.attrs)), **options).load()


def _content_elsewhere(content: bytes, with_groups: bool) -> dict[str, FileGroup]:
    """Return what `content_of` returns, or raise what it raises, from a process with limits of time and memory: a
    script, since multiprocessing needs a `__main__` to import, and no worker may start it.
    """
    if is_cut_short(content):
        raise ValueError("it is no HDF5, or has fewer bytes than it states")
    if not sys.executable or getattr(sys, "frozen", False):
        raise OSError("a file without its checksum is read by a Python of its own, and there is none here")
    seconds, patience = time_limit(len(content))
    command = [sys.executable, "-P", "-W", "ignore", netcdf_content.__file__, *(["groups"] if with_groups else [])]
    paths = os.pathsep.join(path for path in sys.path if path)
    environment = {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"}
    options: dict[str, Any] = {"input": content, "capture_output": True, "timeout": patience, "env": environment}
    try:
        process = subprocess.run(command, check=False, **options)
    except subprocess.TimeoutExpired:
        raise ValueError(f"HDF5 takes more than {patience} s over it") from None
    answer = io.BytesIO(process.stdout)
    kind = answer.readline()
    if process.returncode == 0 and kind == b"content\n":
        return received(answer)
    if process.returncode == 0 and kind in (b"unsafe\n", b"damaged\n"):
        error = UnsafeError if kind == b"unsafe\n" else ValueError
        raise error(answer.read().decode("utf-8", "replace"))
    if process.returncode < 0 and Signals(-process.returncode).name in ("SIGXCPU", "SIGKILL"):
        raise ValueError(f"HDF5 takes more than {seconds} s over it, or all memory")
    said = process.stderr.decode("utf-8", "replace").strip().splitlines()
    raise ValueError(f"HDF5 ends over it with {process.returncode}" + (f": {said[-1]}" if said else ""))


@contextmanager
def reading(refused: Callable[[str], Exception]) -> Iterator[None]:
    """Context in which a NetCDF 4 file is read; any failure is raised as an error from `refused`."""
    try:
        yield
    except UnsafeError as error:
        raise refused(f"is not read, {error}") from None
    except Exception as error:  # a damaged file causes many kinds of errors in HDF5
        what = " ".join(str(error).split()) or type(error).__name__
        raise refused(f"cannot be read, it is damaged or cut short, or no NetCDF 4 file ({what})") from error


def _is_sealed(content: bytes, refused: Callable[[str], Exception]) -> bool:
    """Return whether a file ends with its SHA-256; raise the error from `refused` if it ends with another one."""
    known = max(len(content) - _SEAL_BYTES, 0)
    last = content[known:]
    if not (known and known.to_bytes(8, "little") in content[:_SUPERBLOCK]) and not last.startswith(_SEAL):
        return False
    refuse_unless(last == _seal(hashlib.sha256(memoryview(content)[:known]).hexdigest()), refused)
    return True


def refuse_unless(is_as_written: bool, refused: Callable[[str], Exception]) -> None:
    """Raise the error from `refused` if a file is not as it was written."""
    if not is_as_written:
        raise refused("is damaged, it is not as it was written (its SHA-256 differs)")


def _seal(sha256: str) -> bytes:
    """Return the last line of a file, from the SHA-256 of all before it."""
    return _SEAL + sha256.encode() + b"\n"


def read_netcdf_table(path: Path, columns: Mapping[str, str]) -> Table:
    """Read a table as it is in the file; the dimension of its samples may have any name."""
    source = Source(str(path))
    record = read_netcdf(
        path,
        xr.open_dataset,
        lambda what: source.error(f"the file {what}: write it again, or put a copy of it back"),
        decode_times=False,
        decode_timedelta=False,
        decode_coords=False,
    )
    record.attrs.pop("record_format", None)
    dimensions = {variable.dims for variable in record.variables.values()}
    shared = dimensions.pop() if len(dimensions) == 1 else ()
    return table_of(record, source, shared[0] if len(shared) == 1 else "sample")


def write_netcdf_record(record: xr.Dataset, path: Path) -> None:
    """Write a validated record."""
    record = record.reset_coords([name for name in record.coords if name not in record.dims])
    encoding: dict[Any, dict[str, Any]] = {}
    taken = {*map(str, record.variables), "sample"}
    for name, variable in record.variables.items():
        if variable.dtype.kind == "U":  # fixed-width characters, which every NetCDF library reads
            dimension = re.sub(r"\d", "_", f"{name}_length")  # a number in the name would count as the length
            while dimension in taken:
                dimension += "_"
            taken.add(dimension)
            encoding[name] = {"dtype": "S1", "char_dim_name": dimension}
        elif variable.dtype.kind != "O":  # objects are texts of different lengths
            encoding[name] = {"_FillValue": None}
    write_netcdf(record.assign_attrs(record_format=RECORD_FORMAT), path, encoding)

"""The content of a NetCDF 4 file; run as a script, that of one whose origin is unknown, within limits. It imports
nothing of this package, so that the script starts in a quarter of a second.
"""

from __future__ import annotations

import io
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from types import SimpleNamespace
from typing import Any, BinaryIO, NamedTuple

import h5netcdf
import h5py
import numpy as np
from numpy.typing import NDArray

_DEPTH, _OBJECTS = 32, 10_000  # largest depth of groups, and number of groups and variables
_LARGEST, _RATIO = 1 << 28, 8  # content [bytes] that any file may have, and that of a larger one in its own sizes
_FILTERS = (1, 2, 3, 4, 5, 6, 32000)  # filters that come with HDF5 and h5py; others are in plugins, which are programs
_PLAIN = (h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.STRING, h5py.h5t.ENUM)

# Attributes of references, by which variables have their dimensions.
_OF_DIMENSIONS = ("DIMENSION_LIST", "REFERENCE_LIST")
# Part of the attribute NAME of a dimension that is no variable.
_NO_VARIABLE = b"This is a netCDF dimension but not a netCDF variable."
# Time of the processor [s], bytes that are read in each second more, and the whole time over that of the processor.
_SECONDS, _RATE, _PATIENCE = 5, 10_000_000, 12
_WORKSPACE = 1 << 28  # memory for reading, besides file and content [bytes]


class UnsafeError(ValueError):
    """A file is whole, as far as is known, and is not to be read all the same."""


class FileGroup(NamedTuple):
    """A group of a file."""

    # Dimensions, values as stored, and attributes, by name.
    variables: Mapping[str, tuple[Sequence[str], NDArray[Any], Mapping[str, Any]]]
    attrs: Mapping[str, Any]


def is_cut_short(content: bytes) -> bool:
    """Return whether a file has no beginning of HDF5, or fewer bytes than it states there."""
    if not content.startswith(b"\x89HDF\r\n\x1a\n"):
        return content.find(b"\x89HDF\r\n\x1a\n", 512, 1 << 20) < 0  # other bytes may come before it
    begin = {0: 40, 1: 44, 2: 28, 3: 28}.get(content[8] if len(content) > 8 else -1)
    return begin is not None and int.from_bytes(content[begin : begin + 8], "little") > len(content)


def content_of(content: bytes, with_groups: bool) -> dict[str, FileGroup]:
    """Return the content of a NetCDF 4 file by the path of its groups, or of the root alone; refuse an unsafe one."""
    with h5py.File(io.BytesIO(content), "r") as hdf5:
        refuse_unsafe(hdf5, len(content))
    with h5netcdf.File(io.BytesIO(content), "r", decode_vlen_strings=True, phony_dims="access") as file:
        return dict(islice(_groups("/", file), None if with_groups else 1))


def refuse_unsafe(hdf5: h5py.File, size: int) -> None:
    """Refuse a file that leads to other files or to programs, or states more than its bytes can hold."""
    known, total, waiting = {_address(hdf5)}, 0, [(hdf5, 0)]
    _refuse_attributes(hdf5, size)
    while waiting:
        group, depth = waiting.pop()
        if depth > _DEPTH:
            raise UnsafeError(f"it has groups in groups, more than {_DEPTH} deep")
        for name in group:
            path, part = f"{group.name.rstrip('/')}/{name}", _part_of(group, name)
            if (address := _address(part)) in known:
                raise UnsafeError(f"{path} is in the file a second time")
            known.add(address)
            if len(known) > _OBJECTS:
                raise UnsafeError(f"it has more than {_OBJECTS:,} groups and variables")
            _refuse_attributes(part, size)
            if isinstance(part, h5py.Group):
                waiting.append((part, depth + 1))
            elif isinstance(part, h5py.Dataset):
                total += _size_of(part, size)
                if total > largest_content(size):
                    raise UnsafeError(f"it states more than {largest_content(size):,} bytes of content")


def refuse_unsafe_variable(hdf5: h5py.File, name: str, size: int) -> None:
    """Refuse a variable of the root as `refuse_unsafe` does, whatever else is in the file."""
    if not isinstance(part := _part_of(hdf5, name), h5py.Dataset):
        raise UnsafeError(f"/{name} is no variable")
    _size_of(part, size)


def _part_of(group: h5py.Group, name: str) -> h5py.HLObject:
    """Return a group or variable, and refuse a link."""
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        raise UnsafeError(f"{group.name.rstrip('/')}/{name} is a link, which may lead to another file")
    return group[name]


def largest_content(size: int) -> int:
    """Return the largest content of a file of this size that is read [bytes]."""
    return max(_LARGEST, _RATIO * size)


def _address(part: h5py.HLObject) -> tuple[int, int]:
    info = h5py.h5o.get_info(part.id)
    return info.fileno, info.addr


def _size_of(variable: h5py.Dataset, size: int) -> int:
    """Return the size of a variable [bytes], and refuse one that is not in the file, and in it alone."""
    path = variable.name
    made = variable.id.get_create_plist()
    if made.get_layout() == h5py.h5d.VIRTUAL:
        raise UnsafeError(f"{path} is made of other variables, which may be in other files")
    if made.get_external_count():
        raise UnsafeError(f"{path} is in another file, {os.fsdecode(made.get_external(0)[0])!r}")
    for number in range(made.get_nfilters()):
        if (code := made.get_filter(number)[0]) not in _FILTERS:
            raise UnsafeError(f"{path} is compressed by the plugin number {code}")
    kind = variable.id.get_type()
    if kind.get_class() not in _PLAIN:
        raise UnsafeError(f"{path} is neither of numbers nor of text")
    name = variable.attrs.get("NAME", b"")
    if _NO_VARIABLE in (name.encode() if isinstance(name, str) else name):
        return 0  # it has no values, and is not read
    stated = 0 if variable.shape is None else math.prod(variable.shape) * kind.get_size()
    chunk = math.prod(variable.chunks or (0,)) * kind.get_size()
    if (stored := variable.id.get_storage_size()) > size or chunk > largest_content(size):
        raise UnsafeError(f"{path} is said to have {stored:,} bytes in the file, in pieces of {chunk:,}")
    return stated


def _refuse_attributes(part: h5py.HLObject, size: int) -> None:
    for name in part.attrs:
        attribute = part.attrs.get_id(name)
        if name not in _OF_DIMENSIONS and attribute.get_type().get_class() not in _PLAIN:
            raise UnsafeError(f"the attribute {name} of {part.name} is neither of numbers nor of text")
        if (stored := attribute.get_storage_size()) > size:
            raise UnsafeError(f"the attribute {name} of {part.name} is said to have {stored:,} bytes")


def _groups(path: str, group: h5netcdf.Group) -> Iterator[tuple[str, FileGroup]]:
    variables = {name: (of.dimensions, _plain(of[...]), _attributes(of)) for name, of in group.variables.items()}
    yield path, FileGroup(variables, _attributes(group))
    for name, part in group.groups.items():
        yield from _groups(f"{path.rstrip('/')}/{name}", part)


def _plain(values: Any) -> NDArray[Any]:
    """Return values as an array without what HDF5 adds to its type."""
    array = np.asarray(values)
    return array.astype(np.dtype(array.dtype.str), copy=False) if array.dtype.kind != "O" else array.astype(object)


def _attributes(of: h5netcdf.Group | h5netcdf.Variable) -> dict[str, Any]:
    """Return attributes, texts as such, as xarray does."""
    found = dict(of.attrs)
    for name, value in found.items():
        if isinstance(value, bytes) and name not in ("_FillValue", "missing_value"):
            with suppress(UnicodeDecodeError):
                found[name] = value.decode()
    return found


# ---- from the script to the process that waits for it


def send(groups: Mapping[str, FileGroup], write: Callable[[bytes], object]) -> None:
    """Write groups as arrays of numbers, one after the other; the first is a table of everything, as JSON."""
    arrays: list[NDArray[Any]] = []
    table = _packed(groups, arrays)
    file: Any = SimpleNamespace(write=write)  # an actual file is asked for its position, which a pipe has not
    index = json.dumps([len(arrays), table]).encode()
    for array in (np.frombuffer(index, dtype=np.uint8), *arrays):
        np.save(file, array, allow_pickle=False)


def received(file: BinaryIO) -> dict[str, FileGroup]:
    """Return the groups that `send` has written."""
    count, table = json.loads(np.load(file, allow_pickle=False).tobytes())
    arrays = [np.load(file, allow_pickle=False) for _ in range(count)]
    return {path: FileGroup(*group) for path, group in _unpacked(table, arrays).items()}


def _packed(value: Any, arrays: list[NDArray[Any]]) -> list[Any]:
    """Return a value as JSON, with its kind; arrays of numbers are numbered and go beside it."""
    if isinstance(value, str):
        return ["text", value]
    if isinstance(value, bytes) and not isinstance(value, np.generic):
        return ["bytes", value.decode("latin-1")]
    if isinstance(value, Mapping):
        return ["table", {name: _packed(part, arrays) for name, part in value.items()}]
    if isinstance(value, list | tuple):
        return ["list", [_packed(part, arrays) for part in value]]
    array = np.asarray(value)
    if array.dtype.kind == "O":
        return ["objects", [_packed(part, arrays) for part in array.flat], array.shape]
    arrays.append(_plain(array))
    return ["array" if isinstance(value, np.ndarray) else "number", len(arrays) - 1]


def _unpacked(packed: list[Any], arrays: list[NDArray[Any]]) -> Any:
    kind, value, *shape = packed
    match kind:
        case "text":
            return value
        case "bytes":
            return value.encode("latin-1")
        case "table":
            return {name: _unpacked(part, arrays) for name, part in value.items()}
        case "list":
            return [_unpacked(part, arrays) for part in value]
        case "objects":
            found = np.empty(len(value), dtype=object)
            found[:] = [_unpacked(part, arrays) for part in value]
            return found.reshape(shape[0])
        case _:
            return arrays[value] if kind == "array" else arrays[value][()]


# ---- the script


def time_limit(size: int) -> tuple[int, int]:
    """Return the time of the processor, and the whole time, longer as there is other work, to read a file [s]."""
    seconds = _SECONDS + size // _RATE
    return seconds, _PATIENCE * seconds


def _limit(size: int) -> None:
    """Limit time and memory of this process, where the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds = math.ceil(used.ru_utime + used.ru_stime) + time_limit(size)[0]
    limits = {resource.RLIMIT_CPU: seconds, resource.RLIMIT_CORE: 0}
    with suppress(OSError), open("/proc/self/statm", encoding="ascii") as statm:  # Linux
        mapped = int(statm.read().split()[0]) * resource.getpagesize()
        limits[resource.RLIMIT_AS] = mapped + 2 * size + largest_content(size) + _WORKSPACE
    for limit, value in limits.items():
        _, highest = resource.getrlimit(limit)
        resource.setrlimit(limit, (value if highest == resource.RLIM_INFINITY else min(value, highest), highest))


def _main() -> None:
    """Read a file from the standard input, and write its content, or what is wrong with it, to the standard output."""
    content = sys.stdin.buffer.read()
    _limit(len(content))
    try:
        groups = content_of(content, with_groups=sys.argv[1:] == ["groups"])
    except Exception as error:  # a damaged file causes many kinds of errors in HDF5
        words = " ".join(str(error).split()) or type(error).__name__
        kind = b"unsafe\n" if isinstance(error, UnsafeError) else b"damaged\n"
        sys.stdout.buffer.write(kind + words.encode("utf-8", "backslashreplace"))
    else:
        sys.stdout.buffer.write(b"content\n")
        send(groups, sys.stdout.buffer.write)
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    _main()

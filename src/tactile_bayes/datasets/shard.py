"""A shard: some records of a data set in one NetCDF file."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.contours.family import FamilyParameter
from tactile_bayes.datasets.generation import Records, directions_of, generate_records
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.datasets.specification_reading import read_text
from tactile_bayes.errors import SpecificationError
from tactile_bayes.mechanics.phases import PHASE_NAMES
from tactile_bayes.mechanics.reachability import SnapOff
from tactile_bayes.record import COLUMNS, LOAD_CELL_UNITS, column_of
from tactile_bayes.rig.parameters import parameter_named
from tactile_bayes.rig.rig_file import ROD_UNITS
from tactile_bayes.tasks import write_atomically

_parsed = lru_cache(maxsize=1)(read_text)
_LONGEST = 9  # largest number of phases in a sweep
PHASE_SEQUENCES = tuple(
    "-".join("AB"[(start + k) % 2] for k in range(length)) for length in range(1, _LONGEST + 1) for start in (0, 1)
)
_EVENTS = {"first_contact": "first contact", "snap_off": "snap-off"}
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable.{:10d}"


class Written(NamedTuple):
    """A shard on disk."""

    file: str
    first: int
    records: int
    bytes: int
    sha256: str
    redrawn: dict[str, int]
    strained: int  # number of records with a sweep in which the strain of the rod exceeds the model
    untouched: int  # number of sweeps without a sample in contact


def shard_file(shard: int) -> str:
    """Return the name of the file of a shard."""
    return f"shard-{shard:06d}.nc"


def file_in(folder: Path, name: str) -> Path:
    """Return the path of a file of a data set, and refuse a link that leads out of its folder."""
    path = folder / name
    if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
        raise SpecificationError(f"{path} is a link to another folder: put the file itself there, or remove the link")
    return path


def write_shard(task: tuple[str, int, str]) -> Written:
    """Generate a shard of a specification, and write it atomically to a folder."""
    text, shard, folder = task
    spec = _parsed(text)
    begin = shard * spec.shard_records
    records = generate_records(spec, begin, min(begin + spec.shard_records, spec.records))
    content = netcdf_of(records_as_dataset(spec, records))
    path = file_in(Path(folder), shard_file(shard))
    with ThreadPoolExecutor(1) as beside:  # during the write to the disk
        digest = beside.submit(_sha256, content)
        with write_atomically(path) as temporary, open(temporary, "wb") as file:
            file.writelines(content)
    size = sum(map(len, content))
    return Written(path.name, begin, records.index.size, size, digest.result(), **records.counts)


def _sha256(content: Iterable[memoryview]) -> str:
    digest = hashlib.sha256()
    for part in content:
        digest.update(part)
    return digest.hexdigest()


def records_as_dataset(spec: Specification, records: Records) -> xr.Dataset:
    """Convert records to the dataset of a shard, with dimensions record, sweep and sample."""
    families = [group.family for group in spec.groups]
    variables: dict[str, Any] = {
        "truth_family": ("record", records.family.astype(np.int16), _flags("family of the contour", families)),
        **_parameters(spec, records),
        **_of_rigs(spec, records.drawn),
        **_of_sweeps(spec, records.sweep),
        **_of_samples(spec, records.sample),
    }
    coords = {
        "record": ("record", records.index.astype(np.int64), {"long_name": "number of the record in the data set"}),
        "sweep": ("sweep", np.arange(spec.sweep_count), {"long_name": "number of the sweep in the record"}),
    }
    attrs = {"title": spec.name, "units": spec.units, "load_cell_frame": spec.frame}
    known = {} if spec.friction is None else {"friction": spec.friction}
    return xr.Dataset(variables, coords, {**attrs, **known, "specification_sha256": spec.sha256})


def _flags(long_name: str, meanings: list[str] | tuple[str, ...], kind: Any = np.int16) -> dict[str, Any]:
    """Attributes of numbers that stand for words, by the CF conventions."""
    words = " ".join(meaning.replace(" ", "_") for meaning in meanings)
    return {"long_name": long_name, "flag_values": np.arange(len(meanings), dtype=kind), "flag_meanings": words}


def _parameters(spec: Specification, records: Records) -> dict[str, tuple[str, Floats, dict[str, str]]]:
    """Parameters of the contours by name; NaN for families without the parameter."""
    found = {}
    for name in dict.fromkeys(name for group in spec.groups for name in group.distributions):
        having = [g for g, group in enumerate(spec.groups) if name in group.distributions]
        values = np.full(records.index.size, np.nan)
        for g in having:
            drawn = records.drawn[f"contours[{g}].{name}"]
            values = np.where(np.isnan(drawn), values, drawn)
        entries = [FAMILIES[spec.groups[g].family].table[name] for g in having]
        side = next((f" of the {side} flank" for side in ("left", "right") if name.startswith(f"{side}_")), "")
        long_name = " or ".join(dict.fromkeys(entry.meaning for entry in entries)) + side
        found[f"truth_contour_{name}"] = "record", values, {"units": _unit(spec, name, entries), "long_name": long_name}
    return found


def _unit(spec: Specification, name: str, entries: list[FamilyParameter]) -> str:
    """Unit of a parameter of several families; "see family" if they differ, and for a flank's a, as in older files."""
    powers = {1: "m", -1: "1/m"} if spec.units == "SI" else {}
    units = {powers.get(entry.length_power, entry.unit) for entry in entries}
    return units.pop() if len(units) == 1 and not (powers and name.endswith("_a")) else "see family"


def _of_rigs(spec: Specification, drawn: Mapping[str, Floats]) -> dict[str, Any]:
    """Numbers of rods and load cells, and deviations from what they state."""
    found = {}
    for key, values in drawn.items():
        table, _, name = key.partition(".")
        entry, words = f"{table}_{name}", name.replace("_", " ")
        if table == "rod":
            unit, long_name = ROD_UNITS[name], f"rod {words}"
        elif table == "load_cell":
            unit, long_name = LOAD_CELL_UNITS[name], f"load cell's {words}"
        elif table == "unknown" and (parameter := parameter_named(name)) is not None:
            entry, unit, long_name = f"truth_{name}", parameter.unit, parameter.meaning
        else:
            continue
        unit = unit if unit == "rad" or spec.units == "SI" else "1"
        found[entry] = ("record", values, {"units": unit, "long_name": long_name})
    return found


def _of_sweeps(spec: Specification, sweep: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    backward, both = directions_of(spec, sweep), ("record", "sweep")
    attrs = _flags("sense of the drive", ("forward", "backward"), np.int8)
    found: dict[str, Any] = {"direction": (both[-backward.ndim :], backward, attrs)}
    for name, values in sweep.items():
        if name == "direction":
            continue
        if name == "phases":
            values = np.array([[PHASE_SEQUENCES.index(word) for word in row] for row in values], dtype=np.int8)
            attrs = _flags("phases of the contact in their order: A tip, B tangential", PHASE_SEQUENCES, np.int8)
        elif name == "snap_off_kind":
            values = values.astype(np.int8)
            attrs = _flags("kind of the snap-off", [kind.name.lower() for kind in SnapOff], np.int8)
        elif name == "largest_strain":
            attrs = {"units": "1", "long_name": "largest bending strain of the rod up to snap-off"}
        elif name in COLUMNS:
            attrs = _described(spec, name)
        else:
            event, words = next((e, w) for e, w in _EVENTS.items() if name.startswith(e))
            what = name.removeprefix(f"{event}_")
            attrs = _described(spec, "base_x" if what == "travel" else what)
            attrs["long_name"] = f"{'way of the base' if what == 'travel' else attrs['long_name']} at {words}"
        found[name if name in COLUMNS else f"truth_{name}"] = (both, values, attrs)
    return found


def _of_samples(spec: Specification, sample: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    dims = ("record", "sweep", "sample")
    first = [name for name in COLUMNS if name in sample]
    found: dict[str, Any] = {}
    for name in (*first, *sorted(set(sample) - set(first))):
        values = sample[name]
        if name == "truth_contact_phase":
            found[name] = (dims, values, _flags("phase of the contact", PHASE_NAMES, np.int8))
        else:
            found[name] = (dims, values.astype(np.float32) if spec.single else values, _described(spec, name))
    return found


def _described(spec: Specification, name: str) -> dict[str, Any]:
    column = column_of(name)
    assert column is not None
    return {"units": column.unit_in(spec.units), "long_name": column.long_name_in(spec.frame)}


# ---- NetCDF of plain numbers: the structure is made once for all files that differ in the numbers only


def netcdf_of(dataset: xr.Dataset) -> list[memoryview]:
    """Return a dataset of numbers as NetCDF 4: HDF5 with dimension scales, as the specification of the format defines,
    made in memory, since HDF5 aborts the process if it cannot write. Equal datasets give equal bytes.
    """
    found = []
    for before, name in _frame(_Template(dataset)):
        found.append(before)
        if name is not None:
            found.append(np.ascontiguousarray(dataset[name].values).reshape(-1).view(np.uint8).data)
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

"""One record of a data set, read or regenerated."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_kind, check_path, check_switch
from tactile_bayes.contours import Contour
from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.datasets.collection import opened
from tactile_bayes.datasets.generation import generate_records
from tactile_bayes.datasets.manifest import read_manifest
from tactile_bayes.datasets.shard import records_as_dataset
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.datasets.specification_reading import read_specification, read_text
from tactile_bayes.errors import ParameterError, SpecificationError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS, COLUMNS, column_of
from tactile_bayes.rig import Rig, make_record


def record(
    source: str | os.PathLike[str] | Mapping[str, Any] | Specification, index: int, *, truth: bool = True
) -> xr.Dataset:
    """Return one record of a data set, as `infer_contour`, `reconstruct` and `write_record` take it.

    Parameters
    ----------
    source : path-like, mapping or Specification
        A folder, from which the record is read; or a specification (a TOML file, or its content), from which it is
        generated with its shard, identical to the last bit.
    index : int
        Number of the record.
    truth : bool
        Whether the `truth_` columns are included.

    Returns
    -------
    xr.Dataset
        The record, with the contour's family and parameters, the rod and the data sheet as attributes.

    Raises
    ------
    SpecificationError
        If the source is neither a data set nor a specification, or the record does not exist yet.
    ParameterError
        If there is no record of that number.
    OSError
        If there is neither a folder nor a file of that name.

    Examples
    --------
    >>> contours = [{"family": "parabola", "a": {"uniform": [0.3, 3.0]}, "q": {"uniform": [0.3, 0.7]}}]
    >>> spec = {"records": 1000, "seed": 1, "contours": contours, "load_cell": {"moment_noise": 0.02}}
    >>> one = record(spec, 917)
    >>> one.sizes["sample"], one.attrs["truth_family"], one.attrs["load_cell_moment_noise"]
    (360, 'parabola', 0.02)
    """
    check_switch("truth", truth)
    manifest = None
    if not isinstance(source, Mapping | Specification):
        folder = check_path("source", source, "give a specification, its file, or the folder of a data set")
        manifest = read_manifest(folder) if folder.is_dir() else None
    if manifest is not None:
        spec = read_text(manifest.specification)
    else:
        spec = source if isinstance(source, Specification) else read_specification(source)
    if isinstance(index, bool) or not isinstance(index, int | np.integer) or not 0 <= index < spec.records:
        raise ParameterError(f"there is no record {index!r}: they are numbered from 0 to {spec.records - 1}")
    if manifest is not None:
        data = opened(folder, manifest)
        if index not in data.indexes["record"]:
            raise SpecificationError(f"record {index} is not there yet: run dataset generate again")
    else:
        begin = int(index) - int(index) % spec.shard_records
        records = generate_records(spec, begin, min(begin + spec.shard_records, spec.records))
        data = records_as_dataset(spec, records)
    return _as_record(spec, data.sel(record=index).load(), truth)


def contour_of(record: xr.Dataset) -> Contour:
    """Return the true contour of a record of a data set, in metres if the record is SI, else in rod lengths.

    Parameters
    ----------
    record : xr.Dataset
        A record from `record`.

    Returns
    -------
    Contour

    Raises
    ------
    ParameterError
        If its attributes do not name a contour.

    Examples
    --------
    >>> contours = [{"family": "circle/parabola", "left_r": 0.5, "right_a": 0.7, "q": 0.4}]
    >>> contour_of(record({"records": 1, "seed": 1, "contours": contours}, 0)).right
    Parabola(a=0.7, q=0.4, x_c=0.0)
    """
    check_kind("record", record, xr.Dataset, "give a record of a data set")
    family = FAMILIES.get(str(record.attrs.get("truth_family")))
    names = [] if family is None else [f"truth_contour_{name}" for name in family.parameters]
    if family is None or not all(name in record.attrs for name in names):
        raise ParameterError(
            "the record's attributes name no contour with all its parameters: take it from a data set, with truth=True"
        )
    return family.contour({name: record.attrs[f"truth_contour_{name}"] for name in family.parameters})


def _as_record(spec: Specification, data: xr.Dataset, truth: bool) -> xr.Dataset:
    count = data.sizes["sample"]
    columns: dict[str, Any] = {
        "sweep": np.repeat(data["sweep"].values, count),
        "direction": np.repeat(np.array(["forward", "backward"])[data["direction"].values], count),
    }
    if not spec.translations:
        columns |= {name: np.repeat(data[name].values, count) for name in ("base_x", "base_y")}
    attrs: dict[str, Any] = {"truth_family": spec.groups[int(data["truth_family"])].family}
    for name, variable in data.data_vars.items():
        name = str(name)
        if variable.dims == ("sweep", "sample"):
            if truth or not name.startswith("truth_"):
                values = variable.values.ravel()
                names = str(variable.attrs.get("flag_meanings", "")).split()
                columns[name] = np.array(names)[values] if names else values.astype(np.float64)
        elif variable.dims == () and name.startswith(("truth_contour_", "load_cell_")) and np.isfinite(variable.values):
            attrs[name] = float(variable)
    if spec.single:
        entries = {n.removeprefix("load_cell_"): v for n, v in attrs.items() if n.startswith("load_cell_")}
        # Readings at the end of the range, which 32 bits have rounded, are moved back to it.
        for name, limit in zip(CHANNELS, LoadCell.from_entries(entries).limit, strict=True):
            with np.errstate(over="ignore"):
                at_limit = np.abs(columns[name]) == np.float32(limit)
            columns[name][at_limit] = np.copysign(limit, columns[name][at_limit])
    attrs |= {f"truth_{name}": float(data[f"truth_{name}"]) for name in spec.unknown}
    if not truth:
        attrs = {name: value for name, value in attrs.items() if not name.startswith("truth_")}
    names = ["flexural_rigidity" if name == "youngs_modulus" else name for name in spec.rod]
    rod = Rod(**{name: float(data[f"rod_{name}"]) for name in names}) if names else None
    known = {name: columns[name] for name in (*COLUMNS, *columns) if name in columns and column_of(name) is not None}
    return make_record(known, Rig(rod=rod, load_cell=LoadCell(frame=spec.frame)), attrs=attrs)

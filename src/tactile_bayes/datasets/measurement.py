"""What load cells and encoders read of many records, each with random numbers of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.datasets.specification import Specification
from tactile_bayes.errors import ParameterError, SpecificationError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.corruption import corrupted_angles, corrupted_loads
from tactile_bayes.record import CHANNELS, turned

__all__ = ["measure"]

Floats = NDArray[np.float64]
Index = NDArray[np.intp]

_HARMLESS: dict[str, tuple[str, int | None]] = {
    **{
        name: (name, None)
        for name in (
            "force_noise",
            "moment_noise",
            "relative_noise",
            "drive_angle_offset",
            "drive_angle_backlash",
            "drive_angle_noise",
        )
    },
    "lever_x": ("lever", 0),
    "lever_y": ("lever", 1),
    **{f"{stem}_{name}": (stem, k) for stem in ("bias", "bias_uncertainty") for k, name in enumerate(CHANNELS)},
}
"""Entries of a data sheet that are possible or not whatever the others are: field, and place in it."""


def measure(spec: Specification, index: Index, drawn: Mapping[str, Floats], sample: dict[str, NDArray[Any]]) -> None:
    """Put what the load cell reads beside the truth."""
    loads = np.stack([sample[f"truth_{name}"] for name in CHANNELS], axis=-1)
    angles = sample["drive_angle"]
    if spec.frame == "turning":
        loads[..., 1], loads[..., 2] = turned(loads[..., 1], loads[..., 2], angles)
        for k, name in enumerate(CHANNELS):
            sample[f"truth_{name}"] = loads[..., k]
    laws = spec.load_cell
    cells = _cells(spec, drawn, index.size)
    readings = np.empty_like(loads)
    direction = np.array([direction for _, direction in spec.sweeps])[:, None]
    encoder = any(name.startswith("drive_angle") for name in laws)
    if encoder:
        sample["truth_drive_angle"], sample["drive_angle"] = angles, np.empty_like(angles)
    for i, (record, cell) in enumerate(zip(index.tolist(), cells, strict=True)):
        rng = np.random.default_rng(np.random.SeedSequence(spec.seed, spawn_key=(record, 1)))
        readings[i] = corrupted_loads(cell, loads[i].reshape(-1, 3), rng).reshape(loads[i].shape)
        if encoder:
            sample["drive_angle"][i] = corrupted_angles(cell, angles[i], direction, rng)
    for k, name in enumerate(CHANNELS):
        sample[name] = np.ascontiguousarray(readings[..., k])


def _cells(spec: Specification, drawn: Mapping[str, Floats], count: int) -> list[LoadCell]:
    """The load cell of every record."""
    columns = {name: drawn[f"load_cell.{name}"] for name in spec.load_cell}
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*(v.tolist() for v in columns.values()), strict=True)]
    try:
        if not rows:
            return [LoadCell()] * count
        differ = {name for name, values in columns.items() if np.any(values != values[0])}
        if differ <= set(_HARMLESS) and all(np.all(np.isfinite(values)) for values in columns.values()):
            return _like(LoadCell.from_entries(rows[0]), rows, differ)
        return [LoadCell.from_entries(row) for row in rows]
    except ParameterError as error:
        raise SpecificationError(f"load_cell: {error}") from error


def _like(first: LoadCell, rows: list[dict[str, float]], differ: set[str]) -> list[LoadCell]:
    """Load cells that differ from the first in entries that are possible by their laws: to check each takes longer than
    to draw its noise."""
    cells = []
    for row in rows:
        cell = object.__new__(LoadCell)
        vars(cell).update(vars(first))
        for name in differ:
            field, place = _HARMLESS[name]
            value = row[name]
            if place is None:
                vars(cell)[field] = value
            else:
                triple = getattr(cell, field)
                vars(cell)[field] = (*triple[:place], value, *triple[place + 1 :])
        cells.append(cell)
    return cells

"""Readings of load cells and encoders for many records, each with its own random numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.datasets.deviations import drifts_of
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.errors import ParameterError, SpecificationError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.blocks import elapsed
from tactile_bayes.load_cell.measurement import corrupted_angles, corrupted_loads
from tactile_bayes.record import CHANNELS, loads_of, turned

_OF_ENCODER = ("drive_angle_offset", "drive_angle_backlash", "drive_angle_noise")
# Entries of a data sheet whose validity does not depend on the others: field, and position in it.
_HARMLESS: dict[str, tuple[str, int | None]] = {
    **{name: (name, None) for name in ("force_noise", "moment_noise", "relative_noise", *_OF_ENCODER)},
    **{f"lever_{axis}": ("lever", k) for k, axis in enumerate("xy")},
    **{f"{stem}_{name}": (stem, k) for stem in ("bias", "bias_uncertainty") for k, name in enumerate(CHANNELS)},
}


class Together:
    """Many generators with the interface of one: the first axis of the result runs over them."""

    def __init__(self, generators: list[np.random.Generator]) -> None:
        self._generators = generators

    def standard_normal(self, shape: tuple[int, ...]) -> Floats:
        return np.stack([one.standard_normal(shape[1:]) for one in self._generators])

    def chisquare(self, degrees_of_freedom: float, shape: tuple[int, ...]) -> Floats:
        return np.stack([one.chisquare(degrees_of_freedom, shape[1:]) for one in self._generators])


def measure(
    spec: Specification,
    noise: list[np.random.Generator],
    built: Mapping[str, Floats],
    sample: dict[str, NDArray[Any]],
    backward: NDArray[np.int8],
) -> None:
    """Add the readings of load cells as built, each record's with its own random numbers; backward is 1, else 0."""
    count = len(noise)
    columns = {key.removeprefix("load_cell."): v for key, v in built.items() if key.startswith("load_cell.")}
    cells, cell_of, scale = _cells(columns, count)
    scale *= built.get("unknown.noise_scale", np.ones(count))[:, None]
    drifts = drifts_of(built, count)
    direction = np.array(["forward", "backward"])[np.broadcast_to(backward, (count, spec.sweep_count))][..., None]
    encoder = any(name.startswith("drive_angle") for name in columns)
    if encoder:
        sample["truth_drive_angle"] = sample["drive_angle"].copy()
    sample |= {name: np.empty_like(sample["drive_angle"]) for name in CHANNELS}
    for rows in spec.blocks(count):
        loads = loads_of({name: sample[name][rows] for name in sample}, "truth_")
        if spec.frame == "turning":
            loads[..., 1], loads[..., 2] = turned(loads[..., 1], loads[..., 2], sample["drive_angle"][rows])
            for k, name in enumerate(CHANNELS):
                sample[f"truth_{name}"][rows] = loads[..., k]
        for number in np.unique(cell_of[rows]):
            its = np.flatnonzero(cell_of[rows] == number)
            cell, some = cells[number], rows[its]
            rng = Together([noise[i] for i in some])
            in_a_row = loads[its].reshape(its.size, -1, 3)
            zeros = 0.0 if drifts is None else drifts[some, None] * elapsed(in_a_row.shape[1])[:, None]
            readings = corrupted_loads(cell, in_a_row, rng, scale[some], zeros=zeros)
            readings = readings.reshape(its.size, *loads.shape[1:])
            for k, name in enumerate(CHANNELS):
                sample[name][some] = readings[..., k]
            if encoder:
                sample["drive_angle"][some] = corrupted_angles(cell, sample["drive_angle"][some], direction[some], rng)


def _cells(columns: dict[str, Floats], count: int) -> tuple[list[LoadCell], Index, Floats]:
    """Return load cells from columns of entries, the index of each record's cell, and factors on noises."""
    scale = np.ones((count, 3))
    if not columns:
        return [LoadCell()], np.zeros(count, dtype=np.intp), scale
    is_finite = all(np.all(np.isfinite(values)) for values in columns.values())
    if is_finite and "relative_noise" not in columns:
        for k, name in enumerate(("moment_noise", "force_noise", "force_noise")):
            if name in columns:
                scale[:, k] = columns[name]
        columns |= {name: np.ones(count) for name in ("moment_noise", "force_noise") if name in columns}
    entries, cell_of = np.unique(np.column_stack(list(columns.values())), axis=0, return_inverse=True)
    rows = [dict(zip(columns, row, strict=True)) for row in entries.tolist()]
    differ = {name for name, values in columns.items() if np.any(values != values[0])}
    try:
        if is_finite and differ <= set(_HARMLESS):
            return _like(LoadCell.from_entries(rows[0]), rows, differ), cell_of, scale
        return [LoadCell.from_entries(row) for row in rows], cell_of, scale
    except ParameterError as error:
        raise SpecificationError(f"load_cell: {error}") from error


def _like(first: LoadCell, rows: list[dict[str, float]], differ: set[str]) -> list[LoadCell]:
    """Make load cells like the first but for valid entries, without a check, which takes longer than the noise."""
    cells = []
    for row in rows:
        fields = dict(vars(first))
        for name in differ:
            field, place = _HARMLESS[name]
            if place is not None:
                entries = list(fields[field])
                entries[place] = row[name]
            fields[field] = row[name] if place is None else tuple(entries)
        cell = object.__new__(LoadCell)
        vars(cell).update(fields)
        cells.append(cell)
    return cells

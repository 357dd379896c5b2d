"""Drives of the sweeps of many records: rotations about pivots, or translations, turned on their way or not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.mechanics.branches.line import lines_through

_ROUNDING = 1e-15


class Drives(NamedTuple):
    """Drives of n sweeps, those of a record side by side."""

    base_x: Floats
    base_y: Floats  # pivots, or where the base begins, shape (n,)
    backward: Flags
    # Drive angles in the sweep frame, shape (n, k), or shares of the drive angle from first contact to snap-off, shape
    # (k,); travels of a base that is carried, in rod lengths, shape (n, k).
    way: Floats
    ends: Floats | None = None  # poses between which the base is carried, shape (n, 2, 3)
    lines: Floats | None = None  # its lines, as `trace` takes them, along which it turns too

    @property
    def travel_share(self) -> Floats:
        """Travel over the way along its lines, shape (n,), of a base that is carried."""
        turn = 0.0 if self.ends is None else self.ends[:, 1, 2] - self.ends[:, 0, 2]
        travel = np.sqrt(self.way[:, -1] ** 2 - turn**2)
        return np.asarray(np.where(turn == 0.0, 1.0, travel / self.way[:, -1]))


def drives_of(spec: Specification, values: Mapping[str, Floats], length: Floats) -> Drives:
    """Return the drives of records. Shapes: values (records,), length (n,)."""
    return _translations(spec, values, length) if spec.translations else _rotations(spec, values, length.size)


def _rotations(spec: Specification, values: Mapping[str, Floats], count: int) -> Drives:
    base_x, base_y = (
        np.stack([values[f"scan.bases[{b}][{axis}]"] for b, _ in spec.sweeps], axis=1).ravel() for axis in (0, 1)
    )
    backward = np.tile([direction == "backward" for _, direction in spec.sweeps], count // spec.sweep_count)
    drive, share = spec.drive, np.linspace(0.0, 1.0, spec.drive.samples)
    if drive.begin is None or drive.end is None:
        way = (1.0 + 2.0 * drive.margin) * share - drive.margin
    else:
        forward = drive.begin + (drive.end - drive.begin) * share
        way = np.where(backward[:, None], np.pi - forward[::-1], forward)
    return Drives(base_x, base_y, backward, way)


def _translations(spec: Specification, values: Mapping[str, Floats], length: Floats) -> Drives:
    def column(name: str) -> Floats:
        each = [values[f"scan.translations[{k}].{name}"] for k in range(spec.sweep_count)]
        return np.stack(each, axis=1).ravel()

    ways = [
        values[f"scan.translations[{k}].{name}"] * (spec.drive.samples - 1 if name == "step" else 1)
        for k, one in enumerate(spec.translations)
        for name in ("travel", "step")
        if name in one
    ]
    turns = [values.get(f"scan.translations[{k}].turn", np.zeros(len(ways[k]))) for k in range(spec.sweep_count)]
    turn, travel = (np.stack(each, axis=1).ravel() for each in (turns, ways))
    heading, angle = column("heading"), column("drive_angle")
    ahead = np.stack([np.cos(heading), np.sin(heading), np.zeros(heading.size)], axis=1)
    ahead[np.abs(ahead) < _ROUNDING] = 0.0
    begin = np.stack([column("base[0]"), column("base[1]"), angle], axis=1)
    steps = travel[:, None] * ahead
    steps[:, 2] = turn
    ends = np.stack([begin, begin + steps], axis=1)
    backward = steps[:, 1] * np.cos(angle) + 0.5 * length * turn < steps[:, 0] * np.sin(angle)
    through = [lines_through(*one, backward=mirrored) for *one, mirrored in zip(ends, length, backward, strict=True)]
    way = np.stack([path.travels[-1] * np.linspace(0.0, 1.0, spec.drive.samples) for path in through])
    return Drives(ends[:, 0, 0], ends[:, 0, 1], backward, way, ends, np.stack([path.lines for path in through]))

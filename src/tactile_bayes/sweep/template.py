"""The template of a record: drive angles without loads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig import Rig, make_record
from tactile_bayes.sweep.drive import Carried, Drive


def blind_angles(drive_step: float) -> Floats:
    """Return drive angles [rad] from before any first contact with an object above the pivot to after any snap-off."""
    return np.arange(np.radians(-30.0), np.radians(210.0) + 1e-9, drive_step)


def record_template(drives: Sequence[Drive], drive_angles: Floats, rod: Rod | None, load_cell: LoadCell) -> xr.Dataset:
    """Return a record of sweeps by every drive, with loads of zero. Its drive angles include the encoder's offset and
    backlash. The angles are of rotations without a grid of their own; drives that carry the base have as many
    samples."""
    parts: dict[str, list[Any]] = {name: [] for name in ("sweep", "direction", "base_x", "base_y", "drive_angle")}
    length = 1.0 if rod is None else rod.length
    sweeps = [sweep for drive in drives for sweep in _sweeps_of(drive, np.sort(drive_angles), length)]
    for sweep, (way, poses) in enumerate(sweeps):
        parts["sweep"].append(np.full(len(poses), sweep))
        parts["direction"].append(np.full(len(poses), way))
        for name, column in zip(("base_x", "base_y", "drive_angle"), poses.T, strict=True):
            parts[name].append(column)
    columns: dict[str, Any] = {name: np.concatenate(values) for name, values in parts.items()}
    columns["drive_angle"] = columns["drive_angle"] + load_cell.misread(columns["direction"])
    loads = {name: np.zeros(columns["sweep"].size) for name in CHANNELS}
    return make_record(columns | loads, Rig(rod=rod, load_cell=LoadCell(frame=load_cell.frame or "fixed")))


def _sweeps_of(drive: Drive, angles: Floats, length: float) -> list[tuple[str, Floats]]:
    """Return direction and poses of each sweep of a drive, at increasing angles if it has no grid of its own."""
    if isinstance(drive, Carried):
        even = np.linspace(0.0, drive.travels[-1], angles.size)
        return [(drive.side(length), drive.at(even if drive.drive_step is None else drive.by(drive.drive_step)))]
    if drive.drive_angles is not None:
        angles = np.array(drive.drive_angles)
    elif drive.drive_step is not None:
        angles = blind_angles(drive.drive_step)
    poses = np.column_stack([*(np.full(angles.size, value) for value in drive.base), angles])
    return [(direction, poses[:: 1 if direction == "forward" else -1]) for direction in drive.directions]

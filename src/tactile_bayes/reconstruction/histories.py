"""Drives of a record with a history: they carry the base, or turn back while the rod is in contact."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.zero_load import quiet_zero_load
from tactile_bayes.numerics.scatter import rough_noise
from tactile_bayes.reconstruction.sides import contact_sides
from tactile_bayes.record import carried_sweeps

_LEAST = 1e-6  # change of the drive angle that is rounding of the record [rad]
_SCATTER = 10.0  # change of the drive angle, over the noise of its readings, that noise does not make


def turned_sweeps(measured: xr.Dataset, load_cell: LoadCell) -> set[int]:
    """Return the sweeps about pivots whose loads depend on the history of the drive, if there is friction."""
    backward = contact_sides(measured, load_cell) < 0.0
    history = drive_histories(measured, backward, load_cell, rubs=True)
    return set(measured.sweep.values[history > 0].tolist()) - set(carried_sweeps(measured))


def drive_histories(measured: xr.Dataset, backward: Flags, load_cell: LoadCell, *, rubs: bool) -> Index:
    """Return the number of each sample's history, shape (samples,), one more than its first sweep; 0 if it has none. A
    sweep that carries the base has its own. If the rod `rubs` on the object, so has a sweep whose drive angle turns
    back, and one that goes back in contact, `backward` against its direction, goes on with the sweep before it."""
    sweep, carried = measured.sweep.values, carried_sweeps(measured)
    found = np.where(np.isin(sweep, carried), sweep + 1, 0)
    if not rubs:
        return found
    goes_back = backward != (measured.direction.values == "backward")
    before: Index | None = None
    for number in dict.fromkeys(sweep[found == 0].tolist()):
        own = np.flatnonzero(sweep == number)
        if before is not None and _goes_on(measured, before, own, backward, goes_back):
            found[before] = found[own] = found[before[0]] or sweep[before[0]] + 1
        elif _turns_back(measured.drive_angle.values[own], load_cell):
            found[own] = number + 1
        before = own
    return found


def least_turn(angle: Floats, load_cell: LoadCell) -> float:
    """Return the change of drive angles [rad] from which a drive turns back, and not the noise of its readings."""
    noise = max(load_cell.drive_angle_noise, load_cell.drive_angle_resolution)
    return max(_LEAST, _SCATTER * noise, _SCATTER * rough_noise(angle) if angle.size > 2 else 0.0)


def _turns_back(angle: Floats, load_cell: LoadCell) -> bool:
    """Return whether a drive turns by more than the noise of its readings both ways."""
    ways = (np.max(np.maximum.accumulate(sense * angle) - sense * angle) for sense in (1.0, -1.0))
    return bool(min(ways) > least_turn(angle, load_cell))


def _goes_on(measured: xr.Dataset, before: Index, own: Index, backward: Flags, goes_back: Flags) -> bool:
    """Return whether a sweep begins in the contact in which the one before it ends."""
    at = [measured[name].values for name in ("base_x", "base_y")]
    if any(place[before[0]] != place[own[0]] for place in at) or backward[before[0]] != backward[own[0]]:
        return False
    if goes_back[own[0]] or not goes_back[before[0]]:
        return bool(goes_back[own[0]])
    return not quiet_zero_load(measured.isel(sample=own))["unloaded"].values[0]

"""Checks of units and signs: loads that no rod of the stated size can have, whatever the contour."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.diagnostics.findings import Finding
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction import contact_sides
from tactile_bayes.record import CHANNELS, frame_of, present_channels, rod_of, to_dimensionless, turned, validate

# Force in EI/L² above which units are doubted: a tangential contact with more is within 0.37 L of the pivot.
_STRONGEST = 100.0
_WEAKEST = 0.02  # largest force in EI/L² below which units are doubted: a rod that lets go has been bent by more
_LONGEST_LEVER = 2.0  # moment over force, in L, above which units are doubted: no contact is further away than L


def unit_and_sign_findings(measured: xr.Dataset, load_cell: LoadCell | None = None) -> tuple[Finding, ...]:
    """Report units and signs of loads that are probably wrong, by a cell or else the record's data sheet.

    Whatever the contour, |m0| ≤ f L, f ≤ 13.8/s1² in EI/L² in tangential contact, and fAy > 0.
    """
    measured = validate(measured)
    cell = load_cell or LoadCell.from_record(measured) or LoadCell()
    present = present_channels(measured)
    if len(present) == len(CHANNELS):
        measured = cell.corrected(measured)
    record = to_dimensionless(measured)
    found: list[Finding] = []
    forces = [record[name].values for name in CHANNELS[1:] if name in present]
    if forces:
        force = np.sqrt(np.sum(np.square(forces), axis=0))
        firm = force > 0.1 * _largest(force)
        found += _of_size(record, measured, force, firm, has_all=len(forces) == 2)
        if len(forces) == 2:
            force_x, force_y = forces
            if frame_of(record) == "turning":
                force_y = turned(force_x, force_y, -record.drive_angle.values)[1]
            if force_y[firm].sum() < -0.5 * np.abs(force_y[firm]).sum():
                found.append(Finding("force sign"))
    if "holding_moment" in present:
        drive = np.where(record.direction.values == "backward", -1.0, 1.0)
        if np.all(contact_sides(measured, cell) == -drive):
            found.append(Finding("moment sign"))
    return tuple(found)


def _of_size(record: xr.Dataset, measured: xr.Dataset, force: Floats, firm: Flags, *, has_all: bool) -> list[Finding]:
    """Report loads that are too large or too small for the rod."""
    unit, largest = rod_of(measured).force_unit, _largest(force)
    stated = f" (with EI/L² = {unit:.3g} N)" if measured.attrs["units"] == "SI" else ""
    if largest > _STRONGEST:
        return [Finding("large loads", largest=f"{largest:.3g}", stated=stated)]
    lever = np.abs(record.holding_moment.values[firm]) / force[firm]
    if has_all and firm.any() and np.median(lever) > _LONGEST_LEVER:
        return [Finding("long lever", lever=f"{np.median(lever):.3g}")]
    if 0.0 < largest < _WEAKEST and has_all:
        return [Finding("small loads", largest=f"{largest:.3g}", stated=stated)]
    return []


def _largest(values: Floats) -> float:
    """Return the 98 % quantile: the largest value, a few outliers left out."""
    return float(np.quantile(values, 0.98))

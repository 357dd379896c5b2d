"""Checks of units and signs: loads that no rod of the stated size can have, whatever the contour."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.checks import check_optional
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.reconstruction import contact_sides
from tactile_bayes.record import CHANNELS, frame_of, present_channels, rod_of, to_dimensionless, turned, validate

# Force in EI/L² above which units are doubted: a tangential contact with more is within 0.37 L of the pivot.
_STRONGEST = 100.0
_WEAKEST = 0.02  # largest force in EI/L² below which units are doubted: a rod that lets go has been bent by more
_LONGEST_LEVER = 2.0  # moment over force, in L, above which units are doubted: no contact is further away than L
# Ending of the messages on loads that are too large or too small for the rod.
CHECK_UNITS = "check the units of the loads, and the rod's length and flexural rigidity."


def check_units_and_signs(measured: xr.Dataset, load_cell: LoadCell | None = None) -> tuple[str, ...]:
    """Check the units and signs of a record's loads, without any assumption on the contour.

    Parameters
    ----------
    measured : xr.Dataset
        A valid record.
    load_cell : LoadCell, optional
        The sensor, in the record's units, whose known errors are corrected first; by default the record's data sheet,
        if any.

    Returns
    -------
    tuple of str
        A message for each unit or sign that is probably wrong; empty if there is none.

    Raises
    ------
    ParameterError
        If the load cell is in another frame than the record's forces.

    Notes
    -----
    The lever arm of the contact force is at most L, so that |m0| ≤ f L with or without friction. In tangential contact
    √f s1 ≤ 2 K(1/2), so that f ≤ 13.8/s1² in EI/L². The object lies above the pivot, so that fAy > 0. These bounds
    follow from the closed solution of the rod in elliptic integrals, see
    `tactile_bayes.mechanics.elastica`.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> record = scan(paper_profile("II", q=0.5)).record
    >>> check_units_and_signs(record)
    ()
    >>> print(check_units_and_signs(record.assign(force_y=-record.force_y))[0])
    force_y is negative in contact, but the object pushes the pivot's support up: its sign is wrong, or the frame.
    """
    check_optional("load_cell", load_cell, LoadCell)
    measured = validate(measured)
    cell = load_cell or LoadCell.from_record(measured) or LoadCell()
    present = present_channels(measured)
    if len(present) == len(CHANNELS):
        measured = cell.corrected(measured)
    record = to_dimensionless(measured)
    found = []
    forces = [record[name].values for name in CHANNELS[1:] if name in present]
    if forces:
        force = np.sqrt(np.sum(np.square(forces), axis=0))
        largest = _largest(force)
        firm = force > 0.1 * largest
        found += _of_size(record, measured, force, firm, has_all=len(forces) == 2)
        if len(forces) == 2 and largest > 0.0:
            force_y = forces[1]
            if frame_of(record) == "turning":
                force_y = turned(forces[0], forces[1], -record.drive_angle.values)[1]
            if force_y[firm].sum() < -0.5 * np.abs(force_y[firm]).sum():
                found.append(
                    "force_y is negative in contact, but the object pushes the pivot's support up: its sign is wrong, "
                    "or the frame."
                )
    if "holding_moment" in present:
        drive = np.where(record.direction.values == "backward", -1.0, 1.0)
        if np.all(contact_sides(measured, cell) == -drive):
            found.append(
                "The holding moment has the sign of contacts on the other side in every sweep (it is positive where "
                "the drive turns counter-clockwise against the object): its sign is wrong, or the directions are, "
                "that is the sense of the drive angle."
            )
    return tuple(found)


def _of_size(record: xr.Dataset, measured: xr.Dataset, force: Floats, firm: Flags, *, has_all: bool) -> list[str]:
    """Return a message on loads that are too large or too small for the rod."""
    unit = rod_of(measured).force_unit
    largest = _largest(force)
    stated = f" (with EI/L² = {unit:.3g} N)" if measured.attrs["units"] == "SI" else ""
    advice = CHECK_UNITS
    if largest > _STRONGEST:
        return [f"Forces reach {largest:.3g} EI/L²{stated}, more than such a rod can carry: {advice}"]
    moment = np.abs(record.holding_moment.values)
    if has_all and firm.any() and np.median(moment[firm] / force[firm]) > _LONGEST_LEVER:
        lever = float(np.median(moment[firm] / force[firm]))
        return [
            f"The holding moment is {lever:.3g} L times the force, but no contact is further from the pivot than L: "
            f"{advice}"
        ]
    if 0.0 < largest < _WEAKEST and has_all:
        return [f"Forces reach {largest:.3g} EI/L²{stated} only, which hardly bends such a rod: {advice}"]
    return []


def _largest(values: Floats) -> float:
    """Return the 98 % quantile: the largest value, a few outliers left out."""
    return float(np.quantile(values, 0.98))

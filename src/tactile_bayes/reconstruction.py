"""Step 2: contact points from a measured record, sample by sample."""

from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.special import chdtri

from tactile_bayes.elastica import PHASE_NAMES, TANGENTIAL, TIP, Contact, contact_from_wrench
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.load_cell import LoadCell, rough_noise
from tactile_bayes.record import CHANNELS, COLUMNS, frame_of, in_frame, present_channels, rod_of, validate
from tactile_bayes.rod import Rod

__all__ = ["FALSE_ALARM", "STATUSES", "contact_sides", "loaded_samples", "reconstruct", "with_rod"]

Floats = NDArray[np.float64]

STATUSES = ("no contact", "no zero of curvature", "ok", "beyond the tip")
"""What can become of a sample: load, a contact, and one beyond the tip take it a step further each."""

FALSE_ALARM = 1e-3
"""Share of unloaded samples that noise makes look loaded."""

_ROUNDING = 1e-9
_KEPT = ("sweep", "direction", "base_x", "base_y", "drive_angle")


def reconstruct(
    measured: xr.Dataset,
    *,
    method: Literal["raw"] = "raw",
    load_cell: LoadCell | None = None,
    rod: Rod | None = None,
    friction: float = 0.0,
) -> xr.Dataset:
    """Contact point, arc length, slope and phase from every sample of a record.

    The raw method takes drive angle, holding moment and forces at their word: equation 26 of Merker et al. 2018, doi
    10.1155/2018/1613945, gives the direction of the force, and the rod touches where its curvature is first zero
    (equation 27). One bad sample never stops the others: `status` says what became of each.

    Parameters
    ----------
    measured : xr.Dataset
        A record with all three load channels.
    method : {"raw"}
        How four numbers that do not quite fit together are turned into a contact.
    load_cell : LoadCell, optional
        Tells noise from load; by default the data sheet that the record carries, if any. A sample is loaded if the sum
        of its squared loads in standard deviations is one that noise alone exceeds in 1 of 1000 samples. Without any
        noise level every sample whose load is not exactly zero counts as loaded. What it says of bias, gain and the
        encoder's offset is taken out first.
    rod : Rod, optional
        In place of the rod that an SI record states.
    friction : float
        Coulomb's coefficient μ of the sliding rod.

    Returns
    -------
    xr.Dataset
        Over "sample", in the units of the record: contact_x, contact_y (on the object's surface), contact_arclength,
        slope_angle, contact_phase ("tip", "tangential", "none"), and status:

        ok
            A contact on the rod.
        no contact
            The sample is not loaded; the rest is NaN.
        no zero of curvature
            No point of the rod on the object's side is free of moment, as a contact must be; the rest is NaN.
        beyond the tip
            The curvature vanishes only beyond the rod's end, at the point that is returned; under noise this is what
            becomes of about half of the tip contacts.

    Raises
    ------
    RecordError
        If `measured` is no record, or misses a load channel.
    ParameterError
        If the method is unknown, or the rod does not fit the record.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> contacts = reconstruct(scan(paper_profile("II", q=0.5)).record)
    >>> on = contacts.status == "ok"
    >>> float(abs(contacts.contact_y - (0.5 * contacts.contact_x**2 + 0.5)).where(on).max()) < 1e-10
    True
    """
    if method != "raw":
        raise ParameterError(f"method is {method!r}: choose 'raw'")
    measured = with_rod(validate(measured), rod)
    absent = [name for name in CHANNELS if name not in present_channels(measured)]
    if absent:
        raise RecordError(
            f"Step 2 needs all of {', '.join(CHANNELS)}, and {', '.join(absent)} was not measured: infer_contour works "
            "without"
        )
    cell = load_cell or LoadCell.from_record(measured) or LoadCell()
    loaded = loaded_samples(measured, cell)
    measured = cell.corrected(measured)
    if frame_of(measured) == "turning":
        measured = in_frame(_without_data_sheet(measured), "fixed")
    rod = rod_of(measured)

    def unit(name: str) -> float:
        scale = COLUMNS[name].scale
        return getattr(rod, scale) if scale else 1.0

    with np.errstate(over="ignore"):  # a load beyond all numbers has no zero of curvature
        moment, force_x, force_y = (np.where(loaded, measured[name].values, 0.0) / unit(name) for name in CHANNELS)
    angle, side = measured.drive_angle.values, contact_sides(measured)
    contact = contact_from_wrench(angle, moment, force_x, force_y, np.arctan(friction), side=side)
    status, phase = _status(contact, loaded)
    x, y = contact.contact_x * rod.length_unit, contact.contact_y * rod.length_unit
    if rod.diameter:
        x -= 0.5 * rod.diameter * np.sin(contact.slope_angle)
        y += 0.5 * rod.diameter * np.cos(contact.slope_angle)
    columns = {
        "contact_x": measured.base_x.values + x,
        "contact_y": measured.base_y.values + y,
        "contact_arclength": contact.contact_arclength * rod.length_unit,
        "slope_angle": contact.slope_angle,
    }
    units = measured.attrs["units"]
    variables = {
        name: ("sample", values, {"units": COLUMNS[name].unit_in(units), "long_name": COLUMNS[name].long_name})
        for name, values in columns.items()
    }
    variables["contact_phase"] = ("sample", phase, {"units": "1", "long_name": "phase of the contact"})
    variables["status"] = ("sample", status, {"units": "1", "long_name": "what became of the sample"})
    kept = measured[list(_KEPT)].drop_attrs(deep=False)
    return kept.assign(variables).assign_attrs(method=method, friction=friction, units=units)


def loaded_samples(measured: xr.Dataset, load_cell: LoadCell | None = None) -> NDArray[np.bool_]:
    """Which samples carry more load than noise explains.

    Parameters
    ----------
    measured : xr.Dataset
        A record.
    load_cell : LoadCell, optional
        In the record's units; by default its data sheet, if any. See `reconstruct` for the rule.

    Returns
    -------
    ndarray of bool, shape (samples,)
    """
    load_cell = load_cell or LoadCell.from_record(measured) or LoadCell()
    present = present_channels(measured)
    readings = np.full((measured.sizes["sample"], len(CHANNELS)), np.nan)
    loaded = np.zeros(len(readings), dtype=bool)
    for index, name in enumerate(CHANNELS):
        if name not in present:
            continue
        if load_cell.unrest[index]:
            readings[:, index] = measured[name].values
        else:
            loaded |= measured[name].values != load_cell.bias[index]
    noisy = int(np.count_nonzero(~np.isnan(readings).all(axis=0)))
    return loaded | (load_cell.surprise(readings) > chdtri(noisy, FALSE_ALARM)) if noisy else loaded


def _without_data_sheet(record: xr.Dataset) -> xr.Dataset:
    """The record without what is said of the noise of its load cell, which holds in one frame only."""
    bare = record.copy()
    bare.attrs = {
        k: v for k, v in record.attrs.items() if k == "load_cell_frame" or not str(k).startswith("load_cell_")
    }
    return bare


def with_rod(record: xr.Dataset, rod: Rod | None) -> xr.Dataset:
    """The record as measured with another rod than the one it states."""
    if rod is None:
        return record
    if record.attrs["units"] == "dimensionless" and not rod.is_dimensionless:
        raise ParameterError(f"the record is dimensionless, so {rod} does not fit it: leave the rod out, or use to_si")
    return record.assign_attrs(
        rod_length=rod.length, rod_flexural_rigidity=rod.flexural_rigidity, rod_diameter=rod.diameter
    )


def contact_sides(record: xr.Dataset) -> Floats:
    """+1 where the object is met as in a forward sweep, −1 as in a backward one, shape (samples,).

    It is the sign of a sweep's total holding moment, so that a drive may also turn back in contact; the direction of
    the drive decides where the moment is missing, or sums to no more than six standard errors of its noise.
    """
    sweep, moment = record.sweep.values, record.holding_moment.values
    side = np.empty(sweep.size)
    order = np.argsort(sweep, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(sweep[order])) + 1):
        of_sweep = moment[rows]
        total = of_sweep.sum()
        if abs(total) > 6.0 * rough_noise(of_sweep) * np.sqrt(rows.size):
            side[rows] = np.sign(total)
        else:
            side[rows] = -1.0 if record.direction.values[rows[0]] == "backward" else 1.0
    return side


def _status(contact: Contact, loaded: NDArray[np.bool_]) -> tuple[NDArray[np.str_], NDArray[np.str_]]:
    found = np.isfinite(contact.contact_arclength)
    with np.errstate(invalid="ignore"):
        beyond = found & (contact.contact_arclength > 1.0 + _ROUNDING)
        # In tangential contact the rod lies along the contour, in tip contact it ends there: which holds more nearly?
        lift = np.abs(np.sin(contact.tip_angle - contact.slope_angle))
        tip = np.abs(1.0 - contact.contact_arclength) < lift
    status = loaded.astype(np.int8) + found + beyond
    phase = found * np.where(tip, np.int8(TIP), np.int8(TANGENTIAL))
    return np.array(STATUSES).take(status), np.array(PHASE_NAMES).take(phase)

"""Step 2: contact points from a measured record, sample by sample."""

from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.stats import chi2

from tactile_bayes.elastica import Contact, contact_from_wrench
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.load_cell import LoadCell, rough_noise
from tactile_bayes.record import CHANNELS, COLUMNS, present_channels, rod_of, to_dimensionless, validate
from tactile_bayes.rod import Rod

__all__ = ["FALSE_ALARM", "STATUSES", "contact_sides", "loaded_samples", "reconstruct", "with_rod"]

Floats = NDArray[np.float64]

STATUSES = ("ok", "no contact", "no zero of curvature", "beyond the tip")
"""What can become of a sample."""

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
        noise level every sample whose load is not exactly zero counts as loaded.
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
    record = to_dimensionless(measured)
    rod = rod_of(measured)
    loaded = loaded_samples(measured, load_cell)
    side = contact_sides(record)
    moment, force_x, force_y = (np.where(loaded, record[name].values, 0.0) for name in CHANNELS)
    contact = contact_from_wrench(record.drive_angle.values, moment, force_x, force_y, np.arctan(friction), side=side)
    status, phase = _status(contact, loaded)
    usable = np.isin(status, ("ok", "beyond the tip"))
    standoff = 0.5 * rod.diameter / rod.length_unit
    columns = {
        "contact_x": record.base_x.values + contact.contact_x - standoff * np.sin(contact.slope_angle),
        "contact_y": record.base_y.values + contact.contact_y + standoff * np.cos(contact.slope_angle),
        "contact_arclength": contact.contact_arclength,
        "slope_angle": contact.slope_angle,
    }
    out = measured[list(_KEPT)].drop_attrs(deep=False)
    for name, values in columns.items():
        column = COLUMNS[name]
        scale = getattr(rod, column.scale) if column.scale else 1.0
        attrs = {"units": column.unit_in(measured.attrs["units"]), "long_name": column.long_name}
        out[name] = ("sample", np.where(usable, values * scale, np.nan), attrs)
    out["contact_phase"] = ("sample", phase, {"units": "1", "long_name": "phase of the contact"})
    out["status"] = ("sample", status, {"units": "1", "long_name": "what became of the sample"})
    return out.assign_attrs(method=method, friction=friction, units=measured.attrs["units"])


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
    surprise, noisy, loaded = np.zeros(measured.sizes["sample"]), 0, np.zeros(measured.sizes["sample"], dtype=bool)
    for name in present_channels(measured):
        deviation = load_cell.standard_deviations[name]
        if deviation > 0.0:
            with np.errstate(over="ignore"):
                surprise += (measured[name].values / deviation) ** 2
            noisy += 1
        else:
            loaded |= measured[name].values != 0.0
    return loaded | (surprise > chi2.isf(FALSE_ALARM, noisy)) if noisy else loaded


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
    side = np.where(record.direction.values == "backward", -1.0, 1.0)
    for sweep in np.unique(record.sweep.values):
        chosen = record.sweep.values == sweep
        moment = record.holding_moment.values[chosen]
        if abs(moment.sum()) > 6.0 * rough_noise(moment) * np.sqrt(moment.size):
            side[chosen] = np.sign(moment.sum())
    return side


def _status(contact: Contact, loaded: NDArray[np.bool_]) -> tuple[NDArray[np.str_], NDArray[np.str_]]:
    found = np.isfinite(contact.contact_arclength)
    with np.errstate(invalid="ignore"):
        beyond = found & (contact.contact_arclength > 1.0 + _ROUNDING)
        # In tangential contact the rod lies along the contour, in tip contact it ends there: which holds more nearly?
        lift = np.abs(np.sin(contact.tip_angle - contact.slope_angle))
        tip = np.abs(1.0 - contact.contact_arclength) < lift
    status = np.select([~loaded, ~found, beyond], ["no contact", "no zero of curvature", "beyond the tip"], "ok")
    phase = np.select([~loaded | ~found, tip], ["none", "tip"], "tangential")
    return status, phase

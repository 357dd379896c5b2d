"""Step 2: contact points from a measured record, sample by sample."""

from __future__ import annotations

import json
from typing import Any, Literal

import numpy as np
import xarray as xr
from scipy.special import chdtrc

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_choice, refused
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.measurement import stated_entries
from tactile_bayes.mechanics.contacts.contact_coordinates import PLACE
from tactile_bayes.mechanics.phases import PHASE_NAMES, TANGENTIAL
from tactile_bayes.mechanics.rods.surface import Surface
from tactile_bayes.reconstruction.axial_score import axial_score
from tactile_bayes.reconstruction.estimate import STATUSES, Estimate, raw_estimate, spread_across
from tactile_bayes.reconstruction.samples import Samples, samples_of
from tactile_bayes.reconstruction.senses import fits_better, of_any_sense, with_likelier_senses
from tactile_bayes.reconstruction.sides import OTHER_SIDE, side_of, sides_and_doubts, with_sides
from tactile_bayes.record import CHANNELS, COLUMNS, present_channels, validate, with_rod
from tactile_bayes.rig.corrected import Corrected, corrected
from tactile_bayes.rig.rig import Rig, rig_of

_METHODS = ("raw", "constrained")
_KEPT = ("sweep", "direction", "base_x", "base_y", "drive_angle")
_PHYSICAL = ("m", "N", "N m", "1/m")  # units of what is dimensionless in a dimensionless record
# Signs by which backward contacts are mirrored: contact point, slope angle and arc length.
_MIRROR = np.array([-1.0, 1.0, -1.0, 1.0])
# Standard deviations from the edge between the phases at which the misfit is χ² with one degree of freedom.
_CLEAR = 3.0


def reconstruct(
    measured: xr.Dataset, rig: Rig | None = None, *, method: Literal["raw", "constrained"] = "raw"
) -> xr.Dataset:
    """Reconstruct contact point, arc length, slope and phase from every sample of a record, with their uncertainty.

    The raw method takes drive angle, holding moment and forces as they are: equation 26 of Merker et al. 2018, doi
    10.1155/2018/1613945, gives the direction of the force, and the contact is the first point without moment (equation
    27). A rod that is not straight or not uniform may be bent both ways: then it is the first or the second such point,
    whichever is nearer to a contact, at the tip or with the rod along the contour. These are four numbers, and a
    contact has three degrees of freedom: the constrained method returns the most likely of the possible contacts, at
    the tip (arc length 1) or along the rod. A bad sample does not affect the others.

    Parameters
    ----------
    measured : xr.Dataset
        A record with all three load channels.
    rig : Rig, optional
        Rod and load cell, by default those that the record states, with the deviations that are known: the record is
        first corrected for them, and for the data sheet's bias, gain and encoder offset. Friction is 0 unless it is
        known. A sample is loaded if its squared Mahalanobis distance from zero load is one that noise alone exceeds in
        1 of 1000 samples, and without any noise level if its load is not exactly zero. A turn of a compliant suspension
        by the error of the moment is neglected.
    method : {"raw", "constrained"}
        How a contact is determined from four noisy numbers.

    Returns
    -------
    xr.Dataset
        Over "sample", in the units of the record: contact_x, contact_y (on the object's surface), contact_arclength,
        slope_angle, contact_phase ("tip", "tangential", "none"), status, and standard deviations to first order in the
        errors of load cell and encoder (NaN without any noise level): contact_x_sd, contact_y_sd with
        contact_xy_correlation, slope_angle_sd, contact_arclength_sd, and tangent_sd and normal_sd, along the contour
        and across it. They include errors that samples share, like an unknown bias, as if they were independent.
        other_contact_x, other_contact_y and other_contact_arclength are those of a second contact, where status is
        "ambiguous" or "either phase", else NaN.

        least_slope_angle and greatest_slope_angle are the ends between which friction leaves the slope, for the force
        as it is read. They equal the slope angle, except where the rod may slide either way or stick: it is carried,
        its drive turns back in contact, or it is curved toward the object. There the ends are two friction angles
        apart, and by the raw method the slope angle is the one for sliding, the other way where that fits clearly
        better, judged for each way of the drive. The constrained one takes the rod to stick where sliding is off by
        more than two standard deviations and the force lies within the cone of friction: such a contact is that of the
        raw method, with the slope of the rod.

        With method="constrained" also misfit, the residual sum of squared deviations in standard deviations, and
        edge_distance, the distance of the contact from the change between tip and tangential contact in standard
        deviations. If the model holds, the misfit follows χ² with one degree of freedom, except within some 2 standard
        deviations of the edge: data between the two phases have two contacts nearby, and data beyond the corner none.
        (In simulations 3 to 6 % of misfits there exceed 3.84, instead of 5 %, and their mean is 0.8 to 1.1.) The
        attributes misfit_sum, misfit_samples and misfit_probability (the probability that noise gives at least this
        sum; NaN if samples share errors) leave out contacts within 3 standard deviations. A probability near 0 means
        that rod, friction or frame are wrong or the noise is larger than stated; near 1, that it is smaller.

        In tangential contact the force along the rod at the pivot follows from the moment, fAx cos φ0 + fAy sin φ0 =
        m0²/2 (− f sin δ with the friction angle δ, − κ0 m0 with the rest curvature κ0). For rods that vary along their
        length the difference is f (sin ψ1 + sin δ), with the angle ψ1 of the rod at the contact from the normal of the
        force by Step 2. Its weighted mean over such samples, in standard errors, is the attribute axial_score: standard
        normal if the model holds, and far below zero with unstated friction.

        status is one of

        ok
            A contact on the rod, with valid standard deviations if rod, noise and friction are as stated; the misfits,
            and not the status, show a wrong one.
        no contact
            The sample is not loaded. Here and in the next two cases the rest is NaN.
        cut off
            A channel is at the end of its range, so that the load was larger.
        no zero of curvature
            The moment does not vanish at any point of the rod on the object's side, as it must at a contact.
        nonlinear
            A contact on the rod, but standard deviations of first order are not valid: the force is below 10 standard
            deviations of its noise, or contacts one standard deviation aside deviate by half of one from the ellipse.
            `infer_contacts` gives the whole posterior, as in the other doubtful cases.
        beyond the tip
            The curvature vanishes only beyond the rod's end, at the point that is returned; under noise this happens to
            about half of the tip contacts. With method="raw" only.
        between phases
            Within 2 standard deviations of the change between tip and tangential contact: the phase is uncertain, and
            standard deviations are not valid. With method="constrained" only.
        either phase
            Tip and tangential contact are both likely, at different points, the one returned at most 20 times as likely
            as the other. With method="constrained" only.
        ambiguous
            The moment of a rod that is not straight or not uniform vanishes at two points, and a contact at either is
            likely, the one returned at most 20 times as likely as the other; without a noise level, neither is nearer
            to a contact by more than a factor of 2.6.
        does not fit
            No contact gives such loads: the misfit is above 25, which noise exceeds in less than one of a million
            samples. Check the rod and the noise. With method="constrained" only.

    Raises
    ------
    RecordError
        If `measured` is not a record, or lacks a load channel.
    ParameterError
        If the method is unknown, the rod does not fit the record, or the constrained method has no noise level.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> record = scan(paper_profile("II", q=0.5)).record
    >>> contacts = reconstruct(record)
    >>> on = contacts.status == "ok"
    >>> float(abs(contacts.contact_y - (0.5 * contacts.contact_x**2 + 0.5)).where(on).max()) < 1e-10
    True
    >>> noisy = LoadCell(force_noise=0.05, moment_noise=0.02).measure(record, rng=1)
    >>> for method in ("raw", "constrained"):
    ...     print(method, float(reconstruct(noisy, method=method).normal_sd.median().round(4)))
    raw 0.0062
    constrained 0.0033
    """
    check_choice("method", method, _METHODS)
    rig = rig_of(rig)
    measured = with_rod(validate(measured), rig.rod)
    cell = rig.load_cell or LoadCell.from_entries(stated_entries(measured))
    return contacts_of(corrected(measured, cell, rig.known), method)


def contacts_of(found: Corrected, method: Literal["raw", "constrained"]) -> xr.Dataset:
    """Return the contacts of a record of a valid rig; see `reconstruct`."""
    measured, cell, friction = found.record, found.load_cell, found.friction
    compliance = found.suspension_compliance
    if compliance * float(np.abs(np.nan_to_num(measured.holding_moment.values)).max()) > 2.0 * np.pi:
        correction = "with such moments the pivot would give way by more than a turn: give radians per moment"
        raise refused("suspension_compliance", compliance, correction)
    measured, doubtful = _with_likelier_sides(measured, cell, compliance, friction)
    samples = samples_of(measured, cell, compliance)
    samples = with_likelier_senses(samples, measured, cell, friction)
    if method == "constrained":
        samples, estimate = of_any_sense(samples, friction)
    else:
        estimate = raw_estimate(samples, samples.friction_angles(friction))
    kept = cell.corrected(measured)[list(_KEPT)].drop_attrs(deep=False)
    contacts = kept.assign(_variables(estimate, samples, measured, friction)).assign_attrs(
        method=method,
        friction=friction,
        units=found.units,
        **({"doubtful_sides": json.dumps(doubtful)} if doubtful else {}),
        **_check(estimate, samples, cell, friction),
    )
    if found.contact_compliance:
        contacts = contacts.assign(_before_it_yielded(contacts, samples, found.contact_compliance))
    if found.units != measured.attrs["units"]:
        for variable in contacts.variables.values():
            if variable.attrs.get("units") in _PHYSICAL:
                variable.attrs["units"] = "1"
    return contacts


def _before_it_yielded(contacts: xr.Dataset, samples: Samples, compliance: float) -> dict[str, xr.DataArray]:
    """Return the places of contacts on an object at rest, which then yields along its normal under the force."""
    sin, cos = np.sin(contacts.slope_angle), np.cos(contacts.slope_angle)
    force_x, force_y = samples.side * samples.reading.loads[:, 1], samples.reading.loads[:, 2]
    way = compliance * samples.rod.force_unit * np.abs(cos * force_y - sin * force_x)
    ways = {"x": way * sin, "y": -way * cos}
    names = [(f"{which}contact_{axis}", axis) for which in ("", "other_") for axis in ways]
    return {name: (contacts[name] + ways[axis]).assign_attrs(contacts[name].attrs) for name, axis in names}


def _with_likelier_sides(
    measured: xr.Dataset, cell: LoadCell, suspension_compliance: float, friction: float
) -> tuple[xr.Dataset, dict[int, str]]:
    """Return the record with the sides of its sweeps stated, and the sides of doubtful sweeps. A doubtful sweep takes
    the side of its direction unless the misfit of the other is clearly smaller."""
    taken: dict[int, str] = {}
    sides, doubtful = sides_and_doubts(_in_channels(measured, cell), cell)
    for sweep in doubtful:
        stated = side_of(measured, sweep)
        part = measured.isel(sample=np.flatnonzero(measured.sweep.values == sweep))
        both = [
            samples_of(with_sides(part, {sweep: side}), cell, suspension_compliance)
            for side in (stated, OTHER_SIDE[stated])
        ]
        taken[sweep] = OTHER_SIDE[stated] if fits_better(both[1], both[0], friction) else stated
    return with_sides(measured, sides | taken), taken


def _in_channels(measured: xr.Dataset, cell: LoadCell) -> xr.Dataset:
    """Return the corrected record, if it has all channels; otherwise it is refused later."""
    return cell.corrected(measured) if len(present_channels(measured)) == len(CHANNELS) else measured


def _variables(estimate: Estimate, samples: Samples, measured: xr.Dataset, friction: float) -> dict[str, Any]:
    """Columns of the result, in the laboratory frame and the record's units."""
    rod, side, units = samples.rod, samples.side, measured.attrs["units"]
    length, unit_of_length = rod.length_unit, COLUMNS["contact_x"].unit_in(units)
    scales = {name: 1.0 if name == "slope_angle" else length for name in PLACE}
    unit_of = {name: "rad" if name == "slope_angle" else unit_of_length for name in PLACE}
    covariance = np.full((side.size, 4, 4), np.nan)
    if estimate.covariance is not None:
        covariance = _covariance_in_lab_frame(estimate.place, estimate.covariance, side, rod.surface)
    spread = dict(zip(PLACE, np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)).T, strict=True))
    place, other = (_in_lab_frame(one, side, rod.surface) for one in (estimate.place, estimate.other))
    tangent, normal = spread_across(covariance, place[:, 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = covariance[:, 0, 1] / (spread["contact_x"] * spread["contact_y"])
    pivots = np.stack([measured.base_x.values, measured.base_y.values], axis=1)
    for one in (place, other):
        one *= list(scales.values())
        one[:, :2] += pivots
    contact, other_contact = (dict(zip(PLACE, one.T, strict=True)) for one in (place, other))
    long_names = {name: COLUMNS[name].long_name for name in PLACE}
    points = ("contact_x", "contact_y", "contact_arclength")
    slopes = zip(("least", "greatest"), _slope_ends(estimate, samples, friction), strict=True)
    columns = [
        *((name, contact[name], unit_of[name], long_names[name]) for name in (*points, "slope_angle")),
        *((f"other_{n}", other_contact[n], unit_of_length, f"{long_names[n]} of the other contact") for n in points),
        ("contact_phase", np.array(PHASE_NAMES)[estimate.phase], "1", "phase of the contact"),
        ("status", np.array(STATUSES)[estimate.status], "1", "what became of the sample"),
        *((f"{n}_sd", spread[n] * scales[n], unit_of[n], f"standard deviation of the {long_names[n]}") for n in PLACE),
        *((f"{end}_slope_angle", of, "rad", f"{end} slope angle that friction allows") for end, of in slopes),
        ("contact_xy_correlation", correlation, "1", "correlation of contact_x and contact_y"),
        ("tangent_sd", tangent * length, unit_of_length, "standard deviation along the contour"),
        ("normal_sd", normal * length, unit_of_length, "standard deviation across the contour"),
    ]
    if estimate.misfit is not None:
        change = "standard deviations from the change of contact phase"
        columns += [
            ("misfit", estimate.misfit, "1", "sum of squared deviations"),
            ("edge_distance", estimate.edge_distance, "1", change),
        ]
    return {name: ("sample", of, {"units": unit, "long_name": what}) for name, of, unit, what in columns}


def _slope_ends(estimate: Estimate, samples: Samples, friction: float) -> Floats:
    """Return the least and the greatest slope that friction allows in the laboratory frame, shape (2, n). The force
    lies within the cone of friction about the contour's normal, at an edge of it if the rod slides."""
    slope, most = estimate.place[:, 2], np.where(samples.is_sure, 0.0, np.arctan(friction))
    ends = np.stack([slope + (samples.sense + way) * most for way in (-1.0, 1.0)])
    return np.sort(samples.side * (ends - samples.rod.surface.half_angle), axis=0)


def _in_lab_frame(place: Floats, side: Floats, surface: Surface) -> Floats:
    """Places on the object's surface in the laboratory frame."""
    x, y, alpha, arclength = surface.on_object(place.T) if surface.radius else place.T
    return np.stack([side * x, y, side * alpha, arclength], axis=-1)


def _covariance_in_lab_frame(place: Floats, covariance: Floats, side: Floats, surface: Surface) -> Floats:
    """Covariance of places on the object's surface in the laboratory frame."""
    if surface.radius:
        shift = np.moveaxis(surface.slopes_on_object(place.T), -1, 0)
        covariance = shift @ covariance @ np.swapaxes(shift, 1, 2)
    covariance = covariance.copy()
    covariance[side < 0.0] *= np.outer(_MIRROR, _MIRROR)
    return covariance


def _check(estimate: Estimate, samples: Samples, cell: LoadCell, friction: float) -> dict[str, float | int]:
    """Sum of the misfits of all samples clear of the edge, its probability, and the axial score."""
    if estimate.misfit is None or estimate.edge_distance is None:
        return {}
    with np.errstate(invalid="ignore"):
        clear = (estimate.edge_distance > _CLEAR) & (np.abs(samples.sense) == 1.0)  # if it sticks, the force fits any
    total, count = float(estimate.misfit[clear].sum()), int(np.count_nonzero(clear))
    shared = cell.drift is not None or any(cell.bias_uncertainty)
    probability = np.nan if shared or not count else float(chdtrc(count, total))
    lying = np.flatnonzero(clear & (estimate.phase == TANGENTIAL))
    score = np.nan if shared or not lying.size else axial_score(samples.take(lying), friction)
    return {"misfit_sum": total, "misfit_samples": count, "misfit_probability": probability, "axial_score": score}

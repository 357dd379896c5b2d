"""The contacts that a posterior of the contour implies, for each of its draws and every sample."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_whole_number
from tactile_bayes.contours import Contour
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contact_posterior.posterior import groups_of_contacts
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.experiment import likelihood_of
from tactile_bayes.inference.parameters.unknowns import RigValues
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.inference.result import contour_draws, library, posterior_draws, record_of
from tactile_bayes.mechanics.contacts.contact_coordinates import PLACE
from tactile_bayes.mechanics.phases import TANGENTIAL
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.record import record_hash, validate
from tactile_bayes.sweep import to_lab_frame

_BLOCK = 200  # number of contours whose paths are traced at a time
# Attributes of the posterior that hold for the contacts, too: of its run, and of its model.
_OF_RUN = ("sampler", "seed", "settings", "data_sha256", "converged", "approximations")
_OF_MODEL = ("family", "friction", "nuisances", "priors")
# Unknowns of the rig by which the rod's slope at the pivot differs from the reading, draw by draw.
_ANGLE_UNKNOWNS = ("drive_angle_offset", "backlash", "suspension_compliance")


def implied_contacts(posterior: xr.DataTree, *, draws: int = 250) -> xr.DataTree:
    """Return the joint posterior of contact point and slope angle at every sample, given the whole record.

    Each draw is one contour with its contacts at all samples; `infer_contacts` uses each sample alone. The difference
    shows how much the rest of the record, and the family, tighten each contact.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`; it holds the record.
    draws : int
        Number of draws of each chain, evenly picked; all if there are fewer. By default those of the group `events`.

    Returns
    -------
    xr.DataTree
        In the layout of `infer_contacts`, in the record's units. Group `posterior`, dimensions (chain, draw, sample):
        contact_x, contact_y (on the object's surface), slope_angle, contact_arclength, drive_angle (the rod's slope at
        the pivot) where the encoder's offset or backlash, or the suspension's compliance was inferred, and tangential
        (1 in tangential contact, 0 in tip contact); NaN where the contour of that draw has no contact, before its first
        contact and after its snap-off. Group `sample_stats`, by sample: contact_probability, the share of draws in
        contact, and tangential_probability, the share of these in tangential contact. Groups `observed_data` and
        `constant_data`: the record.

    Raises
    ------
    InferenceError, ParameterError
        If this is no result of `infer_contour`, or its record is another one; if `draws` is no whole number from 1 up.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, SamplerSettings, infer_contour, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> quick = SamplerSettings(min_ess=100, max_r_hat=1.1)
    >>> posterior = infer_contour(measured, rig=Rig(unknown="nothing"), rng=1, settings=quick)
    >>> implied = implied_contacts(posterior, draws=50)
    >>> [round(float(implied["posterior"][name][..., 20].mean()), 2) for name in ("contact_x", "contact_y")]
    [0.66, 0.72]
    """
    check_whole_number("draws", draws, 1, "give a whole number from 1 up, of draws of each chain")
    record = _checked_record(posterior)
    every = posterior_draws(posterior)
    # `infer_contour` picks the draws of which it keeps events and predictions by the same rule.
    picked = every.isel(draw=evenly_spread(every.sizes["draw"], draws))
    variables = _implied(posterior, record, picked)
    tangential = variables["tangential"]
    number, touched = picked.sizes["chain"] * picked.sizes["draw"], np.isfinite(tangential).sum(axis=(0, 1))
    share = np.nansum(tangential, axis=(0, 1)) / np.where(touched, touched, np.nan)
    stats = {"contact_probability": touched / number, "tangential_probability": share}
    coords = {"chain": picked["chain"].values, "draw": picked["draw"].values, "sample": np.arange(touched.size)}
    tree = xr.DataTree.from_dict(groups_of_contacts(variables, coords, stats, record))
    tree.attrs = {
        **library(),
        **{name: posterior.attrs[name] for name in _OF_RUN + _OF_MODEL if name in posterior.attrs},
        "draws": number,
        "dependence": "a draw is one contour, and its contacts at all samples lie on it",
        "message": f"contacts of {number} contours of the posterior; {posterior.attrs['message']}",
        "units": record.attrs["units"],
    }
    return tree


def _checked_record(posterior: xr.DataTree) -> xr.Dataset:
    """Return the record that a contour was inferred from, with the rod and the load cell that were assumed."""
    contour_draws(posterior)
    record = validate(record_of(posterior))
    if record_hash(record) != posterior.attrs["data_sha256"]:
        raise InferenceError(
            "observed_data and constant_data are not the record that this posterior was inferred from: give the whole "
            "tree, as infer_contour has returned it"
        )
    return record


def _implied(posterior: xr.DataTree, record: xr.Dataset, picked: xr.Dataset) -> dict[str, Floats]:
    """Return the variables of the contacts by name, each of shape (chains, draws, samples)."""
    likelihood, unknowns = likelihood_of(posterior, record)
    inferred, angle = unknowns.names, likelihood.segments.drive_angles
    contours = contours_of(picked, posterior.attrs["family"])
    values = {name: picked[name].values.ravel() for name in inferred}
    parts = []
    for block in blocks(contours.shape[0], 1, _BLOCK):
        rig = unknowns.rig({name: of_draws[block] for name, of_draws in values.items()})
        parts.append(contacts_of(likelihood, contours.take(block), rig, angle))
    shape = (picked.sizes["chain"], picked.sizes["draw"], -1)
    names = [*PLACE, "tangential"]
    if any(name in inferred for name in _ANGLE_UNKNOWNS):
        names.insert(-1, "drive_angle")
    return {name: np.concatenate([part[name] for part in parts]).reshape(shape) for name in names}


def contacts_of(
    likelihood: RecordLikelihood, contours: Contour, rig: RigValues, angle: Floats, *, exact: bool = True
) -> dict[str, Floats]:
    """Return contacts of contours, shape (contours, samples), in the laboratory frame and the record's units.

    Drive angles, shape (samples,), are readings corrected by the data sheet; NaN where no contact is sought. With
    ``exact=False`` the events are found to 1e-6 rad, at a quarter of the cost.
    """
    count, segments = contours.shape[0], likelihood.segments.samples
    travels = np.broadcast_to(likelihood.travels(angle, rig), (count, angle.size))
    most = max(own.size for own in segments)
    samples = np.stack([np.pad(own, (0, most - own.size), constant_values=-1) for own in segments])
    by_segment = np.where(samples >= 0, travels[:, samples], np.nan).swapaxes(0, 1)
    paths = likelihood.paths(contours, rig, exact=exact, drive_angles=by_segment.reshape(-1, most))
    batch_index, rank, states = paths.loaded_states()
    columns = to_lab_frame(paths.sweep_frame, batch_index, states, likelihood.rod)
    columns["tangential"] = (states.wrench.phase == TANGENTIAL).astype(float)
    out = {name: np.full(travels.shape, np.nan) for name in (*PLACE, "drive_angle", "tangential")}
    for name, values in out.items():
        values[batch_index % count, samples[batch_index // count, rank]] = columns[name]
    return out

"""The posterior of every single contact, given its sample alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import check_function, check_whole_number, refused
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.contact_posterior.density import ContactDensity, ContactPrior
from tactile_bayes.inference.contact_posterior.draws import CHAINS, LEAST_DRAWS, MixedDraws, draw_contacts, mixed
from tactile_bayes.inference.densities import LARGEST_K
from tactile_bayes.inference.misfit import NO_LOAD
from tactile_bayes.inference.record_likelihood.shortening import thinned
from tactile_bayes.inference.result import library
from tactile_bayes.load_cell import LoadCell, LoneSamples
from tactile_bayes.mechanics.contacts.contact_coordinates import PLACE
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence, seed_words, spawn
from tactile_bayes.reconstruction import contacts_of, samples_of, with_likelier_senses
from tactile_bayes.record import CHANNELS, frame_of, loads_of, record_hash, validate, with_rod
from tactile_bayes.record.schema import column_attributes
from tactile_bayes.rig.corrected import Corrected, corrected
from tactile_bayes.rig.rig import Rig, rig_of

_MIN_MISFIT_PROBABILITY = 1e-4  # probability of a misfit below which the message reports that the loads do not fit
_MOST_DRAWS = 10**6  # largest number of draws for each sample
# Directions of the force over the angle of friction, and their prior probabilities: mostly a rod slides as the drive
# goes, and an interval of 90 % of the slope, with that at its end, holds only if that is likely.
_SENSES = np.array([1.0, -1.0, -0.8, -0.4, 0.0, 0.4, 0.8])
_OF_SENSES = np.array([0.8, 0.1, 0.02, 0.02, 0.02, 0.02, 0.02])
_ATTRIBUTES = {
    "drive_angle": {"units": "rad", "long_name": "drive angle"},
    "tangential": {"units": "1", "long_name": "whether the contact is tangential"},
}
_DIMS = ("chain", "draw", "sample")


def infer_contacts(
    measured: xr.Dataset,
    rig: Rig | None = None,
    *,
    prior: ContactPrior = "flat",
    rng: Rng,
    draws: int = 1000,
    progress: Callable[[int, int], object] | None = None,
) -> xr.DataTree:
    """Infer the posterior of contact point and slope angle for every loaded sample, from that sample alone.

    Of a record of more than 2,000 samples every so many are taken, as the message says.

    A contact has three degrees of freedom, contact point and slope angle, which determine whether the contact is a tip
    or a tangential one. Both phases are branches of one posterior, which yields their probabilities. If errors are
    small, it is the normal distribution that `reconstruct` with method="constrained" gives; near first contact, phase
    changes and snap-off it is not normal.

    Parameters
    ----------
    measured : xr.Dataset
        A record with all three load channels.
    rig : Rig, optional
        Rod and load cell, by default those that the record states, with the deviations that are known, as in
        `reconstruct`. The full likelihood of the load cell is used, including outliers and resolution. Unknown bias and
        drift, which samples share, count as noise of each sample (and cannot be combined with outliers). A sample with
        a reading at the end of its range is left out: one sample does not determine by how much the load was larger.
    prior : {"flat", "polar"} or callable
        Prior over contact point and slope angle, within the rod's reach and |slope_angle| < π/2; see Notes. A function
        takes arrays contact_x, contact_y (on the object's surface, in the laboratory frame and the record's unit) and
        slope_angle [rad], and returns the logarithm of a density, an array of their shape, −inf where there is no
        contact; it need not be normalised. Flat is lambda x, y, slope: 0 * x.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Random numbers; the same seed gives the same draws of the same samples. One sample more, or less,
        changes the draws of others, too.
    draws : int
        Number of draws for each sample; a multiple of 4, since there are four independent chains. They are importance
        samples of normal approximations on both branches, resampled by weight, with Pareto's k̂ (Vehtari et al. 2024,
        JMLR 25(72)) as certificate; without it, of kernels about the best of them, until they are certified.
    progress : callable, optional
        Called with the number of samples done, and the number of loaded samples.

    Returns
    -------
    xr.DataTree
        In ArviZ's layout. Group `posterior`, dimensions (chain, draw, sample), NaN where a sample has no contact:
        contact_x, contact_y (on the object's surface), slope_angle, contact_arclength, drive_angle where the encoder is
        not exact, all in the record's units, and tangential (1 in tangential contact, 0 in tip contact). Draws of
        different samples are independent. Group `sample_stats`, by sample: tangential_probability, log_evidence (of the
        dimensionless sample under the given prior), pareto_k, effective_draws (of the weights) and converged (k̂ of at
        most 0.7 and 400 effective draws; 0 also without a contact).
        Groups `observed_data` and `constant_data`: the record. Attributes: a `message`, and misfit_probability, as
        `reconstruct` with method="constrained" states it: near 0 if the loads are not those of the rod, so that the
        result does not hold.

    Raises
    ------
    RecordError
        If `measured` is not a valid record, or lacks a load channel.
    ParameterError
        If an option is not valid, or the load cell has no noise on a channel.
    InferenceError
        If no sample carries a load that noise does not explain.

    Notes
    -----
    "flat" is uniform in contact_x, contact_y and slope_angle, "polar" in distance from the pivot, direction and slope.
    If the load is at least ten standard deviations of its noise, the posterior moves by less than a tenth of a standard
    deviation between them. Near first contact the choice matters: contacts with loads near zero lie within a thin shell
    at the end of the rod's reach, to which a flat prior gives little mass, and the posterior of a weak contact shifts
    inwards. tangential_probability is that of each sample under the prior, not a frequency along a sweep. If the drive
    angle is exact, the posterior is a density on a surface, with the prior as the limit of small encoder errors.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> contacts = infer_contacts(measured, rng=1)
    >>> contacts["posterior"].sizes["draw"], int(contacts["sample_stats"].converged.sum())
    (250, 46)
    """
    rig = rig_of(rig)
    measured = with_rod(validate(measured), rig.rod)
    seed = seed_sequence(rng)
    correction = f"give a multiple of {CHAINS}, one share for each chain, and at most {_MOST_DRAWS}"
    if check_whole_number("draws", draws, CHAINS, correction, most=_MOST_DRAWS) % CHAINS:
        raise refused("draws", draws, correction)
    check_function("progress", progress)
    stated = rig.load_cell or LoadCell.from_record(measured)
    if stated is None:
        raise ParameterError(
            "the record carries no data sheet of its load cell: give a Rig(load_cell=LoadCell(force_noise=..., "
            "moment_noise=...)), or LoadCell.from_zero_load(record), which finds the noise in the unloaded samples"
        )
    measured, cell, friction, *compliances, _ = corrected(measured, stated, rig.known)
    if any(compliances):
        raise ParameterError(
            "infer_contacts knows no compliant suspension, and no object that yields: say that suspension_compliance "
            "and contact_compliance are 0"
        )
    measured, cell = thinned(measured, cell)
    density, rows, log_prior = density_of(measured, cell, friction, prior)
    if not rows.size:
        raise InferenceError(NO_LOAD)
    for_draws, for_ways = spawn(seed, 2)
    with threadpool_limits(1):  # the arrays are small: threads would only wait for one another
        found = mixed(
            draw_contacts(density, draws, for_draws, progress), rows, log_prior, np.random.default_rng(for_ways)
        )
        tree = xr.DataTree.from_dict(_groups(measured, density, found))
    chance = float("nan")  # without variances
    if cell.degrees_of_freedom > 2.0:
        chance = float(contacts_of(Corrected(measured, cell, friction), "constrained").attrs["misfit_probability"])
    tree.attrs = {
        **library(),
        "sampler": "importance sampling",
        "seed": seed_words(seed),
        "data_sha256": record_hash(measured),
        "prior": prior if isinstance(prior, str) else getattr(prior, "__name__", repr(prior)),
        "friction": friction,
        "draws": draws,
        "dependence": "samples are independent of one another",
        "converged": int(found.stats["converged"].all()),
        "misfit_probability": chance,
        "message": _message(found.stats["converged"], chance, measured.attrs.get("blocks")),
        "units": measured.attrs["units"],
        "approximations": "; ".join(_approximations(cell)),
    }
    return tree


def density_of(
    measured: xr.Dataset, cell: LoadCell, friction: float, prior: ContactPrior
) -> tuple[ContactDensity, Index, Floats]:
    """Return the density of the loaded samples, with their numbers and the logarithms of their prior probabilities.
    Where a sample may also stick, or slide the other way, it stands there once for each direction of the force."""
    samples = with_likelier_senses(samples_of(measured, cell), measured, cell, friction)
    if cell.degrees_of_freedom <= 2.0:  # proposals take a covariance
        about = samples_of(measured, replace(cell, degrees_of_freedom=np.inf))
        samples = samples._replace(reading=about.reading)
    rod = samples.rod
    units = rod.load_units
    readings = LoneSamples(cell.dimensionless(rod), loads_of(measured) / units)
    base = np.stack([measured.base_x.values, measured.base_y.values], axis=-1)
    turning = frame_of(measured) == "turning"
    loaded = np.flatnonzero(samples.loaded & ~samples.cut_off)
    number = np.where(samples.is_sure[loaded] | (friction == 0.0), 1, _SENSES.size)
    rows = np.repeat(loaded, number)
    which = np.arange(rows.size) - np.repeat(np.cumsum(number) - number, number)
    log_prior = np.where(np.repeat(number, number) > 1, np.log(_OF_SENSES[which]), 0.0)
    readings, base, samples = readings.take(rows), base[rows], samples.take(rows)
    samples = samples._replace(sense=samples.sense * _SENSES[which])
    density = ContactDensity(samples, readings, base, turning=turning, friction=friction, prior=prior)
    return density, rows, log_prior


def _groups(measured: xr.Dataset, density: ContactDensity, found: MixedDraws) -> dict[str, xr.Dataset]:
    points = found.of_ways.points
    coordinates, _ = density.unfold(points)
    columns = dict(zip(PLACE, density.contacts(coordinates), strict=True))
    if density.has_free_angle:
        columns["drive_angle"] = np.where(density.samples.side < 0.0, np.pi - coordinates[..., 3], coordinates[..., 3])
    columns["tangential"] = (points[..., 0] < 0.0).astype(float)
    picked = {name: np.take_along_axis(values, found.picked, -1) for name, values in columns.items()}
    coords = {"chain": np.arange(points.shape[0]), "draw": np.arange(points.shape[1]), "sample": found.samples}
    groups = groups_of_contacts(picked, coords, found.stats, measured)
    stats = groups["sample_stats"]
    return groups | {"sample_stats": stats.assign(converged=stats["converged"].fillna(0.0).astype(np.int8))}


def groups_of_contacts(
    draws: Mapping[str, Floats], coords: Mapping[str, Any], stats: Mapping[str, Floats], record: xr.Dataset
) -> dict[str, xr.Dataset]:
    """Return draws of contacts by name, (chain, draw, sample), numbers of each sample, and the record, as groups."""
    every, units = {"sample": np.arange(record.sizes["sample"])}, record.attrs["units"]
    variables = {name: (_DIMS, v, _ATTRIBUTES.get(name) or column_attributes(name, units)) for name, v in draws.items()}
    of_samples = xr.Dataset(
        {name: ("sample", v, {"units": "1"}) for name, v in stats.items()}, {"sample": coords["sample"]}
    )
    observed = [name for name in ("drive_angle", *CHANNELS) if name in record]
    return {
        "posterior": xr.Dataset(variables, coords).reindex(every),
        "observed_data": record[observed].assign_coords(every),
        "constant_data": record[["sweep", "direction", "base_x", "base_y"]].assign_coords(every),
        "sample_stats": of_samples.reindex(every),
    }


def _message(converged: Floats, chance: float, blocks: str | None) -> str:
    message, failed = f"{converged.size} contacts", np.count_nonzero(converged == 0.0)
    if failed:
        why = f"Pareto's k̂ above {LARGEST_K:g} or fewer than {LEAST_DRAWS:g} effective draws"
        message += f"; not converged: {failed} ({why}), see sample_stats"
    if chance < _MIN_MISFIT_PROBABILITY:
        message += f"; THE LOADS DO NOT FIT (probability {chance:.1g}): are rod, friction, frame and noise right?"
    return message if blocks is None else f"{message}; the record has {blocks}"


def _approximations(cell: LoadCell) -> list[str]:
    approximations = list(cell.approximations)
    if cell.drift is not None or any(cell.bias_uncertainty):
        approximations.append("unknown bias and drift, which samples share, count as noise of each sample")
    if cell.drive_angle_resolution:
        approximations.append("the steps of the drive angle are taken for noise of a twelfth of their square")
    return approximations

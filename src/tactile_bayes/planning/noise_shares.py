"""Shares of the readings' noises in the error of a contact point: Sobol' indices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from scipy import stats

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import check_whole_number
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics.random_numbers import Rng, generator, seed_sequence, seed_words
from tactile_bayes.planning.amplification import (
    METHODS,
    SOURCES,
    Method,
    along_and_across,
    angles_within,
    even_shares,
    event_distances,
)
from tactile_bayes.planning.plan import SAMPLE_COLUMNS, Plan
from tactile_bayes.reconstruction import turned_sweeps
from tactile_bayes.record import COLUMNS, carried_sweeps, travel_unit, travels_of

_ERRORS = ("along", "across")


def noise_shares(
    plan: Plan, *, rng: Rng, samples: int = 1024, states: int = 15, methods: tuple[Method, ...] = METHODS
) -> xr.Dataset:
    """Return the shares of each reading's noise in the variance of a contact's error, as `reconstruct` makes it.

    To first order every share is gain² σ² over the sum of these; shares of sum below one come from interactions.
    """
    if check_whole_number("samples", samples, 2, "give a power of two, like 1024") & (samples - 1):
        raise ParameterError(f"samples is {samples!r}: give a power of two, like 1024")
    record, rows = _states(plan, states)
    chosen = record.isel(sample=rows)
    quiet = plan.certain(chosen)
    noises = {**plan.cell.standard_deviations, "drive_angle": plan.cell.drive_angle_deviation}
    sources = [name for name in SOURCES if noises[name] > 0.0]
    distributions = [_distribution(plan, name, noises[name]) for name in sources]
    shape = (len(methods), quiet.sizes["sample"], len(_ERRORS), len(sources))
    first, total = np.full(shape, np.nan), np.full(shape, np.nan)
    rms, lost = np.full(shape[:3], np.nan), np.full(shape[:2], np.nan)
    seed = seed_sequence(rng)
    for m, method in enumerate(methods):
        evaluated: list[Floats] = []

        def errors(drawn: Floats, method: Method = method, evaluated: list[Floats] = evaluated) -> Floats:
            found = _errors(quiet, plan, method, dict(zip(sources, drawn, strict=True)))
            evaluated.append(found)
            return np.nan_to_num(found).reshape(-1, drawn.shape[1])

        indices = stats.sobol_indices(func=errors, n=int(samples), dists=distributions, rng=generator(seed))
        every = np.concatenate(evaluated, axis=-1)
        missing = np.isnan(every)
        lost[m] = np.mean(missing[:, 0], axis=-1)
        with np.errstate(invalid="ignore"):
            rms[m] = np.sqrt(np.nansum(every**2, axis=-1) / (~missing).sum(axis=-1))
        answered = np.asarray(~np.any(missing, axis=-1))
        for out, index in ((first, indices.first_order), (total, indices.total_order)):
            out[m] = np.where(answered[..., None], index.reshape(shape[1:]), np.nan)
    length, along = {"units": COLUMNS["base_x"].unit_in(quiet.attrs["units"])}, {"units": travel_unit(quiet)}
    dims = ("reconstruction", "sample", "error")
    distances = event_distances(plan, chosen.sweep.values, travels_of(record)[rows])
    return xr.Dataset(
        {
            **chosen[SAMPLE_COLUMNS].data_vars,
            "contact_phase": ("sample", chosen.truth_contact_phase.values),
            **{name: ("sample", far, along) for name, far in distances.items()},
            "share": ((*dims, "source"), first),
            "total_share": ((*dims, "source"), total),
            "rms_error": (dims, rms, length),
            "without_answer": (dims[:2], lost),
        },
        coords={"reconstruction": list(methods), "error": list(_ERRORS), "source": sources},
        attrs={"seed": seed_words(seed), "samples": int(samples)},
    )


def _distribution(plan: Plan, source: str, deviation: float) -> Any:
    """Return the frozen distribution of a reading's noise."""
    nu = plan.cell.degrees_of_freedom
    if source == "drive_angle" or math.isinf(nu):
        return stats.norm(0.0, deviation)
    return stats.t(nu, scale=deviation / math.sqrt(nu / (nu - 2.0)))


def _states(plan: Plan, count: int) -> tuple[xr.Dataset, Index]:
    """Return a record, and its loaded samples at even distances between first contact and snap-off of every sweep."""
    record, sweeps = plan.scan.record, range(len(plan.scan.sweeps))
    carried = {*carried_sweeps(record), *turned_sweeps(record, plan.cell)}
    if carried == set(sweeps):
        is_loaded = record.truth_contact_phase.values != "none"
        loaded = [np.flatnonzero(is_loaded & (record.sweep.values == number)) for number in sweeps]
        rows = [own[(even_shares(count) * own.size).astype(int)] for own in loaded if own.size]
        return record, np.concatenate(rows)
    if carried:
        raise ParameterError(
            "noise_shares takes rotations one way, or drives that carry the base or turn back, not both: plan them one "
            "by one, or leave noise_shares out of the parts"
        )
    angles = [angles_within(plan, number, even_shares(count)) for number in sweeps]
    record = plan.at_angles(np.concatenate(angles)).scan.record
    near = np.array([np.isin(record.drive_angle.values[i], angles[s]) for i, s in enumerate(record.sweep.values)])
    return record, np.flatnonzero(near & (record.truth_contact_phase.values != "none"))


def _errors(quiet: xr.Dataset, plan: Plan, method: Method, noise: dict[str, Floats]) -> Floats:
    """Return errors of contacts along and across the contour, shape (samples, 2, draws); NaN without an answer."""
    draws, samples = next(iter(noise.values())).size, quiet.sizes["sample"]
    many = quiet.isel(sample=np.repeat(np.arange(samples), draws))
    values: dict[str, Any] = {}
    for name, drawn in noise.items():
        values[name] = ("sample", many[name].values + np.tile(drawn, samples), many[name].attrs)
    found = plan.reconstruct(many.assign(values), method)
    x, y = (found[name].values - many[f"truth_{name}"].values for name in ("contact_x", "contact_y"))
    both = np.stack(along_and_across(x, y, many.truth_slope_angle.values))
    return np.asarray(both.reshape(2, samples, draws).swapaxes(0, 1))

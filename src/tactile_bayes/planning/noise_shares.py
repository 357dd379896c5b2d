"""Whose noise it is that a contact point is off by: Sobol' indices over the noises of the readings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from scipy import stats

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_whole_number
from tactile_bayes.errors import ParameterError
from tactile_bayes.planning.amplification import METHODS, SOURCES, Method
from tactile_bayes.planning.plan import Plan

__all__ = ["noise_shares"]

_PLACES = 15
"""Of each sweep, where none are given."""

_ERRORS = ("along", "across")


def noise_shares(
    plan: Plan, *, seed: int, samples: int = 1024, places: int = _PLACES, methods: tuple[Method, ...] = METHODS
) -> xr.Dataset:
    """Shares of the variance of a contact's error that come from each reading's noise (Sobol' 2001).

    Noises of the three channels and of the encoder are independent of one another; the error is what `reconstruct`
    makes of them, however crooked. To first order every share is gain² σ² over the sum of these, and shares sum to one;
    what is missing of one comes from noises acting together, and tells how far first order is from the truth.

    Parameters
    ----------
    plan : Plan
        Its load cell's white noise counts, as if that of every channel were independent of the others and of the load;
        bias and drift do not.
    seed : int
    samples : int
        For each index, a power of two; `samples · (noises + 2)` contacts are reconstructed at each place.
    places : int
        Of each sweep, evenly in drive angle.
    methods : tuple of str

    Returns
    -------
    xr.Dataset
        Over "sample", with sweep, direction and drive_angle [rad], contact_phase, after_first_contact and
        before_snap_off [rad]:

        share (reconstruction, sample, error, source)
            First-order index of the error "along" and "across" the contour; NaN where a sample has no answer for some
            of the noise.
        total_share (reconstruction, sample, error, source)
            With all that the noise does together with others.
        rms_error (reconstruction, sample, error)
            Root mean square of the error [length], of the answers.
        without_answer (reconstruction, sample)
            Share of samples without one.

    Raises
    ------
    ParameterError
        If `samples` is no power of two, or `places` is less than 2.

    Notes
    -----
    By scrambled Sobol' sequences and the estimators of Saltelli et al. (2010), in `scipy.stats.sobol_indices`.
    """
    if check_whole_number("samples", samples, 2, "give a power of two, like 1024") & (samples - 1):
        raise ParameterError(f"samples is {samples!r}: give a power of two, like 1024")
    check_whole_number("places", places, 2)
    chosen = _places(plan, int(places))
    quiet = plan.certain(chosen)
    noises = {**plan.cell.standard_deviations, "drive_angle": plan.cell.drive_angle_deviation}
    sources = [name for name in SOURCES if noises[name] > 0.0]
    laws = [_law(plan, name, noises[name]) for name in sources]
    shape = (len(methods), quiet.sizes["sample"], len(_ERRORS), len(sources))
    first, total = np.full(shape, np.nan), np.full(shape, np.nan)
    rms, lost = np.full(shape[:3], np.nan), np.full(shape[:2], np.nan)
    for m, method in enumerate(methods):
        seen: list[Floats] = []

        def errors(drawn: Floats, method: Method = method, seen: list[Floats] = seen) -> Floats:
            found = _errors(quiet, plan, method, dict(zip(sources, drawn, strict=True)))
            seen.append(found)
            return np.nan_to_num(found).reshape(-1, drawn.shape[1])

        found = first_and_total(errors, laws, int(samples), seed)
        every = np.concatenate(seen, axis=-1)
        missing = np.isnan(every)
        lost[m] = np.mean(missing[:, 0], axis=-1)
        with np.errstate(invalid="ignore"):
            rms[m] = np.sqrt(np.nansum(every**2, axis=-1) / (~missing).sum(axis=-1))
        answered = np.asarray(~np.any(missing, axis=-1))
        for out, index in zip((first, total), found, strict=True):
            out[m] = np.where(answered[..., None], index.reshape(shape[1:]), np.nan)
    length = {"units": "1" if quiet.attrs["units"] == "dimensionless" else "m"}
    dims = ("reconstruction", "sample", "error")
    columns = ("sweep", "direction", "drive_angle", "base_x", "base_y")
    sweeps = plan.scan.sweeps
    events = {
        "after_first_contact": np.array([s.first_contact.drive_angle for s in sweeps]),
        "before_snap_off": np.array([s.snap_off.drive_angle for s in sweeps]),
    }
    return xr.Dataset(
        {
            **{name: ("sample", chosen[name].values, chosen[name].attrs) for name in columns},
            "contact_phase": ("sample", chosen.truth_contact_phase.values),
            **{
                name: ("sample", np.abs(chosen.drive_angle.values - of[chosen.sweep.values]), {"units": "rad"})
                for name, of in events.items()
            },
            "share": ((*dims, "source"), first),
            "total_share": ((*dims, "source"), total),
            "rms_error": (dims, rms, length),
            "without_answer": (dims[:2], lost),
        },
        coords={"reconstruction": list(methods), "error": list(_ERRORS), "source": sources},
        attrs={"seed": int(seed), "samples": int(samples)},
    )


def first_and_total(
    function: Callable[[Floats], Floats], laws: Sequence[Any], samples: int, seed: int
) -> tuple[Floats, Floats]:
    """Sobol' indices of first order and total ones of a function's values, shape (values, laws) each.

    Parameters
    ----------
    function : callable
        From numbers (laws, n) to values (values, n).
    laws : sequence of frozen scipy.stats distribution
        Of independent numbers.
    samples : int
        A power of two.
    seed : int
    """
    found = stats.sobol_indices(func=function, n=samples, dists=laws, rng=np.random.default_rng(seed))
    return np.atleast_2d(found.first_order), np.atleast_2d(found.total_order)  # of one value SciPy gives one row


def _law(plan: Plan, source: str, deviation: float) -> Any:
    nu = plan.cell.degrees_of_freedom
    if source == "drive_angle" or math.isinf(nu):
        return stats.norm(0.0, deviation)
    return stats.t(nu, scale=deviation / math.sqrt(nu / (nu - 2.0)))


def _places(plan: Plan, places: int) -> xr.Dataset:
    """Samples evenly between first contact and snap-off of every sweep."""
    angles = []
    for sweep in plan.scan.sweeps:
        first, snap = sweep.first_contact.drive_angle, sweep.snap_off.drive_angle
        angles.append(first + (snap - first) * (np.arange(places) + 0.5) / places)
    record = replace(plan, drive_angles=np.concatenate(angles)).scan.record
    near = np.array([np.isin(record.drive_angle.values[i], angles[s]) for i, s in enumerate(record.sweep.values)])
    return record.isel(sample=np.flatnonzero(near & (record.truth_contact_phase.values != "none")))


def _errors(quiet: xr.Dataset, plan: Plan, method: Method, noise: dict[str, Floats]) -> Floats:
    """Of contacts, along and across the contour, shape (samples, 2, draws); NaN without an answer."""
    draws, samples = next(iter(noise.values())).size, quiet.sizes["sample"]
    many = quiet.isel(sample=np.repeat(np.arange(samples), draws))
    values: dict[str, Any] = {}
    for name, drawn in noise.items():
        values[name] = ("sample", many[name].values + np.tile(drawn, samples), many[name].attrs)
    found = plan.reconstruct(many.assign(values), method)
    slope = many.truth_slope_angle.values
    x, y = (found[name].values - many[f"truth_{name}"].values for name in ("contact_x", "contact_y"))
    cos, sin = np.cos(slope), np.sin(slope)
    both = np.stack([cos * x + sin * y, cos * y - sin * x])
    return np.asarray(both.reshape(2, samples, draws).swapaxes(0, 1))

"""How good the load cell has to be for a band of some width, and which rod a load cell wants."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import TINY, check_choice, check_kind, check_numbers, check_positive, check_probability
from tactile_bayes.errors import ContourError, ParameterError, ReachError, StrainWarning
from tactile_bayes.mechanics.rod import Rod
from tactile_bayes.planning.expected_band import band_factor, deviation_of_heights, height_slopes, stretches
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.record_information import prior_precision, reading_slopes, record_information
from tactile_bayes.tasks import TaskProgress

__all__ = ["Where", "required_noise", "required_rod"]

Where = Literal["gap", "touched", "everywhere"]

_SEEN = 0.5
"""Share of what the plan's own rod touches that another has to touch."""

_LEAST, _MOST = 1e-6, 1e4
"""Factors on the noise between which the one that is wanted is sought."""


class _Band:
    """The expected width of a plan's band, as a function of a factor on its noise."""

    def __init__(self, plan: Plan, x: Floats, probability: float) -> None:
        model, point = plan.model, plan.point
        self._plan = plan
        self._slopes = height_slopes(model, point, x)
        self._by = reading_slopes(model, point)
        self._prior = np.diag(prior_precision(model))
        self._wide = band_factor(probability)

    def width(self, factor: float) -> float:
        """Mean over places."""
        plan, cell = self._plan, self._plan.with_noise(factor).cell
        told = record_information(plan.model, plan.point, slopes=self._by, load_cell=cell).matrix
        spread = deviation_of_heights(self._slopes, told + self._prior)
        return self._wide * float(spread.mean())


def required_noise(
    plan: Plan, band_width: float | Sequence[float], *, where: Where = "everywhere", probability: float = 0.95
) -> xr.Dataset:
    """Noise of the load cell at which the expected band is as narrow as is wanted.

    Force and moment keep the proportion that the plan's load cell has, and all else about it stays.

    Parameters
    ----------
    plan : Plan
    band_width : float or sequence of float
        Mean width of the pointwise band [length].
    where : {"everywhere", "gap", "touched"}
    probability : float
        Of the band.

    Returns
    -------
    xr.Dataset
        Over "band_width": noise_factor, over what the plan's load cell has; force_noise and moment_noise [N, N m, or
        EI/L², EI/L]; infinite where the priors alone give such a band. Numbers: present_width, of the plan as it is,
        and prior_width, without any record.

    Raises
    ------
    ParameterError
        If a width is not positive, or no noise is small enough for it.
    """
    check_kind("plan", plan, Plan, "give a Plan")
    check_probability("probability", probability)
    several = band_width if np.iterable(band_width) else [band_width]
    wanted = check_numbers("band_width", several, "give a positive length, or several", shape=(None,), least=TINY)
    band = _Band(plan, _places(plan, where), probability)
    least, most = band.width(_LEAST), band.width(_MOST)
    if np.any(wanted <= least):
        raise ParameterError(
            f"a band of {wanted.min():g} cannot be had with any noise: without noise at all it would be {least:.3g} "
            "wide, by what is not known of the rig; give tighter priors, or leave out nuisances"
        )
    factors = [
        math.inf
        if width >= most
        else math.exp(
            brentq(lambda log, width=width: band.width(math.exp(log)) - width, math.log(_LEAST), math.log(_MOST))
        )
        for width in wanted
    ]
    unit = {"units": "1" if plan.record.attrs["units"] == "dimensionless" else "m"}
    si = plan.record.attrs["units"] != "dimensionless"
    cell = plan.cell
    return xr.Dataset(
        {
            "noise_factor": ("band_width", np.array(factors)),
            "force_noise": (
                "band_width",
                np.array(factors) * cell.force_noise,
                {"units": "N" if si else "EI/L²"},
            ),
            "moment_noise": (
                "band_width",
                np.array(factors) * cell.moment_noise,
                {"units": "N m" if si else "EI/L"},
            ),
            "present_width": ((), band.width(1.0), unit),
            "prior_width": ((), most, unit),
        },
        coords={"band_width": ("band_width", wanted, unit)},
        attrs={
            "where": where,
            "probability": probability,
            "present_force_noise": cell.force_noise,
            "present_moment_noise": cell.moment_noise,
        },
    )


def required_rod(
    plan: Plan,
    *,
    lengths: Sequence[float],
    diameters: Sequence[float],
    youngs_modulus: float,
    elastic_strain: float,
    where: Where = "everywhere",
    probability: float = 0.95,
    progress: Callable[[TaskProgress], object] | None = None,
) -> xr.Dataset:
    """Which rod a load cell wants: the expected band of every length and diameter, and whether the rod bears it.

    A thicker rod makes larger loads, which drown in less noise, and is bent closer to its elastic limit. The object and
    the pivot stay where they are.

    Parameters
    ----------
    plan : Plan
        In SI units, with a load cell; its rod is one to compare with.
    lengths, diameters : sequence of float
        Of rods of solid circular cross-section [m].
    youngs_modulus : float
        [Pa].
    elastic_strain : float
        Bending strain that the material takes without staying bent: about 0.005 for spring steel, 0.05 for nitinol.
    where, probability
        As in `required_noise`.
    progress : callable, optional
        Is given a `TaskProgress` after each rod.

    Returns
    -------
    xr.Dataset
        Over "length" and "diameter" [m]: width, the mean width of the expected band where the plan's own rod touches,
        or leaves a gap [m]; strain, the largest on the way to the snap-offs; status, "ok", "bent too far", "touches
        little" (less than half of what the plan's own rod does, gap included, so that the band is the family's affair
        alone), "does not reach" or "cannot be swept". Numbers: best_length, best_diameter and best_width of the
        rod with the narrowest band that is "ok"; NaN where none is.

    Raises
    ------
    ParameterError
        If the plan is not in SI units or states no load cell, or a length, a diameter, the modulus or the strain is not
        positive.
    """
    check_kind("plan", plan, Plan, "give a Plan")
    check_probability("probability", probability)
    check_positive("elastic_strain", elastic_strain)
    if plan.rod is None or plan.rod.is_dimensionless or plan.load_cell is None:
        raise ParameterError(
            "a rod is sought for a load cell in N and N m: give a plan with a rod in SI, and a load_cell"
        )
    x = _places(plan, where)
    sides = {
        name: check_numbers(
            f"{name}s", np.atleast_1d(values), "give a list of positive numbers [m]", shape=(None,), least=TINY
        )
        for name, values in (("length", lengths), ("diameter", diameters))
    }
    shape = (sides["length"].size, sides["diameter"].size)
    width, strain = np.full(shape, np.nan), np.full(shape, np.nan)
    status = np.full(shape, "", dtype="U16")
    began = time.monotonic()
    for done, (i, j) in enumerate(np.ndindex(shape), start=1):
        rod = Rod.circular(float(sides["length"][i]), float(sides["diameter"][j]), youngs_modulus, elastic_strain)
        width[i, j], strain[i, j], status[i, j] = _judged(replace(plan, rod=rod), elastic_strain, x, probability)
        if progress is not None:
            progress(TaskProgress(done, width.size, done, time.monotonic() - began))
    usable = np.where(status == "ok", width, np.inf)
    best = np.unravel_index(int(np.argmin(usable)), shape)
    found = bool(np.isfinite(usable[best]))
    metres = {"units": "m"}
    return xr.Dataset(
        {
            "width": (("length", "diameter"), width, metres),
            "strain": (("length", "diameter"), strain),
            "status": (("length", "diameter"), status),
            "best_length": ((), sides["length"][best[0]] if found else np.nan, metres),
            "best_diameter": ((), sides["diameter"][best[1]] if found else np.nan, metres),
            "best_width": ((), width[best] if found else np.nan, metres),
        },
        coords={name: (name, values, metres) for name, values in sides.items()},
        attrs={"where": where, "probability": probability, "elastic_strain": elastic_strain},
    )


def _judged(plan: Plan, elastic_strain: float, x: Floats, probability: float) -> tuple[float, float, str]:
    """Width of the band and largest strain, NaN where there are none, and what speaks for or against a plan's rod."""
    strain = math.nan
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StrainWarning)
            strain = max(sweep.largest_strain for sweep in plan.scan.sweeps)
            width = _Band(plan, x, probability).width(1.0)
    except ReachError:
        return math.nan, strain, "does not reach"
    except (ContourError, ParameterError):
        return math.nan, strain, "cannot be swept"
    if strain > elastic_strain:
        return width, strain, "bent too far"
    arcs = stretches(plan.scan)
    seen = np.mean((x >= arcs[0].begin) & (x <= arcs[-1].end))
    return width, strain, "ok" if seen >= _SEEN else "touches little"


def _places(plan: Plan, where: Where) -> Floats:
    """Values of x."""
    check_choice("where", where, ("everywhere", "gap", "touched"))
    places = [stretch.x for stretch in stretches(plan.scan) if where in ("everywhere", stretch.name)]
    if not places:
        raise ParameterError("the sweeps leave no gap: ask for the band where the contour is touched")
    return np.concatenate(places)

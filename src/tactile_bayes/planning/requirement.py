"""Requirements: the noise of the load cell for a band of given width, and the rod for a load cell."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Literal

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import (
    TINY,
    check_choice,
    check_function,
    check_kind,
    check_numbers,
    check_positive,
    check_probability,
)
from tactile_bayes.errors import ContourError, ParameterError, ReachError, StrainWarning
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.planning.expected_band import band_factor, deviation_of_heights, height_slopes, stretches
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.record_information import prior_precision, record_information
from tactile_bayes.tasks import TaskProgress

Where = Literal["gap", "touched", "everywhere"]

_LEAST_TOUCHED = 0.5  # least share of the grid points of the plan's own rod that another rod must touch
_LEAST, _MOST = 1e-6, 1e4  # range of factors on the noise in which the required one is sought


def _width_by_noise(plan: Plan, x: Floats, probability: float) -> Callable[[float], float]:
    """Return the expected mean width of a plan's band over grid points [length], as a function of a noise factor."""
    model, point = plan.model, plan.point
    slopes, prior, wide = height_slopes(model, point, x), prior_precision(model), band_factor(probability)

    def width(factor: float) -> float:
        cell = plan.with_noise(factor).cell
        gained = record_information(model, point, slopes=plan.reading_slopes, load_cell=cell).matrix
        return wide * float(deviation_of_heights(slopes, gained + prior).mean())

    return width


def required_noise(
    plan: Plan, band_width: float | Sequence[float], *, where: Where = "everywhere", probability: float = 0.95
) -> xr.Dataset:
    """Return the noise of the load cell at which the expected band has a given width.

    The ratio of force noise to moment noise and all other properties of the plan's load cell stay.

    Parameters
    ----------
    plan : Plan
        The plan whose noise is scaled, and whose contour, drive, rod and unknowns are kept.
    band_width : float or sequence of float
        Mean width of the pointwise band [length].
    where : {"everywhere", "gap", "touched"}
        Part of the contour over which the width is averaged.
    probability : float
        Probability of the band, in (0, 1).

    Returns
    -------
    xr.Dataset
        Over "band_width": noise_factor, relative to the plan's load cell; force_noise and moment_noise [N, N m, or
        EI/L², EI/L]; infinite if the priors alone give such a band. Scalars: present_width, of the plan as it is,
        and prior_width, without any record [length].

    Raises
    ------
    ParameterError
        If a width is not positive, no noise is small enough for it, or the sweeps leave no gap and `where` is "gap".

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> from tactile_bayes.planning import Plan
    >>> from tactile_bayes.rig import Rig
    >>> plan = Plan(paper_profile("II", q=0.5), Rig(unknown="nothing"))
    >>> required_noise(plan, [0.001, 0.002])["noise_factor"].diff("band_width").item() > 0.0
    True
    """
    check_kind("plan", plan, Plan, "give a Plan")
    check_probability("probability", probability)
    wanted = _lengths("band_width", band_width)
    width_at = _width_by_noise(plan, _grid_points(plan, where), probability)
    least, most = width_at(_LEAST), width_at(_MOST)
    if np.any(wanted <= least):
        raise ParameterError(
            f"no noise gives a band of {wanted.min():g}: without any it would be {least:.3g} wide, by the unknowns "
            "of the rig; give tighter distributions, or state more of it as known"
        )

    def factor_for(width: float) -> float:
        if width >= most:
            return math.inf
        return math.exp(brentq(lambda log: width_at(math.exp(log)) - width, math.log(_LEAST), math.log(_MOST)))

    factors = np.array([factor_for(width) for width in wanted])
    si, cell = plan.record.attrs["units"] != "dimensionless", plan.cell
    unit = {"units": "m" if si else "1"}
    return xr.Dataset(
        {
            "noise_factor": ("band_width", factors),
            "force_noise": ("band_width", factors * cell.force_noise, {"units": "N" if si else "EI/L²"}),
            "moment_noise": ("band_width", factors * cell.moment_noise, {"units": "N m" if si else "EI/L"}),
            "present_width": ((), width_at(1.0), unit),
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
    """Return the expected band of rods of every length and diameter, whether they stay elastic, and the best rod.

    The object and the pivot stay where they are.

    Parameters
    ----------
    plan : Plan
        A plan in SI units, with a load cell; its rod is the reference.
    lengths, diameters : sequence of float
        Dimensions of rods of solid circular cross-section [m].
    youngs_modulus : float
        Young's modulus [Pa].
    elastic_strain : float
        Largest elastic bending strain of the material: about 0.005 for spring steel, 0.05 for nitinol.
    where, probability
        As in `required_noise`.
    progress : callable, optional
        Called with a `TaskProgress` after each rod.

    Returns
    -------
    xr.Dataset
        Over "length" and "diameter" [m]: width, the mean width of the expected band over the part of the contour that
        the plan's own rod touches, or leaves as a gap [m]; strain, the largest one up to the snap-offs; status, "ok",
        "bent too far", "touches little" (less than half of what the plan's own rod does, gap included, so that the
        family alone determines the band), "does not reach" or "cannot be swept". Scalars: best_length, best_diameter
        and best_width of the rod with the narrowest band that is "ok" [m]; NaN if none is.

    Raises
    ------
    ParameterError
        If the plan is not in SI units or states no load cell, or a length, a diameter, the modulus or the strain is not
        positive.

    Examples
    --------
    >>> from tactile_bayes.contours import Parabola
    >>> from tactile_bayes.load_cell import LoadCell
    >>> from tactile_bayes.planning import Plan
    >>> from tactile_bayes.rig import Rig
    >>> rod, cell = Rod.circular(0.2, 0.7e-3, 206e9), LoadCell(force_noise=3e-3, moment_noise=0.25e-3)
    >>> plan = Plan(Parabola(2.5, q=0.1), Rig(rod, cell, unknown="nothing"))
    >>> steel = {"youngs_modulus": 206e9, "elastic_strain": 0.005}
    >>> required_rod(plan, lengths=[0.2], diameters=[0.7e-3], **steel)["status"].item()
    'bent too far'
    """
    check_kind("plan", plan, Plan, "give a Plan")
    check_probability("probability", probability)
    check_positive("elastic_strain", elastic_strain)
    check_function("progress", progress)
    if plan.rod.is_dimensionless or plan.rig.load_cell is None:
        raise ParameterError(
            "a rod is sought for a load cell in N and N m: give a plan of a rig with a rod in SI, and a load_cell"
        )
    x = _grid_points(plan, where)
    tried = {"length": _lengths("lengths", lengths), "diameter": _lengths("diameters", diameters)}
    sizes = list(product(*(values.tolist() for values in tried.values())))
    judged: list[tuple[float, float, str]] = []
    began = time.monotonic()
    for length, diameter in sizes:
        rod = Rod.circular(length, diameter, youngs_modulus, elastic_strain)
        other = replace(plan, rig=replace(plan.rig, rod=rod))
        judged.append(_judged(other, elastic_strain, x, probability))
        if progress is not None:
            progress(TaskProgress(len(judged), len(sizes), len(judged), time.monotonic() - began))
    usable = [width if status == "ok" else math.inf for width, _, status in judged]
    best = int(np.argmin(usable))
    best_of = (*sizes[best], usable[best]) if math.isfinite(usable[best]) else (math.nan,) * 3
    metres = {"units": "m"}
    shape = [values.size for values in tried.values()]
    width, strain, status = ((tuple(tried), np.reshape(of, shape)) for of in zip(*judged, strict=True))
    return xr.Dataset(
        {
            "width": (*width, metres),
            "strain": strain,
            "status": status,
            **{f"best_{name}": ((), of, metres) for name, of in zip((*tried, "width"), best_of, strict=True)},
        },
        coords={name: (name, values, metres) for name, values in tried.items()},
        attrs={"where": where, "probability": probability, "elastic_strain": elastic_strain},
    )


def _judged(plan: Plan, elastic_strain: float, x: Floats, probability: float) -> tuple[float, float, str]:
    """Return width of the band, largest strain (NaN if unknown), and status of a plan's rod."""
    strain = math.nan
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StrainWarning)
            strain = max(sweep.largest_strain for sweep in plan.scan.sweeps)
            width = _width_by_noise(plan, x, probability)(1.0)
    except ReachError:
        return math.nan, strain, "does not reach"
    except (ContourError, ParameterError):
        return math.nan, strain, "cannot be swept"
    if strain > elastic_strain:
        return width, strain, "bent too far"
    arcs = stretches(plan.scan)
    touched = np.mean((x >= arcs[0].begin) & (x <= arcs[-1].end))
    return width, strain, "ok" if touched >= _LEAST_TOUCHED else "touches little"


def _lengths(name: str, values: float | Sequence[float]) -> Floats:
    """Return positive lengths, of which one may stand alone."""
    several = values if np.iterable(values) else [values]
    return check_numbers(name, several, "give a positive length, or several", shape=(None,), least=TINY)


def _grid_points(plan: Plan, where: Where) -> Floats:
    """Return grid points of x on a part of the contour."""
    check_choice("where", where, ("everywhere", "gap", "touched"))
    grid = [stretch.x for stretch in stretches(plan.scan) if where in ("everywhere", stretch.name)]
    if not grid:
        raise ParameterError("the sweeps leave no gap: ask for the band where the contour is touched")
    return np.concatenate(grid)

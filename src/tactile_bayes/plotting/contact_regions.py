"""Contacts with their uncertainty: first-order ellipses, and regions of a posterior."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from scipy.special import chdtri

from tactile_bayes.arrays import Index
from tactile_bayes.checks import check_probability
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.plotting.axes import axes_for, checked_samples, plot
from tactile_bayes.plotting.labels import percent
from tactile_bayes.plotting.legends import legend_entry
from tactile_bayes.plotting.maps import finish_map, fit_height, outline
from tactile_bayes.plotting.marks import PALETTE, PHASES, TRUTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Ellipse

    from tactile_bayes.contours.base import Contour

_DRAWN = 12
_MIDDLE: dict[str, Any] = {"marker": "+", "markersize": 5.0, "zorder": 3}


@plot("no sample has an ellipse, or the probability is not in (0, 1)")
def contact_ellipses(
    contacts: xr.Dataset,
    *,
    probability: float = 0.9,
    samples: Sequence[int] | None = None,
    truth: Contour | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw contact points of `reconstruct` with first-order ellipses of a given probability.

    Parameters
    ----------
    contacts : xr.Dataset
        From `reconstruct`, with standard deviations, or from `contact_moments`.
    probability : float
        Probability of each ellipse, in (0, 1).
    samples : sequence of int, optional
        Numbers of the samples, of which those without a contact are left out; by default a dozen, evenly spread, of
        those whose status is "ok", or whose draws are all in contact.
    truth : Contour, optional
        The true contour, in the units of the contacts.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, reconstruct, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> contact_ellipses(reconstruct(measured)).get_ylabel()
    '$y$ [$L$]'
    """
    check_probability("probability", probability)
    numbers = checked_samples(samples)
    if not (isinstance(contacts, xr.Dataset) and "contact_x_sd" in contacts):
        raise ParameterError(
            "this is no result of reconstruct: give what it returned; contact_regions draws posteriors"
        )
    if numbers is not None and not np.isin(numbers, np.arange(contacts.sizes["sample"])).all():
        raise ParameterError(f"samples are numbered from 0 to {contacts.sizes['sample'] - 1}: give some of these")
    spread_x, spread_y = contacts["contact_x_sd"].values, contacts["contact_y_sd"].values
    has = np.isfinite(spread_x) & np.isfinite(spread_y)
    chosen = _spread(has, has & is_certain(contacts), numbers)
    if not chosen:
        raise ParameterError(
            "no contact here has a standard deviation: reconstruct with a load cell that states its noise, and choose "
            "samples that are in contact"
        )
    own, ax = ax is None, axes_for(ax, truth)
    radius, phase = radius_of(probability), contacts["contact_phase"].values
    x, y = contacts["contact_x"].values, contacts["contact_y"].values
    for i in chosen:
        colour = PALETTE[phase[i]]
        ax.add_patch(ellipse_of(contacts, i, radius, fill=False, edgecolor=colour, linewidth=1.0))
        ax.plot(x[i], y[i], color=colour, **_MIDDLE)
    return _finished(ax, contacts, phase[chosen], f"{percent(probability)} ellipse", truth, own)


@plot("no sample has a contact, or the probability is not in (0, 1)")
def contact_regions(
    posterior: xr.DataTree,
    *,
    probability: float = 0.9,
    samples: Sequence[int] | None = None,
    truth: Contour | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw highest-density regions of contact points from the draws of `infer_contacts`.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contacts` or `implied_contacts`.
    probability : float
        Probability of each region, in (0, 1).
    samples : sequence of int, optional
        Labels of samples in the coordinate "sample", of which those without a contact are left out; by default a dozen
        of those with one, evenly spread. A region has the colour of its more probable phase.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, infer_contacts, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> contact_regions(infer_contacts(measured, draws=400, rng=1)).get_ylabel()
    '$y$ [$L$]'
    """
    from tactile_bayes.inference.result import contact_draws
    from tactile_bayes.uncertainty.contact_moments import LEAST_DRAWS
    from tactile_bayes.uncertainty.contact_region import contact_region

    check_probability("probability", probability)
    numbers = checked_samples(samples)
    draws = contact_draws(posterior)
    x, y = (draws[name].median(("chain", "draw")).values for name in ("contact_x", "contact_y"))
    tangential = draws["tangential"].mean(("chain", "draw")).values
    has = draws["contact_x"].notnull().sum(("chain", "draw")).values >= LEAST_DRAWS
    labels = draws["sample"].values
    if numbers is not None:
        absent = np.setdiff1d(numbers, labels)
        if absent.size:
            raise ParameterError(f"there is no sample {absent[0]}: the posterior has {labels.min()} to {labels.max()}")
        numbers = np.flatnonzero(np.isin(labels, numbers))
    chosen = _spread(has, has, numbers)
    if not chosen:
        raise ParameterError("no sample here has a contact: choose others")
    own, ax = ax is None, axes_for(ax, truth)
    phase = np.where(tangential > 0.5, "tangential", "tip")
    corners: list[Any] = []
    for i in chosen:
        region = contact_region(draws, int(labels[i]), probability)
        grid_x, grid_y, density = region.grid()
        lines = ax.contour(grid_x, grid_y, density, levels=[region.level], colors=[PALETTE[phase[i]]], linewidths=1.0)
        lines.sticky_edges.x[:], lines.sticky_edges.y[:] = [], []  # the grid's edges would cut regions off
        corners.extend(line for path in lines.get_paths() for line in path.to_polygons(closed_only=False))
        ax.plot(x[i], y[i], color=PALETTE[phase[i]], **_MIDDLE)
    ax.dataLim.update_from_data_xy(np.concatenate(corners), ignore=True)  # limits of the outlines, not of the grids
    return _finished(ax, draws, phase[chosen], f"{percent(probability)} region", truth, own)


def ellipse_of(
    contacts: xr.Dataset, sample: int, radius: float, centre: tuple[float, float] | None = None, **style: Any
) -> Ellipse:
    """Return the ellipse of one contact with a radius in standard deviations, by default around the contact."""
    from matplotlib.patches import Ellipse

    at = contacts.isel(sample=sample)
    spread_x, spread_y, rho = (float(at[name]) for name in ("contact_x_sd", "contact_y_sd", "contact_xy_correlation"))
    shared = rho * spread_x * spread_y
    variances, axes = np.linalg.eigh([[spread_x**2, shared], [shared, spread_y**2]])
    across, along = 2.0 * radius * np.sqrt(np.maximum(variances, 0.0))
    angle = float(np.degrees(np.arctan2(axes[1, 1], axes[0, 1])))
    return Ellipse(centre or (float(at["contact_x"]), float(at["contact_y"])), along, across, angle=angle, **style)


def is_certain(contacts: xr.Dataset) -> Any:
    """Return True for samples with the status "ok", or whose draws are all in contact, shape (samples,)."""
    known = contacts["status"] == "ok" if "status" in contacts else contacts["contact_probability"] == 1.0
    return known.values


def radius_of(probability: float) -> float:
    """Return the radius, in standard deviations, of the ellipse that holds a probability."""
    return float(np.sqrt(chdtri(2.0, 1.0 - probability)))


def _spread(has: Any, is_candidate: Any, samples: Index | None) -> list[int]:
    """Return the requested samples, or a dozen of the candidates, without those that have no contact."""
    candidates = np.flatnonzero(is_candidate)
    chosen = candidates[evenly_spread(candidates.size, _DRAWN)] if samples is None else samples
    return [int(i) for i in chosen[has[chosen]]]


def _finished(ax: Axes, labelled: xr.Dataset, phase: Any, label: str, truth: Contour | None, own: bool) -> Axes:
    for name, words in PHASES.items():
        if np.any(phase == name):
            legend_entry(ax, f"{label}, {words}", color=PALETTE[name], linewidth=1.0)
    ax.autoscale_view(tight=False)  # contour lines ask for tight limits
    if truth is not None:
        limits = {"xlim": ax.get_xlim(), "ylim": ax.get_ylim()}
        ax.plot(*outline(truth, *limits["xlim"]), label="true contour", **TRUTH)
        ax.set(**limits)
    finish_map(ax, labelled["contact_x"].attrs)
    if own:
        fit_height(ax)
    return ax

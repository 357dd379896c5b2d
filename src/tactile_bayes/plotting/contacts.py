"""Contacts with their uncertainty: ellipses, regions of a posterior, and how far the contour tightens them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from scipy.special import chdtri

from tactile_bayes.arrays import Index
from tactile_bayes.checks import check_probability, refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.plotting.axes import AxesArray, axes_for, check_drawing, check_panels, checked_samples, plot
from tactile_bayes.plotting.labels import DRIVE_ANGLE, legend_above, legend_entry, percent, show_numbers
from tactile_bayes.plotting.maps import finish_map, fit_height, label_map, limits_of, outline
from tactile_bayes.plotting.style import PALETTE, PHASES, SWEEP_LINES, TRUTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Ellipse

    from tactile_bayes.contours.base import Contour

_DRAWN = 12
_MIDDLE: dict[str, Any] = {"marker": "+", "markersize": 5.0, "zorder": 3}
_DETAILS = "abc"
_ON_MAP = 18
# Label, standard deviation, and colour of each ratio.
_RATIOS = ("along the contour", "tangent_sd", "#009E73"), ("across it", "normal_sd", "#CC79A7")
_IMPLIED = "#000000"
_HIGHEST = 0.9  # largest height of the map over that of each row below it
_PANEL = 0.25  # height of a row below the map over the width of the figure


@plot("no sample has an ellipse, or the probability is not in (0, 1)", example="measured")
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
    >>> contact_ellipses(tb.reconstruct(measured)).get_ylabel()
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


@plot("no sample has a contact, or the probability is not in (0, 1)", example="measured")
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
    >>> contact_regions(tb.infer_contacts(measured, draws=400, rng=1)).get_ylabel()
    '$y$ [$L$]'
    """
    from tactile_bayes.inference.result import contact_draws
    from tactile_bayes.uncertainty.contact_region import LEAST_DRAWS, contact_region

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


@plot(
    "the two are not of one record, there are not three contacts to be enlarged, or the probability is not in (0, 1)",
    example="inferred",
)
def tightening(
    implied: xr.DataTree,
    single: xr.DataTree | xr.Dataset,
    *,
    probability: float = 0.9,
    samples: Sequence[int] | None = None,
    truth: Contour | None = None,
    axes: Any = None,
) -> AxesArray:
    """Draw single contacts beside the contacts that the contour implies, which the whole record tightens.

    The figure has a map with the ellipses of single contacts, three details with the ellipses that the contour implies,
    and, over the drive angle, the ratio of the standard deviations along and across the contour. A ratio below 1 is
    possible: a contour posterior may find that the rig is not as stated, while single contacts assume that it is.

    Parameters
    ----------
    implied : xr.DataTree
        From `implied_contacts`.
    single : xr.DataTree or xr.Dataset
        Contacts of the same record, from `infer_contacts`, or from `reconstruct` with standard deviations, of which
        those with status "ok" are shown.
    probability : float
        Probability of each ellipse, in (0, 1).
    samples : sequence of int, optional
        The three samples that are enlarged; by default evenly picked from the sweep with the most contacts.
    axes : array_like of Axes, shape (5,), optional
        Axes for the map, the three details, and the ratios.

    Examples
    --------
    >>> implied = tb.uncertainty.implied_contacts(inferred, draws=50)
    >>> tightening(implied, tb.reconstruct(measured, method="constrained"))[-1].get_ylabel()
    'single sd / implied sd'
    """
    from tactile_bayes.uncertainty.contact_region import contact_moments

    check_probability("probability", probability)
    check_drawing(truth=truth)
    tight = contact_moments(implied)
    loose = single if isinstance(single, xr.Dataset) and "contact_x_sd" in single else contact_moments(single)
    if not {"observed_data", "constant_data"} <= set(getattr(implied, "children", ())):
        raise ParameterError("implied is no tree of implied_contacts: give what it returned")
    hashes = {tree.attrs["data_sha256"] for tree in (implied, single) if "data_sha256" in tree.attrs}
    if len(hashes) > 1 or tight.sizes["sample"] != loose.sizes["sample"]:
        raise ParameterError("implied and single contacts are not of one record: compute both from the same one")
    shown = _certain(tight) & _certain(loose)
    panels = _panels(axes)
    chosen = _enlarged(shown, implied, samples)

    x, y = tight["contact_x"].values, tight["contact_y"].values
    dots = {"color": _IMPLIED, "linestyle": "none", "marker": ".", "markersize": 1.2, "zorder": 4}
    panels[0].plot(x[shown], y[shown], **dots)
    legend_entry(panels[0], "implied by the contour", **dots | {"markersize": 6.0})
    every = np.flatnonzero(shown)
    some = every[((np.arange(_ON_MAP) + 0.5) / _ON_MAP * every.size).astype(int)]  # from the middles of equal parts
    samples = np.union1d(some, chosen).tolist()
    contact_ellipses(loose, probability=probability, truth=truth, samples=samples, ax=panels[0])
    if axes is None:
        _fit_map(panels[0])
    legend_above(panels[0], 2)
    radius = radius_of(probability)
    for letter, ax, i in zip(_DETAILS, panels[1:4], chosen.tolist(), strict=True):
        slope = float(tight["slope_angle"][i])
        inside = (-14.0 * np.sin(slope), 14.0 * np.cos(slope))
        letters: dict[str, Any] = {"ha": "center", "va": "center", "fontweight": "bold", "fontsize": "small"}
        panels[0].annotate(letter, (x[i], y[i]), inside, textcoords="offset points", **letters)
        _draw_detail(ax, tight, loose, i, radius, truth)
        ax.set_title(letter, fontsize="small", fontweight="bold", loc="left")
    _draw_ratios(panels[4], implied, tight, loose, shown)
    return panels


def _certain(moments: xr.Dataset) -> Any:
    """Return True for samples that are certainly in contact and have standard deviations, shape (samples,)."""
    return is_certain(moments) & np.isfinite(moments["tangent_sd"].values) & np.isfinite(moments["normal_sd"].values)


def _panels(axes: Any) -> AxesArray:
    if axes is not None:
        return check_panels(axes, (5,), "give five, for the map, three details, and the ratios")
    from matplotlib import pyplot as plt

    figure = plt.figure(figsize=(7.0, 7.6), layout="constrained")
    grid = figure.add_gridspec(3, 3, height_ratios=(_HIGHEST, 1.0, 1.0))
    places = grid[0, :], grid[2, :], *(grid[1, i] for i in range(3))
    whole, bottom, *details = (figure.add_subplot(place) for place in places)
    return np.array([whole, *details, bottom], dtype=object)


def _fit_map(ax: Axes) -> None:
    """Reduce the height of a low map, and of the figure, to what the map needs."""
    left, right, bottom, top = limits_of(ax)
    figure: Any = ax.figure
    wide, high = figure.get_size_inches()
    grid: Any = ax.get_gridspec()
    of_row = _PANEL * wide
    share = min(_HIGHEST, 0.86 * wide * (top - bottom) / (right - left) / of_row)
    grid.set_height_ratios((share, 1.0, 1.0))
    figure.set_size_inches(wide, high - (_HIGHEST - share) * of_row)


def _enlarged(shown: Any, implied: xr.DataTree, samples: Sequence[int] | None) -> Any:
    chosen = checked_samples(samples)
    if chosen is not None:
        if chosen.size != len(_DETAILS) or not np.isin(chosen, np.flatnonzero(shown)).all():
            raise refused("samples", samples, "give three that are certainly in contact and have standard deviations")
        return chosen
    sweep = implied["constant_data"].to_dataset()["sweep"].values
    number, count = np.unique(sweep[shown], return_counts=True)
    if not count.size or count.max() < len(_DETAILS):
        raise ParameterError(
            "there are not three contacts with a standard deviation in any sweep: reconstruct with a load cell that "
            "states its noise, or infer the contacts"
        )
    of_sweep = np.flatnonzero(shown & (sweep == number[np.argmax(count)]))
    return of_sweep[np.linspace(0.1 * of_sweep.size, 0.9 * (of_sweep.size - 1), len(_DETAILS)).astype(int)]


def _draw_detail(
    ax: Axes, tight: xr.Dataset, loose: xr.Dataset, sample: int, radius: float, truth: Contour | None
) -> None:
    """Draw one contact enlarged, with coordinates relative to the implied contact."""
    colour = PALETTE[str(loose["contact_phase"].values[sample])]
    x, y = (float(tight[f"contact_{axis}"][sample]) for axis in "xy")
    off = (float(loose["contact_x"][sample]) - x, float(loose["contact_y"][sample]) - y)
    ax.add_patch(ellipse_of(loose, sample, radius, off, facecolor=colour, alpha=0.12, linewidth=0.0))
    ax.add_patch(ellipse_of(loose, sample, radius, off, fill=False, edgecolor=colour, linewidth=1.0))
    ax.plot(*off, marker="+", color=colour, markersize=5.0)
    ax.add_patch(ellipse_of(tight, sample, radius, (0.0, 0.0), color=_IMPLIED, linewidth=0.6, zorder=4))
    spread = [float(loose[f"contact_{axis}_sd"][sample]) for axis in "xy"]
    reach = 1.15 * (radius * max(spread) + max(map(abs, off)))
    if truth is not None:
        along, height = outline(truth, x - 2.0 * reach, x + 2.0 * reach)
        ax.plot(along - x, height - y, **TRUTH)
    ax.set(aspect="equal", xlim=(-reach, reach), ylim=(-reach, reach))
    ax.locator_params(nbins=3)
    ax.tick_params(labelsize="small")
    for axis in (ax.xaxis, ax.yaxis):
        show_numbers(axis)
    label_map(ax, tight["contact_x"].attrs, np.array([-reach, reach]), "{} − implied")


def _draw_ratios(ax: Axes, implied: xr.DataTree, tight: xr.Dataset, loose: xr.Dataset, shown: Any) -> None:
    angle = np.degrees(implied["observed_data"].to_dataset()["drive_angle"].values)
    record = implied["constant_data"].to_dataset()
    sweeps, directions = record["sweep"].values, record["direction"].values
    for words, name, colour in _RATIOS:
        legend_entry(ax, words, color=colour, linewidth=1.3)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(shown, loose[name].values / tight[name].values, np.nan)
        for sweep in np.unique(sweeps):
            here = sweeps == sweep
            style = SWEEP_LINES[str(directions[here][0])]
            ax.plot(angle[here], ratio[here], color=colour, linestyle=style, linewidth=1.3)
    present = [direction for direction in SWEEP_LINES if direction in directions]
    for direction in present:
        legend_entry(ax, direction, color="0.4", linestyle=SWEEP_LINES[direction], linewidth=1.3)
    ax.axhline(1.0, color="0.4", linewidth=0.8)
    ax.set_yscale("log")
    ax.yaxis.set_major_formatter("{x:g}")
    ax.set(xlabel=DRIVE_ANGLE, ylabel="single sd / implied sd")
    ax.grid(axis="y", color="0.9", linewidth=0.6)
    legend_above(ax, 2 + len(present))

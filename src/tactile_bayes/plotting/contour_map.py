"""The contour as it was found: a map, and its detail."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import single_axes
from tactile_bayes.plotting.labels import LABELS, percent, set_unit
from tactile_bayes.plotting.legends import legend_entry
from tactile_bayes.plotting.maps import draw_gap, draw_pivot, finish_map, outline
from tactile_bayes.plotting.marks import CONTACT_MARKERS, PALETTE, PHASES, TRUTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.contours.base import Contour

__all__ = ["band_detail", "contour"]


def contour(
    x: ArrayLike,
    *,
    truth: Contour | None = None,
    contacts: xr.Dataset | None = None,
    band: xr.Dataset | None = None,
    gap: tuple[float, float] | xr.Dataset | None = None,
    base: tuple[float, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """The contour as it was found: contact points, band and gap, with the true contour where it is known.

    Parameters
    ----------
    x : array_like
        The range drawn, from its least to its greatest value, in the unit of the record.
    truth : Contour, optional
        The true contour.
    contacts : xr.Dataset, optional
        Over "sample": contact_x, contact_y, and where present contact_phase, which colours the points, and status, of
        which only "ok" is drawn.
    band : xr.Dataset, optional
        Over coordinate "x": lower, upper and median, with the probability of the band as attribute.
    gap : (float, float) or xr.Dataset, optional
        x of the contacts between which nothing was touched; if the first is the greater one, they overlap. Or what
        `tactile_bayes.gap` returns, of which the medians are drawn.
    base : (float, float), optional
        The pivot.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If `x` is no range.

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> contour([-0.6, 0.6], truth=paper_profile("II", q=0.5), gap=(-0.1, 0.1), base=(0.0, 0.0)).get_ylabel()
    '$y$ [$L$]'
    """
    drawn = np.asarray(x, dtype=float)
    if not (drawn.size >= 2 and np.all(np.isfinite(drawn)) and np.ptp(drawn) > 0.0):
        raise ParameterError("x must span the range to be drawn: at least two different finite numbers")
    low, high = float(drawn.min()), float(drawn.max())
    ax = single_axes() if ax is None else ax

    if gap is not None:
        _draw_gap(ax, gap)
    attrs: Mapping[Any, Any] = {}
    if band is not None:
        attrs = band["lower"].attrs or band["x"].attrs
        slack = 1e-9 * (high - low)
        inside = band.isel(x=np.flatnonzero((band["x"].values >= low - slack) & (band["x"].values <= high + slack)))
        probability = band.attrs.get("probability")
        label = "band" if probability is None else f"{percent(probability)} band"
        lower, upper = inside["lower"].values, inside["upper"].values
        ax.fill_between(inside["x"].values, lower, upper, color=PALETTE["band"], linewidth=0.5, zorder=1.5, label=label)
        if "median" in inside:
            ax.plot(inside["x"].values, inside["median"].values, color=PALETTE["median"], linewidth=1.0, label="median")
    if truth is not None:
        ax.plot(*outline(truth, low, high), **TRUTH)
    if contacts is not None:
        attrs = contacts["contact_x"].attrs or attrs
        _draw_contacts(ax, contacts, low, high)
    if base is not None:
        draw_pivot(ax, base)
    margin = 0.03 * (high - low)
    ax.set_xlim(low - margin, high + margin)
    finish_map(ax, attrs)
    return ax


def band_detail(
    band: xr.Dataset,
    *,
    truth: Contour | None = None,
    gap: tuple[float, float] | xr.Dataset | None = None,
    ax: Axes | None = None,
) -> Axes:
    """A band measured from its median, enlarged as far as it fills the Axes; a good one is invisible on a map.

    Parameters
    ----------
    band : xr.Dataset
        Over coordinate "x": lower, upper and median.
    truth : Contour, optional
        The true contour.
    gap : (float, float) or xr.Dataset, optional
        As in `contour`.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import xarray as xr
    >>> flat = {"lower": ("x", [-1e-3, -2e-3]), "median": ("x", [0.0, 0.0]), "upper": ("x", [1e-3, 2e-3])}
    >>> band_detail(xr.Dataset(flat, coords={"x": [0.0, 1.0]})).get_ylabel()
    '$y$ − median [$L$]'
    """
    ax = single_axes() if ax is None else ax
    x, median = band["x"].values, band["median"].values
    lower, upper = band["lower"].values - median, band["upper"].values - median
    if gap is not None:
        _draw_gap(ax, gap)
    ax.fill_between(x, lower, upper, color=PALETTE["band"], linewidth=0.5, zorder=1.5)
    ax.axhline(0.0, color=PALETTE["median"], linewidth=1.0)
    if truth is not None:
        ax.plot(x, np.asarray(truth.height(x)) - median, **TRUTH)
    margin = 0.03 * float(np.ptp(x))
    ax.set_xlim(float(x.min()) - margin, float(x.max()) + margin)
    attrs = band["lower"].attrs or band["x"].attrs
    set_unit(ax.xaxis, LABELS["contact_x"] + " ", "contact_x", attrs, x)
    set_unit(ax.yaxis, LABELS["contact_y"] + " − median ", "contact_y", attrs, np.concatenate([lower, upper]))
    return ax


def _draw_contacts(ax: Axes, contacts: xr.Dataset, low: float, high: float) -> None:
    x, y = contacts["contact_x"].values, contacts["contact_y"].values
    drawn = np.isfinite(x) & np.isfinite(y) & (x >= low) & (x <= high)
    if "status" in contacts:
        drawn &= contacts["status"].values == "ok"
    phase = contacts["contact_phase"].values if "contact_phase" in contacts else np.full(x.shape, "none")
    for name, label in (*PHASES.items(), ("none", "contact")):
        chosen = drawn & (phase == name)
        if chosen.any():
            style: dict[str, Any] = {"color": PALETTE[name], "marker": CONTACT_MARKERS[name], "linestyle": "none"}
            ax.plot(x[chosen], y[chosen], markersize=2.6, markeredgewidth=0.0, alpha=0.6, zorder=3, **style)
            legend_entry(ax, label, markersize=4.0, **style)


def _draw_gap(ax: Axes, gap: tuple[float, float] | xr.Dataset) -> None:
    begin, end = (gap[side].sel(bound="median") for side in ("left", "right")) if isinstance(gap, xr.Dataset) else gap
    left, right = sorted((float(begin), float(end)))
    overlap = float(begin) > float(end)
    draw_gap(ax, left, right, "overlap" if overlap else "gap", hatched=not overlap)

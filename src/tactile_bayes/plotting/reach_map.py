"""Contours drawn from prior and posterior, on a map of the rod's reach."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_switch, check_whole_number
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.plotting.axes import axes_for, plot
from tactile_bayes.plotting.labels import legend_entry
from tactile_bayes.plotting.maps import draw_pivot, finish_map, outline
from tactile_bayes.plotting.style import PALETTE, TRUTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.contours.base import Contour

_ROOM = 0.06  # margin of the map beside the rod's reach [rod lengths]
_BELOW = 0.2  # smallest extent of the map below the pivot [rod lengths]
_DRAWS = 400  # number of draws for the posterior's median
_THIN = 0.6  # width of a contour's line [points]
_PRIOR = "#E69F00"  # colour of the prior below the posterior
_COUNT = "give a whole number from 1 up, like 40"
_DASHED: dict[str, Any] = {"linestyle": (0, (6.0, 3.0)), "linewidth": 1.0}


@plot("the tree has no prior draws, or `contours` is not positive", example="inferred")
def prior_contours(
    posterior: xr.DataTree,
    *,
    contours: int = 40,
    median: bool = True,
    truth: Contour | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw contours from the prior, to see whether it covers the possible contours and no others.

    Contours are paler beyond the rod's reach. The legend states the share of the prior that is within reach of every
    sweep; the rest is excluded, and not drawn.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`; its group `prior` is drawn, which holds contours within reach in every sweep.
    contours : int
        Number of contours, evenly picked from the draws.
    median : bool
        If True, the posterior's median is drawn over them, along the touched stretch.

    Examples
    --------
    >>> prior_contours(inferred, ax=Figure().subplots()).get_ylabel()
    '$y$ [$L$]'
    """
    from tactile_bayes.inference.contour import contours_of

    check_switch("median", median)
    if not _has(posterior, "prior", "constant_data"):
        raise ParameterError("there are no draws from a prior here: give the tree that infer_contour returned")
    check_whole_number("contours", contours, 1, _COUNT)
    prior, family = posterior["prior"].to_dataset(), posterior.attrs["family"]
    share = prior.attrs.get("share_within_reach")
    words = "" if share is None else f"\n({100.0 * share:.2g} % of it is within reach)"
    layer = f"{family}, from the prior{words}", contours_of(prior, family), PALETTE["median"]
    touched = _median(posterior) if median and "posterior" in posterior.children else None
    return _draw(ax, posterior, contours, [layer], truth, touched=touched, entry_width=_THIN)


@plot("the tree is not a posterior of a contour, or `contours` is not positive", example="inferred")
def posterior_contours(
    posterior: xr.DataTree, *, contours: int = 40, truth: Contour | None = None, ax: Axes | None = None
) -> Axes:
    """Draw contours from the posterior over contours from the prior, to see what the record has added.

    Contours are paler beyond the rod's reach. If both look alike, the record is uninformative. A good posterior is a
    single line on a map: `band_detail` enlarges it.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`; without a group `prior` the posterior alone is drawn.
    contours : int
        Number of contours of each, evenly picked from the draws.

    Examples
    --------
    >>> posterior_contours(inferred, ax=Figure().subplots()).get_ylabel()
    '$y$ [$L$]'
    """
    from tactile_bayes.inference.contour import contours_of
    from tactile_bayes.uncertainty.band import contours_drawn

    if not _has(posterior, "posterior", "constant_data"):
        raise ParameterError("this is no posterior of a contour: give the tree that infer_contour returned")
    check_whole_number("contours", contours, 1, _COUNT)
    family = posterior.attrs["family"]
    layers = [(f"{family}, from the posterior", contours_drawn(posterior, contours), PALETTE["median"])]
    if "prior" in posterior.children:
        expected = contours_of(posterior["prior"].to_dataset(), family)
        layers.insert(0, (f"{family}, from the prior", expected, _PRIOR))
    return _draw(ax, posterior, contours, layers, truth)


def _has(posterior: Any, *groups: str) -> bool:
    """Return whether this is a result of `infer_contour` with these groups."""
    is_tree = isinstance(posterior, xr.DataTree) and set(groups) <= set(posterior.children)
    return is_tree and {"family", "rod_length"} <= set(posterior.attrs)


def _draw(
    ax: Axes | None,
    posterior: xr.DataTree,
    most: int,
    layers: list[tuple[str, Contour, str]],
    truth: Contour | None,
    *,
    touched: tuple[Floats, Floats] | None = None,
    entry_width: float = 1.5,
) -> Axes:
    """Draw layers (label, many contours, colour) of contours, paler beyond the rod's reach, and lines over them."""
    from matplotlib.patches import Circle

    from tactile_bayes.uncertainty.band import length_unit

    ax = axes_for(ax, truth)
    record, length = posterior["constant_data"].to_dataset(), float(posterior.attrs["rod_length"])
    pivots = np.unique(np.stack([record["base_x"].values, record["base_y"].values], axis=1), axis=0)
    beside, room = (1.0 + _ROOM) * length, _ROOM * length
    span = float(pivots[:, 0].min() - beside), float(pivots[:, 0].max() + beside)
    for pivot in pivots:
        ax.add_patch(Circle(tuple(pivot), length, fill=False, edgecolor="0.4", **_DASHED))
    legend_entry(ax, "rod's reach", color="0.4", **_DASHED)
    lowest = float(pivots[:, 1].min()) - _BELOW * length
    for above, (label, contours, colour) in enumerate(layers):
        style: dict[str, Any] = {"color": colour, "linewidth": _THIN}
        zorder = 1.5 + 0.5 * above
        for i in evenly_spread(contours.shape[0], most):
            x, y = outline(contours.take(i), *span)
            ax.plot(x, y, alpha=0.2, zorder=zorder, **style)
            for pivot in pivots:
                within = Circle(tuple(pivot), length, transform=ax.transData)
                ax.plot(x, y, alpha=0.7, zorder=zorder + 0.1, clip_path=within, **style)
                is_near = np.hypot(x - pivot[0], y - pivot[1]) < length
                lowest = min(lowest, float(np.min(y[is_near], initial=lowest)))
        legend_entry(ax, label, color=colour, linewidth=entry_width)
    ax.set_xlim(*span)
    ax.set_ylim(lowest - 2.0 * room, float(pivots[:, 1].max()) + length + room)
    if touched is not None:
        style = {"color": PALETTE["tangential"], "linewidth": 2.2, "label": "posterior median, where touched"}
        ax.plot(*touched, zorder=3, **style)
    if truth is not None:
        ax.plot(*outline(truth, *span), zorder=3, label="true contour", **TRUTH)
    for k, (x, y) in enumerate(pivots.tolist()):
        draw_pivot(ax, (x, y), label="" if k else "pivot")
    finish_map(ax, length_unit(posterior))
    return ax


def _median(posterior: xr.DataTree) -> tuple[Floats, Floats]:
    """Return points of the posterior's median along the touched stretch."""
    from tactile_bayes.uncertainty.band import contour_heights
    from tactile_bayes.uncertainty.rod_reach import reach

    x = reach(posterior)
    heights = contour_heights(posterior, x, _DRAWS)
    return x, np.median(np.where(np.isnan(heights), np.inf, heights), axis=0)  # beyond its ends a contour is upright

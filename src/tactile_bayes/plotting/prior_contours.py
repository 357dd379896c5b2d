"""Contours that the prior expects, before anything is measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import PALETTE, legend_entry, single_axes
from tactile_bayes.plotting.maps import draw_pivot, finish_map, outline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.contours.base import Contour

__all__ = ["prior_contours"]

_ROOM = 0.06
"""What the map shows beside the rod's reach, in rod lengths."""

_BELOW = 0.2
"""What it shows below the pivot at least, likewise."""

_DRAWS = 400
"""Of which the posterior's median is taken."""


def prior_contours(
    posterior: xr.DataTree,
    *,
    contours: int = 40,
    median: bool = True,
    truth: Contour | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Contours drawn from the prior: does it expect what might be there, and nothing that cannot?

    Beyond the rod's reach they are paler. The legend says which share of the prior is within reach of every sweep: the
    rest is excluded, and not drawn.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`, of which the group `prior` is drawn: contours within reach in every sweep.
    contours : int
        How many, evenly picked from the draws.
    median : bool
        Whether the posterior's median is drawn over them, where the rod touched.
    truth : Contour, optional
        The true contour.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If the tree has no prior draws, or `contours` is not positive.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, SamplerSettings, infer_contour, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, seed=1)
    >>> quick = SamplerSettings(min_ess=100, max_r_hat=1.1)
    >>> prior_contours(infer_contour(measured, nuisances=[], seed=1, settings=quick)).get_ylabel()
    '$y$ [$L$]'
    """
    from matplotlib.patches import Circle

    from tactile_bayes.inference.contour import contours_of
    from tactile_bayes.uncertainty.band import length_unit

    if not {"prior", "constant_data"} <= set(getattr(posterior, "children", ())):
        raise ParameterError("there are no draws from a prior here: give the tree that infer_contour returned")
    if isinstance(contours, bool) or not isinstance(contours, int | np.integer) or contours < 1:
        raise ParameterError(f"contours is {contours!r}: give a whole number from 1 up, like 40")
    prior, family = posterior["prior"].to_dataset(), posterior.attrs["family"]
    drawn = contours_of(prior, family)
    record, length = posterior["constant_data"].to_dataset(), float(posterior.attrs["rod_length"])
    pivots = np.unique(np.stack([record["base_x"].values, record["base_y"].values], axis=1), axis=0)
    (left, _), (right, top) = pivots.min(axis=0) - length, pivots.max(axis=0) + length
    room = _ROOM * length
    left, right, top = left - room, right + room, top + room

    ax = single_axes() if ax is None else ax
    reach = {"edgecolor": "0.4", "linestyle": (0, (6.0, 3.0)), "linewidth": 1.0}
    circles = [ax.add_patch(Circle(tuple(pivot), length, fill=False, **reach)) for pivot in pivots]
    legend_entry(ax, "rod's reach", color="0.4", linestyle=(0, (6.0, 3.0)), linewidth=1.0)
    style: dict[str, Any] = {"color": PALETTE["median"], "linewidth": 0.6}
    lowest = float(pivots[:, 1].min()) - _BELOW * length
    for i in np.unique(np.linspace(0, drawn.shape[0] - 1, min(contours, drawn.shape[0])).astype(np.intp)):
        x, y = outline(drawn.take(i), left, right)
        ax.plot(x, y, **style, alpha=0.2, zorder=1.5)
        for pivot, circle in zip(pivots, circles, strict=True):
            ax.plot(x, y, **style, alpha=0.7, zorder=1.6, clip_path=circle)
            lowest = min(lowest, float(np.min(y[np.hypot(x - pivot[0], y - pivot[1]) < length], initial=lowest)))
    ax.set_xlim(left, right)
    ax.set_ylim(lowest - 2.0 * room, top)
    share = prior.attrs.get("share_within_reach")
    words = "" if share is None else f"\n({100.0 * share:.2g} % of it is within reach)"
    legend_entry(ax, f"{family}, from the prior{words}", **style)
    if median and "posterior" in posterior.children:
        _draw_median(ax, posterior)
    if truth is not None:
        ax.plot(*outline(truth, left, right), color=PALETTE["change"], linestyle="--", zorder=3, label="true contour")
    for k, pivot in enumerate(pivots):
        draw_pivot(ax, tuple(pivot), label="" if k else "pivot")
    finish_map(ax, length_unit(posterior))
    return ax


def _draw_median(ax: Axes, posterior: xr.DataTree) -> None:
    from tactile_bayes.uncertainty.band import contour_heights

    events = posterior["events"].to_dataset()
    ends = np.concatenate([events[f"{when}_contact_x"].values.ravel() for when in ("first", "snap_off")])
    left, right = np.quantile(ends, [0.05, 0.95])
    x = np.linspace(left, right, 201)
    heights = contour_heights(posterior, x, _DRAWS)
    y = np.median(np.where(np.isnan(heights), np.inf, heights), axis=0)  # beyond its ends a contour is upright
    ax.plot(x, y, color=PALETTE["tangential"], linewidth=2.2, zorder=3, label="posterior median, where touched")

"""Contours that the prior expects, before anything is measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import PALETTE, legend_entry, single_axes
from tactile_bayes.plotting.maps import finish_map
from tactile_bayes.plotting.reach import Reach, refuse_count

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.contours.base import Contour

__all__ = ["prior_contours"]

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
    from tactile_bayes.inference.contour import contours_of
    from tactile_bayes.uncertainty.band import length_unit

    if not {"prior", "constant_data"} <= set(getattr(posterior, "children", ())):
        raise ParameterError("there are no draws from a prior here: give the tree that infer_contour returned")
    refuse_count(contours)
    prior, family = posterior["prior"].to_dataset(), posterior.attrs["family"]
    ax = single_axes() if ax is None else ax
    reach = Reach.of(posterior)
    reach.draw(ax)
    style: dict[str, Any] = {"color": PALETTE["median"], "linewidth": 0.6}
    lowest = reach.draw_contours(ax, contours_of(prior, family), contours, pale=0.2, strong=0.7, **style)
    reach.limit(ax, lowest)
    share = prior.attrs.get("share_within_reach")
    words = "" if share is None else f"\n({100.0 * share:.2g} % of it is within reach)"
    legend_entry(ax, f"{family}, from the prior{words}", **style)
    if median and "posterior" in posterior.children:
        _draw_median(ax, posterior)
    if truth is not None:
        reach.draw_truth(ax, truth)
    reach.draw_pivots(ax)
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

"""Contours that the posterior leaves possible, over those that the prior expected."""

from __future__ import annotations

from typing import TYPE_CHECKING

import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import PALETTE, legend_entry, single_axes
from tactile_bayes.plotting.maps import finish_map
from tactile_bayes.plotting.reach import Reach, refuse_count

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.contours.base import Contour

__all__ = ["posterior_contours"]

_PRIOR = "#E69F00"


def posterior_contours(
    posterior: xr.DataTree, *, contours: int = 40, truth: Contour | None = None, ax: Axes | None = None
) -> Axes:
    """Contours drawn from the posterior over contours drawn from the prior: what the record has told.

    Beyond the rod's reach they are paler. Where both look alike the record says nothing. A good posterior is a single
    line on a map: `band_detail` enlarges it.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`; without a group `prior` the posterior alone is drawn.
    contours : int
        How many of each, evenly picked from the draws.
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
        If the tree is no posterior of a contour, or `contours` is not positive.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, SamplerSettings, infer_contour, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, seed=1)
    >>> quick = SamplerSettings(min_ess=100, max_r_hat=1.1)
    >>> posterior_contours(infer_contour(measured, nuisances=[], seed=1, settings=quick)).get_ylabel()
    '$y$ [$L$]'
    """
    from tactile_bayes.inference.contour import contours_of
    from tactile_bayes.uncertainty.band import contours_drawn, length_unit

    if not {"posterior", "constant_data"} <= set(getattr(posterior, "children", ())):
        raise ParameterError("this is no posterior of a contour: give the tree that infer_contour returned")
    refuse_count(contours)
    family = posterior.attrs["family"]
    ax = single_axes() if ax is None else ax
    reach = Reach.of(posterior)
    reach.draw(ax)
    drawn = [("posterior", contours_drawn(posterior, contours), PALETTE["median"])]
    if "prior" in posterior.children:
        drawn.insert(0, ("prior", contours_of(posterior["prior"].to_dataset(), family), _PRIOR))
    lowest = []
    for layer, (name, of_it, colour) in enumerate(drawn):
        style = {"color": colour, "linewidth": 0.6}
        lowest.append(reach.draw_contours(ax, of_it, contours, pale=0.2, strong=0.7, zorder=1.5 + 0.5 * layer, **style))
        legend_entry(ax, f"{family}, from the {name}", **style | {"linewidth": 1.5})
    reach.limit(ax, min(lowest))
    if truth is not None:
        reach.draw_truth(ax, truth)
    reach.draw_pivots(ax)
    finish_map(ax, length_unit(posterior))
    return ax

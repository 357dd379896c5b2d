"""Whose noise it is that a contact point is off by: shares of the variance over a sweep."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import LABELS, single_axes
from tactile_bayes.plotting.planning_groups import READING_COLOURS, READING_LABELS, group_of, of_sweep, sweep_in_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["noise_shares"]

_TOGETHER = "0.75"


def noise_shares(
    found: xr.Dataset | xr.DataTree,
    *,
    reconstruction: Literal["raw", "constrained"] = "raw",
    error: Literal["along", "across"] = "across",
    sweep: int = 0,
    ax: Axes | None = None,
) -> Axes:
    """Shares of the variance of a contact's error by whose noise they come from, stacked, over a sweep.

    What is missing of one is called "together": it comes from noises that act together, and is large where first order
    does not hold. Shares are estimates: those below 0 are drawn as 0, and a stack may rise a little above 1.

    Parameters
    ----------
    found : xr.Dataset or xr.DataTree
        What `tactile_bayes.sensitivity` returned, or its group "noise_shares".
    reconstruction : {"raw", "constrained"}
    error : {"along", "across"}
        Along the contour, or across it.
    sweep : int
        Number of the sweep.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Drive angles are in degrees. A place at which some of the noise leaves no answer is hatched.

    Raises
    ------
    ParameterError
        If this is no such group, or it has not what is chosen.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from tactile_bayes import sensitivity
    >>> found = sensitivity(seed=1, parts=["noise_shares"], samples=8)
    >>> noise_shares(found, ax=Figure().subplots()).get_ylabel()
    'share of variance'
    """
    names = {"share", "reconstruction", "error", "source", "sweep", "direction", "drive_angle"}
    shares = group_of(found, "noise_shares", names)
    for name, value in (("reconstruction", reconstruction), ("error", error)):
        if value not in shares[name].values:
            raise ParameterError(f"{name} is {value!r}: there are {', '.join(map(str, shares[name].values))}")
    chosen = of_sweep(shares.sel(reconstruction=reconstruction, error=error), sweep)
    ax = single_axes() if ax is None else ax
    angle = np.degrees(chosen["drive_angle"].values)
    wide = float(np.median(np.diff(angle))) if angle.size > 1 else 1.0
    share = np.maximum(chosen["share"].transpose("sample", "source").values, 0.0)
    is_answered = np.isfinite(share).all(axis=1)
    below = np.zeros(angle.size)
    together = np.maximum(1.0 - share.sum(axis=1), 0.0)
    sources = [str(name) for name in chosen["source"].values]
    stacked = [(share[:, i], READING_COLOURS[name], READING_LABELS[name]) for i, name in enumerate(sources)]
    for values, colour, label in (*stacked, (together, _TOGETHER, "together")):
        height = np.where(is_answered, values, 0.0)
        ax.bar(angle, height, wide, below, color=colour, label=label, edgecolor="white", linewidth=0.6)
        below = below + height
    if not is_answered.all():
        ax.bar(
            angle[~is_answered],
            np.ones(np.count_nonzero(~is_answered)),
            wide,
            color="white",
            edgecolor="0.6",
            hatch="///",
            linewidth=0.6,
            label="no answer for some of the noise",
        )
    ax.set_xlim(angle.min() - 0.7 * wide, angle.max() + 0.7 * wide)
    ax.set_ylim(0.0, max(1.02, 1.02 * float(below.max(initial=0.0))))
    ax.set_xlabel(f"{LABELS['drive_angle']} [°], {sweep_in_words(chosen)}")
    ax.set_ylabel("share of variance")
    ax.legend(
        title=f"error of a {reconstruction} contact point {error} the contour, by the noise of",
        title_fontsize="small",
        fontsize="small",
        frameon=False,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=4 if len(ax.containers) <= 4 else 3,
    )
    return ax

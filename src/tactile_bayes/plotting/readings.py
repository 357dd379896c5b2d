"""Single readings of a sweep: their leverage, and whose noise it is that a contact point is off by."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr

from tactile_bayes.plotting.axes import single_axes
from tactile_bayes.plotting.labels import DRIVE_ANGLE, LABELS, number
from tactile_bayes.plotting.legends import legend_above, legend_entry
from tactile_bayes.plotting.marks import SWEEP_LINES
from tactile_bayes.plotting.planning_groups import READING_COLOURS, check_among, group_of, of_sweep, sweep_in_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["information", "noise_shares"]

_TOGETHER = "0.75"


def information(found: xr.Dataset | xr.DataTree, *, ax: Axes | None = None) -> Axes:
    """Leverage of every reading over the drive angle, by channel and direction.

    The leverage of a reading is how many parameters are known by it: it is between 0 and 1, and all of them together
    are as many as the record tells. Readings without contact tell of the load cell's zero.

    Parameters
    ----------
    found : xr.Dataset or xr.DataTree
        What `tactile_bayes.sensitivity` returned, or its group "information".
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Drive angles are in degrees. The legend has the sum of the leverage for each channel.

    Raises
    ------
    ParameterError
        If this is no such group.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from tactile_bayes import sensitivity
    >>> found = sensitivity(seed=1, parts=["information"])
    >>> information(found, ax=Figure().subplots()).get_ylabel()
    'leverage of a reading'
    """
    told = group_of(found, "information", {"leverage", "channel", "sweep", "direction", "drive_angle"})
    ax = single_axes() if ax is None else ax
    for sweep in np.unique(told["sweep"].values):
        of = of_sweep(told, sweep)
        angle, style = np.degrees(of["drive_angle"].values), SWEEP_LINES[str(of["direction"].values[0])]
        for name in map(str, told["channel"].values):
            leverage = of["leverage"].sel(channel=name).values
            ax.plot(angle, leverage, style, color=READING_COLOURS[name], linewidth=1.3)
    for name in map(str, told["channel"].values):
        whole = number(float(told["leverage"].sel(channel=name).sum()), digits=3)
        legend_entry(ax, f"{LABELS[name]}: {whole}", color=READING_COLOURS[name], linewidth=2.5)
    for direction in dict.fromkeys(map(str, told["direction"].values)):
        legend_entry(ax, direction, color="0.35", linestyle=SWEEP_LINES[direction], linewidth=1.3)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel(DRIVE_ANGLE)
    ax.set_ylabel("leverage of a reading")
    whole = number(float(told["leverage"].sum()), digits=3)
    title = f"leverage of all {told['leverage'].size:,} readings together: {whole}"
    legend_above(ax, 5, title=title, handlelength=1.6, columnspacing=1.3)
    return ax


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
        check_among(name, value, shares)
    chosen = of_sweep(shares.sel(reconstruction=reconstruction, error=error), sweep)
    ax = single_axes() if ax is None else ax
    angle = np.degrees(chosen["drive_angle"].values)
    wide = float(np.median(np.diff(angle))) if angle.size > 1 else 1.0
    share = np.maximum(chosen["share"].transpose("sample", "source").values, 0.0)
    is_answered = np.isfinite(share).all(axis=1)
    below = np.zeros(angle.size)
    together = np.maximum(1.0 - share.sum(axis=1), 0.0)
    sources = [str(name) for name in chosen["source"].values]
    stacked = [(share[:, i], READING_COLOURS[name], LABELS[name]) for i, name in enumerate(sources)]
    for values, colour, label in (*stacked, (together, _TOGETHER, "together")):
        height = np.where(is_answered, values, 0.0)
        ax.bar(angle, height, wide, below, color=colour, label=label, edgecolor="white", linewidth=0.6)
        below = below + height
    if not is_answered.all():
        style: dict[str, Any] = {"color": "white", "edgecolor": "0.6", "hatch": "///", "linewidth": 0.6}
        ax.bar(angle[~is_answered], 1.0, wide, label="no answer for some of the noise", **style)
    ax.set_xlim(angle.min() - 0.7 * wide, angle.max() + 0.7 * wide)
    ax.set_ylim(0.0, max(1.02, 1.02 * float(below.max(initial=0.0))))
    ax.set_xlabel(f"{DRIVE_ANGLE}, {sweep_in_words(chosen)}")
    ax.set_ylabel("share of variance")
    title = f"error of a {reconstruction} contact point {error} the contour, by the noise of"
    legend_above(ax, 4 if len(ax.containers) <= 4 else 3, title=title)
    return ax

"""Which readings of a record carry what it tells: their leverage over the drive angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from tactile_bayes.plotting.axes import LABELS, legend_entry, number, single_axes
from tactile_bayes.plotting.planning_groups import READING_COLOURS, READING_LABELS, group_of, of_sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["information"]

_LINES = {"forward": "-", "backward": "--"}


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
        angle, style = np.degrees(of["drive_angle"].values), _LINES[str(of["direction"].values[0])]
        for name in map(str, told["channel"].values):
            leverage = of["leverage"].sel(channel=name).values
            ax.plot(angle, leverage, style, color=READING_COLOURS[name], linewidth=1.3)
    for name in map(str, told["channel"].values):
        whole = number(float(told["leverage"].sel(channel=name).sum()), digits=3)
        legend_entry(ax, f"{READING_LABELS[name]}: {whole}", color=READING_COLOURS[name], linewidth=2.5)
    for direction in dict.fromkeys(map(str, told["direction"].values)):
        legend_entry(ax, direction, color="0.35", linestyle=_LINES[direction], linewidth=1.3)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel(f"{LABELS['drive_angle']} [°]")
    ax.set_ylabel("leverage of a reading")
    whole = number(float(told["leverage"].sum()), digits=3)
    ax.legend(
        title=f"leverage of all {told['leverage'].size:,} readings together: {whole}",
        title_fontsize="small",
        fontsize="small",
        frameon=False,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=5,
        handlelength=1.6,
        columnspacing=1.3,
    )
    return ax

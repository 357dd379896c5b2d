"""Which noise a band of some width allows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.plotting.axes import PALETTE, single_axes
from tactile_bayes.plotting.planning_groups import group_of, set_log_scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["WHERE", "required_noise"]

WHERE = {"everywhere": "", "touched": " where it is touched", "gap": " in the gap"}


def required_noise(found: xr.Dataset | xr.DataTree, *, ax: Axes | None = None) -> Axes:
    """Mean width of the band that is to be expected over the noise of the load cell, both logarithmic.

    Noise of the forces is below, noise of the moment that goes with it above. The plan's own load cell is marked.

    Parameters
    ----------
    found : xr.Dataset or xr.DataTree
        What `tactile_bayes.sensitivity` returned, or its group "required_noise".
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Where priors alone give every band that was asked for there is nothing to be drawn, and the Axes say so.

    Raises
    ------
    ParameterError
        If this is no such group.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from tactile_bayes import sensitivity
    >>> found = sensitivity(seed=1, parts=["required_noise"])
    >>> required_noise(found, ax=Figure().subplots()).get_xlabel()
    'noise of the forces [$EI$/$L^2$]'
    """
    names = {"band_width", "noise_factor", "force_noise", "moment_noise", "present_width", "prior_width"}
    needed = group_of(found, "required_noise", names)
    ax = single_axes() if ax is None else ax
    needed = needed.isel(band_width=np.argsort(needed["band_width"].values))
    is_had = np.isfinite(needed["noise_factor"].values)
    if not is_had.any():
        ax.set_axis_off()
        words = "the priors alone give bands as narrow as these, without any record"
        ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", va="center")
        return ax
    some = needed.isel(band_width=is_had)
    factor, width = some["noise_factor"].values, some["band_width"].values
    noise = {name: some[f"{name}_noise"].values for name in ("force", "moment")}
    present = {name: float(values[0] / factor[0]) for name, values in noise.items()}
    present_width = float(needed["present_width"])
    at = np.append(noise["force"], present["force"])
    order = np.argsort(at)
    widths = np.append(width, present_width)
    ax.plot(at[order], widths[order], color=PALETTE["median"], linewidth=1.2, zorder=2)
    ax.plot(noise["force"], width, "o", color=PALETTE["median"], markersize=5.0, zorder=3, label="asked for")
    style: dict[str, Any] = {"markersize": 7.0, "markeredgecolor": "white", "zorder": 4}
    ax.plot([present["force"]], [present_width], "D", color="#D55E00", label="the load cell as it is", **style)
    prior = float(needed["prior_width"])
    if prior < 10.0 * widths.max():
        ax.axhline(prior, color="0.4", linewidth=1.0, linestyle="--", label="priors alone", zorder=1)
        widths = np.append(widths, prior)
    attrs = {name: _plain(needed[f"{name}_noise"].attrs, unit) for name, unit in (("force", "N"), ("moment", "N m"))}
    probability = f"{100.0 * needed.attrs['probability']:.6g} %"
    where = WHERE.get(str(needed.attrs.get("where", "everywhere")), "")
    label = f"mean width of the {probability} band{where}"
    set_log_scale(ax.xaxis, "noise of the forces", "force_x", attrs["force"], at)
    set_log_scale(ax.yaxis, label, "contact_x", needed["band_width"].attrs, widths)
    ratio = present["moment"] / present["force"]

    def moment(force: Any) -> Any:
        return np.asarray(force) * ratio

    def force(moment: Any) -> Any:
        return np.asarray(moment) / ratio

    above = ax.secondary_xaxis("top", functions=(moment, force))
    set_log_scale(above.xaxis, "noise of the moment", "holding_moment", attrs["moment"], at * ratio)
    ax.grid(color="0.92", linewidth=0.8, which="major")
    ax.set_axisbelow(True)
    ax.legend(fontsize="small", frameon=False, loc="upper left")
    return ax


def _plain(attrs: Mapping[Any, Any], si: str) -> dict[str, str]:
    """In the words of a record: without a unit where it is in units of the rod."""
    return {"units": si if attrs.get("units") == si else "1"}

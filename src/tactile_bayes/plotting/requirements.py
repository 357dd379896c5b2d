"""Requirements for a band of given width: the noise of the load cell, and the rod that suits a load cell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.plotting.axes import axes_for, check_dataset, group_of, tile_edges, write_instead
from tactile_bayes.plotting.labels import number, percent, set_log_scale, set_unit, show_numbers, shown_unit
from tactile_bayes.plotting.legends import legend, legend_above
from tactile_bayes.plotting.marks import BEST, PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WHERE = {"everywhere": "", "touched": " where it is touched", "gap": " in the gap"}

_REFUSED: dict[str, dict[str, Any]] = {
    "bent too far": {"facecolor": "none", "edgecolor": "white", "hatch": "////"},
    "touches little": {"facecolor": "none", "edgecolor": "white", "hatch": ".."},
    "does not reach": {"facecolor": "0.9", "edgecolor": "0.6", "hatch": "xx"},
    "cannot be swept": {"facecolor": "0.9", "edgecolor": "0.6", "hatch": ".."},
}


def required_noise(found: xr.Dataset | xr.DataTree, *, ax: Axes | None = None) -> Axes:
    """Draw the expected mean width of the band over the noise of the load cell, both logarithmic.

    The lower axis is the noise of the forces, the upper axis the noise of the moment in proportion. The plan's own load
    cell is marked.

    Parameters
    ----------
    found : xr.Dataset or xr.DataTree
        Result of `tactile_bayes.sensitivity`, or its group "required_noise".
    ax : Axes, optional

    Returns
    -------
    Axes
        If the priors alone give every band that was asked for, the Axes hold a note instead.

    Raises
    ------
    ParameterError
        If the argument does not hold that group.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from tactile_bayes import sensitivity
    >>> found = sensitivity(rng=1, parts=["required_noise"])
    >>> required_noise(found, ax=Figure().subplots()).get_xlabel()
    'noise of the forces [$EI$/$L^2$]'
    """
    names = {"band_width", "noise_factor", "force_noise", "moment_noise", "present_width", "prior_width"}
    needed = group_of(found, "required_noise", names)
    ax = axes_for(ax)
    needed = needed.isel(band_width=np.argsort(needed["band_width"].values))
    is_had = np.isfinite(needed["noise_factor"].values)
    if not is_had.any():
        return write_instead(ax, "the priors alone give bands as narrow as these, without any record")
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
    set_log_scale(ax.xaxis, "noise of the forces", "force_x", attrs["force"], at)
    set_log_scale(ax.yaxis, _band_in_words(needed), "contact_x", needed["band_width"].attrs, widths)
    ratio = present["moment"] / present["force"]
    functions = (lambda force: np.asarray(force) * ratio, lambda moment: np.asarray(moment) / ratio)
    above = ax.secondary_xaxis("top", functions=functions)
    set_log_scale(above.xaxis, "noise of the moment", "holding_moment", attrs["moment"], at * ratio)
    ax.grid(color="0.92", linewidth=0.8, which="major")
    ax.set_axisbelow(True)
    legend(ax, loc="upper left")
    return ax


def required_rod(found: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the expected mean width of the band over the length and the diameter of the rod.

    Rods that are bent too far, touch little or nothing of the contour, or cannot be swept, are hatched; among the
    others, the rod with the narrowest band is marked.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.planning.required_rod`.
    ax : Axes, optional

    Returns
    -------
    Axes
        The figure also holds the colour bar.

    Raises
    ------
    ParameterError
        If the argument is not a result of `required_rod`.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> metres = {"units": "m"}
    >>> found = xr.Dataset(
    ...     {
    ...         "width": (("length", "diameter"), [[2e-4, 1e-4], [4e-4, 3e-4]], metres),
    ...         "status": (("length", "diameter"), [["ok", "bent too far"], ["ok", "ok"]]),
    ...         "best_length": 0.1,
    ...         "best_diameter": 2e-4,
    ...         "best_width": 2e-4,
    ...     },
    ...     coords={"length": ("length", [0.1, 0.2], metres), "diameter": ("diameter", [2e-4, 4e-4], metres)},
    ...     attrs={"probability": 0.95, "where": "everywhere"},
    ... )
    >>> required_rod(found, ax=Figure().subplots()).get_xlabel()
    'length of the rod [mm]'
    """
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Patch

    names = {"width", "status", "length", "diameter", "best_length", "best_diameter", "best_width"}
    check_dataset(found, names, "choice of rods", "required_rod")
    ax = axes_for(ax)
    found = found.sortby(["length", "diameter"])
    lengths, diameters = found["length"].values, found["diameter"].values
    width, status = (found[name].transpose("diameter", "length").values for name in ("width", "status"))
    x, y = tile_edges(lengths), tile_edges(diameters)
    known = width[np.isfinite(width)]
    if known.size:
        low, high = float(known.min()), float(known.max())
        if low == high:
            low, high = 0.9 * low, 1.1 * high
        mesh = ax.pcolormesh(x, y, np.ma.masked_invalid(width), norm=LogNorm(low, high), cmap="cividis_r")
        _label_bar(ax.figure.colorbar(mesh, ax=ax), found, known)
    handles: list[Any] = []
    for word, style in _REFUSED.items():
        here = status == word
        for j, i in zip(*np.nonzero(here), strict=True):
            ax.fill(x[[i, i + 1, i + 1, i]], y[[j, j, j + 1, j + 1]], linewidth=0.0, **style)
        if here.any():
            shade = "0.55" if style["facecolor"] == "none" else style["facecolor"]
            handles.append(Patch(label=word, **style | {"facecolor": shade}))
    best = float(found["best_length"]), float(found["best_diameter"]), float(found["best_width"])
    if np.isfinite(best[2]):
        power, unit = shown_unit("contact_x", found["width"].attrs, np.array(best[2:]))
        label = f"best: {number(best[2], power, digits=3)} {unit}"
        handles += ax.plot(*best[:2], markersize=15.0, zorder=4, clip_on=False, label=label, **BEST)
    set_unit(ax.xaxis, "length of the rod ", "contact_x", found["length"].attrs, lengths)
    set_unit(ax.yaxis, "diameter of the rod ", "contact_y", found["diameter"].attrs, diameters)
    ax.set_xlim(x[0], x[-1])
    ax.set_ylim(y[0], y[-1])
    legend_above(ax, 4, handles=handles)
    return ax


def _label_bar(bar: Any, found: xr.Dataset, known: Floats) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    power, unit = shown_unit("contact_x", found["width"].attrs, known)
    few = known.max() / known.min() < 100.0
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    show_numbers(bar.ax.yaxis, power)
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    bar.set_label(f"{_band_in_words(found)} [{unit}]")


def _band_in_words(found: xr.Dataset) -> str:
    where = _WHERE.get(str(found.attrs.get("where", "everywhere")), "")
    return f"mean width of the {percent(found.attrs['probability'])} band{where}"


def _plain(attrs: Mapping[Any, Any], si: str) -> dict[str, str]:
    """Return the unit as records state it: "1" for quantities in units of the rod."""
    return {"units": si if attrs.get("units") == si else "1"}

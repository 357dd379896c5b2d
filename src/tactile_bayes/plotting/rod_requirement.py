"""Which rod a load cell wants: widths of bands over the length and the diameter of rods."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import Floats, number, set_unit, shown_unit, single_axes
from tactile_bayes.plotting.noise_requirement import WHERE
from tactile_bayes.plotting.tiles import tile_edges

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["required_rod"]

_REFUSED: dict[str, dict[str, Any]] = {
    "bent too far": {"facecolor": "none", "edgecolor": "white", "hatch": "////"},
    "touches little": {"facecolor": "none", "edgecolor": "white", "hatch": ".."},
    "does not reach": {"facecolor": "0.9", "edgecolor": "0.6", "hatch": "xx"},
    "cannot be swept": {"facecolor": "0.9", "edgecolor": "0.6", "hatch": ".."},
}


def required_rod(found: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Mean width of the band that is to be expected over the length and the diameter of the rod.

    Rods that are bent too far, touch little of the contour or none, or cannot be swept, are hatched; of the others the
    one with the narrowest band is marked.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.required_rod`.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Beside it, in its figure, stands the scale of colours.

    Raises
    ------
    ParameterError
        If this is none.

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
    if not isinstance(found, xr.Dataset) or not names <= set(found.variables):
        raise ParameterError("this is no choice of rods: give what required_rod returned")
    ax = single_axes() if ax is None else ax
    found = found.sortby(["length", "diameter"])
    lengths, diameters = found["length"].values, found["diameter"].values
    width = found["width"].transpose("diameter", "length").values
    status = found["status"].transpose("diameter", "length").values
    x, y = tile_edges(lengths), tile_edges(diameters)
    known = width[np.isfinite(width)]
    if known.size:
        low, high = float(known.min()), float(known.max())
        if low == high:
            low, high = 0.9 * low, 1.1 * high
        mesh = ax.pcolormesh(x, y, np.ma.masked_invalid(width), norm=LogNorm(low, high), cmap="cividis_r")
        bar = ax.figure.colorbar(mesh, ax=ax)
        _label_bar(bar, found, known)
    for word, style in _REFUSED.items():
        here = status == word
        for j, i in zip(*np.nonzero(here), strict=True):
            corners = [x[i], x[i + 1], x[i + 1], x[i]], [y[j], y[j], y[j + 1], y[j + 1]]
            ax.fill(*corners, linewidth=0.0, **style)
    handles: list[Any] = [
        Patch(label=word, **(style | {"facecolor": "0.55"} if word in ("bent too far", "touches little") else style))
        for word, style in _REFUSED.items()
        if np.any(status == word)
    ]
    best = float(found["best_length"]), float(found["best_diameter"]), float(found["best_width"])
    if np.isfinite(best[2]):
        power, unit = shown_unit("contact_x", found["width"].attrs, np.array(best[2:]))
        handles += ax.plot(
            *([value] for value in best[:2]),
            "*",
            color="#D55E00",
            markersize=15.0,
            markeredgecolor="white",
            zorder=4,
            clip_on=False,
            label=f"best: {number(best[2], power, digits=3)} {unit}",
        )
    set_unit(ax.xaxis, "length of the rod ", "contact_x", found["length"].attrs, lengths)
    set_unit(ax.yaxis, "diameter of the rod ", "contact_y", found["diameter"].attrs, diameters)
    ax.set_xlim(x[0], x[-1])
    ax.set_ylim(y[0], y[-1])
    ax.legend(
        handles=handles,
        fontsize="small",
        frameon=False,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=4,
    )
    return ax


def _label_bar(bar: Any, found: xr.Dataset, known: Floats) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    power, unit = shown_unit("contact_x", found["width"].attrs, known)
    few = known.max() / known.min() < 100.0
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value, power)))
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    where = WHERE.get(str(found.attrs.get("where", "everywhere")), "")
    probability = f"{100.0 * found.attrs['probability']:.6g} %"
    bar.set_label(f"mean width of the {probability} band{where} [{unit}]")

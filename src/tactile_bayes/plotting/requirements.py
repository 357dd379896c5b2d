"""Requirements and errors over the noise of the load cell, and over the size of the rod."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_choice
from tactile_bayes.plotting.axes import axes_for, check_among, check_dataset, group_of, plot, tile_edges, write_instead
from tactile_bayes.plotting.labels import (
    legend,
    legend_above,
    legend_entry,
    number,
    percent,
    set_log_scale,
    set_unit,
    show_numbers,
    shown_unit,
)
from tactile_bayes.plotting.style import BASES, BEST, PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BANDS = {"touched": "where it is touched", "gap": "in the gap"}
_REFUSED: dict[str, dict[str, Any]] = {
    "bent too far": {"facecolor": "none", "edgecolor": "white", "hatch": "////"},
    "touches little": {"facecolor": "none", "edgecolor": "white", "hatch": ".."},
    "does not reach": {"facecolor": "0.9", "edgecolor": "0.6", "hatch": "xx"},
    "cannot be swept": {"facecolor": "0.9", "edgecolor": "0.6", "hatch": ".."},
}
_MARKS: list[dict[str, Any]] = [{"marker": mark, "markersize": 5.0} for mark in "osD^vP*X<>"]
_MOST_IN_LINE = 6  # largest number of legend entries in a row


@plot("the argument does not hold that group")
def required_noise(found: xr.Dataset | xr.DataTree, *, ax: Axes | None = None) -> Axes:
    """Draw the expected mean width of the band over the noise of the load cell, both logarithmic.

    The lower axis is the noise of the forces, the upper axis the noise of the moment in proportion. The plan's own load
    cell is marked. If the priors alone give every band that was asked for, the Axes hold a note instead.

    Parameters
    ----------
    found : xr.Dataset or xr.DataTree
        Result of `tactile_bayes.sensitivity`, or its group "required_noise".

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


@plot("the argument is not a result of `required_rod`")
def required_rod(found: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the expected mean width of the band over the length and the diameter of the rod, with a colour bar.

    Rods that are bent too far, touch little or nothing of the contour, or cannot be swept, are hatched; among the
    others, the rod with the narrowest band is marked.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.planning.required_rod`.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> dims, metres = ("length", "diameter"), {"units": "m"}
    >>> sizes = {"length": ("length", [0.1, 0.2], metres), "diameter": ("diameter", [2e-4, 4e-4], metres)}
    >>> found = xr.Dataset({"width": (dims, [[2e-4, 1e-4], [4e-4, 3e-4]], metres)}, sizes, {"probability": 0.95})
    >>> found["status"] = dims, [["ok", "bent too far"], ["ok", "ok"]]
    >>> found = found.assign(best_length=0.1, best_diameter=2e-4, best_width=2e-4)
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
    ax.set(xlim=x[[0, -1]], ylim=y[[0, -1]])
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
    words = f"mean width of the {percent(found.attrs['probability'])} band"
    return f"{words} {_BANDS.get(str(found.attrs.get('where')), '')}".rstrip()


def _plain(attrs: Mapping[Any, Any], si: str) -> dict[str, str]:
    """Return the unit as records state it: "1" for quantities in units of the rod."""
    return {"units": si if attrs.get("units") == si else "1"}


@plot("the argument is not an error map, or does not hold the choice")
def error_map(
    found: xr.Dataset,
    *,
    quantity: Literal["across", "along", "touched", "gap"] = "across",
    reconstruction: Literal["raw", "constrained"] = "constrained",
    ax: Axes | None = None,
) -> Axes:
    """Draw errors of contacts, or widths of bands, over the noise: a line for each contour and distance.

    For contacts, a solid line is the root mean square error of those with the status "ok", and a dashed line its
    first-order prediction. For bands, filled markers are widths of posterior bands, where some were inferred, and
    dashed lines with hollow markers are widths expected from Fisher's information. Where the two part, first order
    ceases to hold. Colours denote contours, markers distances. Combinations without any result are left out, and named.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.planning.error_map`.
    quantity : {"across", "along", "touched", "gap"}
        Errors of contacts across the contour or along it, or widths of bands where it is touched or in the gap.
    reconstruction : {"raw", "constrained"}
        Method of Step 2 that made the contacts.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from tactile_bayes.planning import error_map as error_map_of
    >>> study = error_map_of(["II"], over={"noise_factor": [0.1, 1.0]}, replicates=1, rng=1, workers=1)
    >>> error_map(study, ax=Figure().subplots()).get_ylabel()
    'RMS error across the contour [$L$]'
    """
    check_dataset(found, {"rms_across", "contour", "distance", "noise_factor"}, "error map", "error_map")
    check_choice("quantity", quantity, ("across", "along", *_BANDS))
    check_among("reconstruction", reconstruction, found)
    ax = axes_for(ax)
    found = found.isel(noise_factor=np.argsort(found["noise_factor"].values))
    observed, predicted, label, title = _drawn(found, quantity, reconstruction)
    factor, contours, distances = (found[name].values for name in ("noise_factor", "contour", "distance"))
    is_band = quantity in _BANDS
    drawn: list[Floats] = []
    missing: list[str] = []
    is_there = np.zeros((contours.size, distances.size), dtype=bool)
    for i, j in np.ndindex(is_there.shape):
        there, first = observed.values[i, j], predicted.values[i, j]
        if not np.isfinite([*there, *first]).any():
            missing.append(f"{contours[i]} at {number(float(distances[j]))} L")
            continue
        is_there[i, j] = True
        drawn += [there, first]
        style: dict[str, Any] = {"color": BASES[i % len(BASES)], "linewidth": 1.3}
        mark = _MARKS[j % len(_MARKS)]
        hollow = mark | {"markerfacecolor": "white"} if is_band or factor.size == 1 else {}
        ax.plot(factor, first, linestyle="--", zorder=2, **style, **hollow)
        ax.plot(factor, there, linestyle="none" if is_band else "-", zorder=3, **style, **mark)
    if not drawn:
        return write_instead(ax, "there is no gap" if quantity == "gap" else "no cell of this map has a result")
    for i in np.flatnonzero(is_there.any(axis=1)):
        legend_entry(ax, str(contours[i]), color=BASES[i % len(BASES)], linewidth=2.5)
    for j in np.flatnonzero(is_there.any(axis=0)):
        legend_entry(ax, f"at {number(distances[j])} L", color="0.35", linestyle="none", **_MARKS[j % len(_MARKS)])
    legend_entry(ax, "first order", color="0.35", linestyle="--", linewidth=1.3)
    set_log_scale(ax.yaxis, label, "contact_x", predicted.attrs, np.concatenate(drawn))
    set_log_scale(ax.xaxis, _noise_label(found), "sweep", {}, factor)
    if factor.size <= 8:  # more ticks would run into one another
        ax.set_xticks(factor)
    entries = len(ax.get_legend_handles_labels()[1])
    legend_above(ax, entries if entries <= _MOST_IN_LINE else -(-entries // 2), title=title)
    if missing:
        corner: dict[str, Any] = {"transform": ax.transAxes, "ha": "right", "va": "bottom"}
        ax.text(0.99, 0.02, f"no result: {', '.join(missing)}", fontsize="small", color="0.35", **corner)
    return ax


def _drawn(found: xr.Dataset, quantity: str, reconstruction: str) -> tuple[xr.DataArray, xr.DataArray, str, str]:
    """Return what was observed and predicted, over contour, distance and noise_factor, its label and a title."""
    if quantity in _BANDS:
        both = found[f"posterior_{quantity}_width"], found[f"expected_{quantity}_width"]
        label = _band_in_words(found)
        title = f"bands {_BANDS[quantity]}" + (": filled markers are posteriors" if both[0].notnull().any() else "")
    else:
        of_method = found.sel(reconstruction=reconstruction)
        both = of_method[f"rms_{quantity}"], of_method[f"first_order_{quantity}"]
        label = f"RMS error {quantity} the contour"
        title = f'{reconstruction} contact points with the status "ok"'
    observed, predicted = (each.transpose("contour", "distance", "noise_factor") for each in both)
    return observed, predicted, label, title


def _noise_label(found: xr.Dataset) -> str:
    """Return the label of the noise factor, with the noise at factor 1 if known."""
    if "force_noise" not in found.variables or "moment_noise" not in found.variables:
        return "noise factor"
    units = {"units": "1"} if found["rms_across"].attrs.get("units", "1") == "1" else None
    words = []
    for name, column, unit in (("force_noise", "force_x", "N"), ("moment_noise", "holding_moment", "N m")):
        one = float(found[name].values[0] / found["noise_factor"].values[0])
        power, shown = shown_unit(column, units or {"units": unit}, np.array([one]))
        words.append(f"{number(one, power, digits=3)} {shown}")
    return f"noise factor (1 is {' and '.join(words)})"

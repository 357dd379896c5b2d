"""Errors of contacts and widths of bands over the noise, by contour and distance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_choice
from tactile_bayes.plotting.axes import axes_for, check_among, check_dataset, write_instead
from tactile_bayes.plotting.labels import number, percent, set_log_scale, shown_unit
from tactile_bayes.plotting.legends import legend_above, legend_entry
from tactile_bayes.plotting.marks import BASES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Quantity = Literal["across", "along", "touched", "gap"]

_MARKS: list[dict[str, Any]] = [{"marker": mark, "markersize": 5.0} for mark in "osD^vP*X<>"]
_MOST_TICKS = 8
_MOST_IN_LINE = 6  # largest number of legend entries in a row
_BANDS = {"touched": "where it is touched", "gap": "in the gap"}


def error_map(
    found: xr.Dataset,
    *,
    quantity: Quantity = "across",
    reconstruction: Literal["raw", "constrained"] = "constrained",
    ax: Axes | None = None,
) -> Axes:
    """Draw errors of contacts, or widths of bands, over the noise: a line for each contour and distance.

    For contacts, a solid line is the root mean square error of those with the status "ok", and a dashed line its
    first-order prediction. For bands, filled markers are widths of posterior bands, where some were inferred, and
    dashed lines with hollow markers are widths expected from Fisher's information. Where the two part, first order
    ceases to hold.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.planning.error_map`.
    quantity : {"across", "along", "touched", "gap"}
        Errors of contacts across the contour or along it, or widths of bands where it is touched or in the gap.
    reconstruction : {"raw", "constrained"}
        Method of Step 2 that made the contacts.
    ax : Axes, optional

    Returns
    -------
    Axes
        Colours denote contours, markers distances. Combinations without any result are left out, and named.

    Raises
    ------
    ParameterError
        If the argument is not an error map, or does not hold the choice.

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
    observed, predicted = _observed_and_predicted(found, quantity, reconstruction)
    factor = found["noise_factor"].values
    contours, distances = found["contour"].values, found["distance"].values
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
    set_log_scale(ax.yaxis, _label(found, quantity), "contact_x", predicted.attrs, np.concatenate(drawn))
    set_log_scale(ax.xaxis, _noise_label(found), "sweep", {}, factor)
    if factor.size <= _MOST_TICKS:
        ax.set_xticks(factor)
    entries = len(ax.get_legend_handles_labels()[1])
    title = _title(quantity, reconstruction, bool(np.isfinite(observed.values).any()))
    legend_above(ax, entries if entries <= _MOST_IN_LINE else -(-entries // 2), title=title)
    if missing:
        corner: dict[str, Any] = {"transform": ax.transAxes, "ha": "right", "va": "bottom"}
        ax.text(0.99, 0.02, f"no result: {', '.join(missing)}", fontsize="small", color="0.35", **corner)
    return ax


def _observed_and_predicted(found: xr.Dataset, quantity: str, reconstruction: str) -> tuple[xr.DataArray, xr.DataArray]:
    """Return both over contour, distance and noise_factor."""
    if quantity in _BANDS:
        both = found[f"posterior_{quantity}_width"], found[f"expected_{quantity}_width"]
    else:
        of_method = found.sel(reconstruction=reconstruction)
        both = of_method[f"rms_{quantity}"], of_method[f"first_order_{quantity}"]
    observed, predicted = (each.transpose("contour", "distance", "noise_factor") for each in both)
    return observed, predicted


def _label(found: xr.Dataset, quantity: str) -> str:
    if quantity in _BANDS:
        return f"mean width of the {percent(found.attrs['probability'])} band"
    return f"RMS error {quantity} the contour"


def _title(quantity: str, reconstruction: str, has_posteriors: bool) -> str:
    if quantity in _BANDS:
        return f"bands {_BANDS[quantity]}" + (": filled markers are posteriors" if has_posteriors else "")
    return f'{reconstruction} contact points with the status "ok"'


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

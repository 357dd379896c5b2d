"""How wrong contacts and bands are over the noise, by contour and distance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import BASES, Floats, legend_entry, number, shown_unit, single_axes
from tactile_bayes.plotting.planning_groups import set_log_scale

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["error_map"]

Quantity = Literal["across", "along", "touched", "gap"]

_MARKERS = "osD^vP*X<>"
_MOST_TICKS = 8
_MOST_IN_LINE = 6
"""Entries of the legend."""

_BANDS = {"touched": "where it is touched", "gap": "in the gap"}


def error_map(
    found: xr.Dataset,
    *,
    quantity: Quantity = "across",
    reconstruction: Literal["raw", "constrained"] = "constrained",
    ax: Axes | None = None,
) -> Axes:
    """Errors of contacts, or widths of bands, over the noise: a line for each contour and distance.

    Of contacts, a solid line is the root mean square error of those with the status "ok", and a dashed one is what
    first order foretells for the same. Of bands, filled markers are those of posteriors, where some were inferred, and
    dashed lines with hollow markers those that are to be expected from Fisher's information. Where the two part, first
    order stops holding.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.error_map`.
    quantity : {"across", "along", "touched", "gap"}
        Errors of contacts across the contour or along it, or widths of bands where it is touched or in the gap.
    reconstruction : {"raw", "constrained"}
        Whose contacts.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Colours are contours, markers are distances. Those of which no cell has an answer are left out, and named.

    Raises
    ------
    ParameterError
        If this is no error map, or it has not what is chosen.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from tactile_bayes import error_map as error_map_of
    >>> study = error_map_of(["II"], noise_factors=[0.1, 1.0], replicates=1, seed=1, workers=1)
    >>> error_map(study, ax=Figure().subplots()).get_ylabel()
    'RMS error across the contour [$L$]'
    """
    if not isinstance(found, xr.Dataset) or not {"rms_across", "contour", "distance", "noise_factor"} <= set(
        found.variables
    ):
        raise ParameterError("this is no error map: give what error_map returned")
    if quantity not in ("across", "along", *_BANDS):
        raise ParameterError(f"quantity is {quantity!r}: choose 'across', 'along', 'touched' or 'gap'")
    if reconstruction not in found["reconstruction"].values:
        raise ParameterError(
            f"reconstruction is {reconstruction!r}: there are {', '.join(map(str, found['reconstruction'].values))}"
        )
    ax = single_axes() if ax is None else ax
    found = found.isel(noise_factor=np.argsort(found["noise_factor"].values))
    seen, foretold = _seen_and_foretold(found, quantity, reconstruction)
    factor = found["noise_factor"].values
    drawn: list[Floats] = []
    missing: list[str] = []
    contours, distances = found["contour"].values, found["distance"].values
    is_there = np.zeros((contours.size, distances.size), dtype=bool)
    for i, contour in enumerate(contours):
        for j, distance in enumerate(distances):
            there, first = seen.values[i, j], foretold.values[i, j]
            if not np.isfinite([*there, *first]).any():
                missing.append(f"{contour} at {number(distance)} L")
                continue
            is_there[i, j] = True
            style: dict[str, Any] = {"color": BASES[i % len(BASES)], "linewidth": 1.3}
            marker: dict[str, Any] = {"marker": _MARKERS[j % len(_MARKERS)], "markersize": 5.0}
            hollow: dict[str, Any] = (
                marker | {"markerfacecolor": "white"} if quantity in _BANDS or factor.size == 1 else {}
            )
            ax.plot(factor, first, linestyle="--", zorder=2, **style, **hollow)
            ax.plot(factor, there, linestyle="none" if quantity in _BANDS else "-", zorder=3, **style, **marker)
            drawn += [there, first]
    if not drawn:
        ax.set_axis_off()
        words = "there is no gap" if quantity == "gap" else "no cell of this map has an answer"
        ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", va="center")
        return ax
    for i, contour in enumerate(contours):
        if is_there[i].any():
            legend_entry(ax, str(contour), color=BASES[i % len(BASES)], linewidth=2.5)
    for j, distance in enumerate(distances):
        if is_there[:, j].any():
            marker = {"marker": _MARKERS[j % len(_MARKERS)], "markersize": 5.0}
            legend_entry(ax, f"at {number(distance)} L", color="0.35", linestyle="none", **marker)
    legend_entry(ax, "first order", color="0.35", linestyle="--", linewidth=1.3)
    set_log_scale(ax.yaxis, _label(found, quantity), "contact_x", foretold.attrs, np.concatenate(drawn))
    set_log_scale(ax.xaxis, _noise_label(found), "sweep", {}, factor)
    if factor.size <= _MOST_TICKS:
        ax.set_xticks(factor)
    entries = len(ax.get_legend_handles_labels()[1])
    ax.legend(
        title=_title(quantity, reconstruction, bool(np.isfinite(seen.values).any())),
        title_fontsize="small",
        fontsize="small",
        frameon=False,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=entries if entries <= _MOST_IN_LINE else -(-entries // 2),
    )
    if missing:
        ax.annotate(
            f"no answer: {', '.join(missing)}",
            (0.99, 0.02),
            xycoords="axes fraction",
            ha="right",
            va="bottom",
            fontsize="small",
            color="0.35",
        )
    return ax


def _seen_and_foretold(found: xr.Dataset, quantity: str, reconstruction: str) -> tuple[xr.DataArray, xr.DataArray]:
    """Over contour, distance and noise_factor."""
    if quantity in _BANDS:
        both = found[f"posterior_{quantity}_width"], found[f"expected_{quantity}_width"]
    else:
        of_method = found.sel(reconstruction=reconstruction)
        both = of_method[f"rms_{quantity}"], of_method[f"first_order_{quantity}"]
    seen, foretold = (each.transpose("contour", "distance", "noise_factor") for each in both)
    return seen, foretold


def _label(found: xr.Dataset, quantity: str) -> str:
    if quantity in _BANDS:
        return f"mean width of the {100.0 * found.attrs['probability']:.6g} % band"
    return f"RMS error {quantity} the contour"


def _title(quantity: str, reconstruction: str, is_seen: bool) -> str:
    if quantity in _BANDS:
        return f"bands {_BANDS[quantity]}" + (": filled markers are posteriors" if is_seen else "")
    return f'{reconstruction} contact points with the status "ok"'


def _noise_label(found: xr.Dataset) -> str:
    """With what the factor is on, where that is known."""
    if "force_noise" not in found.variables or "moment_noise" not in found.variables:
        return "noise factor"
    units = {"units": "1"} if found["rms_across"].attrs.get("units", "1") == "1" else None
    words = []
    for name, column, unit in (("force_noise", "force_x", "N"), ("moment_noise", "holding_moment", "N m")):
        one = float(found[name].values[0] / found["noise_factor"].values[0])
        power, shown = shown_unit(column, units or {"units": unit}, np.array([one]))
        words.append(f"{number(one, power, digits=3)} {shown}")
    return f"noise factor (1 is {' and '.join(words)})"

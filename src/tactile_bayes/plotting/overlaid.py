"""Bands of several runs, and another contour, laid over each other."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_mapping, check_optional, check_switch
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import axes_for, check_dataset
from tactile_bayes.plotting.labels import LABELS, set_unit
from tactile_bayes.plotting.legends import legend_above, legend_entries
from tactile_bayes.plotting.maps import contacts_within, finish_map
from tactile_bayes.plotting.marks import BASES, TRUTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.uncertainty.overlay import Overlay

_CONTACTS: dict[str, Any] = {
    "marker": "o",
    "markersize": 2.2,
    "markeredgewidth": 0.0,
    "linestyle": "none",
    "alpha": 0.6,
    "zorder": 3,
}


def overlaid(
    bands: Mapping[str, xr.Dataset],
    *,
    contacts: Mapping[str, xr.Dataset] | None = None,
    overlay: Overlay | None = None,
    enlarged: bool = False,
    ax: Axes | None = None,
) -> Axes:
    """Draw bands of several runs over each other, and over another contour.

    Parameters
    ----------
    bands : mapping of str to xr.Dataset
        Bands by the name of the run, from `contour_band`.
    contacts : mapping of str to xr.Dataset, optional
        Contact points of these runs: contact_x and contact_y; if present, only those with status "ok" are drawn.
    overlay : Overlay, optional
        Another contour, from `tactile_bayes.uncertainty.read_overlay`.
    enlarged : bool
        If True, y is measured from `overlay`, or without it from the median of the first run, so that narrow bands are
        visible; contacts are then left out.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If there is no band, or something is none.

    Examples
    --------
    >>> flat = {"lower": ("x", [0.4, 0.4]), "median": ("x", [0.5, 0.5]), "upper": ("x", [0.6, 0.6])}
    >>> band = xr.Dataset(flat, coords={"x": [0.0, 1.0]})
    >>> overlaid({"one": band, "two": band + 0.05}, enlarged=True).get_ylabel()
    '$y$ − one [$L$]'
    """
    from tactile_bayes.uncertainty.overlay import Overlay  # loads the sampler

    check_switch("enlarged", enlarged)
    check_optional("overlay", overlay, Overlay, "give what read_overlay returned")
    for name, found in (("bands", bands), ("contacts", contacts)):
        check_mapping(name, found, "give datasets by the name of the run")
    if not bands:
        raise ParameterError("there are no bands: give at least one, by the name of its run")
    for band in bands.values():
        check_dataset(band, {"x", "lower", "median", "upper"}, "band", "contour_band")
    for points in (contacts or {}).values():
        check_dataset(points, {"contact_x", "contact_y"}, "dataset of contact points", "reconstruct")
    ax = axes_for(ax)
    first = next(iter(bands))
    reference = (overlay or Overlay.of_band(first, bands[first])) if enlarged else None
    for (name, band), colour in zip(bands.items(), cycle(BASES), strict=False):
        x, base = band["x"].values, _height(reference, band)
        lower, upper = band["lower"].values - base, band["upper"].values - base
        ax.fill_between(x, lower, upper, color=colour, alpha=0.3, linewidth=0.5, zorder=1.5)
        ax.plot(x, band["median"].values - base, color=colour, linewidth=1.0, label=name)
        if contacts and name in contacts and not enlarged:
            points = contacts[name].isel(sample=contacts_within(contacts[name], x.min(), x.max()))
            ax.plot(points["contact_x"].values, points["contact_y"].values, color=colour, **_CONTACTS)
    attrs: Mapping[Any, Any] = bands[first]["lower"].attrs or bands[first]["x"].attrs
    limits = [*ax.get_xlim(), *ax.get_ylim()]
    if overlay is not None:
        for piece in overlay.polyline.pieces if reference is None else [np.array([limits[:2], [0.0, 0.0]]).T]:
            ax.plot(*piece.T, **TRUTH, label=overlay.name)
    ax.set(xlim=limits[:2], ylim=limits[2:])  # those of the bands: a drawing may be much larger
    if reference is None:
        finish_map(ax, attrs)
        return ax
    set_unit(ax.xaxis, LABELS["contact_x"] + " ", "contact_x", attrs, np.array(limits[:2]))
    set_unit(ax.yaxis, f"{LABELS['contact_y']} − {reference.name} ", "contact_y", attrs, np.array(limits[2:]))
    legend_above(ax, min(4, len(legend_entries(ax))), legend_entries(ax))
    return ax


def _height(reference: Overlay | None, band: xr.Dataset) -> Floats:
    """Return the heights from which a band is measured."""
    if reference is None:
        return np.zeros(band.sizes["x"])
    return reference.polyline.height(band["x"].values, band["median"].values)

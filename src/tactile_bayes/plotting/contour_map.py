"""Figures of inferred contours: a map, bands in detail or over each other, and the gap enlarged."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_array, check_mapping, check_numbers, check_optional, check_switch
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import axes_for, check_dataset, plot, write_instead
from tactile_bayes.plotting.labels import (
    legend_above,
    legend_entries,
    legend_entry,
    number,
    percent,
    shown_unit,
)
from tactile_bayes.plotting.maps import contacts_within, draw_gap, draw_pivot, finish_map, label_enlarged, outline
from tactile_bayes.plotting.style import BASES, CONTACT_MARKERS, PALETTE, PHASES, TRUTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.contours.base import Contour
    from tactile_bayes.uncertainty.overlay import Overlay

_SHAPE: dict[str, Any] = {"color": "#5FA5D2", "linewidth": 0.0}  # the band of the shape alone
_MARGIN = 0.12  # margin beside the gap, as a share of its width
_ROOM = 0.12  # margin above and below the curves, as a share of their height
_ENDS: dict[str, Any] = {"color": "black", "marker": "o", "markersize": 5.0, "markerfacecolor": "white", "zorder": 4}
_ENDS |= {"markeredgewidth": 1.1, "linestyle": "none", "linewidth": 1.1, "capsize": 2.5}
_CONTACTS: dict[str, Any] = {"marker": "o", "markersize": 2.2, "markeredgewidth": 0.0, "linestyle": "none"}
_CONTACTS |= {"alpha": 0.6, "zorder": 3}
_EDGES = {"x", "lower", "median", "upper"}
_GAP = {"left", "right", "bound"}


@plot("`x` does not span a range")
def contour(
    x: ArrayLike,
    *,
    truth: Contour | None = None,
    contacts: xr.Dataset | None = None,
    band: xr.Dataset | None = None,
    gap: tuple[float, float] | xr.Dataset | None = None,
    base: tuple[float, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw an inferred contour: contact points, band and gap, with the true contour where it is known.

    Parameters
    ----------
    x : array_like, shape (n,)
        Numbers that span the range drawn, in the record's unit of length.
    contacts : xr.Dataset, optional
        Over "sample": contact_x and contact_y; contact_phase colours the points, and of those with a status only "ok"
        is drawn.
    band : xr.Dataset, optional
        Over coordinate "x": lower, upper and median, with the probability of the band as attribute.
    gap : (float, float) or xr.Dataset, optional
        x of the contacts between which nothing was touched; if the first is the larger, the sweeps overlap. Or the
        result of `tactile_bayes.gap`, of which the medians are drawn.
    base : (float, float), optional
        The pivot, in the record's unit of length.

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> contour([-0.6, 0.6], truth=paper_profile("II", q=0.5), gap=(-0.1, 0.1), base=(0.0, 0.0)).get_ylabel()
    '$y$ [$L$]'
    """
    if band is not None:
        check_dataset(band, {"x", "lower", "upper"}, "band", "contour_band")
    if contacts is not None:
        check_dataset(contacts, {"contact_x", "contact_y"}, "dataset of contact points", "reconstruct")
    if base is not None:
        check_numbers("base", base, "give a pivot (x, y)", shape=(2,))
    ends = None if gap is None else _ends_of_gap(gap)
    drawn = check_array("x", x, "give numbers that span the range to be drawn")
    if not (drawn.size >= 2 and np.all(np.isfinite(drawn)) and np.ptp(drawn) > 0.0):
        raise ParameterError("x must span the range to be drawn: at least two different finite numbers")
    low, high = float(drawn.min()), float(drawn.max())
    ax = axes_for(ax, truth)

    if ends is not None:
        _draw_gap(ax, *ends)
    attrs: Mapping[Any, Any] = {}
    if band is not None:
        attrs = band["lower"].attrs or band["x"].attrs
        probability = band.attrs.get("probability")
        label = "band" if probability is None else f"{percent(probability)} band"
        slack = 1e-9 * (high - low)
        band = band.isel(x=(band["x"].values >= low - slack) & (band["x"].values <= high + slack))
        at, lower, upper = (band[name].values for name in ("x", "lower", "upper"))
        ax.fill_between(at, lower, upper, color=PALETTE["band"], linewidth=0.5, zorder=1.5, label=label)
        if "median" in band:
            ax.plot(at, band["median"].values, color=PALETTE["median"], linewidth=1.0, label="median")
    if truth is not None:
        ax.plot(*outline(truth, low, high), label="true contour", **TRUTH)
    if contacts is not None:
        attrs = contacts["contact_x"].attrs or attrs
        _draw_contacts(ax, contacts, low, high)
    if base is not None:
        draw_pivot(ax, base)
    margin = 0.03 * (high - low)
    ax.set_xlim(low - margin, high + margin)
    finish_map(ax, attrs)
    return ax


@plot()
def band_detail(
    band: xr.Dataset,
    *,
    truth: Contour | None = None,
    gap: tuple[float, float] | xr.Dataset | None = None,
    shape: xr.Dataset | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a band measured from its median, enlarged to fill the Axes; on a map a narrow band is invisible.

    Parameters
    ----------
    band : xr.Dataset
        Over coordinate "x": lower, upper and median.
    gap : (float, float) or xr.Dataset, optional
        As in `contour`.
    shape : xr.Dataset, optional
        A further band, of the shape alone (`contour_band(..., align="translation")`), drawn from its own median.

    Examples
    --------
    >>> flat = {"lower": ("x", [-1e-3, -2e-3]), "median": ("x", [0.0, 0.0]), "upper": ("x", [1e-3, 2e-3])}
    >>> band_detail(xr.Dataset(flat, coords={"x": [0.0, 1.0]})).get_ylabel()
    '$y$ − median [$L$]'
    """
    check_dataset(band, _EDGES, "band", "contour_band")
    ends = None if gap is None else _ends_of_gap(gap)
    ax = axes_for(ax, truth)
    x, median = band["x"].values, band["median"].values
    lower, upper = band["lower"].values - median, band["upper"].values - median
    if ends is not None:
        _draw_gap(ax, *ends)
    ax.fill_between(x, lower, upper, color=PALETTE["band"], linewidth=0.5, zorder=1.5)
    if shape is not None:
        check_dataset(shape, _EDGES, "band", "contour_band")
        edges = [shape[edge].values - shape["median"].values for edge in ("lower", "upper")]
        ax.fill_between(shape["x"].values, *edges, zorder=1.6, label="band of the shape alone, up to a shift", **_SHAPE)
        legend_above(ax, 1, legend_entries(ax))
    ax.axhline(0.0, color=PALETTE["median"], linewidth=1.0)
    if truth is not None:
        ax.plot(x, np.asarray(truth.height(x)) - median, **TRUTH)
    margin = 0.03 * float(np.ptp(x))
    ax.set_xlim(float(x.min()) - margin, float(x.max()) + margin)
    label_enlarged(ax, band["lower"].attrs or band["x"].attrs, x, np.concatenate([lower, upper]), "median")
    return ax


@plot("there is no band, or something is none")
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
        check_dataset(band, _EDGES, "band", "contour_band")
    for points in (contacts or {}).values():
        check_dataset(points, {"contact_x", "contact_y"}, "dataset of contact points", "reconstruct")
    ax = axes_for(ax)
    first = next(iter(bands))
    reference = (overlay or Overlay.of_band(first, bands[first])) if enlarged else None
    for (name, band), colour in zip(bands.items(), cycle(BASES), strict=False):
        x, median = band["x"].values, band["median"].values
        base = np.zeros(x.size) if reference is None else reference.polyline.height(x, median)
        lower, upper = band["lower"].values - base, band["upper"].values - base
        ax.fill_between(x, lower, upper, color=colour, alpha=0.3, linewidth=0.5, zorder=1.5)
        ax.plot(x, median - base, color=colour, linewidth=1.0, label=name)
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
    label_enlarged(ax, attrs, np.array(limits[:2]), np.array(limits[2:]), reference.name)
    legend_above(ax, min(4, len(legend_entries(ax))), legend_entries(ax))
    return ax


@plot()
def gap(found: xr.Dataset, *, truth: Contour | None = None, ax: Axes | None = None) -> Axes:
    """Draw certificate and band of the contour inside the gap, measured from the chord between the end contacts.

    Convexity alone confines the contour to the triangle, with a paler rim for the uncertainty of the end contacts; the
    bands are the posterior's. The legend gives the largest width of each in y. If the sweeps overlap, the Axes hold a
    note instead.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.gap`.

    Examples
    --------
    >>> from tactile_bayes import gap as gap_of
    >>> ends = {"first_contact_x": [0.9, -0.9], "snap_off_contact_x": [0.1, -0.1], "snap_off_drive_angle": [3.2, -0.1]}
    >>> posterior = xr.Dataset({k: (("chain", "draw"), [[v]]) for k, v in {"a": 0.5, "q": 0.3, "x_c": 0.0}.items()})
    >>> events = xr.Dataset({k: (("chain", "draw", "segment"), [[v]]) for k, v in ends.items()})
    >>> events["segment"] = ["forward", "backward"]
    >>> tree = xr.DataTree.from_dict({"posterior": posterior, "events": events})
    >>> tree.attrs = {"family": "parabola", "units": "dimensionless"}
    >>> gap(gap_of(tree)).get_ylabel()
    '$y$ − chord [$L$]'
    """
    check_dataset(found, _GAP, "gap", "gap", ["probability"])
    ax = axes_for(ax, truth)
    middle = {name: float(found[name].sel(bound="median")) for name, v in found.items() if v.dims == ("bound",)}
    if not middle["left"] < middle["right"]:
        return write_instead(ax, "the sweeps overlap: no gap is left")
    x, attrs, share = found["x"].values, found["left"].attrs, percent(found.attrs["probability"])
    ends = np.array([middle["left"], middle["right"]])
    margin = _MARGIN * float(np.ptp(ends))
    incline = (middle["right_y"] - middle["left_y"]) / float(np.ptp(ends))

    def above_chord(x: Floats, y: Floats) -> Floats:
        return y - (middle["left_y"] + incline * (x - ends[0]))

    def edges(name: str, *which: str) -> list[Floats]:
        return [above_chord(x, found[f"{name}_{edge}"].values) for edge in which]

    def wide(width: Any) -> str:
        power, unit = shown_unit("contact_x", attrs, np.array([float(width)]))
        return f"{number(float(width), power, digits=3)} {unit} wide"

    least, most = edges("triangle", "lower", "upper")
    corners_x = np.array([ends[0], middle["apex_x"], ends[1]])
    corners_y = above_chord(corners_x, np.array([middle["left_y"], middle["apex_y"], middle["right_y"]]))
    style: dict[str, Any] = {"linewidth": 0.0, "color": PALETTE["gap"]}
    label = f"triangle of chord and tangents, {wide(middle['triangle_width'])}"
    ax.fill(corners_x, corners_y, alpha=0.45, zorder=0.6, label=label, **style)
    if np.isfinite(most - least).any():
        label = f"triangle with uncertain ends, {share}, {wide(np.nanmax(most - least))}"
        ax.fill_between(x, least, most, alpha=0.22, zorder=0.5, label=label, **style)
    outside = np.concatenate([ends[:1] - margin, ends, ends[1:] + margin])
    ax.plot(outside, np.zeros(4), color="0.45", linewidth=0.8, linestyle=(0, (6.0, 3.0)), zorder=1.0, label="chord")
    for side, beyond in ((0, -margin), (1, margin)):
        slope = (corners_y[1] - corners_y[2 * side]) / (corners_x[1] - corners_x[2 * side])
        reach = np.array([ends[side] + beyond, corners_x[1]])
        ax.plot(reach, slope * (reach - ends[side]), color="0.45", linewidth=0.9, zorder=1.0, label="end tangents")

    drawn = np.concatenate([corners_y, least, most])
    if "band_without_events_lower" in found:
        lower, upper = edges("band_without_events", "lower", "upper")
        label = f"{share} band without events, {wide(found['band_width_without_events'])}"
        ax.fill_between(x, lower, upper, color="0.86", linewidth=0.0, zorder=0.4, label=label)
        for edge in (lower, upper):
            ax.plot(x, edge, color="0.4", linewidth=0.9, linestyle=(0, (1.0, 1.2)), zorder=2.1)
        # A band much wider than the triangle leaves the figure, so that the rest stays visible.
        room = 0.7 * float(np.ptp(drawn))
        drawn = np.concatenate([drawn, np.clip([*lower, *upper], drawn.min() - room, drawn.max() + room)])
    lower, median, upper = edges("band", "lower", "median", "upper")
    label = f"{share} band, {wide(found['band_width'])}"
    ax.fill_between(x, lower, upper, color=PALETTE["band"], linewidth=0.0, zorder=1.6, label=label)
    ax.plot(x, median, color=PALETTE["median"], linewidth=1.2, zorder=2.2, label="median")
    if truth is not None:
        along = np.linspace(outside[0], outside[-1], 401)
        height = above_chord(along, np.asarray(truth.height(along)))
        ax.plot(along, height, zorder=2.4, label="true contour", **TRUTH)
    _draw_ends(ax, found, above_chord)

    drawn = np.concatenate([drawn, lower, upper])
    low, high = float(np.nanmin(drawn)), float(np.nanmax(drawn))
    ax.set_xlim(outside[0], outside[-1])
    ax.set_ylim(low - _ROOM * (high - low), high + _ROOM * (high - low) + 0.1 * abs(low))
    label_enlarged(ax, attrs, outside, drawn, "chord")
    legend_above(ax, 2, legend_entries(ax))
    return ax


def _draw_contacts(ax: Axes, contacts: xr.Dataset, low: float, high: float) -> None:
    x, y = contacts["contact_x"].values, contacts["contact_y"].values
    drawn = contacts_within(contacts, low, high)
    phase = contacts["contact_phase"].values if "contact_phase" in contacts else np.full(x.shape, "none")
    for name, label in (*PHASES.items(), ("none", "contact")):
        chosen = drawn & (phase == name)
        if chosen.any():
            style: dict[str, Any] = {"color": PALETTE[name], "marker": CONTACT_MARKERS[name], "linestyle": "none"}
            ax.plot(x[chosen], y[chosen], markersize=2.6, markeredgewidth=0.0, alpha=0.6, zorder=3, **style)
            legend_entry(ax, label, markersize=4.0, **style)


def _ends_of_gap(gap: Any) -> tuple[float, float]:
    """Return where a gap begins and ends, from a result of `gap` or two numbers."""
    if isinstance(gap, xr.Dataset):
        check_dataset(gap, _GAP, "gap", "gap")
        gap = [gap[side].sel(bound="median").item() for side in ("left", "right")]
    begin, end = check_numbers("gap", gap, "give two numbers, or what gap returned", shape=(2,)).tolist()
    return begin, end


def _draw_gap(ax: Axes, begin: float, end: float) -> None:
    is_gap = begin <= end
    draw_gap(ax, min(begin, end), max(begin, end), "gap" if is_gap else "overlap", hatched=is_gap)


def _draw_ends(ax: Axes, found: xr.Dataset, above_chord: Any) -> None:
    """Draw the end contacts with the intervals of their x."""
    for side in ("left", "right"):
        lower, middle, upper = (float(found[side].sel(bound=bound)) for bound in ("lower", "median", "upper"))
        y = above_chord(np.array([middle]), np.array([float(found[f"{side}_y"].sel(bound="median"))]))
        width = [[middle - lower], [upper - middle]]
        ax.errorbar([middle], y, xerr=width, label="end contacts", **_ENDS)

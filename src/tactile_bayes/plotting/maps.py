"""Figures in the plane of object and rod: deformed rods, and the contour as it was found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import (
    LABELS,
    PALETTE,
    PHASES,
    Floats,
    handles_once,
    legend_entry,
    set_unit,
    single_axes,
)
from tactile_bayes.record import CHANNELS, in_frame, rod_of
from tactile_bayes.shape import rod_shape

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.contours.base import Contour
    from tactile_bayes.scanning import Event, Scan

__all__ = ["band_detail", "contour", "rods"]

_CONTACT_MARKERS = {"tip": "o", "tangential": "s"}


def rods(
    scan: Scan, *, direction: Literal["forward", "backward"] = "forward", count: int = 15, ax: Axes | None = None
) -> Axes:
    """Deformed rods along a sweep, coloured by contact phase, like Figures 7 to 10 of Merker et al. 2018.

    Doi 10.1155/2018/1613945.

    Parameters
    ----------
    scan : Scan
        A scan.
    direction : {"forward", "backward"}
        Which sweep.
    count : int
        How many of its states are drawn at most, evenly over the samples in contact; first contact, phase changes and
        snap-off come on top.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If the scan has no sweep in this direction, or the count is not positive.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> rods(scan(paper_profile("I", q=0.4)), direction="backward").get_xlabel()
    '$x$ [$L$]'
    """
    if direction not in scan.events:
        raise ParameterError(f"the scan has no {direction} sweep: choose from {', '.join(scan.events)}")
    if count < 1:
        raise ParameterError(f"count is {count!r}: at least one rod must be drawn")
    record, events, rod = in_frame(scan.record, "fixed"), scan.events[direction], rod_of(scan.record)
    in_contact = (record["direction"].values == direction) & (record["truth_contact_phase"].values != "none")
    samples = np.flatnonzero(in_contact)
    samples = (
        samples[np.unique(np.linspace(0, samples.size - 1, count).round().astype(int))] if samples.size else samples
    )
    base = np.array([record[f"base_{axis}"].values[record["direction"].values == direction][0] for axis in "xy"])

    def shape(state: Mapping[str, Any]) -> tuple[Floats, Floats]:
        x, y = rod_shape(
            state["drive_angle"],
            state["holding_moment"] / rod.moment_unit,
            state["force_x"] / rod.force_unit,
            state["force_y"] / rod.force_unit,
            side=1 if direction == "forward" else -1,
        )
        return base[0] + rod.length_unit * x, base[1] + rod.length_unit * y

    ax = single_axes() if ax is None else ax
    wrench = ("drive_angle", *CHANNELS)
    names = {name: f"truth_{name}" if f"truth_{name}" in record else name for name in wrench}
    phases = record["truth_contact_phase"].values[samples]
    x, y = shape({name: record[column].values[samples] for name, column in names.items()})
    for phase, label in PHASES.items():
        chosen = phases == phase
        if chosen.any():
            ax.plot(x[chosen].T, y[chosen].T, color=PALETTE[phase], linewidth=0.9, label=label)
            at = samples[chosen]
            ax.plot(
                record["truth_contact_x"].values[at],
                record["truth_contact_y"].values[at],
                linestyle="none",
                marker=_CONTACT_MARKERS[phase],
                markersize=3.0,
                color=PALETTE[phase],
                zorder=3,
            )
    marked: list[tuple[Event, str, str]] = [
        (events.first_contact, "first contact", ":"),
        *((event, "phase change", "-") for event in events.transitions),
        (events.snap_off, "snap-off", "--"),
    ]
    extent = [x, y]
    for event, label, style in marked:
        x, y = shape(vars(event))
        extent = [np.append(a, b) for a, b in zip(extent, (x, y), strict=True)]
        ax.plot(x, y, color=PALETTE["change"], linestyle=style, linewidth=1.4, zorder=2.5, label=label)
        ax.plot(event.contact_x, event.contact_y, "o", color=PALETTE["change"], markersize=4.0, zorder=3.5)
    _draw_pivot(ax, (base[0], base[1]))
    room = 0.05 * rod.length_unit
    box = np.array([[e.min() - room, e.max() + room] for e in extent])
    ax.update_datalim(box.T)
    ax.margins(0.0)
    _draw_object(ax, scan.contour, (box[0, 0], box[0, 1]), box[1, 1])
    _finish_map(ax, record["base_x"].attrs)
    return ax


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
    """The contour as it was found: contact points, band and gap, with the true contour where it is known.

    Parameters
    ----------
    x : array_like
        The range drawn, from its least to its greatest value, in the unit of the record.
    truth : Contour, optional
        The true contour.
    contacts : xr.Dataset, optional
        Over "sample": contact_x, contact_y, and where present contact_phase, which colours the points, and status, of
        which only "ok" is drawn.
    band : xr.Dataset, optional
        Over coordinate "x": lower, upper and median, with the probability of the band as attribute.
    gap : (float, float) or xr.Dataset, optional
        x of the contacts between which nothing was touched; if the first is the greater one, they overlap. Or what
        `tactile_bayes.gap` returns, of which the medians are drawn.
    base : (float, float), optional
        The pivot.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If `x` is no range.

    Examples
    --------
    >>> from tactile_bayes.contours import paper_profile
    >>> contour([-0.6, 0.6], truth=paper_profile("II", q=0.5), gap=(-0.1, 0.1), base=(0.0, 0.0)).get_ylabel()
    '$y$ [$L$]'
    """
    drawn = np.asarray(x, dtype=float)
    if not (drawn.size >= 2 and np.all(np.isfinite(drawn)) and np.ptp(drawn) > 0.0):
        raise ParameterError("x must span the range to be drawn: at least two different finite numbers")
    low, high = float(drawn.min()), float(drawn.max())
    ax = single_axes() if ax is None else ax

    if gap is not None:
        _draw_gap(ax, gap)
    attrs: Mapping[Any, Any] = {}
    if band is not None:
        attrs = band["lower"].attrs or band["x"].attrs
        slack = 1e-9 * (high - low)
        inside = band.isel(x=np.flatnonzero((band["x"].values >= low - slack) & (band["x"].values <= high + slack)))
        probability = band.attrs.get("probability")
        label = "band" if probability is None else f"{100.0 * float(probability):.6g} % band"
        lower, upper = inside["lower"].values, inside["upper"].values
        ax.fill_between(inside["x"].values, lower, upper, color=PALETTE["band"], linewidth=0.5, zorder=1.5, label=label)
        if "median" in inside:
            ax.plot(inside["x"].values, inside["median"].values, color=PALETTE["median"], linewidth=1.0, label="median")
    if truth is not None:
        ax.plot(
            *_outline(truth, low, high), color=PALETTE["change"], linewidth=1.0, linestyle="--", label="true contour"
        )
    if contacts is not None:
        attrs = contacts["contact_x"].attrs or attrs
        _draw_contacts(ax, contacts, low, high)
    if base is not None:
        _draw_pivot(ax, base)
    margin = 0.03 * (high - low)
    ax.set_xlim(low - margin, high + margin)
    _finish_map(ax, attrs)
    return ax


def band_detail(
    band: xr.Dataset,
    *,
    truth: Contour | None = None,
    gap: tuple[float, float] | xr.Dataset | None = None,
    ax: Axes | None = None,
) -> Axes:
    """A band measured from its median, enlarged as far as it fills the Axes; a good one is invisible on a map.

    Parameters
    ----------
    band : xr.Dataset
        Over coordinate "x": lower, upper and median.
    truth : Contour, optional
        The true contour.
    gap : (float, float) or xr.Dataset, optional
        As in `contour`.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Examples
    --------
    >>> import xarray as xr
    >>> flat = {"lower": ("x", [-1e-3, -2e-3]), "median": ("x", [0.0, 0.0]), "upper": ("x", [1e-3, 2e-3])}
    >>> band_detail(xr.Dataset(flat, coords={"x": [0.0, 1.0]})).get_ylabel()
    '$y$ − median [$L$]'
    """
    ax = single_axes() if ax is None else ax
    x, median = band["x"].values, band["median"].values
    lower, upper = band["lower"].values - median, band["upper"].values - median
    if gap is not None:
        _draw_gap(ax, gap)
    ax.fill_between(x, lower, upper, color=PALETTE["band"], linewidth=0.5, zorder=1.5)
    ax.axhline(0.0, color=PALETTE["median"], linewidth=1.0)
    if truth is not None:
        ax.plot(x, np.asarray(truth.height(x)) - median, color=PALETTE["change"], linewidth=1.0, linestyle="--")
    margin = 0.03 * float(np.ptp(x))
    ax.set_xlim(float(x.min()) - margin, float(x.max()) + margin)
    attrs = band["lower"].attrs or band["x"].attrs
    set_unit(ax.xaxis, LABELS["contact_x"] + " ", "contact_x", attrs, x)
    set_unit(ax.yaxis, LABELS["contact_y"] + " − median ", "contact_y", attrs, np.concatenate([lower, upper]))
    return ax


def _finish_map(ax: Axes, attrs: Mapping[Any, Any]) -> None:
    """Equal scales, labels, and a legend beside or above the data, whichever leaves them larger."""
    ax.set_aspect("equal", adjustable="box")
    ax.autoscale_view()
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    limits = np.array([left, right, bottom, top])
    set_unit(ax.xaxis, LABELS["contact_x"] + " ", "contact_x", attrs, limits)
    set_unit(ax.yaxis, LABELS["contact_y"] + " ", "contact_y", attrs, limits)
    handles, labels = handles_once(ax)
    if not labels:
        return
    beside = (right - left) < 1.6 * (top - bottom)
    place: dict[str, Any] = (
        {"loc": "center left", "bbox_to_anchor": (1.01, 0.5)}
        if beside
        else {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "ncols": min(4, len(labels))}
    )
    ax.legend(handles, labels, fontsize="small", frameon=False, **place)


def _outline(contour: Contour, low: float, high: float) -> tuple[Floats, Floats]:
    """Points of a contour between two values of x, closest where it may be upright."""
    ends = [float(np.asarray(contour.locate(end).x)) if np.isfinite(end) else float(end) for end in contour.domain]
    low, high = max(low, ends[0]), min(high, ends[1])
    x = low + 0.5 * (high - low) * (1.0 - np.cos(np.linspace(0.0, np.pi, 801)))
    return x, np.asarray(contour.height(x))


def _draw_object(ax: Axes, contour: Contour, across: tuple[float, float], top: float) -> None:
    x, y = _outline(contour, *across)
    shown = y <= top
    ax.fill_between(x, y, top, where=shown, color=PALETTE["object"], linewidth=0.0, zorder=0)
    ax.plot(np.where(shown, x, np.nan), y, color="0.35", linewidth=1.6, zorder=1.2, label="contour")


def _draw_pivot(ax: Axes, base: tuple[float, float]) -> None:
    ax.plot(
        *base,
        linestyle="none",
        marker="o",
        markersize=6.0,
        markerfacecolor="white",
        markeredgecolor="black",
        markeredgewidth=1.2,
        zorder=5,
        label="pivot",
    )


def _draw_gap(ax: Axes, gap: tuple[float, float] | xr.Dataset) -> None:
    begin, end = (gap[side].sel(bound="median") for side in ("left", "right")) if isinstance(gap, xr.Dataset) else gap
    left, right = sorted((float(begin), float(end)))
    overlap = float(begin) > float(end)
    ax.axvspan(
        left,
        right,
        facecolor=PALETTE["gap"],
        alpha=0.25,
        edgecolor="0.5",
        linewidth=0.0,
        hatch=None if overlap else "///",
        zorder=0.5,
    )
    ax.text(
        0.5 * (left + right),
        0.98,
        "overlap" if overlap else "gap",
        transform=ax.get_xaxis_transform(),
        ha="center",
        va="top",
        fontsize="small",
        clip_on=True,
    )


def _draw_contacts(ax: Axes, contacts: xr.Dataset, low: float, high: float) -> None:
    x, y = contacts["contact_x"].values, contacts["contact_y"].values
    drawn = np.isfinite(x) & np.isfinite(y) & (x >= low) & (x <= high)
    if "status" in contacts:
        drawn &= contacts["status"].values == "ok"
    phase = contacts["contact_phase"].values if "contact_phase" in contacts else np.full(x.shape, "none")
    for name, label in (*PHASES.items(), ("none", "contact")):
        chosen = drawn & (phase == name)
        if chosen.any():
            style: dict[str, Any] = {
                "color": PALETTE[name],
                "marker": _CONTACT_MARKERS.get(name, "o"),
                "linestyle": "none",
            }
            ax.plot(x[chosen], y[chosen], markersize=2.6, markeredgewidth=0.0, alpha=0.6, zorder=3, **style)
            legend_entry(ax, label, markersize=4.0, **style)

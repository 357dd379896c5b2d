"""The gap, enlarged: the triangle in which convexity confines the contour, and the posterior's bands in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.plotting.axes import Floats, single_axes, write_instead
from tactile_bayes.plotting.labels import LABELS, number, percent, set_unit, shown_unit
from tactile_bayes.plotting.legends import legend_above, legend_entries
from tactile_bayes.plotting.marks import PALETTE, TRUTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.contours.base import Contour

__all__ = ["gap"]

_MARGIN = 0.12
"""What is drawn beside the gap, as a share of its width."""

_ROOM = 0.12
"""Room above and below what is drawn, as a share of its height."""


def gap(found: xr.Dataset, *, truth: Contour | None = None, ax: Axes | None = None) -> Axes:
    """What is known of the contour inside the gap, measured from the chord between the end contacts.

    The triangle is what convexity alone leaves open, with a paler rim for the uncertainty of the end contacts; the
    bands are the posterior's. The legend gives the largest width of each in y.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.gap`.
    truth : Contour, optional
        The true contour.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Where the sweeps overlap there is nothing to be drawn, and the Axes say so.

    Examples
    --------
    >>> from tactile_bayes import gap as gap_of
    >>> draws = {"a": 0.5, "q": 0.3, "x_c": 0.0}
    >>> ends = {"first_contact_x": [0.9, -0.9], "snap_off_contact_x": [0.1, -0.1], "snap_off_drive_angle": [3.2, -0.1]}
    >>> posterior = xr.Dataset({k: (("chain", "draw"), [[v]]) for k, v in draws.items()})
    >>> events = xr.Dataset({k: (("chain", "draw", "stroke"), [[v]]) for k, v in ends.items()})
    >>> events = events.assign_coords(stroke=["forward", "backward"])
    >>> tree = xr.DataTree.from_dict({"posterior": posterior, "events": events})
    >>> tree.attrs = {"family": "parabola", "units": "dimensionless"}
    >>> gap(gap_of(tree)).get_ylabel()
    '$y$ − chord [$L$]'
    """
    ax = single_axes() if ax is None else ax
    attrs = found["left"].attrs
    middle = {name: float(found[name].sel(bound="median")) for name, v in found.items() if v.dims == ("bound",)}
    if not middle["left"] < middle["right"]:
        return write_instead(ax, "the sweeps overlap: no gap is left")
    ends = np.array([middle["left"], middle["right"]])
    heights = np.array([middle["left_y"], middle["right_y"]])
    incline = float(np.diff(heights)[0] / np.diff(ends)[0])

    def above_chord(x: Floats, y: Floats) -> Floats:
        return y - (heights[0] + incline * (x - ends[0]))

    def edges(name: str, *which: str) -> list[Floats]:
        return [above_chord(x, found[f"{name}_{edge}"].values) for edge in which]

    def wide(width: Any) -> str:
        power, unit = shown_unit("contact_x", attrs, np.array([float(width)]))
        return f"{number(float(width), power, digits=3)} {unit} wide"

    x = found["x"].values
    margin = _MARGIN * float(np.diff(ends)[0])
    share = percent(found.attrs["probability"])
    least, most = edges("triangle", "lower", "upper")
    corners_x = np.array([ends[0], middle["apex_x"], ends[1]])
    corners_y = above_chord(corners_x, np.array([heights[0], middle["apex_y"], heights[1]]))
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
        # A band much wider than the triangle runs out of the figure: else nothing would be seen of the rest.
        room = 0.7 * float(np.ptp(drawn))
        drawn = np.concatenate([drawn, np.clip([*lower, *upper], drawn.min() - room, drawn.max() + room)])
    lower, median, upper = edges("band", "lower", "median", "upper")
    label = f"{share} band, {wide(found['band_width'])}"
    ax.fill_between(x, lower, upper, color=PALETTE["band"], linewidth=0.0, zorder=1.6, label=label)
    ax.plot(x, median, color=PALETTE["median"], linewidth=1.2, zorder=2.2, label="median")
    if truth is not None:
        along = np.linspace(outside[0], outside[-1], 401)
        ax.plot(along, above_chord(along, np.asarray(truth.height(along))), zorder=2.4, **TRUTH)
    _draw_ends(ax, found, above_chord)

    drawn = np.concatenate([drawn, lower, upper])
    low, high = float(np.nanmin(drawn)), float(np.nanmax(drawn))
    ax.set_xlim(outside[0], outside[-1])
    ax.set_ylim(low - _ROOM * (high - low), high + _ROOM * (high - low) + 0.1 * abs(low))
    set_unit(ax.xaxis, LABELS["contact_x"] + " ", "contact_x", attrs, outside)
    set_unit(ax.yaxis, LABELS["contact_y"] + " − chord ", "contact_y", attrs, drawn)
    legend_above(ax, 2, legend_entries(ax))
    return ax


def _draw_ends(ax: Axes, found: xr.Dataset, above_chord: Any) -> None:
    """The end contacts, with the intervals of their x."""
    for side in ("left", "right"):
        lower, middle, upper = (float(found[side].sel(bound=bound)) for bound in ("lower", "median", "upper"))
        y = above_chord(np.array([middle]), np.array([float(found[f"{side}_y"].sel(bound="median"))]))
        ax.errorbar(
            [middle],
            y,
            xerr=[[middle - lower], [upper - middle]],
            color="black",
            marker="o",
            markersize=5.0,
            markerfacecolor="white",
            markeredgewidth=1.1,
            linewidth=1.1,
            capsize=2.5,
            linestyle="none",
            zorder=4,
            label="end contacts",
        )

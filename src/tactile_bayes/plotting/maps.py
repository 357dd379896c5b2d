"""Common parts of maps, the figures in the plane of object and rod."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.plotting.labels import LABELS, legend, legend_above, legend_entries, set_unit
from tactile_bayes.plotting.style import PALETTE

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.text import Text

    from tactile_bayes.contours.base import Contour


def limits_of(ax: Axes) -> Floats:
    """Return the limits of a map in x and y, shape (4,), after setting equal scales."""
    ax.set_aspect("equal", adjustable="box")
    ax.autoscale_view()
    return np.array([*ax.get_xlim(), *ax.get_ylim()])


def finish_map(ax: Axes, attrs: Mapping[Any, Any]) -> None:
    """Set equal scales and labels, and put the legend beside or above the data, whichever leaves more room."""
    limits = limits_of(ax)
    label_map(ax, attrs, limits)
    entries = legend_entries(ax)
    left, right, bottom, top = limits
    if (right - left) < 1.6 * (top - bottom):
        legend(ax, entries, loc="center left", bbox_to_anchor=(1.01, 0.5))
    else:
        legend_above(ax, min(4, len(entries)), entries)


def label_map(ax: Axes, attrs: Mapping[Any, Any], limits: Floats, form: str = "{}") -> None:
    """Label both axes of a map with their unit, in a form that holds the symbol."""
    for axis, name in ((ax.xaxis, "contact_x"), (ax.yaxis, "contact_y")):
        set_unit(axis, f"{form.format(LABELS[name])} ", name, attrs, limits)


def label_enlarged(ax: Axes, attrs: Mapping[Any, Any], x: Floats, y: Floats, against: str) -> None:
    """Label the axes of heights that are measured from a line, each with its own unit."""
    set_unit(ax.xaxis, f"{LABELS['contact_x']} ", "contact_x", attrs, x)
    set_unit(ax.yaxis, f"{LABELS['contact_y']} − {against} ", "contact_y", attrs, y)


def fit_height(ax: Axes) -> None:
    """Reduce the height of a figure with a single low map to that of the map, labels and legend."""
    left, right, bottom, top = limits_of(ax)
    figure: Any = ax.figure
    wide, high = figure.get_size_inches()
    figure.set_size_inches(wide, min(high, max(1.8, 0.88 * wide * (top - bottom) / (right - left) + 1.0)))


def set_below(upper: Axes, lower: Axes) -> None:
    """Align a panel in x with the map above it, whose equal scales may make it narrower."""
    from matplotlib.transforms import Bbox

    def place(_: Any, renderer: Any) -> Bbox:
        upper.apply_aspect()
        above, own = upper.get_position(), lower.get_position(original=True)
        return Bbox.from_extents(above.x0, own.y0, above.x1, own.y1)

    lower.set_axes_locator(place)


def outline(contour: Contour, low: float, high: float) -> tuple[Floats, Floats]:
    """Return points of a contour between two values of x, shape (801,), denser toward the ends."""
    ends = [float(np.asarray(contour.locate(end).x)) if np.isfinite(end) else float(end) for end in contour.domain]
    low, high = max(low, ends[0]), min(high, ends[1])
    x = low + 0.5 * (high - low) * (1.0 - np.cos(np.linspace(0.0, np.pi, 801)))
    return x, np.asarray(contour.height(x))


def contacts_within(contacts: xr.Dataset, low: float, high: float) -> NDArray[np.bool_]:
    """Return True for contacts between two values of x, if there is a status only for those with "ok"."""
    x, y = contacts["contact_x"].values, contacts["contact_y"].values
    is_good = contacts["status"].values == "ok" if "status" in contacts else np.isfinite(x)
    return np.asarray(is_good & np.isfinite(y) & (x >= low) & (x <= high))


def draw_object(ax: Axes, contour: Contour, x: Floats, y: Floats, room: float) -> None:
    """Draw the object in a map that shows given points with a margin around them, unless its limits are set."""
    ax.update_datalim([(x.min() - room, y.min() - room), (x.max() + room, y.max() + room)])
    ax.margins(0.0)
    left, right, _, top = limits_of(ax)
    x, y = outline(contour, left, right)
    shown = y <= top
    ax.fill_between(x, y, top, where=shown, color=PALETTE["object"], linewidth=0.0, zorder=0)
    ax.plot(np.where(shown, x, np.nan), y, color="0.35", linewidth=1.6, zorder=1.2, label="contour")


def draw_pivot(ax: Axes, base: tuple[float, float], *, colour: str = "black", label: str = "pivot") -> None:
    style: dict[str, Any] = {"marker": "o", "markersize": 6.0, "markerfacecolor": "white", "markeredgewidth": 1.2}
    ax.plot(*base, linestyle="none", markeredgecolor=colour, zorder=5, label=label, **style)


def draw_gap(ax: Axes, left: float, right: float, text: str, *, hatched: bool = True) -> Text:
    """Shade a stretch in x from bottom to top, and return its label."""
    style: dict[str, Any] = {"facecolor": PALETTE["gap"], "alpha": 0.25, "edgecolor": "0.5", "linewidth": 0.0}
    ax.axvspan(left, right, hatch="///" if hatched else None, zorder=0.5, **style)
    return write_on_top(ax, 0.5 * (left + right), text)


def write_on_top(ax: Axes, x: float, text: str) -> Text:
    transform = ax.get_xaxis_transform()
    return ax.text(x, 0.98, text, transform=transform, ha="center", va="top", fontsize="small", clip_on=True)

"""Figures of a design: the expected criterion of candidate drives."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.plotting.axes import axes_for, check_dataset, label_rows, plot, tile_edges
from tactile_bayes.plotting.labels import legend, legend_above, legend_entry, number, show_numbers, shown_unit
from tactile_bayes.plotting.maps import draw_pivot, label_map
from tactile_bayes.plotting.style import BASES, BEST, PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HEIGHTS_OF_A_MAP = 3  # smallest number of rows and columns of pivots that is drawn as a map, not as lines
_ROW_WIDTH = 44  # largest number of characters in a line of a candidate's words
_HIGHEST, _ROOM = 7.0, 0.1  # largest height of a map's figure, and the margin in it [inches]
# Variable, label, and whether it is a length, of which less is better.
_KINDS = {
    "band": ("width", "expected width of the band", True),
    "gap": ("gap", "width that no sweep touches", True),
    "information": ("information", "expected information", False),
}
_MARKS = "osD^vP"
_BARS: dict[str, Any] = {"markersize": 4.0, "linewidth": 1.2, "elinewidth": 0.8, "capsize": 2.0}
_RING: dict[str, Any] = {"markersize": 12.0, "markerfacecolor": "none", "color": PALETTE["change"], "label": "best"}
_CROSS: dict[str, Any] = {"linestyle": "none", "marker": "x", "markersize": 7.0}
_LAPLACE, _SAMPLED = "Laplace's approximation", "sampled posteriors"


@plot("the argument is not a design")
def design(found: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the criterion of a design for its candidates, the best of them, and the pivots so far.

    Candidates that form a grid of at least three rows and columns are drawn as a map of tiles with a colour bar, for
    the drive step of the best candidate. Otherwise each height and drive step has a line, with bars of two standard
    errors over the objects drawn; crosses show values from sampled posteriors, where there are some. If some candidates
    are other drives than pivots, each candidate has a row.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.design`.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from scipy import stats
    >>> from tactile_bayes import Family, Rotation
    >>> from tactile_bayes import design as design_of
    >>> known = Family("parabola", a=stats.lognorm(0.3, scale=0.6), q=stats.uniform(0.4, 0.2), x_c=stats.norm(0, 0.05))
    >>> found = design_of(known, drives=[Rotation((0.0, 0.0)), Rotation((0.2, 0.0))], draws=2, rng=1)
    >>> design(found, ax=Figure().subplots()).get_xlabel()
    'position of the pivot $x$ [$L$]'
    """
    names = {"base_x", "drive_step", "is_pivot", "best", "present_base_x"}
    check_dataset(found, names, "design", "tactile_bayes.design")
    if not found["is_pivot"].values.all():
        return _draw_rows(ax, found)
    pivots = np.stack([found["present_base_x"].values, found["present_base_y"].values], axis=-1)
    own, ax = ax is None, axes_for(ax)
    grid = _grid_of(found)
    if grid is None:
        _draw_lines(ax, found, pivots)
    else:
        _draw_map(ax, found, grid, pivots)
        if own:
            _fit_figure(ax)
    return ax


class _Expected(NamedTuple):
    """Expected criterion of each candidate, shape (candidates,), in the unit of its label."""

    values: Floats
    errors: Floats  # two standard errors, or 0
    nested: Floats  # from sampled posteriors; NaN without
    label: str
    is_length: bool  # less is better
    scale: float


def _millimetres(found: xr.Dataset) -> tuple[str, float]:
    """Return the unit in which lengths are written, and its number in the unit of the design."""
    return ("mm", 1e3) if found["base_x"].attrs.get("units") == "m" else ("$L$", 1.0)


def _expected(found: xr.Dataset) -> _Expected:
    name, label, is_length = _KINDS[str(found.attrs["criterion"])]
    unit, scale = _millimetres(found) if is_length else ("nat", 1.0)
    nested = found[f"nested_{name}"].values if f"nested_{name}" in found else np.full(found.sizes["candidate"], np.nan)
    values, errors = found[name].values, np.nan_to_num(found[f"{name}_error"].values)
    return _Expected(scale * values, 2.0 * scale * errors, scale * nested, f"{label} [{unit}]", is_length, scale)


def _draw_lines(ax: Axes, found: xr.Dataset, pivots: Floats) -> None:
    """Draw a line for each height and drive step, and the present pivots, shape (pivots, 2)."""
    expected, (unit, size) = _expected(found), _millimetres(found)
    x, y, step = size * found["base_x"].values, found["base_y"].values, found["drive_step"].values
    for k, (height, of_step) in enumerate(sorted(set(zip(y.tolist(), step.tolist(), strict=True)))):
        here = np.flatnonzero((y == height) & (step == of_step))
        here = here[np.argsort(x[here])]
        words = []
        if np.ptp(y) > 0.0:
            words.append(f"$y$ = {number(size * height, digits=4 if unit == 'mm' else 3)} {unit}")
        if np.ptp(step) > 0.0:
            words.append(f"steps of {np.degrees(of_step):.3g}°")
        colour, label = BASES[k % len(BASES)], ", ".join(words) or _LAPLACE
        look: dict[str, Any] = {"color": colour, "marker": _MARKS[k % len(_MARKS)], "label": label}
        ax.errorbar(x[here], expected.values[here], expected.errors[here], **look, **_BARS)
        if np.isfinite(expected.nested[here]).any():
            ax.plot(x[here], expected.nested[here], color=colour, label=None if k else _SAMPLED, **_CROSS)
    best = int(found["best"])
    ax.plot(x[best], expected.values[best], "o", **_RING)
    if found.attrs["criterion"] == "band":
        present = expected.scale * float(found["present_width"])
        if present < 3.0 * np.nanmax(expected.values):
            ax.axhline(present, color=PALETTE["none"], linestyle="--", linewidth=1.0, label="without a further record")
    style: dict[str, Any] = {"color": "0.6", "linestyle": ":", "linewidth": 1.2, "zorder": 0.5}
    for k, place in enumerate(size * pivots[:, 0]):
        ax.axvline(place, label=None if k else "pivot so far", **style)
    ax.set_xlabel(f"position of the pivot $x$ [{unit}]")
    ax.set_ylabel(expected.label)
    ax.set_ylim(bottom=0.0 if expected.is_length else None)
    ax.spines[["top", "right"]].set_visible(False)
    if len(ax.get_legend_handles_labels()[1]) > 1:
        legend(ax)


def _draw_rows(ax: Axes | None, found: xr.Dataset) -> Axes:
    """Draw a row for each candidate, under each other."""
    expected, best = _expected(found), int(found["best"])
    ax = axes_for(ax, height=1.2 + 0.4 * found.sizes["candidate"])
    rows = np.arange(found.sizes["candidate"])
    bars: dict[str, Any] = {"color": PALETTE["tip"], "marker": "o", "linestyle": "none", "label": _LAPLACE}
    ax.errorbar(expected.values, rows, xerr=expected.errors, **bars | _BARS)
    if np.isfinite(expected.nested).any():
        ax.plot(expected.nested, rows, color=PALETTE["tip"], label=_SAMPLED, **_CROSS)
    ax.plot(expected.values[best], best, "o", **_RING)
    names, steps = [f"{drive}" for drive in found["drive"].values], np.degrees(found["drive_step"].values)
    if np.ptp(steps) > 0.0:
        names = [f"{drive}, {step:.3g}° or as many" for drive, step in zip(names, steps, strict=True)]
    label_rows(ax, [textwrap.fill(words, _ROW_WIDTH) for words in names])
    ax.set_xlim(left=0.0 if expected.is_length else None)
    ax.set_xlabel(expected.label)
    legend_above(ax, 3)
    return ax


class _Grid(NamedTuple):
    """Candidate pivots in rows and columns, with the expected criterion of each."""

    x: Floats
    y: Floats
    values: Floats  # shape (rows, columns); NaN without a candidate or without an expected value
    drive_step: float
    has_other_steps: bool


def _grid_of(found: xr.Dataset) -> _Grid | None:
    """Return the candidates with the best one's drive step, if they fill a grid large enough for a map."""
    steps = found["drive_step"].values
    step = float(steps[int(found["best"])])
    chosen = found.isel(candidate=np.flatnonzero(steps == step))
    x, column = np.unique(chosen["base_x"].values, return_inverse=True)
    y, row = np.unique(chosen["base_y"].values, return_inverse=True)
    if min(x.size, y.size) < _HEIGHTS_OF_A_MAP or chosen.sizes["candidate"] != x.size * y.size:
        return None
    values = np.full((y.size, x.size), np.nan)
    values[row, column] = chosen[_KINDS[str(found.attrs["criterion"])][0]].values
    return _Grid(x, y, values, step, bool(np.any(steps != step)))


def _draw_map(ax: Axes, found: xr.Dataset, grid: _Grid, pivots: Floats) -> None:
    from matplotlib.ticker import MaxNLocator

    name, words, is_length = _KINDS[str(found.attrs["criterion"])]
    edges = tile_edges(grid.x), tile_edges(grid.y)
    shown = np.ma.masked_invalid(grid.values)
    mesh = ax.pcolormesh(*edges, shown, cmap="cividis_r" if is_length else "cividis", zorder=0.5)
    ax.set_facecolor("0.9")
    if np.ma.is_masked(shown):
        legend_entry(ax, "out of reach", color="0.9", marker="s", markersize=8.0, linestyle="none")
    ax.set_aspect("equal", adjustable="box")
    ax.set(xlim=edges[0][[0, -1]], ylim=edges[1][[0, -1]])
    for k, (x, y) in enumerate(pivots.tolist()):
        draw_pivot(ax, (x, y), label="" if k else "pivot so far")
    best = found.isel(candidate=int(found["best"]))
    power, unit = shown_unit("contact_x", found[name].attrs, grid.values) if is_length else (0, "nat")
    label = f"best: {number(float(best[name]), power, digits=3)} {unit}"
    ax.plot(float(best["base_x"]), float(best["base_y"]), markersize=14.0, zorder=5.5, label=label, **BEST)
    label_map(ax, found["base_x"].attrs, np.concatenate(edges), "position of the pivot {}")
    is_low = np.ptp(edges[1]) < 0.45 * np.ptp(edges[0])
    place: dict[str, Any] = {"ax": ax, "orientation": "horizontal" if is_low else "vertical"}
    bar = ax.figure.colorbar(mesh, ticks=MaxNLocator(5), label=f"{words} [{unit}]", **place)
    show_numbers(bar.ax.xaxis if is_low else bar.ax.yaxis, power)
    title = f"steps of {np.degrees(grid.drive_step):.3g}°" if grid.has_other_steps else None
    legend_above(ax, 3, title=title)


def _fit_figure(ax: Axes) -> None:
    """Make the figure as high as the map is at its full width, or narrower where it would be too high."""
    figure: Any = ax.figure
    wide, _ = figure.get_size_inches()
    figure.set_size_inches(wide, _HIGHEST)
    for _ in range(2):  # the room for the colour bar depends on the height
        figure.draw_without_rendering()
        taken = figure.get_tightbbox()
        figure.set_size_inches(min(wide, taken.width + _ROOM), min(_HIGHEST, taken.height + _ROOM))

"""Where to put the next pivot: what is to be expected from every place that it could have."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import Floats, legend_entry, number, set_unit, shown_unit, single_axes
from tactile_bayes.plotting.design_lines import draw_design_lines, kind_of
from tactile_bayes.plotting.maps import draw_pivot
from tactile_bayes.plotting.tiles import tile_edges

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["design"]

_HEIGHTS_OF_A_MAP = 3
"""From which on a grid of places is drawn as a map, and not as lines."""

_HIGHEST, _ROOM = 7.0, 0.1
"""Of the figure of a map, and what is left free in it [inches]."""


def design(found: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """The criterion over the place of the pivot, the best place of all, and the pivots so far.

    Places that form a grid of at least three heights and as many columns are a map, in tiles; with several drive steps
    it is that of the step of the best. Else there is a line for each height and drive step, with bars of two standard
    errors over the objects drawn; where posteriors were sampled as well, crosses show what these gave.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.design`.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Beside a map, in its figure, stands the scale of colours.

    Raises
    ------
    ParameterError
        If this is no design.

    Examples
    --------
    >>> from tactile_bayes import design as design_of
    >>> from scipy import stats
    >>> priors = {"a": stats.lognorm(0.3, scale=0.6), "q": stats.uniform(0.4, 0.2), "x_c": stats.norm(0.0, 0.05)}
    >>> from matplotlib.figure import Figure
    >>> found = design_of("parabola", priors=priors, bases=[(0.0, 0.0), (0.2, 0.0)], draws=2, seed=1)
    >>> design(found, ax=Figure().subplots()).get_xlabel()
    'place of the pivot $x$ [$L$]'
    """
    if not (isinstance(found, xr.Dataset) and {"base_x", "drive_step", "best", "present_base_x"} <= set(found)):
        raise ParameterError("this is no design: give what tactile_bayes.design has returned")
    pivots = np.stack([found["present_base_x"].values, found["present_base_y"].values], axis=-1)
    own, ax = ax is None, single_axes() if ax is None else ax
    grid = _grid_of(found)
    if grid is None:
        draw_design_lines(ax, found, pivots)
    else:
        _draw_map(ax, found, grid, pivots)
        if own:
            _fit_figure(ax)
    return ax


class _Grid(NamedTuple):
    """Places in rows and columns, and what is expected from each."""

    x: Floats
    y: Floats
    values: Floats
    """Shape (rows, columns); NaN where there is no candidate, or nothing is to be expected."""
    drive_step: float
    has_other_steps: bool


def _grid_of(found: xr.Dataset) -> _Grid | None:
    """The candidates of the best one's drive step, if they fill a grid that is worth a map."""
    steps = found["drive_step"].values
    step = float(steps[int(found["best"])])
    chosen = found.isel(candidate=np.flatnonzero(steps == step))
    x, column = np.unique(chosen["base_x"].values, return_inverse=True)
    y, row = np.unique(chosen["base_y"].values, return_inverse=True)
    if min(x.size, y.size) < _HEIGHTS_OF_A_MAP or chosen.sizes["candidate"] != x.size * y.size:
        return None
    values = np.full((y.size, x.size), np.nan)
    values[row, column] = chosen[kind_of(found)[0]].values
    return _Grid(x, y, values, step, bool(np.any(steps != step)))


def _draw_map(ax: Axes, found: xr.Dataset, grid: _Grid, pivots: Floats) -> None:
    name, words, is_length = kind_of(found)
    edges = tile_edges(grid.x), tile_edges(grid.y)
    shown = np.ma.masked_invalid(grid.values)
    mesh = ax.pcolormesh(*edges, shown, cmap="cividis_r" if is_length else "cividis", zorder=0.5)
    ax.set_facecolor("0.9")
    if np.ma.is_masked(shown):
        legend_entry(ax, "out of reach", color="0.9", marker="s", markersize=8.0, linestyle="none")
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlim(edges[0][0], edges[0][-1])
    ax.set_ylim(edges[1][0], edges[1][-1])
    for k, (x, y) in enumerate(pivots.tolist()):
        draw_pivot(ax, (x, y), label="" if k else "pivot so far")
    best = found.isel(candidate=int(found["best"]))
    power, unit = shown_unit("contact_x", found[name].attrs, grid.values) if is_length else (0, "nat")
    ax.plot(
        [float(best["base_x"])],
        [float(best["base_y"])],
        "*",
        color="#D55E00",
        markersize=14.0,
        markeredgecolor="white",
        zorder=5.5,
        label=f"best: {number(float(best[name]), power, digits=3)} {unit}",
    )
    attrs, limits = found["base_x"].attrs, np.concatenate(edges)
    set_unit(ax.xaxis, "place of the pivot $x$ ", "contact_x", attrs, limits)
    set_unit(ax.yaxis, "place of the pivot $y$ ", "contact_y", attrs, limits)
    _draw_scale(ax, mesh, f"{words} [{unit}]" if is_length else words, power)
    title = f"steps of {np.degrees(grid.drive_step):.3g}°" if grid.has_other_steps else None
    ax.legend(
        title=title,
        title_fontsize="small",
        fontsize="small",
        frameon=False,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=3,
    )


def _draw_scale(ax: Axes, mesh: Any, label: str, power: int) -> None:
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    is_low = abs(np.ptp(ax.get_ylim())) < 0.45 * abs(np.ptp(ax.get_xlim()))
    bar = ax.figure.colorbar(mesh, ax=ax, orientation="horizontal" if is_low else "vertical")
    bar.locator = MaxNLocator(5)
    bar.formatter = FuncFormatter(lambda value, _: number(value, power))
    bar.update_ticks()
    bar.set_label(label)


def _fit_figure(ax: Axes) -> None:
    """Make the figure as high as the map is at its full width, or narrower where it would be too high."""
    figure: Any = ax.figure
    wide, _ = figure.get_size_inches()
    figure.set_size_inches(wide, _HIGHEST)
    for _ in range(2):  # the room for the scale of colours goes with the height
        figure.draw_without_rendering()
        taken = figure.get_tightbbox()
        figure.set_size_inches(min(wide, taken.width + _ROOM), min(_HIGHEST, taken.height + _ROOM))

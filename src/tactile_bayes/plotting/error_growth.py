"""How errors of the sensor grow along a sweep: standard deviations of contact points over the drive angle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.plotting.axes import Floats, single_axes
from tactile_bayes.plotting.labels import DRIVE_ANGLE
from tactile_bayes.plotting.legends import legend_above, legend_entry
from tactile_bayes.plotting.planning_groups import METHOD_COLOURS, group_of, of_sweep, set_log_scale, sweep_in_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["amplification"]

_VARIABLES = {
    "sd_along",
    "sd_across",
    "holds",
    "contact_phase",
    "after_first_contact",
    "before_snap_off",
    "reconstruction",
}
_STYLES = {"along": "-", "across": "--"}

_CLOSEST = 0.004
"""Distance from first contact and snap-off, over the sweep's length, from which on all errors are in the figure."""

_STRIP = 0.035
"""Height of the strips below the curves, over that of the Axes."""


def amplification(found: xr.Dataset | xr.DataTree, *, sweep: int = 0, ax: Axes | None = None) -> Axes:
    """Standard deviation of contact points along and across the contour, over the drive angle of a sweep.

    To first order, from all errors of the load cell and the encoder together. A shaded strip at the bottom tells for
    each method where first order does not hold, and its curves are thin there. Toward first contact and snap-off errors
    may grow without bound: there the curves leave the Axes.

    Parameters
    ----------
    found : xr.Dataset or xr.DataTree
        What `tactile_bayes.sensitivity` returned, or its group "amplification".
    sweep : int
        Number of the sweep.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Drive angles are in degrees.

    Raises
    ------
    ParameterError
        If this is no such group, or there is no such sweep.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from tactile_bayes import sensitivity
    >>> found = sensitivity(seed=1, parts=["amplification"])
    >>> amplification(found, ax=Figure().subplots()).get_ylabel()
    'standard deviation of a contact point [$L$]'
    """
    grown = of_sweep(group_of(found, "amplification", _VARIABLES), sweep)
    ax = single_axes() if ax is None else ax
    angle = np.degrees(grown["drive_angle"].values)
    first, last = _events(grown)
    near = np.minimum(grown["after_first_contact"].values, grown["before_snap_off"].values)
    is_shown = near >= _CLOSEST * np.radians(abs(last - first))
    drawn: list[Floats] = []
    methods = [str(name) for name in grown["reconstruction"].values]
    for row, method in enumerate(methods):
        of_method, colour = grown.sel(reconstruction=method), METHOD_COLOURS[method]
        holds = of_method["holds"].values
        phase = of_method["contact_phase"].values
        # Constrained errors jump where the phase changes: no line goes over that. Raw ones know of no phase.
        changes = np.flatnonzero((phase[1:] != phase[:-1]) & (method == "constrained")) + 1
        for side, style in _STYLES.items():
            deviation = of_method[f"sd_{side}"].values
            drawn.append(deviation[is_shown])
            certain = np.where(_joined(holds), deviation, np.nan)
            doubtful = np.where(_joined(~holds), deviation, np.nan)
            lines = ((doubtful, 0.7, None), (certain, 1.8, f"{method}, {side} the contour"))
            for values, width, label in lines:
                split = np.insert(angle, changes, angle[changes]), np.insert(values, changes, np.nan)
                ax.plot(*split, style, color=colour, linewidth=width, label=label)
        low = row * _STRIP
        for begin, end in _runs(~holds, angle):
            ax.axvspan(begin, end, low, low + _STRIP, color=colour, alpha=0.35, linewidth=0.0)
    set_log_scale(
        ax.yaxis, "standard deviation of a contact point", "contact_x", grown["sd_along"].attrs, np.concatenate(drawn)
    )
    bottom, top = ax.get_ylim()
    ax.set_ylim(bottom * (bottom / top) ** (2.0 * _STRIP), top)
    _mark_events(ax, first, last)
    legend_entry(ax, "strip: first order does not hold", color="0.6", linewidth=6.0, solid_capstyle="butt")
    margin = 0.05 * abs(last - first)
    ax.set_xlim(min(first, last) - margin, max(first, last) + margin)
    ax.set_xlabel(f"{DRIVE_ANGLE}, {sweep_in_words(grown)}")
    legend_above(ax, 3)
    return ax


def _events(grown: xr.Dataset) -> tuple[float, float]:
    """First contact and snap-off [degrees]."""
    sense = 1.0 if grown["direction"].values[0] == "forward" else -1.0
    angle = grown["drive_angle"].values[0]
    first = angle - sense * grown["after_first_contact"].values[0]
    last = angle + sense * grown["before_snap_off"].values[0]
    return float(np.degrees(first)), float(np.degrees(last))


def _mark_events(ax: Axes, first: float, last: float) -> None:
    for angle, words in ((first, "first contact"), (last, "snap-off")):
        is_left = angle == min(first, last)
        # Outside of the sweep, where no curve is.
        ax.axvline(angle, color="0.45", linewidth=0.8, linestyle=":", zorder=1)
        place: dict[str, Any] = {"xycoords": ax.get_xaxis_transform(), "textcoords": "offset points"}
        place |= {"ha": "right", "xytext": (-3.0, 0.0)} if is_left else {"ha": "left", "xytext": (3.0, 0.0)}
        ax.annotate(words, (angle, 0.97), va="top", rotation=90.0, fontsize="small", color="0.3", **place)


def _joined(chosen: np.ndarray) -> np.ndarray:
    """With each sample that comes after a chosen one, so that thick and thin lines meet."""
    near = chosen.copy()
    near[1:] |= chosen[:-1]
    return near


def _runs(chosen: np.ndarray, angle: Floats) -> list[tuple[float, float]]:
    """Where samples are chosen, from the middle between two to the middle between two."""
    edges = np.concatenate([angle[:1], 0.5 * (angle[1:] + angle[:-1]), angle[-1:]])
    change = np.diff(np.concatenate([[0], chosen.astype(int), [0]]))
    begins, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    return [(float(edges[i]), float(edges[j])) for i, j in zip(begins, ends, strict=True)]

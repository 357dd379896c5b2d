"""Figures of a plan over the drive angle: error amplification, information, and shares of the noise."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import refused
from tactile_bayes.plotting.axes import axes_for, check_among, group_of, plot
from tactile_bayes.plotting.labels import DRIVE_ANGLE, LABELS, legend_above, legend_entry, number, set_log_scale
from tactile_bayes.plotting.style import BASES, SWEEP_LINES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

READING_COLOURS = {"holding_moment": BASES[0], "force_x": BASES[1], "force_y": BASES[3], "drive_angle": BASES[2]}
METHOD_COLOURS = {"raw": "#D55E00", "constrained": "#0072B2"}
_STYLES = {"along": "-", "across": "--"}
_GROWN = {"sd_along", "sd_across", "holds", "contact_phase", "reconstruction"}
_GROWN |= {"after_first_contact", "before_snap_off"}
# Distance from first contact and snap-off, over the sweep's length, beyond which all errors are within the limits.
_CLOSEST = 0.004
_STRIP = 0.035  # height of the strips below the curves, over that of the Axes


@plot("the argument does not hold that group, or there is no such sweep")
def amplification(found: xr.Dataset | xr.DataTree, *, sweep: int = 0, ax: Axes | None = None) -> Axes:
    """Draw the standard deviation of contact points along and across the contour, over the drive angle of a sweep.

    It is that of first-order error propagation, from all errors of the load cell and the encoder together. A shaded
    strip at the bottom shows for each method where first order does not hold, and its curves are thin there. Toward
    first contact and snap-off errors may grow without bound: there the curves leave the Axes.

    Parameters
    ----------
    found : xr.Dataset or xr.DataTree
        Result of `tactile_bayes.sensitivity`, or its group "amplification".
    sweep : int
        Number of the sweep.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from tactile_bayes import sensitivity
    >>> found = sensitivity(rng=1, parts=["amplification"])
    >>> amplification(found, ax=Figure().subplots()).get_ylabel()
    'standard deviation of a contact point [$L$]'
    """
    grown = _of_sweep(group_of(found, "amplification", _GROWN), sweep)
    ax = axes_for(ax)
    angle = np.degrees(grown["drive_angle"].values)
    first, last = _events(grown)
    near = np.minimum(grown["after_first_contact"].values, grown["before_snap_off"].values)
    is_shown = near >= _CLOSEST * np.radians(abs(last - first))
    drawn: list[Floats] = []
    for row, method in enumerate(map(str, grown["reconstruction"].values)):
        of_method, colour = grown.sel(reconstruction=method), METHOD_COLOURS[method]
        holds, phase = of_method["holds"].values, of_method["contact_phase"].values
        # Constrained errors jump where the phase changes, so their line is interrupted; raw ones ignore the phase.
        changes = np.flatnonzero((phase[1:] != phase[:-1]) & (method == "constrained")) + 1
        for side, style in _STYLES.items():
            deviation = of_method[f"sd_{side}"].values
            drawn.append(deviation[is_shown])
            lines = ((~holds, 0.7, None), (holds, 1.8, f"{method}, {side} the contour"))
            for chosen, width, label in lines:
                # The sample after a chosen one belongs to both lines, so that they meet.
                values = np.where(chosen | np.append(False, chosen[:-1]), deviation, np.nan)
                split = np.insert(angle, changes, angle[changes]), np.insert(values, changes, np.nan)
                ax.plot(*split, style, color=colour, linewidth=width, label=label)
        low = row * _STRIP
        for begin, end in _runs(~holds, angle):
            ax.axvspan(begin, end, low, low + _STRIP, color=colour, alpha=0.35, linewidth=0.0)
    label, attrs = "standard deviation of a contact point", grown["sd_along"].attrs
    set_log_scale(ax.yaxis, label, "contact_x", attrs, np.concatenate(drawn))
    bottom, top = ax.get_ylim()
    ax.set_ylim(bottom * (bottom / top) ** (2.0 * _STRIP), top)
    _mark_events(ax, first, last)
    legend_entry(ax, "strip: first order does not hold", color="0.6", linewidth=6.0, solid_capstyle="butt")
    margin = 0.05 * abs(last - first)
    ax.set_xlim(min(first, last) - margin, max(first, last) + margin)
    ax.set_xlabel(f"{DRIVE_ANGLE}, {grown['direction'].values[0]} sweep")
    legend_above(ax, 3)
    return ax


@plot("the argument does not hold that group")
def information(found: xr.Dataset | xr.DataTree, *, ax: Axes | None = None) -> Axes:
    """Draw the leverage of every reading over the drive angle, by channel and direction.

    The leverage of a reading is its diagonal element of the hat matrix, between 0 and 1: the number of parameters that
    it determines. The sum over all readings is the number of parameters that the record determines; the legend states
    the sum for each channel. Readings without contact determine the load cell's zero.

    Parameters
    ----------
    found : xr.Dataset or xr.DataTree
        Result of `tactile_bayes.sensitivity`, or its group "information".

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from tactile_bayes import sensitivity
    >>> found = sensitivity(rng=1, parts=["information"])
    >>> information(found, ax=Figure().subplots()).get_ylabel()
    'leverage of a reading'
    """
    known = group_of(found, "information", {"leverage", "channel", "sweep", "direction", "drive_angle"})
    ax = axes_for(ax)
    for sweep in np.unique(known["sweep"].values):
        of = _of_sweep(known, sweep)
        angle, style = np.degrees(of["drive_angle"].values), SWEEP_LINES[str(of["direction"].values[0])]
        for name in map(str, known["channel"].values):
            leverage = of["leverage"].sel(channel=name).values
            ax.plot(angle, leverage, style, color=READING_COLOURS[name], linewidth=1.3)
    for name in map(str, known["channel"].values):
        whole = number(float(known["leverage"].sel(channel=name).sum()), digits=3)
        legend_entry(ax, f"{LABELS[name]}: {whole}", color=READING_COLOURS[name], linewidth=2.5)
    for direction in dict.fromkeys(map(str, known["direction"].values)):
        legend_entry(ax, direction, color="0.35", linestyle=SWEEP_LINES[direction], linewidth=1.3)
    ax.set_ylim(bottom=0.0)
    ax.set(xlabel=DRIVE_ANGLE, ylabel="leverage of a reading")
    whole = number(float(known["leverage"].sum()), digits=3)
    title = f"leverage of all {known['leverage'].size:,} readings together: {whole}"
    legend_above(ax, 5, title=title, handlelength=1.6, columnspacing=1.3)
    return ax


@plot("the argument does not hold that group, or the group does not hold the choice")
def noise_shares(
    found: xr.Dataset | xr.DataTree,
    *,
    reconstruction: Literal["raw", "constrained"] = "raw",
    error: Literal["along", "across"] = "across",
    sweep: int = 0,
    ax: Axes | None = None,
) -> Axes:
    """Draw the shares of the variance of a contact's error by the source of noise, stacked, over a sweep.

    The shares are first-order Sobol' indices (Sobol' 2001). The remainder to 1 is called "together": it comes from
    interactions of several noises, and is large where first order does not hold. Shares are estimates: those below 0
    are drawn as 0, and a stack may rise a little above 1. Angles at which Step 2 has no solution for some of the noise
    are hatched.

    Parameters
    ----------
    found : xr.Dataset or xr.DataTree
        Result of `tactile_bayes.sensitivity`, or its group "noise_shares".
    reconstruction : {"raw", "constrained"}
        Method of Step 2.
    error : {"along", "across"}
        Error along the contour, or across it.
    sweep : int
        Number of the sweep.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from tactile_bayes import sensitivity
    >>> found = sensitivity(rng=1, parts=["noise_shares"], samples=8)
    >>> noise_shares(found, ax=Figure().subplots()).get_ylabel()
    'share of variance'
    """
    names = {"share", "reconstruction", "error", "source", "sweep", "direction", "drive_angle"}
    shares = group_of(found, "noise_shares", names)
    for name, value in (("reconstruction", reconstruction), ("error", error)):
        check_among(name, value, shares)
    chosen = _of_sweep(shares.sel(reconstruction=reconstruction, error=error), sweep)
    ax = axes_for(ax)
    angle = np.degrees(chosen["drive_angle"].values)
    wide = float(np.median(np.diff(angle))) if angle.size > 1 else 1.0
    share = np.maximum(chosen["share"].transpose("sample", "source").values, 0.0)
    is_answered = np.isfinite(share).all(axis=1)
    below = np.zeros(angle.size)
    together = np.maximum(1.0 - share.sum(axis=1), 0.0)
    sources = map(str, chosen["source"].values)
    stacked = [(share[:, i], READING_COLOURS[name], LABELS[name]) for i, name in enumerate(sources)]
    for values, colour, label in (*stacked, (together, "0.75", "together")):
        height = np.where(is_answered, values, 0.0)
        ax.bar(angle, height, wide, below, color=colour, label=label, edgecolor="white", linewidth=0.6)
        below = below + height
    if not is_answered.all():
        style: dict[str, Any] = {"color": "white", "edgecolor": "0.6", "hatch": "///", "linewidth": 0.6}
        ax.bar(angle[~is_answered], 1.0, wide, label="no result for some of the noise", **style)
    ax.set_xlim(angle.min() - 0.7 * wide, angle.max() + 0.7 * wide)
    ax.set_ylim(0.0, max(1.02, 1.02 * float(below.max(initial=0.0))))
    ax.set(xlabel=f"{DRIVE_ANGLE}, {chosen['direction'].values[0]} sweep", ylabel="share of variance")
    title = f"error of a {reconstruction} contact point {error} the contour, by the noise of"
    legend_above(ax, 4 if len(ax.containers) <= 4 else 3, title=title)
    return ax


def _of_sweep(found: xr.Dataset, sweep: int) -> xr.Dataset:
    """Return the samples of a sweep in the order of the drive angle."""
    numbers = found["sweep"].values
    is_number = isinstance(sweep, int | np.integer) and not isinstance(sweep, bool)
    here = np.flatnonzero(numbers == sweep) if is_number else np.arange(0)
    if not here.size:
        raise refused("sweep", sweep, f"there are {', '.join(map(str, np.unique(numbers)))}")
    return found.isel(sample=here[np.argsort(found["drive_angle"].values[here], kind="stable")])


def _events(grown: xr.Dataset) -> tuple[float, float]:
    """Return the drive angles of first contact and snap-off [degrees]."""
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


def _runs(chosen: np.ndarray, angle: Floats) -> list[tuple[float, float]]:
    """Return the intervals of chosen samples, bounded midway to the neighbours that are not chosen."""
    edges = np.concatenate([angle[:1], 0.5 * (angle[1:] + angle[:-1]), angle[-1:]])
    change = np.diff(np.concatenate([[0], chosen.astype(int), [0]]))
    begins, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    return [(float(edges[i]), float(edges[j])) for i, j in zip(begins, ends, strict=True)]

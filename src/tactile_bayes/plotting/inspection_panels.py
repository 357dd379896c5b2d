"""The inspection of a record: its observables, where contact begins and ends, and what looks wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tactile_bayes.checks import check_kind
from tactile_bayes.plotting.axes import AxesArray, check_panels, new_panels, plot, write_not_measured
from tactile_bayes.plotting.drive_axis import DriveAxis, drive_axis, finish_channels, reading_style
from tactile_bayes.plotting.labels import LABELS, legend_entry, set_unit
from tactile_bayes.plotting.style import PALETTE
from tactile_bayes.record import CHANNELS, present_channels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.diagnostics.inspection import Inspection

_COLOURS = {"forward": "#0072B2", "backward": "#D55E00"}
_WRONG: dict[str, tuple[str, dict[str, Any]]] = {
    "outlier": ("stands out", {"marker": "o", "markersize": 9.0, "color": "#CC79A7"}),
    "stuck": ("stuck", {"marker": "s", "markersize": 8.0, "color": "#E69F00"}),
    "cut_off": ("cut off", {"marker": "D", "markersize": 8.0, "color": "#009E73"}),
    "repeated": ("twice", {"marker": "h", "markersize": 9.0, "color": "#000000"}),
    "uneven_step": ("uneven step", {"marker": "|", "markersize": 14.0, "color": "#000000"}),
}
_MARKS: dict[str, Any] = {"linestyle": "none", "markerfacecolor": "none", "markeredgewidth": 1.2, "zorder": 4}
_LEGEND = ["forward", "backward", "first contact", "snap-off", *(words for words, _ in _WRONG.values())]


@plot("there are not three rows of two axes", example="measured")
def inspection(inspected: Inspection, *, axes: Any = None) -> AxesArray:
    """Draw the observables of a record along the drive, marks of wrong samples, and unloaded samples enlarged.

    Parameters
    ----------
    inspected : Inspection
        From `tactile_bayes.inspect_record`.
    axes : array of Axes, shape (3, 2), optional
        A row for each of holding_moment, force_x and force_y. The left Axes hold readings over the coordinate of
        `observables`: vertical lines between the samples beside first contact (dotted) and snap-off (dashed) have the
        colour of the sweep's direction; rings and other marks show samples that look wrong. The right Axes hold
        readings of the unloaded samples in the order of measurement, with their mean and two standard deviations to
        either side.

    Examples
    --------
    >>> inspection(tb.inspect_record(measured))[0, 1].get_title()
    'unloaded'
    """
    from tactile_bayes.diagnostics.inspection import Inspection

    check_kind("inspected", inspected, Inspection, "give what inspect_record returned")
    if axes is None:
        panels = new_panels(3, 2, 5.6, sharex="col", width_ratios=(2.2, 1.0))
    else:
        panels = check_panels(axes, (3, 2), f"a row for each of {', '.join(CHANNELS)}")
    record = inspected.record
    along = drive_axis(record)
    for index, channel in enumerate(CHANNELS):
        readings, zero = panels[index]
        label = LABELS[channel]
        if channel not in present_channels(record):
            write_not_measured(readings, label)
            zero.set_yticks([])
            continue
        _draw_readings(readings, inspected, index, along)
        set_unit(readings.yaxis, f"{label}\n", channel, record[channel].attrs, record[channel].values)
        _draw_unloaded(zero, inspected, index)
        set_unit(zero.yaxis, "", channel, record[channel].attrs, record[channel].values[inspected.samples.unloaded])
    along.label(panels[-1, 0].xaxis, with_ticks=False)
    panels[-1, 1].set_xlabel("sample")
    panels[0, 1].set_title("unloaded", fontsize="small")
    panels[0, 0].figure.align_ylabels(list(panels[:, 0]))
    finish_channels(panels.ravel(), _LEGEND.index, 3, handlelength=1.5, columnspacing=1.2)
    return panels


def _draw_readings(ax: Axes, inspected: Inspection, index: int, along: DriveAxis) -> None:
    record, sweeps = inspected.record, inspected.sweeps
    places, reading = along.values, record[CHANNELS[index]].values
    along.draw_below(ax)
    for place, number in enumerate(sweeps.sweep.values):
        direction = str(sweeps.direction.values[place])
        rows = record.sweep.values == number
        style = reading_style(direction, _COLOURS[direction])
        ax.plot(places[rows], reading[rows], **style)
        legend_entry(ax, direction, **style)
        for event, label, line in (("onset", "first contact", ":"), ("snap_off", "snap-off", "--")):
            between = along.place_of(sweeps.isel(sweep=place), event, np.flatnonzero(rows))
            if np.isfinite(between):
                ax.axvline(between, color=_COLOURS[direction], linestyle=line, linewidth=1.0, zorder=0.5)
                legend_entry(ax, label, color="0.35", linestyle=line, linewidth=1.0)
    for name, flags in _wrong(inspected, index):
        label, special = _WRONG[name]
        ax.plot(places[flags], reading[flags], label=label, **_MARKS, **special)


def _draw_unloaded(ax: Axes, inspected: Inspection, index: int) -> None:
    reading = inspected.record[CHANNELS[index]].values
    unloaded = inspected.samples.unloaded.values
    sample = np.arange(reading.size)
    numbers = inspected.record.sweep.values
    for start in np.flatnonzero(np.diff(numbers) != 0) + 0.5:
        ax.axvline(start, color="0.6", linewidth=0.8, zorder=0)
    row = inspected.channels.isel(channel=index)
    bias, noise = float(row.bias), float(row.noise)
    if np.isfinite(bias):
        ax.axhspan(bias - 2.0 * noise, bias + 2.0 * noise, color=PALETTE["band"], alpha=0.5, linewidth=0.0, zorder=0.2)
        ax.axhline(bias, color=PALETTE["median"], linewidth=0.8, zorder=0.3)
    ax.plot(sample[unloaded], reading[unloaded], color=PALETTE["none"], marker=".", markersize=3.0, linestyle="none")
    for name, flags in _wrong(inspected, index):
        shown = flags & unloaded
        if shown.any():
            ax.plot(sample[shown], reading[shown], **_MARKS, **_WRONG[name][1])
    ax.set_xlim(-0.02 * reading.size, 1.02 * reading.size)


def _wrong(inspected: Inspection, index: int) -> list[tuple[str, Any]]:
    """Return the kinds of wrong samples that are present, with their flags."""
    samples = inspected.samples
    flags = {name: samples[name].values for name in _WRONG}
    flags = {name: values[:, index] if values.ndim == 2 else values for name, values in flags.items()}
    return [(name, values) for name, values in flags.items() if values.any()]

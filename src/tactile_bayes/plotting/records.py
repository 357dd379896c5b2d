"""Figures of a record: observables along the drive, their posterior predictive interval, and its inspection."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_kind, check_mapping
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import AxesArray, check_panels, new_panels, plot, write_not_measured
from tactile_bayes.plotting.drive_axis import (
    DriveAxis,
    draw_events,
    drive_axis,
    finish_channels,
    phase_runs,
    reading_style,
    with_events,
)
from tactile_bayes.plotting.labels import LABELS, legend_entry, set_unit
from tactile_bayes.plotting.style import PALETTE, PHASES, SWEEP_LINES, SWEEP_MARKERS
from tactile_bayes.record import CHANNELS, frame_of, present_channels, validate
from tactile_bayes.sweep import SweepEvents

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.diagnostics.inspection import Inspection

# Colours of residuals of two overlapping sweeps, after Okabe and Ito.
_SWEEPS = {"forward": "#0072B2", "backward": "#B34700"}
_ENDS = ("lower", "upper")
_ALONG = "along_drive"  # variable with the coordinate of a sample in the figure
_IN_ORDER = ("forward", "backward", "tip contact", "tangential contact", "truth", "first", "change", "snap")
_FARTHEST = 8.0  # largest residual within a panel's limits: a single outlier must not flatten all others
_TURNING_LABELS = {
    **LABELS,
    "force_x": r"axial force $f_{\mathrm{A}\parallel}$",
    "force_y": r"transversal force $f_{\mathrm{A}\perp}$",
}
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


@plot(example="scanned")
def observables(
    record: xr.Dataset, *, events: Mapping[str, SweepEvents] | None = None, axes: Sequence[Axes] | None = None
) -> AxesArray:
    """Draw holding moment and support reaction along the drive, like Figures 3 to 6 of Merker et al. 2018.

    The paper's doi is 10.1155/2018/1613945. A record without noise, as `scan` returns it, is drawn as lines coloured by
    contact phase; any other record as points, with its truth, if it has one, as thin lines. Forces are drawn in the
    frame of the record. The coordinate is the drive angle [°]; for drives that carry the base it is the travel of the
    base, in the record's unit of length or its thousandth; for records with drives of both kinds it is the number of
    the sample, sweep beside sweep.

    Parameters
    ----------
    record : xr.Dataset
        A record.
    events : mapping of str to SweepEvents, optional
        Events by direction, as in a scan, for a record in either frame; first contact, phase changes and snap-off are
        marked.
    axes : sequence of 3 Axes, optional
        One for each of holding_moment, force_x and force_y.

    Raises
    ------
    RecordError
        If `record` is not a valid record.
    ParameterError
        If there are not three axes.

    Examples
    --------
    >>> observables(scanned.record, events=scanned.events)[-1].get_xlabel()
    'drive angle $\\\\varphi_0$ [°]'
    """
    record = validate(record)
    correction = "give the events of a scan, by direction"
    check_mapping("events", events, correction)
    for name, of_sweep in (events or {}).items():
        check_kind(f"events[{name!r}]", of_sweep, SweepEvents, correction)
    panels, along = _panels(axes), drive_axis(record)
    _draw_observables(panels, record, along, events or {}, with_truth=True)
    _finish_panels(panels, along, axes is None)
    return panels


@plot(example="measured")
def predictive(
    record: xr.Dataset,
    predicted: xr.Dataset,
    *,
    axes: Sequence[Axes] | None = None,
    residuals: Sequence[Axes] | None = None,
    label: str = "predicted",
) -> AxesArray:
    """Draw measured observables over their posterior predictive interval, and their residuals.

    A residual is a reading less the middle of its interval, over half the interval's width: within ±1 the reading lies
    in the interval. Misfit enlarges the inferred noise, so that misfitting readings may lie in their intervals; their
    residuals then drift instead of scattering. A new figure has residuals below each channel; the Axes returned are
    those of the channels.

    Parameters
    ----------
    record : xr.Dataset
        A record.
    predicted : xr.Dataset
        Over "sample" as the record, from `predictive_interval`: for a channel such as force_x the interval is
        force_x_lower to force_x_upper, in the units and the frame of the record. Intervals may be missing.
    axes : sequence of 3 Axes, optional
        One for each of holding_moment, force_x and force_y, over the coordinate of `observables`.
    residuals : sequence of 3 Axes, optional
        Axes for the residuals of each channel; if `axes` alone are given, residuals are not drawn.
    label : str
        Label of the interval in the legend.

    Raises
    ------
    RecordError
        If `record` is not a valid record.
    ParameterError
        If there are not three axes, or axes for residuals alone, or `predicted` does not have the samples of the
        record, or states another frame.

    Examples
    --------
    >>> ends, true = {"lower": -0.04, "upper": 0.04}, scanned.record["holding_moment"]
    >>> predicted = xr.Dataset({f"holding_moment_{end}": true + off for end, off in ends.items()})
    >>> predictive(measured, predicted).shape
    (3,)
    """
    record = validate(record)
    check_kind("predicted", predicted, xr.Dataset, "give what predictive_interval returned")
    check_kind("label", label, str, "give a text")
    if predicted.sizes.get("sample") != record.sizes["sample"]:
        raise ParameterError(
            f"predicted has {predicted.sizes.get('sample', 'no')} samples and the record {record.sizes['sample']}: "
            "give the prediction for every sample of this record"
        )
    frame = predicted.attrs.get("load_cell_frame", frame_of(record))
    if frame != frame_of(record):
        raise ParameterError(
            f"forces are predicted in the {frame} frame, and those of the record are in the {frame_of(record)} one: "
            f"give in_frame(record, {frame!r})"
        )
    if axes is None and residuals is not None:
        raise ParameterError("axes are given for the residuals only: give three for the channels, too")
    if axes is None:
        both = new_panels(6, 1, 8.4, sharex=True, height_ratios=3 * (2.0, 1.0))[:, 0]
        panels, below = both[::2], both[1::2]
    else:
        panels, below = _panels(axes), np.full(3, None) if residuals is None else _panels(residuals)
    along = drive_axis(record)
    _draw_observables(panels, record, along, {}, with_truth=False)
    for channel, panel, ax in zip(CHANNELS, panels, below, strict=True):
        if f"{channel}_lower" not in predicted or np.isnan(record[channel].values).all():
            if ax is not None:
                ax.set_yticks([])
            continue
        for sweep in _sweeps(record.assign({end: predicted[f"{channel}_{end}"] for end in _ENDS}), along):
            sweep = sweep.sortby(_ALONG)
            style = {"color": PALETTE["band"], "linewidth": 0.5, "zorder": 0.5, "label": label}
            panel.fill_between(sweep[_ALONG].values, *(sweep[end].values for end in _ENDS), **style)
            if ax is not None:
                _draw_residuals(ax, sweep, channel)
        if ax is not None:
            _finish_residuals(ax)
    drawn = [ax for pair in zip(panels, below, strict=True) for ax in pair if ax is not None]
    _finish_panels(np.array(drawn, dtype=object), along, axes is None, columns=4 if below[0] is None else 3)
    return panels


def _panels(axes: Sequence[Axes] | None) -> AxesArray:
    if axes is None:
        return new_panels(3, 1, 5.4, sharex=True)[:, 0]
    return check_panels(axes, (3,), f"give three, for {', '.join(CHANNELS)}")


def _draw_residuals(ax: Axes, sweep: xr.Dataset, channel: str) -> None:
    lower, upper = (sweep[end].values for end in _ENDS)
    with np.errstate(divide="ignore", invalid="ignore"):
        off = (sweep[channel].values - 0.5 * (lower + upper)) / (0.5 * (upper - lower))
    direction = str(sweep["direction"].values[0])
    style: dict[str, Any] = {"color": _SWEEPS[direction], "marker": SWEEP_MARKERS[direction], "markersize": 2.2}
    style |= {"markeredgewidth": 0.0, "linestyle": SWEEP_LINES[direction], "linewidth": 0.5}
    off[~np.isfinite(off)] = np.nan
    ax.plot(sweep[_ALONG].values, off, label=f"residual {direction}", **style)


def _finish_residuals(ax: Axes) -> None:
    ax.axhspan(-1.0, 1.0, color=PALETTE["band"], linewidth=0.0, zorder=0.5)
    ax.axhline(0.0, color=PALETTE["median"], linewidth=1.0, zorder=0.6)
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in ax.lines])
    most = float(np.clip(np.max(np.abs(values), initial=1.0, where=np.isfinite(values)), 1.5, _FARTHEST))
    ax.set_ylim(-1.1 * most, 1.1 * most)
    ax.set_ylabel("residual\n[½ interval]")


def _finish_panels(panels: AxesArray, along: DriveAxis, own: bool, columns: int = 4) -> None:
    bottom = panels[-1]
    along.label(bottom.xaxis)
    if own:
        bottom.figure.align_ylabels(list(panels))
        for panel in panels[:-1]:
            panel.tick_params(labelbottom=False)
    finish_channels(panels, _legend_order, columns)


def _legend_order(label: str) -> int:
    """Return the rank of a label: directions, then phases, then the rest in the order of the sweep."""
    return next((rank for rank, word in enumerate(_IN_ORDER) if word in label), len(_IN_ORDER))


def _draw_observables(
    panels: AxesArray, record: xr.Dataset, along: DriveAxis, events: Mapping[str, SweepEvents], *, with_truth: bool
) -> None:
    labels = LABELS if frame_of(record) == "fixed" else _TURNING_LABELS
    for panel, channel in zip(panels, CHANNELS, strict=True):
        if np.isnan(record[channel].values).all():
            write_not_measured(panel, f"{labels[channel]}\n")
            continue
        along.draw_below(panel)
        for sweep in _sweeps(record, along):
            direction = str(sweep["direction"].values[0])
            of_sweep = None if along.kind == "sample" else events.get(direction)
            if _is_exact(sweep, channel):
                _draw_line(panel, sweep, channel, of_sweep, along, linewidth=1.6)
                legend_entry(panel, direction, color="0.35", linestyle=SWEEP_LINES[direction], linewidth=1.6)
            else:
                style = reading_style(direction, PALETTE["sample"])
                panel.plot(sweep[_ALONG].values, sweep[channel].values, **style)
                legend_entry(panel, f"measured {direction}", **style)
                if with_truth and f"truth_{channel}" in sweep:
                    _draw_line(panel, sweep, f"truth_{channel}", of_sweep, along, linewidth=1.0)
            if of_sweep is not None:
                draw_events(panel, of_sweep, channel, frame_of(record), travels=along.kind == "travel")
        set_unit(panel.yaxis, f"{labels[channel]}\n", channel, record[channel].attrs, record[channel].values)


def _sweeps(record: xr.Dataset, along: DriveAxis) -> Iterator[xr.Dataset]:
    record = record.assign({_ALONG: ("sample", along.values)})
    for number in np.unique(record["sweep"].values):
        yield record.isel(sample=np.flatnonzero(record["sweep"].values == number))


def _is_exact(sweep: xr.Dataset, channel: str) -> bool:
    """Return True if a channel comes from a scan, or from a load cell without noise."""
    if "truth_contact_phase" not in sweep:
        return False
    truth = f"truth_{channel}"
    return truth not in sweep or bool(np.array_equal(sweep[truth].values, sweep[channel].values))


def _draw_line(
    ax: Axes, sweep: xr.Dataset, column: str, events: SweepEvents | None, along: DriveAxis, linewidth: float
) -> None:
    """Draw a channel without noise, coloured by phase, and complete up to the events."""
    angle, value = sweep[_ALONG].values, sweep[column].values
    if along.kind == "angle" and "truth_drive_angle" in sweep:
        angle = np.degrees(sweep["truth_drive_angle"].values)
    direction = str(sweep["direction"].values[0])
    style: dict[str, Any] = {"linestyle": SWEEP_LINES[direction], "linewidth": linewidth, "zorder": 2.5}
    if "truth_contact_phase" not in sweep:
        ax.plot(angle, value, color=PALETTE["change"], **style)
        legend_entry(ax, "truth", color=PALETTE["change"], linewidth=linewidth)
        return
    phase, channel = sweep["truth_contact_phase"].values.astype(object), column.removeprefix("truth_")
    if events is not None:
        travels = along.kind == "travel"
        angle, value, phase = with_events(angle, value, phase, events, channel, frame_of(sweep), travels=travels)
    for run in phase_runs(phase):
        name = str(phase[run.start])
        ax.plot(angle[run], value[run], color=PALETTE[name], **style)
        if name in PHASES:
            label = PHASES[name] if column == channel else f"true {PHASES[name]}"
            legend_entry(ax, label, color=PALETTE[name], linewidth=linewidth)


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
        _draw_inspected(readings, inspected, index, along)
        set_unit(readings.yaxis, f"{label}\n", channel, record[channel].attrs, record[channel].values)
        _draw_unloaded(zero, inspected, index)
        set_unit(zero.yaxis, "", channel, record[channel].attrs, record[channel].values[inspected.samples.unloaded])
    along.label(panels[-1, 0].xaxis, with_ticks=False)
    panels[-1, 1].set_xlabel("sample")
    panels[0, 1].set_title("unloaded", fontsize="small")
    panels[0, 0].figure.align_ylabels(list(panels[:, 0]))
    finish_channels(panels.ravel(), _LEGEND.index, 3, handlelength=1.5, columnspacing=1.2)
    return panels


def _draw_inspected(ax: Axes, inspected: Inspection, index: int, along: DriveAxis) -> None:
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

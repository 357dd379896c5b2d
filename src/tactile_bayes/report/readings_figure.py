"""Figures of the readings and of the rod at every sample: its shapes, drawings, and frames for the page's script."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from markupsafe import Markup
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours import Contour
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.experiment import likelihood_of, segments_of
from tactile_bayes.inference.result import best_draw, record_of
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.mechanics.phases import NONE, PHASE_NAMES
from tactile_bayes.plotting.drive_axis import drive_axis
from tactile_bayes.plotting.maps import outline
from tactile_bayes.record import (
    CHANNELS,
    bases_of,
    carried_sweeps,
    frame_of,
    loads_of,
    present_channels,
    rod_of,
    rows_of_sweeps,
    travels_of,
    turned,
)
from tactile_bayes.report.drawing import Plot, dots, element, figure, legend
from tactile_bayes.report.findings import Findings
from tactile_bayes.report.wording import Shown, percent, shown_as
from tactile_bayes.rig.stated import rod_with
from tactile_bayes.sweep import ManyUnits, to_lab_frame

_WORDS = {"holding_moment": "holding moment", "force_x": "force x", "force_y": "force y"}
_TURNING = {"force_x": "force along the rod", "force_y": "force across the rod"}
# Channels beside an axis, by their words.
_SHORT = {"holding moment": "moment", "force along the rod": "along", "force across the rod": "across"}
_READINGS_HEIGHT = 190.0
_ARROW = 110.0  # length of the largest force
# Largest number of samples drawn of each channel; of a longer record every second, or third, and so on.
_MOST_DOTS = 1500


# Legend of the rods: classes and texts.
_RODS = (
    ("key-object", "object, by the most probable contour"),
    ("key-rod", "rod"),
    ("key-tip", "tip contact"),
    ("key-tangential", "tangential contact"),
    ("key-force", "support reaction at the pivot, contact force at the contact"),
    ("key-moment", "holding moment"),
)
_MOST = 900  # largest number of samples shown; of a longer record every second, or third, and so on
_POINTS = 33


class ReadingsFigure(NamedTuple):
    """Drawings and data of the readings for a page."""

    rods: Markup
    readings: Markup
    rods_legend: Markup
    readings_legend: Markup
    channels: list[tuple[str, str, str]]  # name, label and unit of every channel
    data: Mapping[str, Any]  # frames of the moving rod
    # Sample, sweep, drive angle [degrees], then travel if the base is carried in some sweep, then readings.
    rows: list[list[str]]
    travel_unit: str | None  # unit of the travel; None if the base is never carried
    shown: dict[str, Shown]
    drawn_every: int


def channel_names(record: xr.Dataset) -> dict[str, str]:
    """Return the names of the channels in the frame of the load cell."""
    return _WORDS | (_TURNING if frame_of(record) == "turning" else {})


def readings_figure(findings: Findings, motion: Frames) -> ReadingsFigure:
    """Draw the readings along the drive, and the rod at the largest load of the first sweep."""
    record, present = findings.record, present_channels(findings.record)
    words = channel_names(record)
    # The rod has all loads, also those that were not measured, each in a suitable unit.
    bent = _in_frame(findings, motion)
    shown = {
        name: shown_as(name, record[name].attrs, record[name].values if name in present else bent[:, i])
        for i, name in enumerate(CHANNELS)
    }
    force = np.hypot(motion.loads[:, 1], motion.loads[:, 2])
    first = int(np.argmax(np.where(motion.sweep == motion.sweep[0], force, -1.0)))
    about = np.concatenate([motion.rod_x.ravel(), motion.rod_y.ravel()])
    length = shown_as("contact_x", record["base_x"].attrs, about)
    rods, data = _rods(motion, first, length)
    plots, drawings, every = _readings(findings, shown, int(motion.samples[first]))
    across = next(iter(plots.values())).x
    data["angle"] = [across.at(value) for value in drive_axis(record).values[motion.samples]]
    data["marks"] = {
        name: [None if not np.isfinite(value) else plot.y.at(value) for value in record[name].values[motion.samples]]
        for name, plot in plots.items()
    }
    data["said"], rows = _said(findings, motion, shown, bent, length)
    data["sweeps"] = [
        {"name": _sweep_name(record, number), "frames": np.flatnonzero(motion.sweep == number).tolist()}
        for number in dict.fromkeys(motion.sweep.tolist())
    ]
    data["first"] = first
    senses = [sense for sense in ("forward", "backward") if sense in record.direction.values]
    entries = [
        *((f"key-{sense}", f"reading, {sense} sweep") for sense in senses),
        ("key-unloaded", "certainly unloaded (pale)"),
        ("key-predicted", f"{percent(findings.probability)} of what the posterior predicts"),
        ("key-event", "first contact and snap-off, medians"),
    ]
    channels = [(name, words[name], shown[name].name) for name in CHANNELS]
    travel_unit = length.bracketed if carried_sweeps(record) else None
    together = Markup("").join(drawings)
    return ReadingsFigure(
        rods, together, legend(_RODS), legend(entries), channels, data, rows, travel_unit, shown, every
    )


def _sweep_name(record: xr.Dataset, number: int) -> str:
    first = record.isel(sample=int(np.argmax(record.sweep.values == number)))
    name, bases = f"sweep {number}, {first.direction.item()}", bases_of(record)
    if number in carried_sweeps(record):
        return f"{name}, carried"
    pivot = first.base_x.item(), first.base_y.item()
    return name if len(bases) == 1 else f"{name}, pivot {bases.index(pivot) + 1}"


def _in_frame(findings: Findings, motion: Frames) -> Floats:
    """Return the loads of the rod along the axes of the load cell, shape (n, 3)."""
    if frame_of(findings.record) == "fixed":
        return motion.loads
    moment, force_x, force_y = motion.loads.T
    return np.stack([moment, *turned(force_x, force_y, motion.cell_angle)], axis=-1)


def _rods(motion: Frames, first: int, unit: Shown) -> tuple[Markup, dict[str, Any]]:
    """Return the map of the rod in one frame, and all frames, in the drawing's own units."""
    x, y = motion.rod_x, motion.rod_y
    plot, height = Plot.map_of(x.ravel(), y.ravel(), unit)
    along, up = outline(motion.contour, plot.x.low, plot.x.high)
    up = np.minimum(up, plot.y.high + 1.0 * (plot.y.high - plot.y.low))
    plot.area(along, up, np.full_like(up, plot.y.high + 2.0 * (plot.y.high - plot.y.low)), "object")
    plot.path(along, up, "object-edge")
    plot.put_pivots(motion.pivots)

    rod_x, rod_y = np.round(plot.x(x), 1), np.round(plot.y(y), 1)
    force = motion.loads[:, 1:]
    largest = float(np.max(np.hypot(*force.T), initial=0.0)) or 1.0
    arrow = np.round(force / largest * _ARROW * np.array([1.0, -1.0]), 1)
    moment = motion.loads[:, 0] / (float(np.max(np.abs(motion.loads[:, 0]), initial=0.0)) or 1.0)
    frames: dict[str, Any] = {
        "rod": np.stack([rod_x, rod_y], axis=-1).reshape(len(x), -1).tolist(),
        "contact": [
            [plot.x.at(a), plot.y.at(b)] if np.isfinite(a) else None
            for a, b in zip(motion.contact_x, motion.contact_y, strict=True)
        ],
        "phase": motion.phase.tolist(),
        "force": arrow.tolist(),
        "moment": np.round(moment, 3).tolist(),
    }
    plot.put(*_rod(frames, first))
    head = element("path", d="M0 0L8 4L0 8z")
    size = {"markerUnits": "userSpaceOnUse", "markerWidth": 8, "markerHeight": 8, "refX": 7, "refY": 4}
    marker = element("marker", head, id="head", class_="arrow-head", **size, orient="auto", viewBox="0 0 8 8")
    description = (
        "The rod from its pivot to its tip, as the most probable contour bends it at one sample of the record, with "
        "the contact point, the forces and the holding moment. The slider below chooses the sample; its numbers are in "
        "the table beside it."
    )
    return figure("rod-map", "The rod", description, height, element("defs", marker), *plot.drawn("rod-clip")), frames


def _rod(frames: Mapping[str, Any], first: int) -> tuple[Markup, ...]:
    """Return the moving elements of one frame; the script draws the others in the same way."""
    rod, contact = frames["rod"][first], frames["contact"][first]
    force, phase = frames["force"][first], frames["phase"][first]
    points = " ".join(f"{a:g},{b:g}" for a, b in zip(rod[::2], rod[1::2], strict=True))
    lines = []
    for name, sign, place in (("reaction", 1, rod[:2]), ("thrust", -1, contact)):
        start = place or [-20, -20]
        ends = dict(zip(("x1", "y1"), start, strict=True))
        ends |= {"x2": round(start[0] + sign * force[0], 1), "y2": round(start[1] + sign * force[1], 1)}
        hidden = "hidden" if contact is None else "visible"
        lines.append(element("line", id=name, class_="force", marker_end="url(#head)", visibility=hidden, **ends))
    at = contact or [-20, -20]
    return (
        element("path", id="moment", class_="moment", d="M0 0", marker_end="url(#head)"),
        element("polyline", id="rod", points=points, class_="rod"),
        element("circle", id="contact", cx=at[0], cy=at[1], r=5, class_=f"touch {phase}"),
        *lines,
    )


def _readings(findings: Findings, shown: Mapping[str, Shown], here: int) -> tuple[dict[str, Plot], list[Markup], int]:
    """Return plots of the measured channels with a rule at one sample, their drawings, and the thinning of readings."""
    record, interval, words = findings.record, findings.interval, channel_names(findings.record)
    along, sweep = drive_axis(record), record.sweep.values
    angle = along.values
    length = shown_as("contact_x", along.attrs, angle)
    travelled = f"the travel of the base from {length.text(angle.min())} to {length.full(angle.max())}"
    name_of_axis, power, over = {
        "angle": ("drive angle φ₀ [°]", 0, f"the drive angle from {angle.min():.4g} to {angle.max():.4g} degrees"),
        "travel": (f"travel of the base{length.bracketed}", length.power, travelled),
        "sample": ("sample", 0, "the number of the sample"),
    }[along.kind]
    unloaded, direction = findings.zero.unloaded.values, record.direction.values
    every = max(1, -(-angle.size // _MOST_DOTS))
    kept = np.arange(angle.size) % every == 0
    events = findings.posterior["events"].to_dataset().median(("chain", "draw"))
    rules = [
        along.place_of(events.isel(segment=k), event, own)
        for event in ("first", "snap_off")
        for k, own in enumerate(segments_of(findings.posterior, record).samples)
    ]
    plots, drawings = {}, []
    for name in present_channels(record):
        values = record[name].values
        bounds = [interval[f"{name}_{edge}"].values for edge in ("lower", "upper")]
        unit = shown[name]
        labels = name_of_axis, f"{_SHORT.get(words[name], words[name])}{unit.bracketed}"
        plot = Plot.around(angle, np.concatenate([values, *bounds]), labels, _READINGS_HEIGHT, (power, unit.power))
        for number in np.unique(sweep):
            rows = np.flatnonzero((sweep == number) & kept)
            rows = rows[np.argsort(angle[rows], kind="stable")]
            plot.area(angle[rows], bounds[0][rows], bounds[1][rows], "predicted")
        plot.path([plot.x.low, plot.x.high], [0.0, 0.0], "zero")
        for places, class_ in ((along.starts, "zero"), (rules, "event")):
            for at in places:
                plot.path([at, at], [plot.y.low, plot.y.high], class_)
        for sense, pale in product(("forward", "backward"), (" unloaded", "")):
            rows = np.flatnonzero(kept & (direction == sense) & (unloaded == bool(pale)))
            if rows.size:
                at_x, at_y = plot.x(angle[rows]), plot.y(values[rows])
                plot.put(dots(at_x, at_y, 1.8, f"reading {sense}{pale}", square=sense == "backward"))
        across = plot.x.at(angle[here])
        ends = {"x1": across, "x2": across, "y1": plot.y.end, "y2": plot.y.start}
        plot.put(
            element("line", class_="rule moving", **ends),
            element("circle", class_="mark moving", cx=across, cy=plot.y.at(values[here]), r=5, data_channel=name),
        )
        plots[name] = plot
        description = (
            f"{words[name].capitalize()} of {angle.size} samples over {over}, over what the posterior predicts; "
            "all numbers are in the table below."
        )
        identity, title = f"readings-{name.replace('_', '-')}", f"Readings: {words[name]}"
        drawings.append(figure(identity, title, description, _READINGS_HEIGHT, *plot.drawn(f"{identity}-clip")))
    return plots, drawings, every


def _said(
    findings: Findings, motion: Frames, shown: Mapping[str, Shown], bent: Floats, length: Shown
) -> tuple[dict[str, Any], list[list[str]]]:
    """Return the entries of the table beside the rod in every frame, and a table of all readings."""
    record, interval, present = findings.record, findings.interval, present_channels(findings.record)
    angles = [f"{angle:.2f}".replace("-", "−") for angle in np.degrees(record.drive_angle.values[motion.samples])]
    carried = np.isin(record.sweep.values, carried_sweeps(record))
    travels = travels_of(record)
    frames: dict[str, Any] = {
        "angle": angles,
        "sample": motion.samples.tolist(),
        "travel": [f", travel {length.full(float(travels[k]))}" if carried[k] else "" for k in motion.samples],
        "contact": [
            f"({length.text(a)}, {length.text(b)}) {length.name}".rstrip() if np.isfinite(a) else "none"
            for a, b in zip(motion.contact_x, motion.contact_y, strict=True)
        ],
    }
    for i, name in enumerate(CHANNELS):
        unit = shown[name]
        frames[name] = []
        for row, k in enumerate(motion.samples):
            reading = between = "not measured"
            if name in present:
                reading = unit.text(float(record[name].values[k]))
                low, high = (unit.text(float(interval[f"{name}_{edge}"].values[k])) for edge in ("lower", "upper"))
                between = f"{low} to {high}"
            frames[name].append([reading, between, unit.text(float(bent[row, i]))])
    moved = [[length.text(float(travels[k])) if carried[k] else "–"] if carried.any() else [] for k in motion.samples]
    rows = [
        [str(k), str(sweep), angle, *travel, *(shown[name].text(float(record[name].values[k])) for name in present)]
        for k, sweep, angle, travel in zip(motion.samples, motion.sweep, angles, moved, strict=True)
    ]
    return frames, rows


@dataclass(frozen=True)
class Frames:
    """Rods along the most probable contour, at samples of a record, sweep after sweep; in the record's units."""

    contour: Contour  # of the draw with the highest posterior density
    samples: Index  # numbers of the samples in the record, shape (n,)
    sweep: Index  # their sweeps
    rod_x: Floats  # the rod from pivot to tip, shape (n, points)
    rod_y: Floats
    contact_x: Floats  # contact point on the object, shape (n,); NaN out of contact
    contact_y: Floats
    phase: NDArray[np.str_]  # "tip", "tangential" or "none"
    drive_angle: Floats  # slope of the rod at the pivot [rad]
    # Drive angle as read, without the encoder's offset and backlash [rad]: the angle of a load cell that turns with the
    # drive. It differs from `drive_angle` by the deflection of a compliant suspension.
    cell_angle: Floats
    loads: (
        Floats  # holding moment and support reaction in the laboratory frame, without the cell's errors, shape (n, 3)
    )
    pivots: Floats  # pivots of that draw, shape (pivots, 2)
    every: int  # every how many samples one is shown


def motion_of(posterior: xr.DataTree, most: int = _MOST) -> Frames:
    """Return the rods of the most probable draw, with its rigidity, encoder, friction, suspension and pivots."""
    record, draw = record_of(posterior), best_draw(posterior)
    contour = contours_of(draw, posterior.attrs["family"])
    likelihood, unknowns = likelihood_of(posterior, record)
    rig = unknowns.rig({name: np.atleast_1d(draw[name].values) for name in unknowns.names})
    paths = likelihood.paths(contour, rig)

    numbers = record.sweep.values
    every = max(1, -(-numbers.size // most))
    samples = np.concatenate([rows[::every] for rows in rows_of_sweeps(numbers)])
    batch_index = likelihood.segments.of_sample[samples]
    mirrored = paths.sweep_frame.mirrored[batch_index]
    read = likelihood.segments.drive_angles
    angle = (read - likelihood.misread(rig)[0])[samples]
    angle_in_sweep_frame = np.where(mirrored, np.pi - angle, angle)
    states = paths.states(batch_index, likelihood.travels(read, rig)[0, samples])
    rod = rod_with(rod_of(record), {**unknowns.known, **{name: float(draw[name]) for name in unknowns.names}})
    stiffer = float(np.ravel(rig.rigidity_scale)[0])
    units = ManyUnits(rod.length_unit, stiffer * rod.moment_unit, stiffer * rod.force_unit)
    in_lab_frame = to_lab_frame(paths.sweep_frame, batch_index, states, units)
    loaded = states.wrench.phase != NONE
    slope = np.where(loaded, states.wrench.drive_angle, angle_in_sweep_frame)
    wrench = (np.where(loaded, getattr(states.wrench, name), 0.0) for name in ("holding_moment", "force_x", "force_y"))
    sign = np.where(mirrored, -1.0, 1.0)
    x, y = rod_shape(slope, *wrench, points=_POINTS, side=1.0, rods=rod.mirrored(sign))
    loads = loads_of(in_lab_frame)
    starts = np.stack([paths.sweep_frame.base_x, paths.sweep_frame.base_y], axis=-1)
    bases = np.stack([record["base_x"].values, record["base_y"].values], axis=-1)[samples]
    base_x, base_y = (starts[batch_index] + bases - likelihood.segments.bases[batch_index]).T
    return Frames(
        contour=contour.take(np.array(0)),
        samples=samples,
        sweep=numbers[samples],
        rod_x=base_x[:, None] + sign[:, None] * x * rod.length_unit,
        rod_y=base_y[:, None] + y * rod.length_unit,
        contact_x=np.where(loaded, in_lab_frame["contact_x"], np.nan),
        contact_y=np.where(loaded, in_lab_frame["contact_y"], np.nan),
        phase=np.array(PHASE_NAMES)[states.wrench.phase],
        drive_angle=np.where(mirrored, np.pi - slope, slope),
        cell_angle=angle,
        loads=np.where(loaded[:, None], loads, 0.0),
        pivots=np.unique(starts, axis=0),
        every=every,
    )

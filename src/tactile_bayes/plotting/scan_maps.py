"""Maps of a scan: deformed rods along a sweep, and the arcs that its sweeps touched."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle, product
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_choice, check_kind, check_whole_number, shown
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.plotting import maps
from tactile_bayes.plotting.axes import axes_for, plot
from tactile_bayes.plotting.drive_axis import ENDINGS
from tactile_bayes.plotting.labels import legend_entry, number, shown_unit
from tactile_bayes.plotting.style import BASES, CONTACT_MARKERS, PALETTE, PHASES
from tactile_bayes.record import CHANNELS, in_frame, rod_of
from tactile_bayes.sweep import Scan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox

    from tactile_bayes.contours.base import Contour
    from tactile_bayes.sweep import Event, SweepEvents

# Distance [L] below which contacts coincide: at a fold, rounding leaves a contact half of its digits.
_SAME_PLACE = 1e-7
# Line styles: the first for as many bases as there are colours, the next for as many further bases, and so on.
_STYLES: tuple[Any, ...] = ("solid", (0, (3.0, 1.0)), (0, (1.0, 0.5)))
_ARC_WIDTH = 3.0
# Distance [points] of the arcs of a base below those of the base before: side by side up to slopes of 45°.
_OFFSET = np.sqrt(2.0) * _ARC_WIDTH


@plot("the scan has no such sweep, or several of this direction, or the count is not positive", example="scanned")
def rods(
    scan: Scan,
    *,
    direction: Literal["forward", "backward"] | None = None,
    sweep: int | None = None,
    count: int = 15,
    ax: Axes | None = None,
) -> Axes:
    """Draw deformed rods along a sweep, coloured by contact phase, like Figures 7 to 10 of Merker et al. 2018.

    The paper's doi is 10.1155/2018/1613945.

    Parameters
    ----------
    scan : Scan
        A scan.
    direction : {"forward", "backward"}, optional
        Direction of the sweep, if the scan has one sweep of this direction; by default forward.
    sweep : int, optional
        Number of the sweep in the record, instead of its direction: for scans with several bases.
    count : int
        Largest number of rods, evenly over the samples in contact; those at first contact, phase changes and snap-off
        are added.

    Examples
    --------
    >>> rods(scanned, direction="backward").get_xlabel()
    '$x$ [$L$]'
    """
    check_kind("scan", scan, Scan, "give what scan returned")
    chosen_sweep = _number(scan, direction, sweep)
    check_whole_number("count", count, 1, "at least one rod must be drawn")
    record, events, rod = in_frame(scan.record, "fixed"), scan.sweeps[chosen_sweep], rod_of(scan.record)
    of_sweep, side = record["sweep"].values == chosen_sweep, 1 if events.direction == "forward" else -1
    samples = np.flatnonzero(of_sweep & (record["truth_contact_phase"].values != "none"))
    if samples.size:
        samples = samples[np.unique(np.linspace(0, samples.size - 1, min(count, samples.size)).round().astype(int))]

    def shape(state: Mapping[str, Any]) -> tuple[Floats, Floats]:
        loads = (state[name] / unit for name, unit in zip(CHANNELS, rod.load_units, strict=True))
        x, y = rod_shape(state["drive_angle"], *loads, side=side, rods=rod.mirrored(side))
        base_x, base_y = (np.asarray(state[name])[..., None] for name in ("base_x", "base_y"))
        return base_x + rod.length_unit * x, base_y + rod.length_unit * y

    def true(name: str) -> Floats:
        return record[f"truth_{name}" if f"truth_{name}" in record else name].values[samples]

    ax = axes_for(ax)
    phases = record["truth_contact_phase"].values[samples]
    x, y = shape({name: true(name) for name in ("base_x", "base_y", "drive_angle", *CHANNELS)})
    for phase, label in PHASES.items():
        chosen = phases == phase
        if chosen.any():
            ax.plot(x[chosen].T, y[chosen].T, color=PALETTE[phase], linewidth=0.9, label=label)
            contacts = (record[f"truth_contact_{axis}"].values[samples[chosen]] for axis in "xy")
            dots: dict[str, Any] = {"linestyle": "none", "marker": CONTACT_MARKERS[phase], "markersize": 3.0}
            ax.plot(*contacts, color=PALETTE[phase], zorder=3, **dots)
    marked: list[tuple[Event, str, str]] = [
        (events.first_contact, "first contact", ":"),
        *((event, "phase change", "-") for event in events.transitions),
        (events.snap_off, ENDINGS.get(events.snap_off.kind, "snap-off"), "--"),
    ]
    extent = [x, y]
    for event, label, style in marked:
        x, y = shape(vars(event))
        extent = [np.append(a, b) for a, b in zip(extent, (x, y), strict=True)]
        ax.plot(x, y, color=PALETTE["change"], linestyle=style, linewidth=1.4, zorder=2.5, label=label)
        ax.plot(event.contact_x, event.contact_y, "o", color=PALETTE["change"], markersize=4.0, zorder=3.5)
    path = np.stack([record[f"base_{axis}"].values[of_sweep] for axis in "xy"])
    is_carried = bool(np.ptp(path, axis=1).any())
    if is_carried:
        ax.plot(*path, color="0.5", linestyle="-.", linewidth=0.8, zorder=1.5, label="base path")
    maps.draw_pivot(ax, events.base, label="base at start" if is_carried else "pivot")
    maps.draw_object(ax, scan.contour, extent[0], extent[1], room=0.05 * rod.length_unit)
    maps.finish_map(ax, record["base_x"].attrs)
    return ax


@plot("`scan` is not a scan", example="scanned")
def touched(scan: Scan, *, ax: Axes | None = None) -> Axes:
    """Draw the arcs of the contour that the sweeps touched, in a colour for each base, and the gaps between them.

    An arc extends from first contact to the end of contact. Arcs of the first base lie on the contour, those of every
    further base a line's width below; x is true everywhere. From the seventh base on, lines are dashed. The way of a
    base that is carried is drawn up to the end of contact. A gap is a stretch between the outermost contacts that no
    sweep touched; its width in x is written where there is room. If no gap remains, "no gap" is written.

    Parameters
    ----------
    scan : Scan
        A scan, from one base or several.

    Examples
    --------
    >>> [text.get_text() for text in touched(scanned).texts]
    ['gap\\n0.122 $L$']
    >>> [text.get_text() for text in touched(tb.scan(scanned.contour, base=[(0, 0), (0.25, 0)])).texts]
    ['no gap']
    """
    from matplotlib.transforms import ScaledTranslation

    check_kind("scan", scan, Scan, "touched takes what scan(...) returned: give it; plotting.observables draws records")
    rod, attrs = rod_of(scan.record), scan.record["base_x"].attrs
    same = _SAME_PLACE * rod.length_unit
    ax = axes_for(ax)
    arcs = [_arc(scan.contour, sweep) for sweep in scan.sweeps]
    looks = product(_STYLES, BASES)
    lines: dict[tuple[float, float], dict[str, Any]] = {
        base: {"color": colour, "linestyle": style, "linewidth": _ARC_WIDTH}
        for base, (style, colour) in zip(dict.fromkeys(sweep.base for sweep in scan.sweeps), cycle(looks), strict=False)
    }
    for (x, y), sweep in zip(arcs, scan.sweeps, strict=True):
        (line,) = ax.plot(x, y, **lines[sweep.base], solid_capstyle="butt", zorder=2.0)
        lowered = ScaledTranslation(0.0, -_OFFSET / 72.0 * list(lines).index(sweep.base), ax.figure.dpi_scale_trans)
        line.set_transform(ax.transData + lowered)  # only now, so that the limits are those of the arc itself
        if x[-1] - x[0] <= same:  # the sweep touched an edge alone
            line.set_marker("o")
    ends = {sweep.base: (sweep.snap_off.base_x, sweep.snap_off.base_y) for sweep in scan.sweeps}
    pivots = np.array([*lines, *ends.values()])
    x, y = (np.concatenate([*(arc[axis] for arc in arcs), pivots[:, axis]]) for axis in (0, 1))
    maps.draw_object(ax, scan.contour, x, y, room=0.05 * rod.length_unit)
    power, unit = shown_unit("contact_x", attrs, maps.limits_of(ax))
    for base, style in lines.items():
        ax.plot(*zip(base, ends[base], strict=True), color=style["color"], linewidth=1.0, zorder=1.5)
        maps.draw_pivot(ax, base, colour=style["color"], label="")
        place = ", ".join(number(part, power) for part in base)
        what = "base" if ends[base] == base else "base from"
        legend_entry(ax, f"{what} ({place}) {unit}", **style, marker="o", markerfacecolor="white")

    gaps = _gaps(arcs, same)
    texts = [
        maps.draw_gap(ax, left, right, f"gap\n{number(right - left, power, digits=3)} {unit}")
        for left, right in sorted(gaps, key=lambda gap: gap[0] - gap[1])
    ]
    _keep_apart(ax, texts)
    if not gaps and len(arcs) > 1:
        maps.write_on_top(ax, 0.5 * sum(ax.get_xlim()), "no gap")
    maps.finish_map(ax, attrs)
    return ax


def _arc(contour: Contour, sweep: SweepEvents) -> tuple[Floats, Floats]:
    """Return points of the arc that a sweep touched, from left to right; its ends are the events' contacts."""
    left, right = sorted((sweep.first_contact, sweep.snap_off), key=lambda event: event.contact_x)
    x, y = maps.outline(contour, left.contact_x, right.contact_x)
    x[[0, -1]] = left.contact_x, right.contact_x
    y[[0, -1]] = left.contact_y, right.contact_y
    return x, y


def _gaps(arcs: list[tuple[Floats, Floats]], same: float) -> list[tuple[float, float]]:
    """Return the stretches in x between arcs, from left to right."""
    ends = sorted((float(x[0]), float(x[-1])) for x, _ in arcs)
    reached = np.maximum.accumulate([right for _, right in ends])
    return [(float(end), left) for end, (left, _) in zip(reached, ends[1:], strict=False) if left - end > same]


def _keep_apart(ax: Axes, texts: list[Text]) -> None:
    """Remove texts that would overlap an earlier one, or leave the Axes, at the figure's size."""
    ax.apply_aspect()
    kept: list[Bbox] = []
    for text in texts:
        box = text.get_window_extent()
        if ax.bbox.x0 <= box.x0 and box.x1 <= ax.bbox.x1 and not box.count_overlaps(kept):
            kept.append(box)
        else:
            text.remove()


def _number(scan: Scan, direction: str | None, sweep: int | None) -> int:
    """Return the number of the requested sweep."""
    sweeps = [f"{k}: {of.direction} from ({of.base[0]:g}, {of.base[1]:g})" for k, of in enumerate(scan.sweeps)]
    listed = "\n".join(sweeps)
    if sweep is not None:
        if direction is not None:
            raise ParameterError(f"both direction={direction!r} and sweep={sweep!r} are given: one of them is enough")
        is_number = isinstance(sweep, int | np.integer) and not isinstance(sweep, bool)
        if not is_number or sweep not in range(len(sweeps)):
            raise ParameterError(f"the scan has no sweep {shown(sweep)}: choose from\n{listed}")
        return sweep
    direction = check_choice("direction", "forward" if direction is None else direction, ("forward", "backward"))
    directions = [of.direction for of in scan.sweeps]
    count = directions.count(direction)
    if not count:
        raise ParameterError(f"the scan has no {direction} sweep: choose from {', '.join(dict.fromkeys(directions))}")
    number = directions.index(direction)
    if count > 1:
        many = f"the scan has {count} {direction} sweeps"
        raise ParameterError(f"{many}: choose one by its number, as sweep={number}, from\n{listed}")
    return number

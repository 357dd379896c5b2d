"""Deformed rods along a sweep, on a map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_choice, check_kind, check_whole_number, shown
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.plotting.axes import axes_for
from tactile_bayes.plotting.maps import draw_object, draw_path, draw_pivot, finish_map
from tactile_bayes.plotting.marks import CONTACT_MARKERS, PALETTE, PHASES
from tactile_bayes.plotting.sweep_lines import ENDINGS
from tactile_bayes.record import CHANNELS, in_frame, rod_of
from tactile_bayes.sweep import Scan

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.sweep import Event


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
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If the scan has no such sweep, or several of this direction, or the count is not positive.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> rods(scan(paper_profile("I", q=0.4)), direction="backward").get_xlabel()
    '$x$ [$L$]'

    The third of four sweeps, forward from the second base:

    >>> rods(scan(paper_profile("I", q=0.4), base=[(0, 0), (0.25, 0)]), sweep=2).get_xlabel()
    '$x$ [$L$]'
    """
    check_kind("scan", scan, Scan, "give what scan returned")
    number = _number(scan, direction, sweep)
    check_whole_number("count", count, 1, "at least one rod must be drawn")
    record, events, rod = in_frame(scan.record, "fixed"), scan.sweeps[number], rod_of(scan.record)
    samples = np.flatnonzero((record["sweep"].values == number) & (record["truth_contact_phase"].values != "none"))
    if samples.size:
        samples = samples[np.unique(np.linspace(0, samples.size - 1, min(count, samples.size)).round().astype(int))]

    def shape(state: Mapping[str, Any]) -> tuple[Floats, Floats]:
        x, y = rod_shape(
            state["drive_angle"],
            state["holding_moment"] / rod.moment_unit,
            state["force_x"] / rod.force_unit,
            state["force_y"] / rod.force_unit,
            side=1 if events.direction == "forward" else -1,
            rods=rod.mirrored(1 if events.direction == "forward" else -1),
        )
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
            touched = (record[f"truth_contact_{axis}"].values[samples[chosen]] for axis in "xy")
            dots: dict[str, Any] = {"linestyle": "none", "marker": CONTACT_MARKERS[phase], "markersize": 3.0}
            ax.plot(*touched, color=PALETTE[phase], zorder=3, **dots)
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
    path = np.stack([record[f"base_{axis}"].values[record["sweep"].values == number] for axis in "xy"])
    is_carried = bool(np.ptp(path, axis=1).any())
    if is_carried:
        draw_path(ax, *path)
    draw_pivot(ax, events.base, label="base at start" if is_carried else "pivot")
    draw_object(ax, scan.contour, extent[0], extent[1], room=0.05 * rod.length_unit)
    finish_map(ax, record["base_x"].attrs)
    return ax


def _number(scan: Scan, direction: str | None, sweep: int | None) -> int:
    """Return the number of the requested sweep."""
    if sweep is not None:
        if direction is not None:
            raise ParameterError(f"both direction={direction!r} and sweep={sweep!r} are given: one of them is enough")
        is_number = isinstance(sweep, int | np.integer) and not isinstance(sweep, bool)
        if not is_number or sweep not in range(len(scan.sweeps)):
            raise ParameterError(f"the scan has no sweep {shown(sweep)}: choose from\n{_listed(scan)}")
        return sweep
    direction = "forward" if direction is None else check_choice("direction", direction, ("forward", "backward"))
    numbers = [number for number, events in enumerate(scan.sweeps) if events.direction == direction]
    if not numbers:
        have = ", ".join(dict.fromkeys(events.direction for events in scan.sweeps))
        raise ParameterError(f"the scan has no {direction} sweep: choose from {have}")
    if len(numbers) > 1:
        raise ParameterError(
            f"the scan has {len(numbers)} {direction} sweeps: choose one by its number, as sweep={numbers[0]}, "
            f"from\n{_listed(scan)}"
        )
    return numbers[0]


def _listed(scan: Scan) -> str:
    return "\n".join(
        f"{number}: {events.direction} from ({events.base[0]:g}, {events.base[1]:g})"
        for number, events in enumerate(scan.sweeps)
    )

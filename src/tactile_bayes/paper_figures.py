"""Figures 2 to 11 of Merker et al. 2018 (doi 10.1155/2018/1613945), each computed anew.

`figure` makes a figure, `draw_all` writes figures to files in a look of `plotting.style`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes import checks
from tactile_bayes.arrays import Floats
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import ContourError, ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence, seed_words
from tactile_bayes.plotting.axes import AxesArray
from tactile_bayes.plotting.drive_axis import EVENT_MARKERS, draw_events, phase_runs, with_events
from tactile_bayes.plotting.labels import DRIVE_ANGLE, LABELS, legend_entries, legend_entry, legend_in_rows, set_unit
from tactile_bayes.plotting.maps import draw_object, draw_pivot, label_map, outline
from tactile_bayes.plotting.scan_maps import rods as draw_rods
from tactile_bayes.plotting.style import (
    BASES,
    COLUMN_WIDTH,
    PAGE_WIDTH,
    PALETTE,
    PHASES,
    SWEEP_MARKERS,
    Style,
    own_style,
    save_figure,
)
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig.rig import Rig
from tactile_bayes.sweep import Rotation, Scan, scan
from tactile_bayes.tasks import write_atomically

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tactile_bayes.sweep import SweepEvents

__all__ = ["NUMBERS", "caption", "draw_all", "figure"]

Profile = Literal["I", "II", "III", "IV"]
Direction = Literal["both", "forward", "backward"]
Limits = tuple[tuple[float, float], tuple[float, float]]

_PROFILES: tuple[Profile, ...] = ("I", "II", "III", "IV")
_SWEEPS: Mapping[Profile, Direction] = {"I": "forward", "II": "both", "III": "both", "IV": "both"}
_FORMATS = ("pdf", "svg", "png")


def figure(
    number: int,
    *,
    distances: Sequence[float] | None = None,
    drive_step: float | None = None,
    rods: int = 15,
    load_cell: LoadCell | None = None,
    rng: Rng | None = None,
    width: float = PAGE_WIDTH,
) -> Figure:
    """Draw a figure of Merker et al. 2018 (doi 10.1155/2018/1613945), computed anew.

    Figure 2 explains tip and tangential contact. Figures 3 to 6 show moment and forces over the drive angle for
    profiles I to IV, Figures 7 to 10 the deformed rods, and Figure 11 the contact points that Step 2 reconstructs from
    these records. Profile I is swept forward; the others are swept forward and backward.

    Parameters
    ----------
    number : int
        Number of the figure, from 2 to 11.
    distances : sequence of float, optional
        Distances of the profile's vertex above the pivot, q [L]. By default 0.5 in Figure 2 (of several the first at
        which a phase occurs); 0.3, 0.4, 0.5 and 0.6 in Figures 3 to 6; 0.4 and 0.6 in Figures 7 to 10; 0.3 and 0.6 in
        Figure 11.
    drive_step : float, optional
        Step of the drive [rad], at most 0.5 and by default 1°.
    rods : int
        Number of rods drawn of a sweep in Figures 7 to 10, except those at first contact, phase changes and snap-off.
    load_cell : LoadCell, optional
        Load cell that measures the records of Figure 11; by default they are without noise.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator, optional
        Random numbers of the load cell's noise, needed with a load cell.
    width : float
        Width of the figure [inches]: 7 for a page, 3.5 for a column, with panels below one another.

    Returns
    -------
    matplotlib.figure.Figure
        Figure outside pyplot. Its look follows the settings while it is made and saved: see `plotting.style`.

    Raises
    ------
    ParameterError
        If there is no such figure, or an argument is not valid.
    ContourError
        If a distance is beyond the rod's reach.

    Examples
    --------
    >>> len(figure(3, distances=[0.3, 0.5]).axes)
    3
    """
    entry, choice = _chosen(number, distances, drive_step, rods, load_cell, rng, width)
    return entry.draw(choice)


def caption(number: int, **options: Any) -> str:
    """Return the caption of a figure, with the sweep, the distances and the seed of the noise.

    Arguments and errors are those of `figure`.

    Examples
    --------
    >>> caption(7, distances=[0.5])
    'Deformed rods, profile I, forward sweep, q = 0.5 L.'
    """
    entry, choice = _chosen(number, **{**(figure.__kwdefaults__ or {}), **options})
    sweep = "forward and backward sweep" if entry.direction == "both" else f"{entry.direction} sweep"
    noise = ""
    if number == 11 and choice.load_cell is not None and choice.seed is not None:
        noise = f", measured with noise (seed {seed_words(choice.seed)})"
    elif number == 11:
        noise = ", without noise"
    return f"{entry.words}, {sweep}{noise}, q = {', '.join(f'{q:g}' for q in choice.distances)} L."


def draw_all(
    out: str | os.PathLike[str],
    *,
    only: Sequence[int] | None = None,
    formats: Sequence[str] = ("pdf", "png"),
    style: Style = "print",
    progress: Callable[[int], object] | None = None,
    **options: Any,
) -> dict[int, dict[str, Path]]:
    """Write figures of the paper to a folder, and return their files by number and format.

    Files are named figure_02.pdf and so on, and hold their caption. They are written whole: after an interrupt each
    file is the old or the new one, and the same call makes all of them anew. The same options give the same bytes.

    Parameters
    ----------
    out : path-like
        Folder, created if missing.
    only : sequence of int, optional
        Numbers of the figures, from 2 to 11; by default all.
    formats : sequence of {"pdf", "svg", "png"}
        File formats of each figure.
    style : {"print", "screen"}
        Look of the figures, as in `plotting.style`.
    progress : callable, optional
        Called with the number of figures done, after each.
    **options
        Options of `figure`.

    Raises
    ------
    ParameterError, ContourError
        As in `figure`, or if there is no such format. Figures are made one by one: those made before an error remain.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     draw_all(folder, only=[3], formats=["svg"], distances=[0.5])[3]["svg"].name
    'figure_03.svg'
    """
    wanted = list(dict.fromkeys(checks.check_names("formats", formats)))
    if not wanted or not set(wanted) <= set(_FORMATS):
        raise ParameterError(f"formats are {list(formats)!r}: choose from {', '.join(_FORMATS)}")
    only = only.tolist() if isinstance(only, np.ndarray) else only
    checks.check_optional("only", only, Sequence, "give a list of numbers of figures")
    # Refuses before anything is written.
    captions = {number: caption(number, **options) for number in (NUMBERS if only is None else only)}
    checks.check_function("progress", progress)
    folder = checks.check_path("out", out, "give the path of a folder")
    files: dict[int, dict[str, Path]] = {}
    with own_style(style):
        for done, (number, text) in enumerate(captions.items(), start=1):
            made = figure(number, **options)
            folder.mkdir(parents=True, exist_ok=True)
            files[number] = {name: folder / f"figure_{number:02d}.{name}" for name in wanted}
            for name, path in files[number].items():
                with write_atomically(path) as temporary:
                    _save(made, temporary, name, number, text)
            if progress is not None:
                progress(done)
    return files


def _save(made: Figure, path: Path, name: str, number: int, text: str) -> None:
    """Save a figure with a caption, and without a date."""
    title = f"Figure {number}"
    metadata: dict[str, dict[str, Any]] = {
        "pdf": {"Title": title, "Subject": text, "CreationDate": None},
        "svg": {"Title": title, "Description": text, "Date": None},
        "png": {"Title": title, "Description": text},
    }
    save_figure(made, path, name, metadata=metadata[name])


# --- Options --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Choice:
    """Checked options of a figure."""

    distances: tuple[float, ...]  # of the vertex above the pivot, increasing [L]
    drive_step: float | None  # [rad]; None for that of `scan`
    rods: int  # largest number drawn in one sweep
    load_cell: LoadCell | None  # that measures the records of reconstructed points
    seed: np.random.SeedSequence | None  # of its noise
    width: float  # of the figure [inches]

    @property
    def is_column(self) -> bool:
        """True if panels must stand below one another."""
        return self.width < 0.5 * (COLUMN_WIDTH + PAGE_WIDTH)

    def map_panels(
        self, count: int, limits: Limits, *, beside: float, between: float, above: float, widest: float = np.inf
    ) -> tuple[Figure, AxesArray]:
        """Return a figure of maps at one scale, shape (rows, columns), with margins for labels and legend [inches]."""
        from matplotlib.figure import Figure

        columns = 1 if self.is_column else min(2, count)
        rows = -(-count // columns)
        (left, right), (bottom, top) = limits
        high = min(self.width / columns - beside, widest) * (top - bottom) / (right - left) + between
        figure = Figure(figsize=(self.width, rows * high + above), layout="compressed")
        options: dict[str, Any] = {"xlim": limits[0], "ylim": limits[1], "aspect": "equal"}
        return figure, figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False, subplot_kw=options)

    def scan(self, profile: Profile, distance: float, direction: Direction = "both") -> Scan:
        """Return the scan of a profile of the paper at a distance."""
        try:
            return scan(paper_profile(profile, q=distance), direction=direction, drive_step=self.drive_step)
        except ContourError as error:
            raise type(error)(f"profile {profile} at the distance q = {distance:g}: {error}") from None


def _chosen(
    number: int, distances: Any, drive_step: float | None, rods: int, load_cell: LoadCell | None, rng: Any, width: float
) -> tuple[_Entry, _Choice]:
    """Return an entry of the catalogue, and the checked options."""
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number not in _ENTRIES:
        raise ParameterError(f"there is no figure {number!r}: choose from {NUMBERS[0]} to {NUMBERS[-1]}")
    entry = _ENTRIES[number]
    given = entry.distances if distances is None else distances
    correction = "give rod lengths above 0, like [0.3, 0.5]"
    q = checks.check_numbers("distances", given, correction, shape=(None,), least=checks.TINY)
    rods = checks.check_whole_number("rods", rods, 1, "give a whole number from 1 up, like 15")
    inches = f"give inches from 3 to 12, like {COLUMN_WIDTH} or {PAGE_WIDTH}"
    width = checks.check_number("width", width, inches, least=3.0, most=12.0)
    checks.check_optional("load_cell", load_cell, LoadCell, "give a LoadCell")
    if load_cell is not None and rng is None:
        raise ParameterError("the load cell has noise: give rng, like rng=1")
    seed = None if rng is None else seed_sequence(rng)
    Rotation(drive_step=drive_step)  # refuses an impossible step
    return entry, _Choice(tuple(np.unique(q).tolist()), drive_step, rods, load_cell, seed, width)


# --- Figure 2: tip and tangential contact, with the names of their quantities ---------------------------------------

_WAY = {"tip": 0.6, "tangential": 0.45}  # position of the state shown between the first and the last of a phase
_LIMITS: Limits = (-0.36, 1.02), (-0.24, 0.98)  # limits of both panels in x and y [L]
_BESIDE = {"tip": 0.2, "tangential": 0.36}  # radius at which the slope angle is drawn: beyond the rod's end [L]
_ARROW = 0.2  # length of the contact force; components of the reaction are in proportion to it [L]
_THIN: dict[str, Any] = {"color": "0.35", "linewidth": 0.7}
_HEAD: dict[str, Any] = {"arrowstyle": "-|>", "color": PALETTE["change"], "linewidth": 1.2, "mutation_scale": 9.0}
_HEAD |= {"shrinkA": 0.0, "shrinkB": 0.0}


def _draw_contact_kinds(profile: Profile, choice: _Choice) -> Figure:
    """Draw a panel for each kind of contact: angles, contact point, and the forces on the rod and its support."""
    figure, panels = choice.map_panels(2, _LIMITS, beside=0.28, between=0.35, above=0.0)
    for letter, ax, phase in zip("ab", panels.ravel(), PHASES, strict=True):
        distance, made, state = _state(profile, phase, choice)
        _draw_state(ax, made, state, phase)
        ax.set_title(f"({letter}) {PHASES[phase]}, $q$ = {distance:g} $L$")
        ax.label_outer()
    return figure


def _state(profile: Profile, phase: str, choice: _Choice) -> tuple[float, Scan, dict[str, float]]:
    """Return distance, scan and state of a phase before the vertex, at the first distance at which it occurs."""
    for distance in choice.distances:
        made = choice.scan(profile, distance, "forward")
        before_vertex = made.record["truth_slope_angle"].values > 0.0
        of_phase = np.flatnonzero((made.record["truth_contact_phase"].values == phase) & before_vertex)
        if of_phase.size:
            sample = made.record.isel(sample=int(of_phase[int(_WAY[phase] * (of_phase.size - 1))]))
            truth = ("slope_angle", "contact_x", "contact_y")
            values = {name: float(sample[name]) for name in ("drive_angle", *CHANNELS)}
            return distance, made, values | {name: float(sample[f"truth_{name}"]) for name in truth}
    distances = ", ".join(f"{q:g}" for q in choice.distances)
    raise ParameterError(
        f"figure 2 shows {PHASES[phase]}, and profile {profile} has none at q = {distances}: give a distance like 0.5 "
        "besides, or leave this figure out"
    )


def _draw_state(ax: Axes, made: Scan, state: dict[str, float], phase: str) -> None:
    angle, slope = state["drive_angle"], state["slope_angle"]
    pivot, contact = np.zeros(2), np.array([state["contact_x"], state["contact_y"]])
    x, y = rod_shape(*(state[part] for part in ("drive_angle", *CHANNELS)), points=301)
    draw_object(ax, made.contour, x, y, room=0.0)
    ax.plot(x, y, color=PALETTE[phase], linewidth=2.0, zorder=3, solid_capstyle="round")
    draw_pivot(ax, (0.0, 0.0))
    _write(ax, "pivot $(x_0, y_0)$", pivot, (0.14, -0.08), ha="left", va="center")

    # Drive angle, from the horizontal to the rod at the pivot.
    ax.plot([0.0, 0.3], [0.0, 0.0], linestyle="--", **_THIN)
    ax.plot([0.0, 0.3 * np.cos(angle)], [0.0, 0.3 * np.sin(angle)], linestyle=":", **_THIN)
    _draw_angle(ax, pivot, 0.13, angle, r"$\varphi_0$")

    # Slope angle, from the horizontal to the contour's tangent.
    along, normal = np.array([np.cos(slope), np.sin(slope)]), np.array([-np.sin(slope), np.cos(slope)])
    radius = _BESIDE[phase]
    tangent = contact - 0.2 * along, contact + (radius + 0.04) * along
    ax.plot(*zip(*tangent, strict=True), linestyle=":", zorder=2, **_THIN)
    ax.plot([contact[0], contact[0] + radius + 0.04], [contact[1]] * 2, linestyle="--", zorder=2, **_THIN)
    _draw_angle(ax, contact, radius, slope, r"$\alpha$")
    ax.plot(*contact, "o", color=PALETTE["change"], markersize=4.5, zorder=4)
    ends = "$s_1 = L$" if phase == "tip" else "$s_1 < L$"
    _write(ax, f"contact $(\\xi, \\eta)$\n{ends}", contact, 0.09 * normal - 0.03 * along, ha="right", va="bottom")

    # The contact force on the rod, and the support reaction.
    force = np.array([state["force_x"], state["force_y"]])
    force *= _ARROW / np.hypot(*force)
    _draw_arrow(ax, contact, contact - force)
    _write(ax, "$f$", contact - force, -0.04 * normal, ha="center", va="center")
    for tip, label, away in (
        (np.array([force[0], 0.0]), r"$f_{\mathrm{A}x}$", (-0.06, 0.0)),
        (np.array([0.0, force[1]]), r"$f_{\mathrm{A}y}$", (0.05, 0.035)),
    ):
        _draw_arrow(ax, pivot, tip)
        _write(ax, label, tip, away, ha="center", va="center")
    turn = np.radians(np.linspace(-150.0, -30.0, 41))[:: 1 if state["holding_moment"] > 0.0 else -1]
    arc = 0.11 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    ax.plot(*arc.T, color=PALETTE["change"], linewidth=1.2, zorder=4.5)
    _draw_arrow(ax, arc[-4], arc[-1])
    _write(ax, "$m_0$", pivot, (0.0, -0.165), ha="center", va="center")
    if phase == "tangential":
        clear = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
        _write(ax, "tip", (float(x[-1]), float(y[-1])), 0.02 * along, ha="left", va="center", bbox=clear)
    label_map(ax, {}, np.zeros(1))


def _write(ax: Axes, words: str, at: Any, away: Any, **style: Any) -> None:
    ax.text(at[0] + away[0], at[1] + away[1], words, zorder=6, **style)


def _draw_angle(ax: Axes, at: Any, radius: float, angle: float, label: str) -> None:
    turn = np.linspace(0.0, angle, 61)
    ax.plot(at[0] + radius * np.cos(turn), at[1] + radius * np.sin(turn), color="black", linewidth=0.8, zorder=3.5)
    middle, beyond = 0.4 * angle, radius + 0.05
    _write(ax, label, at, (beyond * np.cos(middle), beyond * np.sin(middle)), ha="center", va="center")


def _draw_arrow(ax: Axes, begin: Floats, end: Floats) -> None:
    ax.annotate("", tuple(end), tuple(begin), arrowprops=_HEAD, zorder=4.5)


# --- Figures 3 to 6: moment and forces along a sweep ----------------------------------------------------------------

_LINES = {"forward": "-", "backward": (0, (3.0, 1.2))}
_WIDTHS = {"tip": 0.8, "tangential": 1.7}
_BETWEEN = 48  # number of points of a line between two events, beside those of the drive's steps
_SHRUNK = 0.75  # size of the many event markers, over their usual size


def _draw_observables(profile: Profile, choice: _Choice) -> Figure:
    """Draw moment and forces from first contact to snap-off: a colour for each distance, thin lines in tip contact."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator, MultipleLocator

    figure = Figure(figsize=(choice.width, 5.6), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    shades = colormaps["viridis"](np.linspace(0.0, 0.85, len(choice.distances)))
    of_distance = [f"$q$ = {distance:g} $L$" for distance in choice.distances]
    direction = _SWEEPS[profile]
    for distance, words, shade in zip(choice.distances, of_distance, shades, strict=True):
        made = choice.scan(profile, distance, direction)
        for number, events in enumerate(made.sweeps):
            for ax, channel in zip(panels, CHANNELS, strict=True):
                _draw_sweep(ax, _finer(made, number), events, channel, tuple(shade))
        legend_entry(panels[0], words, color=tuple(shade), linewidth=1.7)
    for way in _LINES if direction == "both" else ():
        legend_entry(panels[0], way, color="0.35", linestyle=_LINES[way], linewidth=1.2)
    for phase, words in PHASES.items():
        legend_entry(panels[0], words, color="0.35", linewidth=_WIDTHS[phase])
    for ax, channel in zip(panels, CHANNELS, strict=True):
        ax.axhline(0.0, color="0.85", linewidth=0.8, zorder=0)
        ax.yaxis.set_major_locator(MaxNLocator(5))
        set_unit(ax.yaxis, f"{LABELS[channel]}\n", channel, {}, np.zeros(1))
    panels[-1].set_xlabel(DRIVE_ANGLE)
    panels[-1].xaxis.set_major_locator(MultipleLocator(30.0))
    figure.align_ylabels(list(panels))
    groups = [of_distance, [*_LINES, *PHASES.values()], list(EVENT_MARKERS)]
    legend_in_rows(figure, legend_entries(*panels), groups, 2 if choice.is_column else 4)
    return figure


def _finer(made: Scan, number: int) -> xr.Dataset:
    """Return samples at the drive's steps and, denser, toward events, where loads change with the root of the angle."""
    events = made.sweeps[number]
    ends = np.array([event.drive_angle for event in (events.first_contact, *events.transitions, events.snap_off)])
    share = 0.5 * (1.0 - np.cos(np.pi * np.arange(1, _BETWEEN) / _BETWEEN))
    steps = made.record["drive_angle"].values[made.record["sweep"].values == number]
    inside = steps[(steps > ends.min()) & (steps < ends.max())]
    angles = np.append(inside, ends[:-1, None] + np.diff(ends)[:, None] * share)
    way: Direction = "forward" if events.direction == "forward" else "backward"
    return scan(made.contour, direction=way, drive_angles=angles).record


def _draw_sweep(ax: Axes, sweep: xr.Dataset, events: SweepEvents, channel: str, colour: Any) -> None:
    touching = sweep["truth_contact_phase"].values != "none"
    phase = sweep["truth_contact_phase"].values[touching].astype(object)
    place, value = np.degrees(sweep["drive_angle"].values[touching]), sweep[channel].values[touching]
    place, value, phase = with_events(place, value, phase, events, channel, "fixed")
    line: dict[str, Any] = {"color": colour, "linestyle": _LINES[events.direction], "zorder": 2.5}
    for run in phase_runs(phase):
        ax.plot(place[run], value[run], linewidth=_WIDTHS[str(phase[run.start])], **line)
    draw_events(ax, events, channel, "fixed", _SHRUNK, markeredgewidth=0.7)


# --- Figures 7 to 10: the deformed rod along a sweep ----------------------------------------------------------------

_ROD_LEGEND = [*PHASES.values(), "contour", "pivot"], ["first contact", "phase change", "snap-off"]
_ROOM = 0.05  # margin around the rods [L]


def _draw_deformed_rods(profile: Profile, choice: _Choice) -> Figure:
    """Draw deformed rods in a panel for each distance and sweep, all at one scale."""
    from matplotlib.ticker import MaxNLocator

    scans = {distance: choice.scan(profile, distance, _SWEEPS[profile]) for distance in choice.distances}
    sweeps = [(distance, made, number) for distance, made in scans.items() for number in range(len(made.sweeps))]
    limits = _limits(sweeps)
    figure, grid = choice.map_panels(len(sweeps), limits, beside=0.45, between=0.38, above=0.7, widest=3.6)
    columns = grid.shape[1]
    found: dict[str, Any] = {}
    grid[0, 0].xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))  # sparse: panels are neighbours
    for ax, (distance, made, number) in zip(grid.ravel(), sweeps, strict=False):
        draw_rods(made, sweep=number, count=choice.rods, ax=ax)
        found |= legend_entries(ax)
        ax.get_legend().remove()
        ax.set_title(f"{made.sweeps[number].direction}, $q$ = {distance:g} $L$")
    for ax in grid.ravel()[len(sweeps) :]:
        ax.remove()
    for place, ax in enumerate(grid.ravel()[: len(sweeps)]):
        is_lowest, is_first = place + columns >= len(sweeps), place % columns == 0
        ax.tick_params(labelbottom=is_lowest, labelleft=is_first)
        if not is_lowest:
            ax.set_xlabel("")
        if not is_first:
            ax.set_ylabel("")
    legend_in_rows(figure, found, _ROD_LEGEND, 2 if choice.is_column else 5)
    return figure


def _limits(sweeps: Sequence[tuple[float, Scan, int]]) -> Limits:
    """Return limits in x and y that hold all rods of all sweeps, and the pivot."""
    corners = []
    for _, made, number in sweeps:
        events = made.sweeps[number]
        of_sweep = made.record["sweep"].values == number
        chosen = of_sweep & (made.record["truth_contact_phase"].values != "none")
        ends = [events.first_contact, *events.transitions, events.snap_off]
        names = ("drive_angle", *CHANNELS)
        states = [np.append(made.record[name].values[chosen], [getattr(e, name) for e in ends]) for name in names]
        shapes = rod_shape(*states, side=1 if events.direction == "forward" else -1)
        corners.append([bound for shape in shapes for bound in (shape.min(), shape.max())])
    (left, _, bottom, _), (_, right, _, top) = np.min(corners, axis=0), np.max(corners, axis=0)
    return (float(left) - _ROOM, float(right) + _ROOM), (float(bottom) - _ROOM, float(top) + _ROOM)


# --- Figure 11: contact points of Step 2 on the true contours -------------------------------------------------------

_COLOURS = {"forward": BASES[3], "backward": BASES[2]}
_REACH: Limits = (-0.92, 0.92), (-0.06, 1.0)  # limits of every panel [L]: no rod reaches farther


def _draw_reconstructed_points(choice: _Choice) -> Figure:
    """Draw the points of a forward and a backward sweep, and the gap between them."""
    from matplotlib.ticker import MultipleLocator

    figure, grid = choice.map_panels(len(_PROFILES), _REACH, beside=0.4, between=0.3, above=0.8)
    grid[0, 0].xaxis.set_major_locator(MultipleLocator(0.5))
    for ax, profile in zip(grid.ravel(), _PROFILES, strict=True):
        for distance in choice.distances:
            _draw_points(ax, choice.scan(profile, distance), distance, choice)
        draw_pivot(ax, (0.0, 0.0))
        ax.set_title(f"profile {profile}")
        label_map(ax, {}, np.zeros(1))
        ax.label_outer()
    sweeps, rest = [f"{direction} sweep" for direction in _COLOURS], ["contour", "gap", "pivot"]
    groups = [sweeps, rest] if choice.is_column else [[*sweeps, *rest]]
    legend_in_rows(figure, legend_entries(*grid.flat), groups, 3 if choice.is_column else 5)
    return figure


def _draw_points(ax: Axes, made: Scan, distance: float, choice: _Choice) -> None:
    record = made.record
    if choice.load_cell is not None and choice.seed is not None:
        record = choice.load_cell.measure(record, rng=choice.seed)
    contacts = reconstruct(record, Rig(load_cell=choice.load_cell))
    ax.plot(*outline(made.contour, *_REACH[0]), color="0.55", linewidth=0.8, zorder=1.5, label="contour")
    left, right = (made.events[way].snap_off.contact_x for way in ("backward", "forward"))
    if left < right:
        gap: dict[str, Any] = {"color": PALETTE["gap"], "linewidth": 6.0, "solid_capstyle": "butt"}
        ax.plot(*outline(made.contour, left, right), zorder=1.0, label="gap", **gap)
    lowest = outline(made.contour, *_REACH[0])[1].min()
    ax.text(0.0, lowest - 0.04, f"$q$ = {distance:g} $L$", ha="center", va="top", fontsize="small")
    x, y = contacts["contact_x"].values, contacts["contact_y"].values
    for direction, colour in _COLOURS.items():
        chosen = (contacts["direction"].values == direction) & np.isfinite(x) & np.isfinite(y)
        points: dict[str, Any] = {"linestyle": "none", "color": colour, "marker": SWEEP_MARKERS[direction]}
        points["markeredgewidth"] = 0.0
        ax.plot(x[chosen], y[chosen], markersize=2.4, zorder=3, **points)
        legend_entry(ax, f"{direction} sweep", markersize=4.5, **points)


# --- The catalogue --------------------------------------------------------------------------------------------------


class _Entry(NamedTuple):
    draw: Callable[[_Choice], Figure]
    words: str  # beginning of the caption
    direction: Direction
    distances: tuple[float, ...]  # default distances q [L]


def _of_profiles(draw: Callable[[Profile, _Choice], Figure], first: int, words: str, *q: float) -> dict[int, _Entry]:
    """Return the figures of one kind, numbered from `first` on, one of each profile."""
    return {
        number: _Entry(partial(draw, profile), f"{words}, profile {profile}", _SWEEPS[profile], q)
        for number, profile in enumerate(_PROFILES, first)
    }


_ENTRIES: Mapping[int, _Entry] = {
    2: _Entry(partial(_draw_contact_kinds, "II"), "Tip and tangential contact, profile II", "forward", (0.5,)),
    **_of_profiles(
        _draw_observables, 3, "Holding moment and support reaction over the drive angle", 0.3, 0.4, 0.5, 0.6
    ),
    **_of_profiles(_draw_deformed_rods, 7, "Deformed rods", 0.4, 0.6),
    11: _Entry(_draw_reconstructed_points, "Reconstructed contact points, profiles I to IV", "both", (0.3, 0.6)),
}

NUMBERS = tuple(_ENTRIES)  # numbers of the figures, in order

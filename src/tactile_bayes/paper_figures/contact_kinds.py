"""Figure 2: the rod in tip and in tangential contact, with the names of its quantities."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.paper_figures.choice import Choice, Limits, Profile
from tactile_bayes.plotting.maps import draw_object, draw_path, draw_pivot, label_map
from tactile_bayes.plotting.marks import PALETTE, PHASES
from tactile_bayes.record import CHANNELS
from tactile_bayes.sweep import Scan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WAY = {"tip": 0.6, "tangential": 0.45}  # position of the state shown between the first and the last of a phase
_LIMITS: Limits = (-0.36, 1.02), (-0.24, 0.98)  # limits of both panels in x and y for rotations [L]
# Limits from the base where it is carried, in x those of a forward contact [L].
_CARRIED_LIMITS: Limits = (-0.36, 1.1), (-0.24, 1.16)
_BESIDE = {"tip": 0.2, "tangential": 0.36}  # radius at which the slope angle is drawn: beyond the rod's end [L]
_ARROW = 0.2  # length of the contact force; components of the reaction are in proportion to it [L]
_CLEAR: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
_THIN: dict[str, Any] = {"color": "0.35", "linewidth": 0.7}


def draw_contact_kinds(profile: Profile, choice: Choice) -> Figure:
    """Draw a panel for each kind of contact: angles, contact point, and the forces on the rod and its support."""
    from matplotlib.figure import Figure

    columns = 1 if choice.is_column else 2
    rows = 2 // columns
    wide, rests = choice.width / columns, choice.drive is None
    limits = _LIMITS if rests else _CARRIED_LIMITS
    size = choice.width, rows * (0.92 * wide * np.ptp(limits[1]) / np.ptp(limits[0]) + 0.35)
    figure = Figure(figsize=size, layout="compressed")
    panels = figure.subplots(rows, columns, sharex=rests, sharey=rests, subplot_kw={"aspect": "equal"}).ravel()
    for letter, ax, phase in zip("ab", panels, PHASES, strict=True):
        distance, made, state = _state(profile, phase, choice)
        if choice.drive is not None:
            draw_path(ax, *choice.drive.poses[:, :2].T)
        _draw_state(ax, made, state, phase, limits, "pivot" if rests else "base")
        ax.set_title(f"({letter}) {PHASES[phase]}, $q$ = {distance:g} $L$")
        if rests:
            ax.label_outer()
    return figure


def _state(profile: Profile, phase: str, choice: Choice) -> tuple[float, Scan, dict[str, float]]:
    """Return distance, scan and state of a phase before the vertex, at the first distance at which it occurs."""
    for distance in choice.distances:
        made = choice.scan(profile, distance, "forward")
        slope = made.record["truth_slope_angle"].values
        before_vertex = slope > 0.0 if made.sweeps[0].direction == "forward" else slope < 0.0
        of_phase = np.flatnonzero((made.record["truth_contact_phase"].values == phase) & before_vertex)
        if of_phase.size:
            sample: xr.Dataset = made.record.isel(sample=int(of_phase[int(_WAY[phase] * (of_phase.size - 1))]))
            names = ("base_x", "base_y", "drive_angle", *CHANNELS)
            truth = ("slope_angle", "contact_x", "contact_y", "contact_arclength")
            values = {name: float(sample[name]) for name in names}
            return distance, made, values | {name: float(sample[f"truth_{name}"]) for name in truth}
    distances = ", ".join(f"{q:g}" for q in choice.distances)
    raise ParameterError(
        f"figure 2 shows {PHASES[phase]}, and profile {profile} has none at q = {distances}: give "
        f"{'a distance like 0.5' if choice.drive is None else 'another distance'} besides, or leave this figure out"
    )


def _draw_state(ax: Axes, made: Scan, state: dict[str, float], phase: str, limits: Limits, name: str) -> None:
    angle, slope = state["drive_angle"], state["slope_angle"]
    base, contact = (np.array([state[f"{place}_x"], state[f"{place}_y"]]) for place in ("base", "contact"))
    is_forward = made.sweeps[0].direction == "forward"
    side = 1.0 if is_forward else -1.0
    outer, inner = ("left", "right") if is_forward else ("right", "left")
    ax.set(xlim=sorted(base[0] + side * np.array(limits[0])), ylim=base[1] + np.array(limits[1]))
    x, y = rod_shape(*(state[part] for part in ("drive_angle", *CHANNELS)), points=301, side=side)
    x, y = base[0] + x, base[1] + y
    draw_object(ax, made.contour, x, y, room=0.0)
    ax.plot(x, y, color=PALETTE[phase], linewidth=2.0, zorder=3, solid_capstyle="round")
    draw_pivot(ax, (base[0], base[1]))
    _write(ax, f"{name} $(x_0, y_0)$", base, (0.14 * side, -0.08), ha=outer, va="center")

    # Drive angle, from the horizontal to the rod at the base.
    ax.plot(base[0] + [0.0, 0.3], [base[1]] * 2, linestyle="--", **_THIN)
    ax.plot(base[0] + [0.0, 0.3 * np.cos(angle)], base[1] + [0.0, 0.3 * np.sin(angle)], linestyle=":", **_THIN)
    _draw_angle(ax, base, 0.13, 0.0, angle, r"$\varphi_0$")

    # Slope angle, from the horizontal to the contour's tangent.
    along, normal = side * np.array([np.cos(slope), np.sin(slope)]), np.array([-np.sin(slope), np.cos(slope)])
    radius = _BESIDE[phase]
    tangent = contact - 0.2 * along, contact + (radius + 0.04) * along
    ax.plot(*zip(*tangent, strict=True), linestyle=":", zorder=2, **_THIN)
    ax.plot([contact[0], contact[0] + side * (radius + 0.04)], [contact[1]] * 2, linestyle="--", zorder=2, **_THIN)
    level = 0.0 if is_forward else np.pi
    _draw_angle(ax, contact, radius, level, level + slope, r"$\alpha$")
    ax.plot(*contact, "o", color=PALETTE["change"], markersize=4.5, zorder=4)
    ends = "$s_1 = L$" if phase == "tip" else "$s_1 < L$"
    _write(ax, f"contact $(\\xi, \\eta)$\n{ends}", contact, 0.09 * normal - 0.03 * along, ha=inner, va="bottom")

    # The contact force on the rod, and the support reaction.
    force = np.array([state["force_x"], state["force_y"]])
    scale = _ARROW / float(np.hypot(*force))
    _draw_arrow(ax, contact, contact - scale * force)
    _write(ax, "$f$", contact - scale * force, -0.04 * normal, ha="center", va="center")
    is_upright = name == "base" and side * np.cos(angle) > -0.1
    beside = (-0.06, 0.0) if is_upright else (0.05, 0.035)
    for component, label, away in ((0, r"$f_{\mathrm{A}x}$", (-0.06, 0.0)), (1, r"$f_{\mathrm{A}y}$", beside)):
        tip = base.copy()
        tip[component] += scale * force[component]
        _draw_arrow(ax, base, tip)
        clear = {} if name == "pivot" else {"bbox": _CLEAR}
        _write(ax, label, tip, (side * away[0], away[1]), ha="center", va="center", **clear)
    _draw_moment(ax, base, state["holding_moment"])
    if phase == "tangential":
        _write(ax, "tip", (float(x[-1]), float(y[-1])), 0.02 * along, ha=outer, va="center", bbox=_CLEAR)
    label_map(ax, {}, np.zeros(1))


def _write(ax: Axes, words: str, at: Any, away: Any, **style: Any) -> None:
    ax.text(at[0] + away[0], at[1] + away[1], words, zorder=6, **style)


def _draw_angle(ax: Axes, at: Any, radius: float, begin: float, end: float, label: str) -> None:
    turn = np.linspace(begin, end, 61)
    ax.plot(at[0] + radius * np.cos(turn), at[1] + radius * np.sin(turn), color="black", linewidth=0.8, zorder=3.5)
    middle, beyond = begin + 0.4 * (end - begin), radius + 0.05
    _write(ax, label, at, (beyond * np.cos(middle), beyond * np.sin(middle)), ha="center", va="center")


def _draw_arrow(ax: Axes, begin: Any, end: Floats) -> None:
    style = {"arrowstyle": "-|>", "color": PALETTE["change"], "linewidth": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}
    ax.annotate("", tuple(end), tuple(begin), arrowprops=style | {"mutation_scale": 9.0}, zorder=4.5)


def _draw_moment(ax: Axes, at: Floats, moment: float) -> None:
    """Draw an arrow about the base, in the sense of the moment."""
    turn = np.radians(np.linspace(-150.0, -30.0, 41))
    turn = turn if moment > 0.0 else turn[::-1]
    x, y = at[0] + 0.11 * np.cos(turn), at[1] + 0.11 * np.sin(turn)
    ax.plot(x, y, color=PALETTE["change"], linewidth=1.2, zorder=4.5)
    style = {"arrowstyle": "-|>", "color": PALETTE["change"], "linewidth": 1.2, "mutation_scale": 9.0}
    ax.annotate("", (float(x[-1]), float(y[-1])), (float(x[-4]), float(y[-4])), arrowprops=style, zorder=4.5)
    _write(ax, "$m_0$", at, (0.0, -0.165), ha="center", va="center")

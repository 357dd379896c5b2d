"""The two universal maps of a rod in contact: how its ends lie → the piece of elastica that joins them.

In tangential contact the angle of the chord over the contour's tangent alone gives the amplitude (one variable); in tip
contact the chord's length and its angle over the force give amplitude and direction at the contact (two variables).
Both are tabulated as Chebyshev series when first used, and polished by Newton's method on the exact arc.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes import chebyshev
from tactile_bayes.arc import Arc, ArcSlopes, arc_and_slopes, arc_to, chord_angle, slack, slack_slope, slopes_by_chi
from tactile_bayes.roots import falling_root

__all__ = [
    "TangentialArcs",
    "TangentialNumbers",
    "TipArcs",
    "TipNumbers",
    "number_tables",
    "tangential_arcs",
    "tangential_numbers",
    "tip_arcs",
    "tip_numbers",
]

Floats = NDArray[np.float64]

_SETTLED = 1e-8
"""Relative Newton step at which a first-order correction of the arc leaves nothing but rounding."""

_MAX_STEPS = 40

_CHI_MAX = 3.2
"""A little over π, the amplitude at which the line of force passes through the pivot."""

_TILT_MAX = 0.5 * np.pi + 0.02
"""Greatest ε1 = π/2 − ψ1 in the table of tip contacts; with friction it can be a little more."""


_ROUGH = 16
"""Number of coefficients in each direction of the rough tables."""

_FINE = 28, 22
"""Those over the angle, and over the share of the greatest radius, of the others."""


class TangentialArcs(NamedTuple):
    """Tangential contacts."""

    amplitude: Floats
    arc: Arc
    by_chi: ArcSlopes


class TipArcs(NamedTuple):
    """Tip contacts."""

    amplitude: Floats
    tilt: Floats
    """ε1 = π/2 − ψ1."""
    arc: Arc


class TangentialNumbers(NamedTuple):
    """What the chord's angle says about a frictionless tangential contact."""

    force: Floats
    """Force times the squared length of the chord."""
    turn: Floats
    """Turn of the rod from the contact to the pivot."""
    stretch: Floats
    """Arc length over chord."""


class TipNumbers(NamedTuple):
    """What the chord says about a tip contact."""

    force: Floats
    turn: Floats
    tilt: Floats
    """ε1 = π/2 − ψ1."""


def tangential_numbers(angle: Floats, *, roughly: bool = False) -> TangentialNumbers:
    """Frictionless tangential contact straight from the table: chords at `angle` ∈ [0, π/2] to the contour.

    To 1e-9, or roughly, to 1e-7, from half the table.
    """
    table = _tangential_numbers_table()[:, : _ROUGH if roughly else None]
    level = np.minimum(angle, 0.5 * np.pi) / (0.5 * np.pi)
    force, turn, stretch = np.tensordot(table, chebyshev.basis(table.shape[1], level), 1)
    return TangentialNumbers(force * angle, turn * angle, stretch)


def tip_numbers(lack: Floats, tilt: Floats, *, roughly: bool = False) -> TipNumbers:
    """Frictionless tip contact straight from the table; arguments as for `tip_arcs`, one-dimensional.

    To 1e-9, or roughly, to 3e-6, from a third of the table.
    """
    _, radius, table = number_tables(roughly=roughly)
    _, radii, angles = table.shape
    angle = np.arctan2(lack, tilt)
    by_angle = chebyshev.basis(angles, angle / (0.5 * np.pi))
    share = np.minimum(np.hypot(lack, tilt) / (radius @ by_angle), 1.0)
    rows = (table.reshape(-1, angles) @ by_angle).reshape(3, radii, -1)
    force, turn, tilt1 = np.einsum("ksn,sn->kn", rows, chebyshev.basis(radii, share))
    return TipNumbers(force * angle, turn * angle, tilt1 * share)


def number_tables(*, roughly: bool) -> tuple[Floats, Floats, Floats]:
    """The tables themselves: `TangentialNumbers` (3, angles), the greatest radius (angles,), and `TipNumbers`
    (3, radii, angles), without what makes them vanish."""
    tangential = _tangential_numbers_table()[:, : _ROUGH if roughly else None]
    return tangential, *_tip_numbers_table(*((_ROUGH, _ROUGH) if roughly else _FINE))


def tangential_arcs(angle: Floats, m: Floats) -> TangentialArcs:
    """Arcs with amplitude χ ∈ [0, π] whose chord stands at `angle` ≥ 0 over the direction at the contact.

    Newton on the square root of the angle, which is nearly proportional to χ.
    """
    target = np.sqrt(angle)
    level = np.minimum(angle, 0.5 * np.pi)
    table = _tangential_table()
    guess = target * np.sqrt(chebyshev.polynomials(table.size, level / (0.5 * np.pi)) @ table)
    chi = np.where(m == 0.5, guess, np.minimum(np.sqrt(3.0 / np.sqrt(m * (1.0 - m))) * target, np.pi))
    result = _Collected(angle.size, 5)
    active = np.arange(angle.size)
    for _ in range(_MAX_STEPS):
        x = chi[active]
        arc, by_chi = arc_to(x, m[active])
        value, slope = chord_angle(arc, by_chi)
        root = np.sqrt(value)
        with np.errstate(invalid="ignore"):
            step = np.where(x > 0.0, (root - target[active]) * 2.0 * root / slope, 0.0)
        done = np.abs(step) <= _SETTLED * x
        x = x - step
        result.store(active, done, (x, *_moved(arc, (by_chi, -step))))
        chi[active] = np.clip(x, 0.5 * chi[active], np.pi)
        active = active[~done]
        if not active.size:
            break
    amplitude, *rest = result.columns
    return TangentialArcs(amplitude, Arc(*rest), slopes_by_chi(amplitude, m))


def tip_arcs(lack: Floats, tilt: Floats) -> TipArcs:
    """Arcs of length one with amplitude χ ∈ [0, π], by chord: √(1 − lack²) long, and `tilt` off the force's line.

    `tilt` ∈ [0, π/2 + δ] is π/2 minus the chord's angle over the direction across the force.
    """
    chi, tilt1 = _tip_guess(lack, tilt)
    return _polished_tips(lack, tilt, chi, tilt1)


def _polished_tips(lack: Floats, tilt: Floats, chi: Floats, tilt1: Floats) -> TipArcs:
    result = _Collected(lack.size, 6)
    active = np.arange(lack.size)
    for _ in range(_MAX_STEPS):
        x, t = chi[active], tilt1[active]
        arc, by_chi, by_psi1 = arc_and_slopes(x, np.sin(0.5 * t) ** 2)
        angle, angle_x = chord_angle(arc, by_chi)
        angle_t = -chord_angle(arc, by_psi1)[1]
        value = slack(arc)
        with np.errstate(divide="ignore", invalid="ignore"):
            value_x, value_t = slack_slope(arc, value, by_chi), -slack_slope(arc, value, by_psi1)
            miss, miss_tilt = value - lack[active], t - angle - tilt[active]
            det = value_x * (1.0 - angle_t) + value_t * angle_x
            dx = np.where(x > 0.0, (miss * (1.0 - angle_t) - value_t * miss_tilt) / det, 0.0)
            dt = np.where(x > 0.0, (value_x * miss_tilt + angle_x * miss) / det, 0.0)
        done = (np.abs(dx) <= _SETTLED * x) & (np.abs(dt) <= _SETTLED * t)
        result.store(active, done, (x - dx, t - dt, *_moved(arc, (by_chi, -dx), (by_psi1, dt))))
        chi[active] = np.clip(x - dx, 0.5 * x, np.minimum(1.5 * x, _CHI_MAX))
        tilt1[active] = np.clip(t - dt, 0.5 * t, 0.5 * (t + np.pi))
        active = active[~done]
        if not active.size:
            break
    amplitude, tilt_out, *rest = result.columns
    return TipArcs(amplitude, tilt_out, Arc(*rest))


class _Collected:
    """Columns filled as entries settle; NaN for those that never do."""

    def __init__(self, size: int, columns: int) -> None:
        self.size = size
        self.columns: list[Floats] = [np.full(size, np.nan) for _ in range(columns)]

    def store(self, active: NDArray[np.intp], done: NDArray[np.bool_], values: tuple[Floats, ...]) -> None:
        if done.all() and active.size == self.size:
            self.columns = list(values)
            return
        where = active[done]
        for column, value in zip(self.columns, values, strict=True):
            column[where] = value[done]


def _moved(arc: Arc, *steps: tuple[ArcSlopes, Floats]) -> Arc:
    """An arc after a small step."""
    length, shortfall, offset, turn = arc
    for slopes, step in steps:
        length = length + slopes.length * step
        shortfall = shortfall + slopes.shortfall * step
        offset = offset + slopes.offset * step
        turn = turn + slopes.turn * step
    return Arc(length, shortfall, offset, turn)


@functools.cache
def _tangential_table() -> Floats:
    """Coefficients of χ²/angle over angle/(π/2), frictionless; to 1e-14."""
    angle = chebyshev.nodes(34) * 0.5 * np.pi

    def missing(i: NDArray[np.intp], chi: Floats) -> tuple[Floats, Floats]:
        value, slope = chord_angle(*arc_to(chi, np.full(chi.size, 0.5)))
        return angle[i] - value, -slope

    chi = falling_root(missing, np.zeros(angle.size), np.full(angle.size, _CHI_MAX))
    return chebyshev.coefficients(chi**2 / angle)


@functools.cache
def _tangential_numbers_table() -> Floats:
    """Coefficients, shape (3, order), of `TangentialNumbers` with what makes them vanish divided out."""
    angle = chebyshev.nodes(28) * 0.5 * np.pi
    _, arc, _ = tangential_arcs(angle, np.full(angle.size, 0.5))
    chord = np.hypot(arc.length - arc.shortfall, arc.offset)
    return chebyshev.coefficients(np.stack([chord**2 / angle, arc.turn / angle, arc.length / chord])).T.copy()


class _TipTable(NamedTuple):
    """Chebyshev coefficients over polar coordinates in (tilt, lack): angle, and share of the greatest radius."""

    radius: Floats
    chi2: Floats
    tilt: Floats


def _tip_grid(angles: int, radii: int) -> tuple[Floats, Floats, Floats, TipArcs]:
    """Angles, greatest radii and shares of a grid, and the arcs on it, shape (angles · radii,)."""
    angle = chebyshev.nodes(angles) * 0.5 * np.pi
    m = np.full(angles, np.sin(0.5 * _TILT_MAX) ** 2)

    def polar(chi: Floats) -> tuple[Floats, Floats, Floats]:
        arc, by_chi = arc_to(chi, m[: chi.size])
        chord, turning = chord_angle(arc, by_chi)
        lack, tilt = slack(arc), _TILT_MAX - chord
        radius = np.hypot(lack, tilt)
        return np.arctan2(lack, tilt), (tilt * slack_slope(arc, lack, by_chi) + lack * turning) / radius**2, radius

    def missing(i: NDArray[np.intp], chi: Floats) -> tuple[Floats, Floats]:
        value, slope, _ = polar(chi)
        return angle[i] - value, -slope

    edge = falling_root(missing, np.full(angles, 1e-3), np.full(angles, _CHI_MAX))
    radius = polar(edge)[2]
    share = chebyshev.nodes(radii)
    lack, tilt = (np.outer(trig(angle) * radius, share).ravel() for trig in (np.sin, np.cos))
    # To first order in ε1 the amplitude depends on the angle alone, and the edge's serves as a first guess.
    start = np.repeat(edge, radii), np.outer(np.full(angles, _TILT_MAX), share).ravel()
    return angle, radius, share, _polished_tips(lack, tilt, *start)


@functools.cache
def _tip_table() -> _TipTable:
    # Enough for 1e-12 without friction: one Newton step then leaves rounding alone.
    angle, radius, share, arcs = _tip_grid(40, 32)
    chi2, tilt = (a.reshape(angle.size, share.size) for a in (arcs.amplitude**2, arcs.tilt))
    return _TipTable(chebyshev.coefficients(radius), _fit(chi2 / angle[:, None]), _fit(tilt / share))


@functools.cache
def _tip_numbers_table(angles: int, radii: int) -> tuple[Floats, Floats]:
    """Coefficients of the greatest radius, and, shape (3, radii, angles), of `TipNumbers` less their zeros."""
    angle, radius, share, arcs = _tip_grid(angles, radii)
    force, turn, tilt = (a.reshape(angle.size, share.size) for a in (arcs.arc.length**2, arcs.arc.turn, arcs.tilt))
    fits = [_fit(force / angle[:, None]), _fit(turn / angle[:, None]), _fit(tilt / share)]
    return chebyshev.coefficients(radius), np.stack([fit.T for fit in fits])


def _fit(values: Floats) -> Floats:
    """Coefficients of a function on a grid of nodes."""
    return chebyshev.coefficients(chebyshev.coefficients(values))


def _polar(
    lack: Floats, tilt: Floats, radius: Floats, angles: int, radii: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Angle and share of the greatest radius, and Chebyshev polynomials of both."""
    angle = np.arctan2(lack, tilt)
    by_angle = chebyshev.polynomials(angles, angle / (0.5 * np.pi))
    share = np.minimum(np.hypot(lack, tilt) / (by_angle @ radius), 1.0)
    return angle, share, by_angle, chebyshev.polynomials(radii, share)


def _tip_guess(lack: Floats, tilt: Floats) -> tuple[Floats, Floats]:
    table = _tip_table()
    angle, share, by_angle, by_share = _polar(lack, tilt, table.radius, *table.chi2.shape)
    chi2, tilt1 = (((by_angle @ c) * by_share).sum(axis=1) for c in (table.chi2, table.tilt))
    return np.sqrt(angle * chi2), tilt1 * share

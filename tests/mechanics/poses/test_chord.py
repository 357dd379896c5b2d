"""Arcs, and the arcs that join given ends, against Legendre's closed form, and bracketed roots of it."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import brentq

from helpers.compiled_calls import by_number
from helpers.exact_rod import mp
from helpers.legendre import HALF, piece, theta_of
from tactile_bayes.mechanics.compiler import cached
from tactile_bayes.mechanics.poses import arc as compiled_arc
from tactile_bayes.mechanics.poses import chord as compiled_chord

EPS = np.finfo(float).eps
FRICTION = (0.0, 0.05, 0.3, 0.7)

_arc_to, _arc_at = compiled_arc.arc_to, compiled_arc.arc_at
_tangential_arc, _tip_arc = compiled_chord.tangential_arc, compiled_chord.tip_arc


@cached
def _to(rows, out):
    for i in range(len(rows)):
        arc, _ = _arc_to(rows[i, 0], rows[i, 1])
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = arc


@cached
def _at(rows, out):
    for i in range(len(rows)):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = _arc_at(rows[i, 0], rows[i, 1], rows[i, 2])


@cached
def _lying(rows, out):
    for i in range(len(rows)):
        out[i, 0], arc, _ = _tangential_arc(rows[i, 0], rows[i, 1], rows[i, 2])
        out[i, 1], out[i, 2], out[i, 3], out[i, 4] = arc


@cached
def _ending(rows, out):
    for i in range(len(rows)):
        out[i, 0], out[i, 1], arc, _, _ = _tip_arc(rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3])
        out[i, 2], out[i, 3], out[i, 4], out[i, 5] = arc


class Arcs(NamedTuple):
    length: np.ndarray
    shortfall: np.ndarray
    offset: np.ndarray
    turn: np.ndarray


def arc_to(chi, m):
    return Arcs(*by_number(_to, 4)(chi, m).T)


def arc_at(sin, cos, m):
    return Arcs(*by_number(_at, 4)(sin, cos, m).T)


def tangential_arcs(angle, m):
    """Amplitudes and arcs, from a guess as for nearly straight rods."""
    guess = np.minimum(np.sqrt(3.0 / np.sqrt(m * (1.0 - m)) * angle), np.pi)
    chi, *rest = by_number(_lying, 5)(angle, m, guess).T
    return chi, Arcs(*rest)


def tip_arcs(deficit, chord_angle, chi, epsilon1):
    """Amplitudes, directions at the contact, and arcs, from a guess."""
    found, found1, *rest = by_number(_ending, 6)(deficit, chord_angle, chi, epsilon1).T
    return found, found1, Arcs(*rest)


def amplitude(theta: float, m: float) -> float:
    """tan χ = cot θ / √(1 − m)."""
    return float(np.arctan2(np.cos(theta), np.sqrt(1 - m) * np.sin(theta)))


@pytest.mark.parametrize("m", [1e-9, 0.02, 0.5, 0.82, 0.9])
def test_arcs_against_legendre(m):
    """In a hundred digits, on both sides of the amplitude at which quadrature gives way, and up to where maps end."""
    chi = np.array([1e-6, 0.1, 0.6, 0.999, 1.001, 1.5, HALF, 1.6, 2.2, 3.0, 3.14, 3.2])
    arc = arc_to(chi, m)
    c = 2 * mp.sqrt(mp.mpf(m) * (1 - mp.mpf(m)))
    for i, x in enumerate(map(mp.mpf, chi)):
        F, s, w = mp.ellipf(x, m), mp.sin(x), mp.sin(x / 2) ** 2
        D, d = (F - mp.ellipe(x, m)) / m, mp.sqrt(1 - m * s * s)
        P, Q = F - s / d, 2 * w * s / d - D
        exact = F, 2 * m * (P - (1 - 2 * mp.mpf(m)) * Q), c * (P + 2 * m * Q), 2 * mp.atan2(c * w, 1 - 2 * m * w)
        for name, value in zip(arc._fields, map(float, exact), strict=True):
            # What a closed form loses is less than rounding of the length.
            atol = 16 * EPS * (arc.length[i] if chi[i] > 1.0 else abs(value))
            assert abs(getattr(arc, name)[i] - value) <= atol, (name, chi[i])
    told = arc_at(np.sin(chi[:-1]), np.cos(chi[:-1]), m)
    for values, by_sine in zip(arc, told, strict=True):
        np.testing.assert_allclose(by_sine, values[:-1], rtol=0, atol=32 * EPS)


@pytest.mark.parametrize("delta", FRICTION)
def test_tangential_map_over_its_domain(delta):
    """The chord stands at 0 to π/2 + δ over the contour; Legendre's form measures from across the force."""
    m = 0.5 * (1 + np.sin(delta))
    angle = np.linspace(0.02, HALF + delta - 1e-9, 61)
    amplitudes, arc = tangential_arcs(angle, m)
    theta = np.array([theta_of(a - delta, m) for a in angle])
    tau, u, v = np.transpose([piece(t, m) for t in theta])
    turn = HALF + delta - 2 * np.arcsin(np.sqrt(m) * np.sin(theta))
    # K − F and E − E(θ) are differences of numbers of order 1 that are of order χ³ and χ: judged where χ > 0.2.
    atol = 1e-11
    np.testing.assert_allclose(amplitudes, [amplitude(t, m) for t in theta], rtol=0, atol=atol)
    np.testing.assert_allclose(arc.length, tau, rtol=0, atol=atol)
    np.testing.assert_allclose(arc.turn, turn, rtol=0, atol=atol)
    chord = np.hypot(arc.length - arc.shortfall, arc.offset)
    np.testing.assert_allclose(chord, np.hypot(u, v), rtol=0, atol=atol)


@pytest.mark.parametrize("delta", FRICTION)
def test_tangential_map_of_nearly_straight_rods(delta):
    """Bracketed on the exact arc, which keeps its digits; angle = cos δ χ²/6 to first order."""
    m = 0.5 * (1 + np.sin(delta))
    for angle in 10.0 ** np.arange(-14.0, -1.0):
        amplitudes, _ = tangential_arcs(np.array([angle]), m)

        def miss(log_chi, angle=angle):
            arc = arc_to(np.array([np.exp(log_chi)]), m)
            return float(np.arctan2(arc.offset, arc.length - arc.shortfall)[0]) / angle - 1

        guess = 0.5 * np.log(6 * angle / np.cos(delta))
        chi = np.exp(brentq(miss, guess - 1, guess + 1, xtol=1e-15, rtol=4 * EPS))
        assert float(amplitudes[0]) == pytest.approx(chi, rel=64 * EPS)
    amplitudes, arc = tangential_arcs(np.zeros(1), m)
    assert amplitudes[0] == arc.length[0] == arc.turn[0] == 0


TIPS = [
    (chi, chord_angle)
    for chi in (0.05, 0.4, 0.9, 1.3, 2.0, 2.8, 3.1)
    for chord_angle in (0.01, 0.3, 0.9, 1.3, 1.5, HALF)
]


def test_tip_map_over_its_domain():
    """Begun with an amplitude and a direction at the contact; told only how the ends lie, the map finds them again."""
    chi, epsilon1 = np.transpose(TIPS)
    arc = arc_to(chi, np.sin(0.5 * epsilon1) ** 2)
    chord = np.hypot(arc.length - arc.shortfall, arc.offset) / arc.length
    deficit = np.sqrt((1 - chord) * (1 + chord))
    chord_angle = epsilon1 - np.arctan2(arc.offset, arc.length - arc.shortfall)
    found, found1, of = tip_arcs(deficit, chord_angle, 1.01 * chi, 0.99 * epsilon1)
    # chord is rounded to ε: lack to ε/lack, and amplitude and direction follow.
    worth = 1e-13 + 8 * EPS / deficit**2
    assert np.all(np.abs(found - chi) <= worth * 20)
    assert np.all(np.abs(found1 - epsilon1) <= worth * 20)
    for one, other in zip(of, arc_to(found, np.sin(0.5 * found1) ** 2), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-15)

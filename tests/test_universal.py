"""The universal maps against bracketed roots of Legendre's closed form, and of the exact arc for straight rods."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from helpers.exact_rod import mp
from helpers.legendre import HALF, piece, theta_of
from tactile_bayes.arc import arc_at, arc_to
from tactile_bayes.universal import tangential_arcs, tip_arcs

EPS = np.finfo(float).eps
FRICTION = (0.0, 0.05, 0.3, 0.7)


def amplitude(theta: float, m: float) -> float:
    """tan χ = cot θ / √(1 − m)."""
    return float(np.arctan2(np.cos(theta), np.sqrt(1 - m) * np.sin(theta)))


@pytest.mark.parametrize("m", [1e-9, 0.02, 0.5, 0.82, 0.9])
def test_arcs_against_legendre(m):
    """In a hundred digits, on both sides of the amplitude at which quadrature gives way, and up to where maps end."""
    chi = np.array([1e-6, 0.1, 0.6, 0.999, 1.001, 1.5, HALF, 1.6, 2.2, 3.0, 3.14, 3.2])
    arc, _ = arc_to(chi, np.full(chi.size, m))
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
    told = arc_at(np.sin(chi[:-1]), np.cos(chi[:-1]), np.full(chi.size - 1, m))
    for values, by_sine in zip(arc, told, strict=True):
        np.testing.assert_allclose(by_sine, values[:-1], rtol=0, atol=32 * EPS)


@pytest.mark.parametrize("delta", FRICTION)
def test_tangential_map_over_its_domain(delta):
    """The chord stands at 0 to π/2 + δ over the contour; Legendre's form measures from across the force."""
    m = 0.5 * (1 + np.sin(delta))
    angle = np.linspace(0.02, HALF + delta - 1e-9, 61)
    arcs = tangential_arcs(angle, np.full(angle.size, m))
    theta = np.array([theta_of(a - delta, m) for a in angle])
    tau, u, v = np.transpose([piece(t, m) for t in theta])
    turn = HALF + delta - 2 * np.arcsin(np.sqrt(m) * np.sin(theta))
    # K − F and E − E(θ) are differences of numbers of order 1 that are of order χ³ and χ: judged where χ > 0.2.
    atol = 1e-11
    np.testing.assert_allclose(arcs.amplitude, [amplitude(t, m) for t in theta], rtol=0, atol=atol)
    np.testing.assert_allclose(arcs.arc.length, tau, rtol=0, atol=atol)
    np.testing.assert_allclose(arcs.arc.turn, turn, rtol=0, atol=atol)
    chord = np.hypot(arcs.arc.length - arcs.arc.shortfall, arcs.arc.offset)
    np.testing.assert_allclose(chord, np.hypot(u, v), rtol=0, atol=atol)


@pytest.mark.parametrize("delta", FRICTION)
def test_tangential_map_of_nearly_straight_rods(delta):
    """Bracketed on the exact arc, which keeps its digits; angle = cos δ χ²/6 to first order."""
    m = np.array([0.5 * (1 + np.sin(delta))])
    for angle in 10.0 ** np.arange(-14.0, -1.0):
        arcs = tangential_arcs(np.array([angle]), m)

        def miss(log_chi, angle=angle):
            arc, _ = arc_to(np.array([np.exp(log_chi)]), m)
            return float(np.arctan2(arc.offset, arc.length - arc.shortfall)[0]) / angle - 1

        guess = 0.5 * np.log(6 * angle / np.cos(delta))
        chi = np.exp(brentq(miss, guess - 1, guess + 1, xtol=1e-15, rtol=4 * EPS))
        assert float(arcs.amplitude[0]) == pytest.approx(chi, rel=64 * EPS)
    zero = tangential_arcs(np.zeros(1), m)
    assert zero.amplitude[0] == zero.arc.length[0] == zero.arc.turn[0] == 0


TIPS = [(chi, tilt) for chi in (0.05, 0.4, 0.9, 1.3, 2.0, 2.8, 3.1) for tilt in (0.01, 0.3, 0.9, 1.3, 1.5, HALF)]


def test_tip_map_over_its_domain():
    """Begun with an amplitude and a direction at the contact; told only how the ends lie, the map finds them again."""
    chi, tilt1 = np.transpose(TIPS)
    m = np.sin(0.5 * tilt1) ** 2
    arc, _ = arc_to(chi, m)
    chord = np.hypot(arc.length - arc.shortfall, arc.offset) / arc.length
    lack = np.sqrt((1 - chord) * (1 + chord))
    tilt = tilt1 - np.arctan2(arc.offset, arc.length - arc.shortfall)
    found = tip_arcs(lack, tilt)
    # chord is rounded to ε: lack to ε/lack, and amplitude and direction follow.
    worth = 1e-13 + 8 * EPS / lack**2
    assert np.all(np.abs(found.amplitude - chi) <= worth * 20)
    assert np.all(np.abs(found.tilt - tilt1) <= worth * 20)
    again, _ = arc_to(found.amplitude, np.sin(0.5 * found.tilt) ** 2)
    for name in ("length", "shortfall", "offset", "turn"):
        np.testing.assert_allclose(getattr(found.arc, name), getattr(again, name), rtol=1e-11, atol=1e-15)


@pytest.mark.parametrize("chi", [0.5, 1.2, 2.2, 3.0])
@pytest.mark.parametrize("psi1", [0.05, 0.5, 1.1])
def test_tip_map_against_legendre(chi, psi1):
    m = 0.5 * (1 - np.sin(psi1))
    theta = float(np.arctan2(np.cos(chi), np.sqrt(1 - m) * np.sin(chi)))
    tau, u, v = piece(theta, m)
    lack, tilt = np.sqrt(1 - (u * u + v * v) / tau**2), np.arctan2(u, v)
    found = tip_arcs(np.array([lack]), np.array([tilt]))
    np.testing.assert_allclose(found.amplitude, chi, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.tilt, HALF - psi1, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.arc.length, tau, rtol=0, atol=1e-11)


def test_tip_map_solves_its_equations_for_nearly_straight_rods():
    """Chord and tilt of the arc it answers with are those asked for, to rounding, down to lacks of 1e-7."""
    lack, tilt = (a.ravel() for a in np.meshgrid(10.0 ** np.arange(-7.0, -1.0), [1e-6, 1e-3, 0.1, 0.8, 1.4]))
    keep = lack < tilt  # elsewhere the rod has to bend more than this test is about
    found = tip_arcs(lack[keep], tilt[keep])
    arc, _ = arc_to(found.amplitude, np.sin(0.5 * found.tilt) ** 2)
    F, C, S = arc.length, arc.shortfall, arc.offset
    np.testing.assert_allclose(np.sqrt(2 * F * C - C * C - S * S) / F, lack[keep], rtol=1e-12)
    np.testing.assert_allclose(found.tilt - np.arctan2(S, F - C), tilt[keep], rtol=1e-12)
    assert np.all((found.amplitude > 0) & (found.tilt >= tilt[keep]))


def test_answers_do_not_depend_on_the_company():
    rng = np.random.default_rng(4)
    angle = rng.uniform(0, HALF, 20)
    m = np.full(20, 0.5)
    together = tangential_arcs(angle, m)
    alone = [tangential_arcs(angle[i : i + 1], m[:1]).amplitude[0] for i in range(20)]
    np.testing.assert_allclose(together.amplitude, alone, rtol=8 * EPS)
    lack, tilt = rng.uniform(0.05, 0.5, 20), rng.uniform(0.3, 1.0, 20)
    both = tip_arcs(lack, tilt)
    single = [tip_arcs(lack[i : i + 1], tilt[i : i + 1]).amplitude[0] for i in range(20)]
    np.testing.assert_allclose(both.amplitude, single, rtol=1e-11)
    assert tangential_arcs(np.zeros(0), np.zeros(0)).amplitude.shape == (0,)

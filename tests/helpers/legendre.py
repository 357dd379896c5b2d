"""The rod's equilibria by brentq on Legendre's integrals, in doubles: good to some 1e-12 away from first contact.

`universal` and `elastica` count from the contact in Jacobi's amplitude and use Newton's method on tables; here θ0 and m
of the textbook form are bracketed and bisected.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

HALF = 0.5 * np.pi


class Rest(NamedTuple):
    """A forward equilibrium: drive angle, moment, force, arc length, whether the tip touches."""

    drive_angle: float
    moment: float
    force: float
    arclength: float
    tip: bool


def piece(theta: float, m: float) -> tuple[float, float, float]:
    """√f times arc length, u and v."""
    tau = ellipk(m) - ellipkinc(theta, m)
    return tau, 2 * np.sqrt(m) * np.cos(theta), 2 * (ellipe(m) - ellipeinc(theta, m)) - tau


def theta_of(angle: float, m: float) -> float:
    """θ0 whose chord stands at an angle over the direction along the contour: it falls as θ0 grows."""

    def miss(theta: float) -> float:
        _, u, v = piece(theta, m)
        return float(np.arctan2(v, u)) - angle

    return brentq(miss, -HALF, HALF - 1e-6, xtol=1e-15, rtol=1e-15)


def _rest(theta: float, m: float, alpha: float, arclength: float, tip: bool) -> Rest:
    tau, u, _ = piece(theta, m)
    root = tau / arclength
    return Rest(alpha + HALF - 2 * np.arcsin(np.sqrt(m) * np.sin(theta)), u * root, root**2, arclength, tip)


def tangential_arclength(x: float, y: float, alpha: float) -> float:
    """Arc length that tangential contact takes."""
    angle = np.arctan2(y, x) - alpha
    tau, u, v = piece(theta_of(angle, 0.5), 0.5)
    return float(np.hypot(x, y) * tau / np.hypot(u, v))


def equilibrium(x: float, y: float, alpha: float) -> Rest:
    """Frictionless forward equilibrium at a contact point relative to the pivot."""
    angle, distance = float(np.arctan2(y, x)) - alpha, float(np.hypot(x, y))
    theta = theta_of(angle, 0.5)
    tau, u, v = piece(theta, 0.5)
    arclength = distance * tau / np.hypot(u, v)
    if arclength <= 1:
        return _rest(theta, 0.5, alpha, arclength, False)

    def miss(psi1: float) -> float:
        m = 0.5 * (1 - np.sin(psi1))
        tau, u, v = piece(theta_of(angle, m), m)
        return float(np.hypot(u, v)) / tau - distance

    psi1 = brentq(miss, 0.0, min(angle, HALF) - 1e-5, xtol=1e-15, rtol=1e-15)
    m = 0.5 * (1 - np.sin(psi1))
    return _rest(theta_of(angle, m), m, alpha, 1.0, True)

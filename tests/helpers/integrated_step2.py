"""The touching rod and Step 2 by integration in complex numbers: derivatives to all digits, and no closed form.

φ' = κ, κ' = f cos(φ − β), x' = cos φ, y' = sin φ, with the world's signs: the reaction at the base is (−f sin β,
f cos β) and κ(0) = −m0. A function that is analytic has the derivative Im F(z + ih)/h, which for h = 1e-30 cancels
nothing. Everything here is analytic: a fixed number of steps of Dormand's and Prince's eighth order, and a zero of
curvature polished by Newton's method.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

STEPS = 120  # an arc of 4/√f then takes steps of h = 0.03/√f; derivatives then agree with closed forms to 1e-12
TINY = 1e-30
_LONGEST, _STRIDE = 12.0, 0.05  # how far, and in what steps, to look for the first zero of curvature, in 1/√f
Complex = NDArray[np.complex128]
Function = Callable[[Complex, NDArray[np.float64]], Complex]
# Of the unloaded rod; the moment at the base is its difference from the curvature there.
Curvature = NDArray[np.float64] | float


def _along(state: Complex, fx: Complex, fy: Complex) -> Complex:
    """Derivatives of x, y, φ, κ, shape (4, n), by arc length."""
    cos, sin = np.cos(state[2]), np.sin(state[2])
    return np.stack([cos, sin, state[3], fy * cos - fx * sin])


def _advanced(state: Complex, step: Complex, fx: Complex, fy: Complex) -> Complex:
    stages: list[Complex] = []
    for row in DOP853.A[: DOP853.n_stages]:
        moved = state + step * sum((a * k for a, k in zip(row, stages, strict=False) if a), np.zeros_like(state))
        stages.append(_along(moved, fx, fy))
    return state + step * sum(b * k for b, k in zip(DOP853.B, stages, strict=True) if b)


def bent_rod(start: Complex, length: Complex, fx: Complex, fy: Complex) -> Complex:
    """x, y, φ, κ after an arc of this length, which may be negative, shape (4, n)."""
    state = np.array(start, dtype=complex)
    for _ in range(STEPS):
        state = _advanced(state, length / STEPS, fx, fy)
    return state


def _complex_hypot(a: Complex, b: Complex) -> Complex:
    return np.sqrt(a * a + b * b)


def step2(wrench: Complex, friction_angle: NDArray[np.float64], rest_curvature: Curvature = 0.0) -> Complex:
    """Contact point, slope angle and arc length, shape (n, 4), from drive angle, moment and forces, shape (n, 4)."""
    phi0, moment, fx, fy = np.asarray(wrench, dtype=complex).T
    force = _complex_hypot(fx, fy)
    zero = np.zeros_like(phi0)
    start = np.stack([zero, zero, phi0, rest_curvature - moment])
    length = _first_zero(start.real, fx.real, fy.real, rest_curvature).astype(complex)
    for _ in range(5):  # four for the real parts, one for the imaginary ones
        _, _, phi, kappa = bent_rod(start, length, fx, fy)
        length = length - (kappa - rest_curvature) / (fy * np.cos(phi) - fx * np.sin(phi))
    x, y, _, kappa = bent_rod(start, length, fx, fy)
    assert np.max(np.abs(kappa - rest_curvature) / np.maximum(np.abs(moment), 1e-3 * np.sqrt(np.abs(force)))) < 1e-10
    beta = 2.0 * np.arctan(-fx / (force + fy))
    return np.stack([x, y, beta - friction_angle, length], axis=-1)


def _first_zero(
    start: NDArray[np.float64], fx: NDArray[np.float64], fy: NDArray[np.float64], rest_curvature: Curvature
) -> NDArray[np.float64]:
    """Arc length at which the bending moment first changes its sign, roughly."""
    stride = _STRIDE / np.sqrt(np.hypot(fx, fy))
    zero, state = np.full(fx.size, np.nan), start
    for number in range(int(_LONGEST / _STRIDE)):
        new = _advanced(state, stride, fx, fy)
        before, after = state[3] - rest_curvature, new[3] - rest_curvature
        crossed = np.isnan(zero) & (np.sign(after) != np.sign(start[3] - rest_curvature))
        share = before / (before - after)
        zero[crossed] = ((number + share) * stride)[crossed]
        state = new
    assert np.isfinite(zero).all(), "the curvature has no zero"
    return zero


def touched(
    coordinates: Complex, friction_angle: NDArray[np.float64], rest_curvature: Curvature = 0.0
) -> tuple[Complex, Complex]:
    """Loads, shape (n, 3), and place, shape (n, 4), from force, ψ1, arc length and drive angle, shape (n, 4).

    The rod is integrated from the contact back to the pivot, the direction of the force being along the y axis, and
    then turned as a whole so that it has the drive angle.
    """
    force, psi1, arclength, drive_angle = np.asarray(coordinates, dtype=complex).T
    zero = np.zeros_like(force)
    end = bent_rod(np.stack([zero, zero, psi1, zero + rest_curvature]), -arclength, zero, force)
    beta = drive_angle - end[2]
    cos, sin = np.cos(beta), np.sin(beta)
    x, y = -end[0] * cos + end[1] * sin, -end[0] * sin - end[1] * cos
    loads = np.stack([rest_curvature - end[3], -force * sin, force * cos], axis=-1)
    return loads, np.stack([x, y, beta - friction_angle, arclength], axis=-1)


def slopes(function: Function, at: NDArray[np.float64], friction_angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives of a function of (n, k) by its k columns, which are the last axis, by the complex step."""
    n, k = at.shape
    moved = at + 1j * TINY * np.eye(k)[:, None, :]
    values = function(moved.reshape(k * n, k), np.tile(friction_angle, k))
    return np.moveaxis(values.imag.reshape(k, n, -1), 0, -1) / TINY

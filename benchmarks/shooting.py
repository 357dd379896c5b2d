"""Code that a user would write from the paper with SciPy alone: integrate the rod, and search for roots.

A state is (drive angle, holding moment, force, arc length of the contact). Along a sweep every state is sought from its
neighbour. The rod is in Phase B until it would be too short, then in Phase A until its tip would lie below the tangent.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import least_squares, root

State = tuple[float, float, float, float]  # drive angle, holding moment, force, arc length of the contact


def _rod(s, state, force, beta):
    _, _, phi, kappa = state
    return [np.cos(phi), np.sin(phi), kappa, force * np.cos(phi - beta)]


def _tapered_rod(s, state, force, beta, taper):
    _, _, phi, moment = state
    return [np.cos(phi), np.sin(phi), moment / (1.0 - taper * s) ** 4, force * np.cos(phi - beta)]


def _sweep(contour, slope_angles: np.ndarray, first: State, solve: Callable) -> np.ndarray:
    """Return states at slope angles, in the phase of the one before, or if that fails in the other."""
    state, tip, states = first, first[3] == 1.0, []
    for alpha in slope_angles:
        x, y = contour.point(alpha)
        found, stays = solve(float(x), float(y), alpha, state, tip)
        if not stays:
            tip = not tip
            found, _ = solve(float(x), float(y), alpha, state, tip)
        state = found
        states.append(state)
    return np.array(states)


def sweep_by_shooting(contour, slope_angles: np.ndarray, first: State, rtol: float = 1e-9) -> np.ndarray:
    """Return states at slope angles by equations (19) and (20), with unknown force, drive angle and arc length."""

    def solve(x: float, y: float, alpha: float, guess: State, tip: bool) -> tuple[State, bool]:
        arm = x * np.cos(alpha) + y * np.sin(alpha)

        def end(p: np.ndarray) -> np.ndarray:
            force, drive_angle, length = (*p, 1.0) if tip else p
            start = [0.0, 0.0, drive_angle, -force * arm]
            return solve_ivp(_rod, (0.0, length), start, args=(force, alpha), rtol=rtol, atol=1e-3 * rtol).y[:, -1]

        def miss(p: np.ndarray) -> np.ndarray:
            return end(p)[: p.size] - [x, y, alpha][: p.size]

        solution = root(miss, [guess[2], guess[0], guess[3]][: 2 if tip else 3], tol=rtol)
        if not solution.success:
            raise RuntimeError(f"shooting failed at slope angle {alpha}")
        force, drive_angle, length = (*solution.x, 1.0) if tip else solution.x
        stays = end(solution.x)[2] >= alpha if tip else length <= 1.0
        return (drive_angle, force * arm, force, length), stays

    return _sweep(contour, slope_angles, first, solve)


def sweep_by_collocation(
    contour, slope_angles: np.ndarray, first: State, tol: float = 1e-9, taper: float = 0.0
) -> np.ndarray:
    """Return them by solve_bvp, from 200 nodes of the neighbour's solution: other numbers take longer.

    The fourth component of a state is the bending moment, which is the curvature of a rod without taper.
    """
    mesh = np.linspace(0.0, 1.0, 200)
    drive_angle, moment, _, length = first
    shape = np.stack([mesh * length * np.cos(drive_angle), mesh * length * np.sin(drive_angle), 0.0 * mesh, 0.0 * mesh])
    shape[2:] = drive_angle - moment * mesh, -moment * (1.0 - mesh)

    def solve(x: float, y: float, alpha: float, guess: State, tip: bool) -> tuple[State, bool]:
        nonlocal shape

        def rod(t, state, p):
            force, length = (p[0], 1.0) if tip else p
            if taper:
                return length * np.array(_tapered_rod(length * t, state, force, alpha, taper))
            return length * np.array(_rod(t, state, force, alpha))

        def boundary(pivot, contact, p):
            miss = [pivot[0], pivot[1], contact[0] - x, contact[1] - y, contact[3]]
            return np.array(miss if tip else [*miss, contact[2] - alpha])

        parameters = [guess[2]] if tip else [guess[2], guess[3]]
        solution = solve_bvp(rod, boundary, mesh, shape, p=parameters, tol=tol, max_nodes=20_000)
        if not solution.success:
            raise RuntimeError(f"solve_bvp failed at slope angle {alpha}: {solution.message}")
        shape = solution.sol(mesh)
        force, length = (solution.p[0], 1.0) if tip else solution.p
        stays = shape[2, -1] >= alpha if tip else length <= 1.0
        return (shape[2, 0], -shape[3, 0], force, length), stays

    return _sweep(contour, slope_angles, first, solve)


def contact_by_integration(
    drive_angle: float, moment: float, force_x: float, force_y: float, rtol: float = 1e-9
) -> tuple[float, float]:
    """Return a contact by Step 2 as in the paper: integrate from the base until the curvature vanishes."""
    force, beta = np.hypot(force_x, force_y), np.arctan2(-force_x, force_y)

    def curvature(s, state, *_):
        return state[3]

    curvature.terminal = True
    curvature.direction = 1.0
    start = [0.0, 0.0, drive_angle, -moment]
    found = solve_ivp(_rod, (0.0, 1.5), start, args=(force, beta), events=curvature, rtol=rtol, atol=1e-3 * rtol)
    return found.y_events[0][0][0], found.y_events[0][0][1]


def misfit_by_least_squares(drive_angle: float, loads: np.ndarray, noise: np.ndarray) -> float:
    """Sum of squares of the most likely tangential contact, forward and without friction: one with m0² = 2 f sin ψ0."""

    def deviations(p):
        force, psi = p
        if not (force > 0.0 and 0.0 < psi < np.pi):
            return np.full(3, 1e3)
        beta = drive_angle - psi
        model = np.sqrt(2.0 * force * np.sin(psi)), -force * np.sin(beta), force * np.cos(beta)
        return (model - loads) / noise

    start = np.hypot(loads[1], loads[2]), max(drive_angle - np.arctan2(-loads[1], loads[2]), 0.01)
    return 2.0 * least_squares(deviations, start).cost

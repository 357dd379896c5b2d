"""What a user would write from the paper: integrate the rod and search for roots."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

__all__ = ["contact_by_integration", "sweep_by_shooting"]


def _rod(s: float, state: np.ndarray, force: float, beta: float) -> list[float]:
    _, _, phi, kappa = state
    return [np.cos(phi), np.sin(phi), kappa, force * np.cos(phi - beta)]


def sweep_by_shooting(contour, slope_angles: np.ndarray, first: tuple[float, float, float]) -> np.ndarray:
    """Tangential states (drive angle, moment, force) at slope angles, each started from the one before.

    `first` is a guess for the first state: force, arc length, drive angle. From the contact back to the pivot would be
    cleverer; this is equations (19) and (20) as they stand.
    """
    guess, states = np.array(first), []
    for alpha in slope_angles:
        x, y = contour.point(alpha)
        moment_arm = x * np.cos(alpha) + y * np.sin(alpha)

        def miss(
            p: np.ndarray, alpha: float = alpha, x: float = x, y: float = y, arm: float = moment_arm
        ) -> list[float]:
            force, length, drive_angle = p
            start = [0.0, 0.0, drive_angle, -force * arm]
            end = solve_ivp(_rod, (0.0, length), start, args=(force, alpha), rtol=1e-9, atol=1e-12).y[:, -1]
            return [end[0] - x, end[1] - y, end[2] - alpha]

        solution = root(miss, guess, tol=1e-9)
        if not solution.success:
            raise RuntimeError(f"shooting failed at slope angle {alpha}")
        guess = solution.x
        states.append((guess[2], guess[0] * moment_arm, guess[0]))
    return np.array(states)


def contact_by_integration(drive_angle: float, moment: float, force_x: float, force_y: float) -> tuple[float, float]:
    """Step 2 as in the paper: integrate from the base until the curvature vanishes."""
    force, beta = np.hypot(force_x, force_y), np.arctan2(-force_x, force_y)

    def curvature(s: float, state: np.ndarray, *_: float) -> float:
        return state[3]

    curvature.terminal = True
    curvature.direction = 1.0
    start = [0.0, 0.0, drive_angle, -moment]
    found = solve_ivp(_rod, (0.0, 1.5), start, args=(force, beta), events=curvature, rtol=1e-10, atol=1e-12)
    return found.y_events[0][0][0], found.y_events[0][0][1]

"""The rod's differential equations, integrated: shares nothing with the closed form.

x' = cos φ, y' = sin φ, φ' = κ, κ' = f cos(φ − β), written with the support reaction (−f sin β, f cos β), so that one
equation serves forward and backward contacts. Equations 19, 20 and 27 of Merker et al. 2018, doi 10.1155/2018/1613945.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

RTOL, ATOL = 1e-13, 1e-14


def rod(wrench, length: float, *, rest: float = 0.0, stop_at_contact: bool = False, **options):
    """Solution from the pivot on: x, y, φ, κ, begun with (drive angle, holding moment, force_x, force_y).

    `rest` is the curvature without load, the same everywhere.
    """
    phi0, moment, fx, fy = (float(v) for v in wrench)

    def slope(_s: float, z: NDArray[np.float64]) -> list[float]:
        cos, sin = np.cos(z[2]), np.sin(z[2])
        return [cos, sin, z[3], fy * cos - fx * sin]

    def curvature(_s: float, z: NDArray[np.float64]) -> float:
        return z[3]

    curvature.terminal = True
    atol = ATOL * np.array([1.0, 1.0, 1.0, max(abs(moment), abs(rest))])
    events = curvature if stop_at_contact else None
    start = [0.0, 0.0, phi0, rest - moment]
    solution = solve_ivp(slope, (0.0, length), start, "DOP853", events=events, rtol=RTOL, atol=atol, **options)
    assert solution.success, solution.message
    return solution


def contact_end(wrench: tuple[float, float, float, float], longest: float) -> tuple[float, NDArray[np.float64]]:
    """Arc length and x, y, φ, κ at the first zero of curvature: found as an event, then polished by Newton's method.

    (Dense output is of lower order than the solution: the event alone is good to ten digits, not more.)
    """
    events = rod(wrench, longest, stop_at_contact=True).t_events[0]
    assert events.size, "the curvature has no zero"
    s = float(events[0])
    _, _, fx, fy = wrench
    for _ in range(2):
        z = rod(wrench, s).y[:, -1]
        s -= z[3] / (fy * np.cos(z[2]) - fx * np.sin(z[2]))
    return s, rod(wrench, s).y[:, -1]


def shoot(
    contact: tuple[float, float], normal_angle: float, guess: tuple[float, ...], slope_angle: float | None = None
) -> NDArray[np.float64]:
    """Drive angle, holding moment, contact force (and, in tangential contact, arc length) by shooting.

    The boundary-value problems (19) and (20): the rod ends at `contact` without curvature, at arc length one or, if
    `slope_angle` is given, with that slope.
    """

    def miss(unknown: NDArray[np.float64]) -> list[float]:
        phi0, moment, force, *rest = unknown
        wrench = (phi0, moment, -force * np.sin(normal_angle), force * np.cos(normal_angle))
        x, y, phi, kappa = rod(wrench, rest[0] if rest else 1.0).y[:, -1]
        ends = [x - contact[0], y - contact[1], kappa]
        return ends if slope_angle is None else [*ends, phi - slope_angle]

    solution = root(miss, guess, tol=1e-13)
    assert np.max(np.abs(solution.fun)) < 1e-11, solution.message
    return solution.x

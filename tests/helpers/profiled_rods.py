"""Rods of any rest curvature and rigidity: drawn, and integrated without the package's series."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from tactile_bayes.mechanics.rods.profile import Profile, profile_of
from tactile_bayes.mechanics.rods.rod import Rod

Function = Callable[[float], float]

RTOL, ATOL = 3e-14, 1e-15


class RodAlong(NamedTuple):
    """A rod as the package takes it, and as plain functions of s."""

    profile: Profile
    curvature: Function
    rigidity: Function
    breaks: tuple[float, ...]  # where these are not smooth: an integration stops there
    softness: float  # small deflection of the tip under a force across it, over that of a uniform rod


def rod_along(curvature, rigidity, taper: float) -> RodAlong:
    """Rod of properties that are numbers, functions or tables."""
    breaks: set[float] = set()

    def plain(given):
        if callable(given):
            return given
        if isinstance(given, tuple):
            breaks.update(given[0][1:-1])
            return PchipInterpolator(*given)
        return lambda _: given

    bent, rigid = plain(curvature), plain(rigidity)

    def stiff(s: float) -> float:
        return rigid(s) * (1.0 - taper * s) ** 4

    s = np.linspace(0.0, 1.0, 2001)
    softness = 3.0 * np.trapezoid((1.0 - s) ** 2 / np.array([stiff(at) for at in s]), s)
    return RodAlong(profile_of(curvature, rigidity, taper), bent, stiff, tuple(sorted(breaks)), softness)


def drawn_rods() -> dict[str, RodAlong]:
    """Rods by names: every kind of property, and mixtures."""
    rng = np.random.default_rng(7)
    table = np.linspace(0.0, 1.0, 6), rng.uniform(-1.0, 1.0, 6)
    stepped = np.array([0.0, 0.45, 0.55, 1.0]), np.array([1.0, 1.0, 0.3, 0.3])
    return {
        "uniform": rod_along(0.0, 1.0, 0.0),
        "arc": rod_along(0.8, 1.0, 0.0),
        "half cone": rod_along(0.0, 1.0, 0.5),
        "cone": rod_along(0.3, 1.0, 0.9),
        "parabolic": rod_along(lambda s: 0.5 - 2.0 * s + 1.5 * s * s, 1.0, 0.3),
        "wavy": rod_along(lambda s: 1.5 * np.cos(7.0 * s), lambda s: np.exp(-2.0 * s), 0.0),
        "table": rod_along(table, 1.0, 0.7),
        "stepped": rod_along(-0.6, stepped, 0.0),
        "both tables": rod_along(table, stepped, 0.2),
    }


def integrated(rod: RodAlong, start, begin: float, end: float, force: float) -> NDArray[np.float64]:
    """ψ, M, u and v at the end, from those at the beginning, by DOP853."""

    def rates(s, z):
        psi, moment, _, _ = z
        bend = rod.curvature(s) + moment / rod.rigidity(s)
        return [bend, force * np.cos(psi), np.cos(psi), np.sin(psi)]

    inner = [at for at in rod.breaks if min(begin, end) < at < max(begin, end)]
    stops = [begin, *(inner if begin < end else inner[::-1]), end]
    z = np.asarray(start, dtype=float)
    for span in itertools.pairwise(stops):
        solution = solve_ivp(rates, span, z, method="DOP853", rtol=RTOL, atol=ATOL)
        assert solution.success, solution.message
        z = solution.y[:, -1]
    return z


def integrated_pose(rod: RodAlong, psi1: float, arclength: float, force: float) -> NDArray[np.float64]:
    """u, v and turn of `pose`."""
    psi0, _, u, v = integrated(rod, [psi1, 0.0, 0.0, 0.0], arclength, 0.0, force)
    return np.array([-u, -v, psi0 - psi1])


class GivenRod(NamedTuple):
    """A rod as users give it, dimensionless, and as plain functions of s."""

    rod: Rod
    plain: RodAlong

    def in_sweep(self, side: float) -> RodAlong:
        """The rod in the frame of a forward sweep, side 1, or of a backward one."""
        return self.plain._replace(curvature=lambda s: side * self.plain.curvature(s))


def given_rod(curvature=0.0, rigidity=1.0, taper: float = 0.0) -> GivenRod:
    """Rod of properties that are numbers, functions or tables."""
    rigidity_profile = None if rigidity == 1.0 else rigidity
    rod = Rod(rest_curvature=curvature, rigidity_profile=rigidity_profile, taper=taper)
    return GivenRod(rod, rod_along(curvature, rigidity, taper))


def given_rods() -> dict[str, GivenRod]:
    """Rods by names whose sweeps along most contours have one contact only."""
    table = np.linspace(0.0, 1.0, 6), np.array([-0.2, -0.5, 0.1, 0.3, -0.1, 0.2])
    stepped = np.array([0.0, 0.45, 0.55, 1.0]), np.array([1.0, 1.0, 0.3, 0.3])
    return {
        "arc": given_rod(0.6),
        "other arc": given_rod(-0.6),
        "cone": given_rod(taper=0.9),
        "half cone": given_rod(taper=0.5),
        "curved to its tip": given_rod(lambda s: -0.8 * s, taper=0.6),
        "parabolic": given_rod(lambda s: 0.5 - 2.0 * s + 1.5 * s * s, taper=0.3),
        "wavy": given_rod(lambda s: np.cos(7.0 * s), lambda s: np.exp(-2.0 * s)),
        "tables": given_rod(table, stepped, 0.2),
    }

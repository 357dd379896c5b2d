"""Events of sweeps of curved and tapered rods against shooting with SciPy, which knows nothing of paths.

A state at a given contact has two unknowns, the force and ψ1 or the arc length, and two equations: the rod, integrated
from its contact, ends at the pivot. First contact has no force; at a change of the phase ψ1 and the arc length are
known, and the slope angle is not. At a fold the drive angle is stationary along the contour: a polynomial through
states around it shows where. A rod with a diameter is a cone, whose surface touches.
"""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from scipy.optimize import root

from helpers.profiled_rods import GivenRod, RodAlong, given_rod, integrated_pose
from tactile_bayes import Rig, Rod, scan
from tactile_bayes.contours import Circle, Contour, Parabola
from tactile_bayes.errors import ClearanceWarning, ContourError, ReachError, StrainWarning
from tactile_bayes.sweep.events import SweepEvents

# Slope angles around a fold [rad], and how many: the remainder of the polynomial is below rounding errors.
NEAR, NODES = 5e-3, 9


class Shooting:
    """One sweep in its own frame: mirrored if it is a backward one, the pivot at the origin."""

    def __init__(self, contour: Contour, rod: RodAlong, thick: Rod, side: float, friction: float):
        self.contour, self.rod, self.side = contour, rod, side
        self.friction = np.arctan(friction)
        self.radius = 0.5 * thick.diameter
        self.half_angle = np.arctan(self.radius * thick.taper)
        self.psi1 = self.half_angle - self.friction

    def contact(self, alpha: float, arclength: float) -> np.ndarray:
        """Point of the centreline at which the normal of the contour meets it."""
        x, y = self.contour.point(self.side * alpha)
        off = (self.radius - np.tan(self.half_angle) * arclength) * np.cos(self.half_angle)
        return np.array([self.side * float(x) + off * np.sin(alpha), float(y) - off * np.cos(alpha)])

    def miss(self, alpha: float, psi1: float, arclength: float, force: float) -> np.ndarray:
        """From the pivot to where the rod, integrated from the contact, has its base."""
        beta = alpha + self.friction
        u, v, _ = integrated_pose(self.rod, psi1, arclength, force)
        return [u * np.cos(beta) - v * np.sin(beta), u * np.sin(beta) + v * np.cos(beta)] - self.contact(
            alpha, arclength
        )

    def angle(self, alpha: float, psi1: float, arclength: float, force: float) -> float:
        return alpha + self.friction + psi1 + integrated_pose(self.rod, psi1, arclength, force)[2]

    def tip_touches(self, alpha: float) -> tuple[float, float]:
        """Slope angle near a guess at which the tip of the rod at rest touches, and drive angle."""
        u, v, turn = integrated_pose(self.rod, 0.0, 1.0, 0.0)
        alpha = solved(lambda z: [np.hypot(*self.contact(z[0], 1.0)) - np.hypot(u, v)], [alpha])[0]
        x, y = self.contact(alpha, 1.0)
        return alpha, np.arctan2(y, x) - np.arctan2(v, u) + turn

    def rod_touches(self, alpha: float, arclength: float) -> tuple[float, float]:
        """Slope angle at which the rod at rest is tangent to the contour, and drive angle."""
        alpha, s = solved(lambda z: self.miss(z[0], self.psi1, z[1], 0.0), [alpha, arclength])
        assert s < 1.0
        return alpha, self.angle(alpha, self.psi1, s, 0.0)

    def changes_phase(self, alpha: float, force: float) -> tuple[float, float]:
        alpha, force = solved(lambda z: self.miss(z[0], self.psi1, 1.0, z[1]), [alpha, force])
        return alpha, self.angle(alpha, self.psi1, 1.0, force)

    def folds(self, alpha: float, tip: bool, q: float, force: float, near: float) -> tuple[float, float]:
        """Slope angle near a guess at which the drive angle is largest, and drive angle; q is ψ1 or the arc length."""
        nodes = chebyshev.chebpts1(NODES)
        angles = []
        for node in nodes:
            at = alpha + near * node

            def state(z, at=at):
                return (at, z[0], 1.0, z[1]) if tip else (at, self.psi1, z[0], z[1])

            angles.append(self.angle(*state(solved(lambda z, state=state: self.miss(*state(z)), [q, force]))))
        series = chebyshev.chebfit(nodes, angles, NODES - 1)
        stationary = chebyshev.chebroots(chebyshev.chebder(series))
        (best,) = stationary[(abs(stationary.imag) < 1e-9) & (abs(stationary.real) < 1.0)].real
        return alpha + near * best, chebyshev.chebval(best, series)


def solved(miss, guess):
    """Root by Newton's method with derivatives by differences, from a guess that is good."""
    z = np.array(guess, dtype=float)
    solution = root(miss, z, tol=1e-14)
    z, at = solution.x, np.array(miss(solution.x))
    assert np.abs(at).max() < 1e-12, solution.message
    return z


def drawn(rng) -> tuple[GivenRod, Contour, str, float, float]:
    """Rod, contour, direction, friction and diameter."""
    a, b, c = rng.uniform(-0.6, 0.6, 3)
    taper = rng.choice([0.0, rng.uniform(0.1, 0.9)])
    rod = given_rod(a if rng.random() < 0.3 else (lambda s: a + b * s + c * np.sin(3.0 * s)), taper=taper)
    height, offset = rng.uniform(0.3, 0.75), rng.uniform(-0.1, 0.1)
    contour = (
        Parabola(rng.uniform(0.3, 0.8), height, offset)
        if rng.random() < 0.6
        else Circle(rng.uniform(0.2, 0.8), height, offset)
    )
    direction, friction = str(rng.choice(["forward", "backward"])), float(rng.choice([0.0, rng.uniform(0.1, 0.5)]))
    return rod, contour, direction, friction, float(rng.choice([0.0, rng.uniform(0.01, 0.08)]))


def swept(seed: int) -> tuple[Shooting, SweepEvents]:
    """A drawn sweep, the first with a single contact all along, which slides in one sense."""
    rng = np.random.default_rng(seed)
    while True:
        rod, contour, direction, friction, diameter = drawn(rng)
        thick = replace(rod.rod, diameter=diameter)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ClearanceWarning)
                warnings.simplefilter("ignore", StrainWarning)
                events = scan(
                    contour, direction=direction, rig=Rig(rod=thick, unknown={"friction": friction}), drive_step=0.1
                ).events
        except (ContourError, ReachError):
            continue
        if {change.kind for change in events[direction].transitions} & {"stick", "slip"}:
            continue
        side = 1.0 if direction == "forward" else -1.0
        return Shooting(contour, rod.in_sweep(side), thick, side, friction), events[direction]


@pytest.mark.parametrize("seed", [1, 2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(3, 17))])
def test_events_against_shooting(seed):
    shooting, events = swept(seed)
    side = shooting.side

    def agrees(event, exact):
        found = side * event.slope_angle, event.drive_angle if side > 0 else np.pi - event.drive_angle
        assert found[1] == pytest.approx(exact[1], abs=1e-10)
        assert found[0] == pytest.approx(exact[0], abs=1e-7 if event.kind == "fold" else 1e-10)

    first, last = events.first_contact, events.snap_off
    start = side * first.slope_angle + 1e-4
    if first.kind == "tip":
        agrees(first, shooting.tip_touches(start))
    else:
        agrees(first, shooting.rod_touches(start, first.contact_arclength))
    for change in events.transitions:
        force = np.hypot(change.force_x, change.force_y)
        agrees(change, shooting.changes_phase(side * change.slope_angle + 1e-4, 1.001 * force))
    kind = [first, *events.transitions][-1].kind
    tip = kind.endswith("tip")
    alpha, force = side * last.slope_angle, float(np.hypot(last.force_x, last.force_y))
    if last.kind == "corner":
        agrees(last, shooting.changes_phase(alpha + 1e-4, 1.001 * force))
    else:
        assert last.kind == "fold"
        before = [side * change.slope_angle - alpha for change in events.transitions]
        near = min([NEAR, *(0.5 * abs(way) for way in before)])
        q = last.contact_arclength if not tip else None
        if tip:
            # The moment of the force about the pivot is u f; ψ1 follows from the slope at the tip.
            q = _tip_slope(shooting, alpha, force)
        agrees(last, shooting.folds(alpha + 0.1 * near, tip, q, force, near))


def _tip_slope(shooting: Shooting, alpha: float, force: float) -> float:
    """ψ1 at which a rod with a known force ends nearest to the pivot, as a guess."""
    choices = np.linspace(shooting.psi1, 1.5, 40)
    return float(min(choices, key=lambda psi1: np.hypot(*shooting.miss(alpha, psi1, 1.0, force))))


HOOKED = {
    "arc": (given_rod(2.0), Parabola(1.0, 0.8315, 0.1)),
    "hook": (given_rod(lambda s: -1.5 * (1.0 + np.tanh((s - 0.7) / 0.15)), taper=0.3), Parabola(1.3, 0.9631, 0.1)),
}


@pytest.mark.parametrize("friction", [0.0, 0.2])
@pytest.mark.parametrize("kind", HOOKED)
def test_a_hooked_rod_is_released_where_its_tip_touches_without_load(kind, friction):
    """A rod that yields along its chord passes a shallow object: the force grows, and vanishes without a jump."""
    rod, contour = HOOKED[kind]
    found = scan(contour, direction="forward", rig=Rig(rod=rod.rod, unknown={"friction": friction}), drive_step=2e-4)
    first, last = found.events["forward"].first_contact, found.events["forward"].snap_off
    assert (first.kind, last.kind) == ("tip", "release")
    shooting = Shooting(contour, rod.in_sweep(1.0), rod.rod, 1.0, friction)
    for event in (first, last):
        slope_angle, drive_angle = shooting.tip_touches(event.slope_angle)
        assert event.drive_angle == pytest.approx(drive_angle, abs=1e-10)
        assert event.slope_angle == pytest.approx(slope_angle, abs=1e-9)
    assert last.drive_angle > first.drive_angle + 0.05
    assert np.hypot(last.force_x, last.force_y) < 1e-9
    forces = np.hypot(found.record.force_x, found.record.force_y).values
    touched = np.flatnonzero(forces)
    assert forces[touched[-1]] < 0.1 * forces.max()
    assert np.all(np.diff(touched) == 1)

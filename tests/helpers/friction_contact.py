"""A rod that touches a contour with Coulomb friction: shares nothing with the package's mechanics.

The slope φ of the rod between base and contact is unknown at the Gauss nodes of [0, s1]. With the contact force
F = (Fx, Fy) on the rod, the bending moment is M(s) = ∫ₛ (Fy cos φ − Fx sin φ) ds, and

    φ(s) = φ_b + ∫₀ (κ0 + M/B) ds,    b + ∫₀ (cos φ, sin φ) ds = P(p),

for the pose (b, φ_b) of the base and the point P of the contour at its parameter p. Two more equations say where the
contact is on the rod, s1 = 1 (tip) or φ(s1) = α or α + π (flank), and what it does: the slip ζ = σ(p) ∓ (s1 − 1) stays
as it was (stick), or F lies at the edge of the cone of friction, against the change of ζ (slip).

Lengths are in rod lengths, forces in EI/L².
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from scipy.optimize import brentq
from scipy.special import ellipeinc

NODES = 26
# Last step of Newton's method, after which the error is of the size of its square.
_CONVERGED, _MOST_ITERATIONS = 1e-7, 12
_SENSE = 1e-12  # slip against the sense of a state that is rounding
_JUMP = 0.5  # largest change of the force in a step, over one more than the force


def _quadrature() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss's nodes and weights of [0, 1], and integrals from 0 to each node."""
    x, weights = legendre.leggauss(NODES)
    values, order = legendre.legvander(x, NODES), np.arange(1, NODES)
    integrals = np.empty((NODES, NODES))
    integrals[:, 0] = x + 1.0
    integrals[:, 1:] = (values[:, 2:] - values[:, :-2]) / (2 * order + 1)
    return 0.5 * (x + 1.0), 0.5 * weights, 0.5 * integrals @ np.linalg.inv(values[:, :-1])


X, W, BEFORE = _quadrature()
BEYOND = W - BEFORE  # integrals from each node to 1
BEFORE_AND_ALL = np.vstack([BEFORE, W])


class Place(NamedTuple):
    """What a contour is at a parameter: point, slope angle, arc length, and their rates."""

    x: float
    y: float
    alpha: float
    sigma: float
    speed: float
    turn: float


@dataclass(frozen=True)
class Oval:
    """Ellipse with half-axes a, b and the lowest point (x_c, q); its parameter is the eccentric angle."""

    a: float
    b: float
    q: float
    x_c: float = 0.0

    def at(self, p: float) -> Place:
        a, b, sin, cos = self.a, self.b, math.sin(p), math.cos(p)
        speed = math.hypot(a * cos, b * sin)
        sigma = a * p if a == b else a * float(ellipeinc(p, 1.0 - (b / a) ** 2))
        alpha = math.atan2(b * sin, a * cos)
        return Place(self.x_c + a * sin, self.q + b - b * cos, alpha, sigma, speed, a * b / speed**2)

    def parameter(self, x: float, y: float) -> float:
        return math.atan2((x - self.x_c) / self.a, 1.0 - (y - self.q) / self.b)

    def outside(self, x: Any, y: Any) -> Any:
        """Positive outside the object, zero on its contour."""
        return np.hypot((x - self.x_c) / self.a, (y - self.q) / self.b - 1.0) - 1.0


@dataclass(frozen=True)
class Parabola:
    """y = a (x − x_c)² + q; its parameter is the slope angle."""

    a: float
    q: float
    x_c: float = 0.0

    def at(self, p: float) -> Place:
        slope = math.tan(p)
        x, root = slope / (2.0 * self.a), math.hypot(1.0, slope)
        sigma = (slope * root + math.asinh(slope)) / (4.0 * self.a)
        return Place(self.x_c + x, self.q + self.a * x * x, p, sigma, root**3 / (2.0 * self.a), 1.0)

    def parameter(self, x: float, y: float) -> float:
        return math.atan(2.0 * self.a * (x - self.x_c))

    def outside(self, x: Any, y: Any) -> Any:
        """Positive below the parabola, zero on it."""
        return (self.a * (x - self.x_c) ** 2 + self.q - y) / np.sqrt(1.0 + (2.0 * self.a * (x - self.x_c)) ** 2)


class Flexible:
    """Rod of length 1 with the rigidity (1 − taper·s)⁴ and a rest curvature, a polynomial in s, lowest power first."""

    def __init__(self, taper: float = 0.0, curvature: tuple[float, ...] = (0.0,)):
        self.taper, powers = taper, np.arange(1.0, len(curvature) + 1.0)
        self.curvature, self.turned = np.array(curvature), np.append(0.0, curvature / powers)
        self.bend = self.curvature[1:] * powers[:-1]

    def along(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Flexibility 1/B, its rate, rest curvature and its rate."""
        width = 1.0 / (1.0 - self.taper * s)
        rate = 4.0 * self.taper * width**5
        return width**4, rate, _power_series(self.curvature, s), _power_series(self.bend, s)

    def turn(self, s: Any) -> Any:
        """Turn of the unloaded rod from its base."""
        return _power_series(self.turned, s)

    def rest(self, s: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Points of the unloaded rod, shape (2, n)."""
        slope = pose[2] + self.turn(np.multiply.outer(s, X))
        return pose[:2, None] + s * np.stack([np.cos(slope) @ W, np.sin(slope) @ W])


def _power_series(coefficients: np.ndarray, s: Any) -> Any:
    found = 0.0 * s
    for one in coefficients[::-1]:
        found = found * s + one
    return found


class State(NamedTuple):
    """A state in contact: `mode` is 0 if it sticks, else the sign of the slip; `offset` is φ(s1) − α of a flank."""

    kind: str
    mode: int
    pose: np.ndarray
    phi: np.ndarray
    fx: float
    fy: float
    p: float
    s1: float
    offset: float
    slip: float
    slipping: float  # rate of the slip at the end of the step, times the step
    end: float  # φ(s1)
    moment: float  # M(0)
    stored: float
    sign: float  # sign of the determinant of the equations; it changes at a fold

    @property
    def side(self) -> float:
        return math.cos(self.offset)

    @property
    def loaded(self) -> bool:
        return self.fx != 0.0 or self.fy != 0.0


class Stepper:
    """The equations of a rod against a contour with friction, and one step of them."""

    def __init__(self, rod: Flexible, contour: Any, friction: float):
        self.rod, self.contour, self.friction, self.delta = rod, contour, friction, math.atan(friction)

    def bent(self, pose, phi, fx, fy, s1, matrix, miss):
        """Rows of the rod: its slopes, and its end; returns that slope with its rates."""
        flexible, its_rate, curved, its_change = self.rod.along(s1 * X)
        cos, sin, n = np.cos(phi), np.sin(phi), NODES
        moment = s1 * (BEYOND @ (fy * cos - fx * sin))
        curvature = curved + flexible * moment
        slopes = pose[2] + s1 * (BEFORE_AND_ALL @ curvature)
        rates = np.empty((n + 1, n + 4))
        rates[:, :n] = s1 * s1 * (BEFORE_AND_ALL * flexible) @ (BEYOND * (-fy * sin - fx * cos))
        rates[:, n] = -s1 * s1 * (BEFORE_AND_ALL @ (flexible * (BEYOND @ sin)))
        rates[:, n + 1] = s1 * s1 * (BEFORE_AND_ALL @ (flexible * (BEYOND @ cos)))
        rates[:, n + 2] = 0.0
        rates[:, n + 3] = BEFORE_AND_ALL @ (curvature + s1 * X * (its_change + its_rate * moment) + flexible * moment)
        matrix[:n] = -rates[:n]
        matrix[range(n), range(n)] += 1.0
        miss[:n] = phi - slopes[:n]
        x, y = float(W @ cos), float(W @ sin)
        matrix[n, :n], matrix[n + 1, :n] = -s1 * W * sin, s1 * W * cos
        matrix[n : n + 2, n + 3] = x, y
        miss[n : n + 2] = pose[0] + s1 * x, pose[1] + s1 * y
        return slopes[n], rates[n]

    def touching(self, old: State, kind: str, mode: int, end, at: Place, fx, fy, s1, matrix, miss):
        """Rows of the contact: its place, its kind, and what it does."""
        n, (slope, rates) = NODES, end
        cos, sin = math.cos(at.alpha), math.sin(at.alpha)
        matrix[n : n + 2, n + 2] = -at.speed * cos, -at.speed * sin
        miss[n : n + 2] -= at.x, at.y
        if kind == "tip":
            matrix[n + 2, n + 3], miss[n + 2] = 1.0, s1 - 1.0
        else:
            matrix[n + 2] = rates
            matrix[n + 2, n + 2] -= at.turn
            miss[n + 2] = slope - at.alpha - old.offset
        if mode:
            edge = at.alpha - mode * self.delta
            cos, sin = math.cos(edge), math.sin(edge)
            matrix[n + 3, n : n + 3] = cos, sin, at.turn * (fy * cos - fx * sin)
            miss[n + 3] = fx * cos + fy * sin
        else:
            matrix[n + 3, n + 2 :] = at.speed, -old.side
            miss[n + 3] = self.slip(at, old, s1) - old.slip

    @staticmethod
    def slip(at: Place, old: State, s1: float) -> float:
        """ζ = σ ∓ (s1 − 1): how far the rod's material has slipped along the contour."""
        return at.sigma - old.side * (s1 - 1.0)

    def solve(self, old: State, pose: np.ndarray, kind: str, mode: int, start: State) -> State | None:
        """The equilibrium of a kind and a mode after `old`, by Newton's method from `start`, if it finds one."""
        n, phi, s1 = NODES, start.phi, 1.0 if kind == "tip" else start.s1
        fx, fy, p = start.fx, start.fy, start.p
        for _ in range(_MOST_ITERATIONS):
            matrix, miss = np.zeros((n + 4, n + 4)), np.zeros(n + 4)
            end = self.bent(pose, phi, fx, fy, s1, matrix, miss)
            self.touching(old, kind, mode, end, self.contour.at(p), fx, fy, s1, matrix, miss)
            try:
                change = np.linalg.solve(matrix, miss)
            except np.linalg.LinAlgError:
                return None
            largest = float(np.abs(change[:n]).max()) + abs(change[n + 2]) + abs(change[n + 3])
            if not largest < 5.0:
                return None
            share = 0.3 / max(largest, 0.3)
            phi = phi - share * change[:n]
            fx, fy, p, s1 = ((fx, fy, p, s1) - share * change[n:]).tolist()
            if not (0.0 < s1 < 1.5 and abs(p) < 3.0 and self.rod.taper * s1 < 0.99):
                return None
            if largest + (abs(change[n]) + abs(change[n + 1])) / (1.0 + abs(fx) + abs(fy)) < _CONVERGED:
                at, sign = self.contour.at(p), float(np.linalg.slogdet(matrix)[0])
                by_drive = np.linalg.solve(matrix, self.driven(kind, pose - old.pose))
                ends = self.slip(at, old, s1), at.speed * by_drive[n + 2] - old.side * by_drive[n + 3]
                rest = self.outcome(pose, phi, fx, fy, s1)
                return State(kind, mode, pose, phi, fx, fy, p, s1, old.offset, *ends, *rest, sign)
        return None

    @staticmethod
    def driven(kind: str, move: np.ndarray) -> np.ndarray:
        """What a motion of the base takes off the equations."""
        turn = move[2] if kind == "flank" else 0.0
        return np.array([*[move[2]] * NODES, -move[0], -move[1], -turn, 0.0])

    def outcome(self, pose, phi, fx, fy, s1) -> tuple[float, float, float]:
        """φ(s1), M(0) and the elastic energy."""
        cos, sin = np.cos(phi), np.sin(phi)
        flexible, _, curved, _ = self.rod.along(s1 * X)
        moment = s1 * (BEYOND @ (fy * cos - fx * sin))
        end = pose[2] + s1 * float(W @ (curved + flexible * moment))
        return end, s1 * float(W @ (fy * cos - fx * sin)), 0.5 * s1 * float(W @ (flexible * moment**2))

    def pressed(self, state: State) -> tuple[float, float]:
        """Components of the force on the rod across the contour, outward, and along it."""
        alpha = self.contour.at(state.p).alpha
        cos, sin = math.cos(alpha), math.sin(alpha)
        return state.fx * sin - state.fy * cos, state.fx * cos + state.fy * sin

    def follows(self, old: State, new: State, near: float) -> bool:
        """Whether an equilibrium obeys the inequalities, and lies near the state before it."""
        alpha, before = self.contour.at(new.p).alpha, self.contour.at(old.p).alpha
        across, along = self.pressed(new)
        jump = math.hypot(new.fx - old.fx, new.fy - old.fy)
        return (
            across >= 0.0
            and (new.mode != 0 or abs(along) <= self.friction * across * (1.0 + 1e-9))
            and (self.friction == 0.0 or min(new.mode * (new.slip - old.slip), new.mode * new.slipping) >= -_SENSE)
            and (new.s1 <= 1.0 if new.kind == "flank" else math.sin(new.end - alpha) >= 0.0)
            and max(abs(alpha - before), abs(new.end - old.end), abs(new.s1 - old.s1)) < near
            and jump < _JUMP * (1.0 + math.hypot(old.fx, old.fy))
            and ((new.kind, new.mode) != (old.kind, old.mode) or old.sign in (0.0, new.sign))
        )

    def next_state(self, old: State, pose: np.ndarray, near: float) -> State | None:
        """The state after `old` at a pose, of the same motion, sticking, slip either way; or with the other contact."""
        old = old._replace(offset=math.pi * round((old.end - self.contour.at(old.p).alpha) / math.pi))
        for kind in (old.kind, "flank" if old.kind == "tip" else "tip"):
            start = old
            for mode in dict.fromkeys([old.mode, 0, -1, 1] if old.loaded else [-1, 1, 0]):
                new = self.solve(old, pose, kind, mode, start)
                if new is not None and not old.loaded:
                    start = new  # sticking has no equations at no load
                if new is not None and self.follows(old, new, near):
                    return new
        return None

    def clearance(self, state: State | None, pose: np.ndarray) -> float:
        """Least distance, over the contour's size, of points of the rod from the object; negative inside."""
        if state is None:
            return float(self.contour.outside(*self.rod.rest(np.linspace(0.0, 1.0, 101), pose)).min())
        at, turned = self.contour.at(state.p), np.array([0.0, 0.0, state.end - self.rod.turn(state.s1)])
        held = pose[:2, None] + state.s1 * np.stack([BEFORE @ np.cos(state.phi), BEFORE @ np.sin(state.phi)])
        free = self.rod.rest(np.append(state.s1, state.s1 + (1.0 - state.s1) * X), turned)
        free = free[:, 1:] - free[:, :1] + [[at.x], [at.y]]
        return float(self.contour.outside(*np.hstack([held, free])).min())

    def first_touch(
        self, pose_at: Callable[[float], np.ndarray], begin: float, end: float
    ) -> tuple[float, State] | None:
        """Where the unloaded rod, free at `begin`, first touches before `end`, and the state there."""

        def least(t: float) -> tuple[float, float]:
            s = np.linspace(0.0, 1.0, 101)
            for _ in range(4):
                found = self.contour.outside(*self.rod.rest(s, pose_at(t)))
                i = int(np.argmin(found))
                s = np.linspace(s[max(i - 1, 0)], s[min(i + 1, s.size - 1)], 41)
            return float(found[i]), float(s[0 if i == 0 else 40 if i == found.size - 1 else 20])

        if least(end)[0] >= 0.0:
            return None
        t = begin if least(begin)[0] <= 0.0 else brentq(lambda t: least(t)[0], begin, end, xtol=1e-14)
        s1, pose = least(t)[1], pose_at(t)
        kind, s1 = ("tip", 1.0) if s1 > 1.0 - 1e-9 else ("flank", s1)
        p = self.contour.parameter(*self.rod.rest(np.array([s1]), pose)[:, 0])
        at, slope = self.contour.at(p), pose[2] + float(self.rod.turn(s1))
        offset, phi = math.pi * round((slope - at.alpha) / math.pi), pose[2] + self.rod.turn(s1 * X)
        state = State(kind, 0, pose, phi, 0.0, 0.0, p, s1, offset, 0.0, 0.0, slope, 0.0, 0.0, 0.0)
        return t, state._replace(slip=self.slip(at, state, s1))

"""A rod with Coulomb friction, step by step: shares nothing with the package's mechanics.

The slope φ of the rod between base and contact is unknown at the Gauss nodes of [0, s1]. With the contact force
F = (Fx, Fy) on the rod, the bending moment is M(s) = ∫ₛ (Fy cos φ − Fx sin φ) ds, and

    φ(s) = φ_b + ∫₀ (κ0 + M/B) ds,    b + ∫₀ (cos φ, sin φ) ds = P(p),

for the pose (b, φ_b) of the base and the point P of the contour at its parameter p. Two more equations say what the
contact is: s1 = 1 (tip) or φ(s1) = α or α + π (flank), and what it does: the slip ζ = σ(p) ∓ (s1 − 1) stays where it was
(stick), or F lies at the edge of the cone of friction, against the change of ζ (slip).

Each step of the drive is one implicit step: the same motion is tried first, then sticking, then slipping either way,
and what obeys all inequalities (cone, sense of slip, s1 ≤ 1, tip outside, F presses) is the next state. A step without
such a state nearby is parted; when it has become too small for that, the rod has lost its contact. Nothing looks for
events except the first touch of the unloaded rod. Lengths are in rod lengths, forces in EI/L².
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.polynomial.polynomial import polyder, polyint, polyval
from scipy.optimize import brentq
from scipy.special import ellipeinc

NODES = 20
_CONVERGED, _MOST_ITERATIONS = 1e-12, 12
_SENSE = 1e-11
"""Slip against the sense of a state that is rounding."""
_NEAR = 0.2
"""Largest change of the slope, and of the contour's, in a step [rad]."""
_FINEST = 1e-8
"""Smallest part of the drive, over its whole travel."""
_MODES = {0: "stick", 1: "slip+", -1: "slip-"}
_UNLOADED = 1e-3
"""Force below which contact that is lost was released, without a jump."""


def _quadrature() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss's nodes and weights of [0, 1], and integrals from 0 to each node."""
    x, weights = legendre.leggauss(NODES)
    values, order = legendre.legvander(x, NODES), np.arange(1, NODES)
    integrals = np.empty((NODES, NODES))
    integrals[:, 0] = x + 1.0
    integrals[:, 1:] = (values[:, 2:] - values[:, :-2]) / (2 * order + 1)
    return 0.5 * (x + 1.0), 0.5 * weights, 0.5 * integrals @ np.linalg.inv(values[:, :-1])


X, W, I = _quadrature()
J = W - I
"""Integrals from each node to 1."""
IW = np.vstack([I, W])


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


@dataclass(frozen=True)
class Flexible:
    """Rod of length 1 with the rigidity (1 − taper·s)⁴ and a rest curvature, a polynomial in s, lowest power first."""

    taper: float = 0.0
    curvature: tuple[float, ...] = (0.0,)

    def along(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Flexibility 1/B, its rate, rest curvature and its rate."""
        width = 1.0 - self.taper * s
        return width**-4, 4.0 * self.taper * width**-5, polyval(s, self.curvature), polyval(s, polyder(self.curvature))

    def turn(self, s: Any) -> Any:
        """Turn of the unloaded rod from its base."""
        return polyval(s, polyint(self.curvature))

    def rest(self, s: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Points of the unloaded rod, shape (2, n)."""
        slope = pose[2] + self.turn(np.multiply.outer(s, X))
        return pose[:2, None] + s * np.stack([np.cos(slope) @ W, np.sin(slope) @ W])


class State(NamedTuple):
    """A state in contact."""

    kind: str
    """"tip" or "flank"."""
    mode: int
    """0 if it sticks, else the sign of the slip ζ."""
    phi: np.ndarray
    fx: float
    fy: float
    p: float
    s1: float
    offset: float
    """Slope of the rod against the contour's in flank contact: a multiple of π."""
    slip: float
    """ζ."""
    end: float
    """φ(s1)."""
    moment: float
    """M(0)."""
    stored: float
    sign: float = 0.0
    """Sign of the determinant of the equations."""

    @property
    def side(self) -> float:
        return math.cos(self.offset)


class Sample(NamedTuple):
    """One row of a history; loads in the signs of a record, `slope_angle` that of the contour, `force_angle` β."""

    travel: float
    base_x: float
    base_y: float
    drive_angle: float
    kind: str
    mode: str
    contact_arclength: float
    parameter: float
    slope_angle: float
    contact_x: float
    contact_y: float
    force: float
    force_angle: float
    holding_moment: float
    force_x: float
    force_y: float
    stored: float
    work: float
    dissipated: float
    lost: float
    clearance: float


@dataclass
class History:
    """Columns of `Sample` by name, what happened as (travel, word), and the number of steps."""

    columns: dict[str, np.ndarray]
    events: list[tuple[float, str]]
    steps: int

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]


class Stepper:
    """The equations of a rod against a contour with friction, and one step of them."""

    def __init__(self, rod: Flexible, contour: Any, friction: float):
        self.rod, self.contour, self.friction, self.delta = rod, contour, friction, math.atan(friction)

    def bent(self, pose, phi, fx, fy, s1, matrix, miss):
        """Rows of the rod: its slopes, and its end; returns that slope with its rates, M(0) and the energy."""
        flexible, its_rate, curved, its_change = self.rod.along(s1 * X)
        cos, sin, n = np.cos(phi), np.sin(phi), NODES
        moment = s1 * (J @ (fy * cos - fx * sin))
        curvature = curved + flexible * moment
        slopes = pose[2] + s1 * (IW @ curvature)
        rates = np.empty((n + 1, n + 4))
        rates[:, :n] = s1 * s1 * (IW * flexible) @ (J * (-fy * sin - fx * cos))
        rates[:, n] = -s1 * s1 * (IW @ (flexible * (J @ sin)))
        rates[:, n + 1] = s1 * s1 * (IW @ (flexible * (J @ cos)))
        rates[:, n + 2] = 0.0
        rates[:, n + 3] = IW @ (curvature + s1 * X * (its_change + its_rate * moment) + flexible * moment)
        matrix[:n] = -rates[:n]
        matrix[range(n), range(n)] += 1.0
        miss[:n] = phi - slopes[:n]
        x, y = float(W @ cos), float(W @ sin)
        matrix[n, :n], matrix[n + 1, :n] = -s1 * W * sin, s1 * W * cos
        matrix[n : n + 2, n + 3] = x, y
        miss[n : n + 2] = pose[0] + s1 * x, pose[1] + s1 * y
        return slopes[n], rates[n], s1 * (fy * x - fx * y), 0.5 * s1 * float(W @ (flexible * moment**2))

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
            slope, rates, moment, stored = self.bent(pose, phi, fx, fy, s1, matrix, miss)
            self.touching(old, kind, mode, (slope, rates), self.contour.at(p), fx, fy, s1, matrix, miss)
            try:
                change = np.linalg.solve(matrix, miss)
            except np.linalg.LinAlgError:
                return None
            largest = float(np.abs(change[:n]).max()) + abs(change[n + 2]) + abs(change[n + 3])
            if not largest < 5.0:
                return None
            share = min(1.0, 0.3 / largest)
            phi = phi - share * change[:n]
            fx, fy, p, s1 = ((fx, fy, p, s1) - share * change[n:]).tolist()
            if not (0.0 < s1 < 1.5 and abs(p) < 3.0 and self.rod.taper * s1 < 0.99):
                return None
            if largest + (abs(change[n]) + abs(change[n + 1])) / (1.0 + abs(fx) + abs(fy)) < _CONVERGED:
                slip, sign = self.slip(self.contour.at(p), old, s1), float(np.linalg.slogdet(matrix)[0])
                return State(kind, mode, phi, fx, fy, p, s1, old.offset, slip, float(slope), moment, stored, sign)
        return None

    def pressed(self, state: State) -> tuple[float, float]:
        """Components of the force on the rod across the contour, outward, and along it."""
        alpha = self.contour.at(state.p).alpha
        cos, sin = math.cos(alpha), math.sin(alpha)
        return state.fx * sin - state.fy * cos, state.fx * cos + state.fy * sin

    def follows(self, old: State, new: State) -> bool:
        """Whether an equilibrium obeys the inequalities, and lies near the state before it."""
        alpha, before = self.contour.at(new.p).alpha, self.contour.at(old.p).alpha
        across, along = self.pressed(new)
        return (
            across >= 0.0
            and (new.mode != 0 or abs(along) <= self.friction * across * (1.0 + 1e-9))
            and (self.friction == 0.0 or new.mode * (new.slip - old.slip) >= -_SENSE)
            and (new.s1 <= 1.0 if new.kind == "flank" else math.sin(new.end - alpha) >= 0.0)
            and max(abs(alpha - before), abs(new.end - old.end)) < _NEAR
            and ((new.kind, new.mode) != (old.kind, old.mode) or old.sign in (0.0, new.sign))
        )

    def next_states(self, old: State, pose: np.ndarray) -> Iterator[State]:
        """States after `old` at a pose: the same motion, sticking, slip either way; then with the other contact."""
        old = old._replace(offset=math.pi * round((old.end - self.contour.at(old.p).alpha) / math.pi))
        for kind in (old.kind, "flank" if old.kind == "tip" else "tip"):
            start = old
            for mode in dict.fromkeys([old.mode, 0, -1, 1] if old.fx or old.fy else [-1, 1, 0]):
                new = self.solve(old, pose, kind, mode, start)
                if new is not None and not (old.fx or old.fy):
                    start = new  # sticking has no equations at no load
                if new is not None and self.follows(old, new):
                    yield new

    def first_touch(self, poses: Callable[[float], np.ndarray], begin: float, end: float) -> tuple[float, State] | None:
        """Where the unloaded rod, free at `begin`, first touches before `end`, and the state there."""

        def clearance(t: float) -> tuple[float, float]:
            s = np.linspace(0.0, 1.0, 101)
            for _ in range(4):
                found = self.contour.outside(*self.rod.rest(s, poses(t)))
                i = int(np.argmin(found))
                s = np.linspace(s[max(i - 1, 0)], s[min(i + 1, s.size - 1)], 41)
            return float(found[i]), float(s[0 if i == 0 else 40 if i == found.size - 1 else 20])

        if clearance(end)[0] >= 0.0:
            return None
        t = begin if clearance(begin)[0] <= 0.0 else brentq(lambda t: clearance(t)[0], begin, end, xtol=1e-14)
        s1, pose = clearance(t)[1], poses(t)
        x, y = self.rod.rest(np.array([s1]), pose)[:, 0]
        p = self.contour.parameter(x, y)
        at, slope, tip = self.contour.at(p), pose[2] + float(self.rod.turn(s1)), s1 > 1.0 - 1e-9
        offset, phi = math.pi * round((slope - at.alpha) / math.pi), pose[2] + self.rod.turn(s1 * X)
        state = State("tip" if tip else "flank", 0, phi, 0.0, 0.0, p, s1, offset, 0.0, slope, 0.0, 0.0, 0.0)
        return t, state._replace(slip=self.slip(at, state, s1))

    def sample(self, travel: float, pose: np.ndarray, state: State | None, energies: tuple[float, ...]) -> Sample:
        """A row of the history."""
        if state is None:
            clearance = self.contour.outside(*self.rod.rest(np.linspace(0.0, 1.0, 41), pose)).min()
            gone = (math.nan,) * 5
            return Sample(travel, *pose, "none", "none", *gone, 0.0, math.nan, *(0.0,) * 4, *energies, clearance)
        at, slopes = self.contour.at(state.p), np.append(state.phi, state.end)
        along = pose[:2, None] + state.s1 * (I @ np.stack([np.cos(slopes[:-1]), np.sin(slopes[:-1])]).T).T
        bare = state.s1 + (1.0 - state.s1) * X
        turned = state.end - self.rod.turn(state.s1)
        beyond = self.rod.rest(bare, np.array([0.0, 0.0, turned])) - self.rod.rest(
            np.array([state.s1]), np.array([0.0, 0.0, turned])
        )
        clearance = min(
            self.contour.outside(*along).min(), self.contour.outside(at.x + beyond[0], at.y + beyond[1]).min()
        )
        return Sample(
            travel,
            *pose,
            state.kind,
            _MODES[state.mode],
            state.s1,
            state.p,
            at.alpha,
            at.x,
            at.y,
            math.hypot(state.fx, state.fy),
            math.atan2(state.fx, -state.fy),
            -state.moment,
            -state.fx,
            -state.fy,
            state.stored,
            *energies,
            clearance,
        )


def contour_of(description: dict[str, Any]) -> Any:
    """The contour of a description: its family and the family's parameters by name."""
    family, values = description["family"], {k: v for k, v in description.items() if k != "family"}
    if family == "circle":
        radius = values.pop("r")
        values |= {"a": radius, "b": radius}
    return Parabola(**values) if family == "parabola" else Oval(**values)


def travels(poses: Any) -> np.ndarray:
    """Travel at each pose: distance moved by the base, or turn if it does not move."""
    steps = np.diff(np.asarray(poses, dtype=float), axis=0)
    ways = np.hypot(steps[:, 0], steps[:, 1])
    return np.append(0.0, np.cumsum(ways if ways.any() else np.abs(steps[:, 2])))


def step_through(case: dict[str, Any], *, alternatives: bool = False) -> History:
    """The history of a case: a dict of `rod`, `contour`, `friction`, `poses` (n, 3) and `step`, the samples' spacing.

    With `alternatives`, steps after which several different states obey all conditions are events, too.
    """
    stepper = Stepper(Flexible(**case["rod"]), contour_of(case["contour"]), case["friction"])
    vertices, knots = np.asarray(case["poses"], dtype=float), travels(case["poses"])
    samples = case["step"] * np.arange(math.floor(knots[-1] / case["step"] + 1e-9) + 1)

    def pose(t: float) -> np.ndarray:
        return np.array([np.interp(t, knots, column) for column in vertices.T])

    t, state, rows, events, steps = 0.0, None, [], [], 0
    work = dissipated = lost = 0.0
    part, last_touch = knots[-1], -1.0
    for target in np.union1d(samples, knots):
        while t < target:
            if state is None:
                touch = stepper.first_touch(pose, t, target)
                if touch is None:
                    t = target
                    continue
                if touch[0] == last_touch:
                    events.append((t, "blocked"))
                    return History(_columns(rows), events, steps)
                t, state = touch
                last_touch = t
                events.append((t, f"touch {state.kind}"))
                if stepper.contour.outside(*stepper.rod.rest(np.linspace(0.0, 1.0, 101), pose(t))).min() < -1e-6:
                    events.append((t, "blocked"))
                    return History(_columns(rows), events, steps)
                continue
            part = min(part, target - t)
            ahead, now = pose(t + part), pose(t)
            found = list(islice(stepper.next_states(state, ahead), None if alternatives else 1))
            steps += 1
            if not found:
                part *= 0.25
                if part > _FINEST * knots[-1]:
                    continue
                released = math.hypot(state.fx, state.fy) < _UNLOADED
                events.append((t, "release" if released else "snap-off"))
                lost += state.stored
                state, part = None, knots[-1]
                continue
            new = found[0]
            if any(abs(new.p - other.p) + abs(new.end - other.end) > 1e-7 for other in found[1:]):
                events.append((t, "not unique: " + ", ".join(f"{one.kind} {one.mode:+d}" for one in found)))
            if (new.kind, new.mode) != (state.kind, state.mode):
                events.append((t, f"{new.kind} {_MODES[new.mode]}"))
            move = ahead - now
            mean = 0.5 * (np.array([state.fx, state.fy, state.moment]) + [new.fx, new.fy, new.moment])
            work -= float(mean @ move)
            rubbed = 0.5 * (stepper.pressed(state)[1] + stepper.pressed(new)[1])
            dissipated -= rubbed * (new.slip - state.slip)
            t, state, part = t + part if part < target - t else target, new, 4.0 * part
            if abs(stepper.contour.at(state.p).alpha) >= 0.5 * math.pi:
                events.append((t, "end of the contour"))
                return History(_columns(rows), events, steps)
        if target in samples:
            rows.append(stepper.sample(t, pose(t), state, (work, dissipated, lost)))
    return History(_columns(rows), events, steps)


def _columns(rows: list[Sample]) -> dict[str, np.ndarray]:
    return {name: np.array(column) for name, column in zip(Sample._fields, zip(*rows, strict=True), strict=True)}

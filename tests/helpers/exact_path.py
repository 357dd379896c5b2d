"""The equilibrium path of one contour in forty digits: what `continuation` is judged against, down to its snap-off.

Contours are written out again, in mpmath and straight from what defines them, in pieces between which only point and
slope are continuous. States are roots of the rod's equations (Legendre's form, from `exact_rod`) and of the contour's,
found by Newton's method from an approximate state; the snap-off is the greatest drive angle among the few candidates
that theory has for it near an approximate one, each again a root.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from mpmath.calculus.quadrature import GaussLegendre

from helpers.exact_rod import HALF, elastica, mp
from tactile_bayes.contours import Circle, Contour, Ellipse, Joined, Parabola, PowerLaw, ShapeFree
from tactile_bayes.mechanics.paths import States

Number = Any
DIGITS = 40
STEP = mp.mpf(10) ** -22  # of derivatives by differences: Newton's steps then gain 22 digits each
SETTLED = mp.mpf(10) ** -18
NEAR = 1e-5  # candidates for the snap-off are looked for this near, in a piece's parameter


class Piece(NamedTuple):
    """A smooth piece of a contour."""

    # From a parameter, which grows from left to right, to x, y and slope angle.
    locate: Callable[[Number], tuple[Number, Number, Number]]
    low: Number
    high: Number
    parameter: Callable[[Number, Number, Number], Number]  # from x, y and slope angle, roughly, to the parameter


def pieces(contour: Contour, low: Number = -mp.inf, high: Number = mp.inf) -> list[Piece]:
    """A contour between two values of x, from left to right."""
    match contour:
        case Parabola():
            return [_parabola(contour, low, high)]
        case Circle():
            return [_ellipse(contour.r, contour.r, contour, low, high)]
        case Ellipse():
            return [_ellipse(contour.a, contour.b, contour, low, high)]
        case PowerLaw():
            halves = (_power(contour, side, low, high) for side in (-1, 1))
            return [half for half in halves if half.low < half.high]
        case Joined():
            return _joined(contour, low, high)
        case ShapeFree():
            return [_shape_free(contour)]
    raise TypeError(f"no exact form of {contour}")


def _numbers(*values: Any) -> list[Number]:
    return [mp.mpf(float(v)) for v in values]


def _parabola(contour: Parabola, low: Number, high: Number) -> Piece:
    a, q, x_c = _numbers(contour.a, contour.q, contour.x_c)

    def locate(x: Number) -> tuple[Number, Number, Number]:
        return x, a * (x - x_c) ** 2 + q, mp.atan(2 * a * (x - x_c))

    return Piece(locate, low, high, lambda x, y, alpha: x_c + mp.tan(alpha) / (2 * a))


def _ellipse(half_width: Any, half_height: Any, contour: Circle | Ellipse, low: Number, high: Number) -> Piece:
    a, b, q, x_c = _numbers(half_width, half_height, contour.q, contour.x_c)

    def locate(t: Number) -> tuple[Number, Number, Number]:
        return x_c + a * mp.sin(t), q + 2 * b * mp.sin(t / 2) ** 2, mp.atan2(b * mp.sin(t), a * mp.cos(t))

    def end(x: Number, upright: Number) -> Number:
        return upright if abs(x) == mp.inf else mp.asin((x - x_c) / a)

    return Piece(
        locate, end(low, -HALF), end(high, HALF), lambda x, y, alpha: mp.atan2(a * mp.sin(alpha), b * mp.cos(alpha))
    )


def _power(contour: PowerLaw, side: int, low: Number, high: Number) -> Piece:
    """One side of the vertex; the parameter is the offset for n ≥ 2, and like the slope for n < 2."""
    a, n, q, x_c = _numbers(contour.a, contour.n, contour.q, contour.x_c)
    power = mp.mpf(1) if n >= 2 else 1 / (n - 1)

    def locate(p: Number) -> tuple[Number, Number, Number]:
        offset = abs(p) ** power
        return x_c + side * offset, q + a * offset**n, side * mp.atan(a * n * offset ** (n - 1))

    def end(x: Number) -> Number:
        return x if abs(x) == mp.inf else mp.sign(x - x_c) * abs(x - x_c) ** (1 / power)

    def parameter(x: Number, y: Number, alpha: Number) -> Number:
        offset = abs(x - x_c) if n >= 2 else (abs(mp.tan(alpha)) / (a * n)) ** (1 / (n - 1))
        return side * offset ** (1 / power)

    zero = mp.mpf(0)
    bounds = (end(low), min(zero, end(high))) if side < 0 else (max(zero, end(low)), end(high))
    return Piece(locate, *bounds, parameter)


def _joined(contour: Joined, low: Number, high: Number) -> list[Piece]:
    vertex = contour.left.point(0.0)[0] if contour.x is None else contour.x
    (joint,) = _numbers(vertex)
    left, right = pieces(contour.left, low, joint), pieces(contour.right, joint, high)
    before = left[-1].locate(left[-1].high)[2]
    x, y, after = right[0].locate(right[0].low)
    edge = [Piece(lambda alpha: (x, y, alpha), before, after, lambda x, y, alpha: alpha)]
    return [*left, *(edge if after - before > 1e-9 else []), *right]


def _shape_free(contour: ShapeFree) -> Piece:
    """Its spline solved for again, with not-a-knot ends, and integrated by Gauss's rule stretch by stretch."""
    knots, values = _numbers(*contour.slope_angles), _numbers(*np.ravel(contour.log_radius))
    x, y, at = _numbers(contour.x, contour.y, contour.at)
    last, width = len(knots) - 1, [b - a for a, b in pairwise(knots)]
    system, right_side = mp.zeros(last + 1), mp.zeros(last + 1, 1)
    for i in range(1, last):
        system[i, i - 1], system[i, i], system[i, i + 1] = width[i - 1], 2 * (width[i - 1] + width[i]), width[i]
        steeper = (values[i + 1] - values[i]) / width[i] - (values[i] - values[i - 1]) / width[i - 1]
        right_side[i] = 6 * steeper
    for row, i in ((0, 1), (last, last - 1)):
        system[row, i - 1], system[row, i], system[row, i + 1] = width[i], -width[i - 1] - width[i], width[i - 1]
    bends = mp.lu_solve(system, right_side)
    nodes, weights = zip(*GaussLegendre(mp).calc_nodes(5, mp.prec), strict=True)

    def radius(i: int, alpha: Number) -> Number:
        h, ahead, behind = width[i], knots[i + 1] - alpha, alpha - knots[i]
        cubic = (bends[i] * ahead**3 + bends[i + 1] * behind**3) / (6 * h)
        linear = (values[i] / h - bends[i] * h / 6) * ahead + (values[i + 1] / h - bends[i + 1] * h / 6) * behind
        return mp.exp(cubic + linear)

    def chord(i: int, end: Number) -> tuple[Number, Number]:
        half = (end - knots[i]) / 2
        angles = [knots[i] + half * (1 + node) for node in nodes]
        parts = [weight * radius(i, alpha) * half for weight, alpha in zip(weights, angles, strict=True)]
        return tuple(mp.fdot(parts, [f(alpha) for alpha in angles]) for f in (mp.cos, mp.sin))

    corners = [(mp.mpf(0), mp.mpf(0))]
    for i in range(last):
        dx, dy = chord(i, knots[i + 1])
        corners.append((corners[-1][0] + dx, corners[-1][1] + dy))

    def from_first(alpha: Number) -> tuple[Number, Number]:
        i = min(max(sum(knot <= alpha for knot in knots) - 1, 0), last - 1)
        dx, dy = chord(i, alpha)
        return corners[i][0] + dx, corners[i][1] + dy

    x_at, y_at = from_first(at)

    def locate(alpha: Number) -> tuple[Number, Number, Number]:
        dx, dy = from_first(alpha)
        return x + dx - x_at, y + dy - y_at, alpha

    return Piece(locate, knots[0], knots[-1], lambda x, y, alpha: alpha)


class ExactState(NamedTuple):
    """An equilibrium, in a forward sweep's view."""

    drive_angle: Number
    holding_moment: Number
    force_x: Number
    force_y: Number
    arclength: Number
    tip: bool
    piece: int
    parameter: Number
    rod: tuple[Number, ...]  # θ0 and, in tip contact, ψ1

    @property
    def possible(self) -> bool:
        """Whether the phase is right: a longer rod than there is would touch, or the tip would be inside."""
        slight = mp.mpf(10) ** -25
        return self.rod[1] >= -slight if self.tip else self.arclength <= 1 + slight

    def loads(self) -> np.ndarray:
        return np.array([float(v) for v in (self.holding_moment, self.force_x, self.force_y)])


class Start(NamedTuple):
    """An approximate state to search from."""

    piece: int
    parameter: Number
    tip: bool
    rod: tuple[Number, ...]


class ExactPath:
    """States of one sweep in forty digits."""

    @mp.workdps(DIGITS)
    def __init__(self, contour: Contour, base: tuple[float, float], direction: str) -> None:
        self.pieces = pieces(contour)
        self.base = _numbers(*base)
        self.side = 1 if direction == "forward" else -1

    @mp.workdps(DIGITS)
    def start(self, states: States, k: int = 0) -> Start:
        """From doubles: only where to search."""
        x, y, alpha = _numbers(states.x[k], states.y[k], states.slope_angle[k])
        x, y, alpha = self.side * x + self.base[0], y + self.base[1], self.side * alpha
        places = []
        for i, piece in enumerate(self.pieces):
            p = min(max(piece.parameter(x, y, alpha), piece.low), piece.high)
            off = sum(abs(a - b) for a, b in zip(piece.locate(p), (x, y, alpha), strict=True))
            places.append((off, i, p))
        _, i, p = min(places)
        w = states.wrench
        phi0, moment, force_x, force_y = (float(v[k]) for v in (w.drive_angle, w.holding_moment, w.force_x, w.force_y))
        force, beta = np.hypot(force_x, force_y), np.arctan2(-force_x, force_y)
        a, b = np.sin(0.25 * np.pi - 0.5 * (phi0 - beta)), moment / (2.0 * np.sqrt(force))
        psi1 = 0.5 * np.pi - 2.0 * np.arcsin(min(np.hypot(a, b), 1.0))
        tip = float(w.contact_arclength[k]) == 1.0 and psi1 > 1e-13
        return Start(i, p, tip, tuple(_numbers(np.arctan2(a, b), max(psi1, 0.0))))

    @mp.workdps(DIGITS)
    def at_angle(self, drive_angle: Number, start: Start) -> ExactState:
        """The state at exactly this drive angle, in whichever piece and phase it is."""
        i, p, tip, rod = start
        angle = mp.mpf(drive_angle)
        for _ in range(8):
            p, *rod = self._solve(i, tip, [p, *rod[: 1 + tip]], angle=angle)
            found, piece = self._state(i, p, tip, rod), self.pieces[i]
            if p > piece.high and i + 1 < len(self.pieces):
                i, p = i + 1, self.pieces[i + 1].low
            elif p < piece.low and i > 0:
                i, p = i - 1, self.pieces[i - 1].high
            elif not found.possible:
                tip, rod = not tip, [rod[0], mp.mpf(10) ** -6]
            else:
                return found
        raise ArithmeticError(f"no state at {drive_angle} near {start}")

    @mp.workdps(DIGITS)
    def snap_off(self, start: Start) -> tuple[str, ExactState]:
        """The maximum of the drive angle near an approximate one, and what makes it one."""
        found: list[tuple[str, ExactState]] = []
        here = self.pieces[start.piece]
        near = [(start.piece, start.parameter)]
        if start.piece + 1 < len(self.pieces) and here.high - start.parameter < NEAR:
            near.append((start.piece + 1, self.pieces[start.piece + 1].low))
        if start.piece > 0 and start.parameter - here.low < NEAR:
            near.append((start.piece - 1, self.pieces[start.piece - 1].high))
        for i, p in near:
            for name, search in self._candidates(i, p, start.rod):
                try:
                    state = search()
                except (ArithmeticError, ZeroDivisionError, ValueError):
                    continue
                piece = self.pieces[i]
                if state.possible and piece.low <= state.parameter <= piece.high and abs(state.parameter - p) < NEAR:
                    found.append((name, state))
        return max(found, key=lambda one: one[1].drive_angle)

    def _candidates(self, i: int, p: Number, rod: tuple[Number, ...]) -> list[tuple[str, Callable[[], ExactState]]]:
        piece = self.pieces[i]

        def change() -> ExactState:
            q, theta = self._solve(i, True, [p, rod[0]], psi1=mp.mpf(0))
            return self._state(i, q, False, [theta])

        def thrust(tip: bool) -> ExactState:
            q = mp.findroot(lambda t: self._frame(i, t)[0], (p, p + NEAR / 10), tol=mp.mpf(10) ** -60, verify=False)
            return self.at_parameter(i, q, tip, rod)

        out: list[tuple[str, Callable[[], ExactState]]] = [("corner", change)]
        for tip in (False, True):
            out.append(("fold", lambda tip=tip: self._fold(i, p, tip, rod)))
            out.append(("thrust", lambda tip=tip: thrust(tip)))
            out.extend(
                ("corner", lambda tip=tip, end=end: self.at_parameter(i, end, tip, rod))
                for end in (piece.low, piece.high)
                if abs(end - p) < NEAR
            )
        return out

    def _fold(self, i: int, p: Number, tip: bool, rod: tuple[Number, ...]) -> ExactState:
        """Where the drive angle is stationary: secants on its central difference, whose error is STEP^(4/3)."""
        h = STEP ** (mp.mpf(2) / 3)

        def slope(q: Number) -> Number:
            middle = self.at_parameter(i, q, tip, rod)
            sides = [self.at_parameter(i, q + s * h, tip, middle.rod) for s in (1, -1)]
            return (sides[0].drive_angle - sides[1].drive_angle) / (2 * h)

        old, now = p, p + mp.mpf(NEAR) / 100
        at_old, at_now = slope(old), slope(now)
        for _ in range(9):
            old, now, at_old = now, now - at_now * (now - old) / (at_now - at_old), at_now
            if not abs(now - p) < 100 * NEAR:
                raise ArithmeticError("the secants run away")
            at_now = slope(now)
            if abs(now - old) < SETTLED or at_now == at_old:
                break
        if abs(at_now) > mp.mpf(10) ** -14:
            raise ArithmeticError("the secants do not settle")
        return self.at_parameter(i, now, tip, rod)

    @mp.workdps(DIGITS)
    def at_parameter(self, i: int, p: Number, tip: bool, rod: tuple[Number, ...]) -> ExactState:
        return self._state(i, p, tip, self._solve(i, tip, list(rod[: 1 + tip]), parameter=p))

    def _frame(self, i: int, p: Number) -> tuple[Number, Number, Number]:
        """Contact relative to the pivot along and across the contour, and its slope angle."""
        x, y, alpha = self.pieces[i].locate(p)
        x, y, alpha = self.side * (x - self.base[0]), y - self.base[1], self.side * alpha
        cos, sin = mp.cos(alpha), mp.sin(alpha)
        return x * cos + y * sin, y * cos - x * sin, alpha

    def _state(self, i: int, p: Number, tip: bool, rod: list[Number]) -> ExactState:
        tau, a, b, turned = elastica(rod[0], rod[1] if tip else mp.mpf(0))
        u, v, alpha = self._frame(i, p)
        arclength = mp.mpf(1) if tip else mp.hypot(u, v) * tau / mp.hypot(a, b)
        force = (tau / arclength) ** 2
        loads = force * u, -force * mp.sin(alpha), force * mp.cos(alpha)
        return ExactState(alpha + turned, *loads, arclength, tip, i, p, tuple(rod))

    def _solve(
        self, i: int, tip: bool, unknown: list[Number], *, parameter=None, angle=None, psi1=None
    ) -> list[Number]:
        """Newton's method for [parameter, θ0, ψ1], without those that are given, or that the phase does not have."""

        def miss(z: list[Number]) -> list[Number]:
            p, *rod = z if parameter is None else [parameter, *z]
            end = psi1 if psi1 is not None else rod[1] if tip else mp.mpf(0)
            tau, a, b, turned = elastica(rod[0], end)
            u, v, alpha = self._frame(i, p)
            lies = [a / tau - u, b / tau - v] if tip else [(a * v - b * u) / tau]
            return lies if angle is None else [*lies, alpha + turned - angle]

        for _ in range(14):
            at = miss(unknown)
            columns = []
            for k in range(len(unknown)):
                moved = [*unknown[:k], unknown[k] + STEP, *unknown[k + 1 :]]
                columns.append([(b - a) / STEP for a, b in zip(at, miss(moved), strict=True)])
            step = mp.lu_solve(mp.matrix(columns).T, mp.matrix(at))
            unknown = [a - b for a, b in zip(unknown, step, strict=True)]
            if mp.norm(step, mp.inf) < SETTLED:
                return unknown
        raise ArithmeticError("Newton's method does not settle")

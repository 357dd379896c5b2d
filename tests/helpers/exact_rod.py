"""The rod in a hundred digits: what floating-point code is judged against.

Legendre's form of the elastica (θ and m), with F and E by the descending Landen transformation. `elastica` counts from
the contact in Jacobi's amplitude and uses Carlson's forms, so that formulas and evaluation are both different. Partial
derivatives are one-sided differences, exact to some twenty digits.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from mpmath import MPContext

mp = MPContext()
mp.dps = 100
STEP = mp.mpf(10) ** -25
INNER_STEP = mp.mpf(10) ** -50
QUARTER, HALF = mp.pi / 4, mp.pi / 2

Number = Any
Outputs = dict[str, Number]


class Shape(NamedTuple):
    """An equilibrium told by its elastica; `contact` and `wrench` round it to doubles."""

    amplitude: float  # χ at the pivot: small near first contact, π where the line of force passes through the pivot
    end_angle: float  # ψ1: from the force's normal to the rod at the contact; −friction in tangential contact
    normal_angle: float  # β
    arclength: float = 1.0
    friction: float = 0.0

    @property
    def tangential(self) -> bool:
        return self.end_angle == -self.friction


def complementary_arc(theta: Number, m: Number) -> tuple[Number, Number]:
    """K(m) − F(θ|m) and E(m) − E(θ|m)."""
    a, b, phi, power = mp.mpf(1), mp.sqrt(1 - m), theta, 1
    squares, sines = m / 2, mp.mpf(0)
    while True:
        turns = mp.floor(phi / mp.pi + mp.mpf(1) / 2)
        phi = phi + mp.atan(b / a * mp.tan(phi)) + mp.pi * turns
        a, b, c = (a + b) / 2, mp.sqrt(a * b), (a - b) / 2
        power *= 2
        squares += power * c * c / 2
        sines += c * mp.sin(phi)
        if abs(c) < mp.eps:
            break
    difference = (power * HALF - phi) / (power * a)
    return difference, difference * (1 - squares) - sines


def elastica(theta: Number, psi1: Number) -> tuple[Number, Number, Number, Number]:
    """√f s1, √f times the contact along β and across it, φ0 − β: DESIGN.md, section 2."""
    k = mp.sin(QUARTER - psi1 / 2)
    tau, e = complementary_arc(theta, k * k)
    return tau, 2 * k * mp.cos(theta), 2 * e - tau, HALF - 2 * mp.asin(k * mp.sin(theta))


_elastica = lru_cache(maxsize=4096)(elastica)


def _legendre_angle(amplitude: Number, psi1: Number) -> Number:
    """θ0 of amplitude χ: tan χ = cot θ / √(1 − m)."""
    return mp.atan2(mp.cos(amplitude), mp.cos(QUARTER - psi1 / 2) * mp.sin(amplitude))


def _rotate(u: Number, v: Number, beta: Number) -> tuple[Number, Number]:
    return u * mp.cos(beta) - v * mp.sin(beta), u * mp.sin(beta) + v * mp.cos(beta)


def _wrench(phi0: Number, moment: Number, root_f: Number, beta: Number) -> Outputs:
    force_x, force_y = -(root_f**2) * mp.sin(beta), root_f**2 * mp.cos(beta)
    return {"drive_angle": phi0, "holding_moment": moment, "force_x": force_x, "force_y": force_y}


def contact(shape: Shape) -> tuple[float, float, float, float]:
    """Contact point, slope angle and friction angle of a shape, rounded."""
    chi, psi1, beta, s1, delta = map(mp.mpf, shape)
    tau, u, v, _ = _elastica(_legendre_angle(chi, psi1), psi1)
    x, y = _rotate(u * s1 / tau, v * s1 / tau, beta)
    return float(x), float(y), float(beta - delta), float(delta)


def wrench(shape: Shape) -> tuple[float, float, float, float, float]:
    """Base wrench and friction angle of a shape, rounded."""
    chi, psi1, beta, s1, delta = map(mp.mpf, shape)
    tau, u, _, turned = _elastica(_legendre_angle(chi, psi1), psi1)
    root_f = tau / s1
    out = _wrench(beta + turned, root_f * u, root_f, beta)
    return (*map(float, out.values()), float(delta))


# A family of equilibria maps four coordinates to (contact_x, contact_y, slope_angle, friction_angle) and the outputs.
Family = Callable[[list[Number]], tuple[list[Number], Outputs]]


def _tip(z: list[Number]) -> tuple[list[Number], Outputs]:
    theta, psi1, beta, delta = z
    tau, u, v, turned = _elastica(theta, psi1)
    inputs = [*_rotate(u / tau, v / tau, beta), beta - delta, delta]
    rest = {"contact_arclength": mp.mpf(1), "tip_angle": beta + psi1}
    return inputs, _wrench(beta + turned, tau * u, tau, beta) | rest


def _tangential(z: list[Number]) -> tuple[list[Number], Outputs]:
    theta, root_f, beta, delta = z
    tau, u, v, turned = _elastica(theta, -delta)
    inputs = [*_rotate(u / root_f, v / root_f, beta), beta - delta, delta]
    rest = dict.fromkeys(("contact_arclength", "tangential_arclength"), tau / root_f) | {"tip_angle": beta - delta}
    return inputs, _wrench(beta + turned, root_f * u, root_f, beta) | rest


def _moved(z: list[Number], i: int, step: Number) -> list[Number]:
    return [*z[:i], z[i] + step, *z[i + 1 :]]


def _jacobian(family: Family, z: list[Number], inputs: list[Number], step: Number) -> Number:
    columns = [[(b - a) / step for a, b in zip(inputs, family(_moved(z, i, step))[0], strict=True)] for i in range(4)]
    return mp.matrix(columns).T


def _polish(family: Family, z: list[Number], target: list[Number]) -> list[Number]:
    for _ in range(12):
        inputs, _ = family(z)
        miss = mp.matrix([t - a for t, a in zip(target, inputs, strict=True)])
        if mp.norm(miss, mp.inf) < mp.mpf(10) ** -80:
            return z
        step = mp.lu_solve(_jacobian(family, z, inputs, INNER_STEP), miss)
        z = [a + b for a, b in zip(z, step, strict=True)]
    raise ArithmeticError(f"no equilibrium of {family.__name__} at {[float(t) for t in target]}")


def _with_slopes(family: Family, z: list[Number]) -> Outputs:
    """Outputs and the module's two derivative fields."""
    inputs, out = family(z)
    gradient = [
        (family(_moved(z, i, INNER_STEP))[1]["drive_angle"] - out["drive_angle"]) / INNER_STEP for i in range(4)
    ]
    by = mp.lu_solve(_jacobian(family, z, inputs, INNER_STEP).T, mp.matrix(gradient))
    x, y = inputs[:2]
    return out | {"by_slope": by[2], "by_distance": (x * by[0] + y * by[1]) / (2 * (x * x + y * y))}


def _input_errors(values: list[float]) -> list[Number]:
    return [mp.mpf(float(np.spacing(abs(v)))) / 2 for v in values]


def _rounding(out: Outputs, changes: list[Outputs], errors: list[Number]) -> Outputs:
    """What half a unit in the last place of every input does to the outputs, and half a unit of each output itself."""
    bound = {}
    for name, value in out.items():
        by_inputs = sum(abs(c[name]) * e for c, e in zip(changes, errors, strict=True))
        bound[name] = by_inputs + _input_errors([float(value)])[0]
    return bound


def _judge(family: Family, z: list[Number], evaluate: Callable[[list[Number]], Outputs], inputs: list[float]) -> Any:
    out = evaluate(z)
    by_z = [{n: (b - out[n]) / STEP for n, b in evaluate(_moved(z, i, STEP)).items()} for i in range(4)]
    inverse = mp.inverse(_jacobian(family, z, family(z)[0], STEP))
    by_inputs = [{n: sum(by_z[i][n] * inverse[i, j] for i in range(4)) for n in out} for j in range(4)]
    return out, _rounding(out, by_inputs, _input_errors(inputs))


def _tangential_coordinates(x: Number, y: Number, alpha: Number, delta: Number) -> list[Number]:
    beta = alpha + delta
    u, v = _rotate(x, y, -beta)

    def miss(q: Number) -> Number:
        tau, a, b, _ = _elastica(HALF - mp.sqrt(q), -delta)
        return (b * u - a * v) / tau

    q = mp.findroot(miss, (mp.mpf(10) ** -60, mp.pi**2), solver="anderson", tol=mp.mpf(10) ** -44, verify=False)
    theta = HALF - mp.sqrt(q)
    _, a, b, _ = _elastica(theta, -delta)
    return [theta, mp.hypot(a, b) / mp.hypot(u, v), beta, delta]


def judge_wrench(inputs: list[float], tip_guess: tuple[float, ...] | None = None) -> tuple[Outputs, Outputs]:
    """Exact outputs of contact → wrench at these doubles, and what rounding of the inputs alone does to them.

    `tip_guess` (drive angle, holding moment, force) only starts the search in tip contact.
    """
    target = [mp.mpf(v) for v in inputs]
    z = _polish(_tangential, _tangential_coordinates(*target), target)
    if tip_guess is None:
        return _judge(_tangential, z, lambda t: _with_slopes(_tangential, t), inputs)
    reach, reach_bound = _judge(_tangential, z, lambda t: _tangential(t)[1], inputs)
    phi0, moment, force = map(mp.mpf, tip_guess)
    beta = target[2] + target[3]
    a, b = mp.sin(QUARTER - (phi0 - beta) / 2), moment / (2 * mp.sqrt(force))
    start = [mp.atan2(a, b), HALF - 2 * mp.asin(mp.hypot(a, b)), beta, target[3]]
    z = _polish(_tip, start, target)
    out, bound = _judge(_tip, z, lambda t: _with_slopes(_tip, t), inputs)
    name = "tangential_arclength"
    return out | {name: reach[name]}, bound | {name: reach_bound[name]}


def judge_contact(inputs: list[float]) -> tuple[Outputs, Outputs]:
    """Exact outputs of wrench → contact at these doubles, and what rounding of the inputs alone does to them."""

    def evaluate(values: list[Number]) -> Outputs:
        phi0, moment, force_x, force_y, delta = values
        beta, root_f = mp.atan2(-force_x, force_y), mp.sqrt(mp.hypot(force_x, force_y))
        psi0 = phi0 - beta
        a, b = mp.sin(QUARTER - psi0 / 2), moment / (2 * root_f)
        m = a * a + b * b
        psi1 = HALF - 2 * mp.asin(mp.sqrt(m))
        tau, u, v, turned = _elastica(mp.atan2(a, b), psi1)
        x, y = _rotate(u / root_f, v / root_f, beta)
        return {
            "contact_x": x,
            "contact_y": y,
            "slope_angle": beta - delta,
            "contact_arclength": tau / root_f,
            "tip_angle": phi0 - turned + psi1,
            "modulus": m,
        }

    values = [mp.mpf(v) for v in inputs]
    out = evaluate(values)
    changes = [{n: (b - out[n]) / STEP for n, b in evaluate(_moved(values, i, STEP)).items()} for i in range(5)]
    return out, _rounding(out, changes, _input_errors(inputs))

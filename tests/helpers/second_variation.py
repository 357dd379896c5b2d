"""The second variation of the rod's energy: the textbook test of stability, which knows nothing of paths.

The rod's slope φ(s) is varied by η(s) with the drive held, η(0) = 0. Its energy is ∫ B (φ' − κ0)²/2 ds over its length
1, for a rest curvature κ0(s) and a rigidity B(s), and it must stay outside the object. Let d(r) be the distance of a
point r from the object, negative inside; the object's boundary has slope angle α and radius of curvature ρ at the
contact, t = (cos α, sin α) lies along it and
n = (sin α, −cos α) points out of it. There ∇d = n and ∇∇d = t tᵀ/ρ. To second order the point at s moves by

    δr = ∫₀ˢ η (−sin φ, cos φ) ds,     δ²r = −∫₀ˢ η² (cos φ, sin φ) ds.

With ψ = φ − α and

    N = −n·δr = ∫₀ˢ¹ η cos ψ ds,    T = t·δr = −∫₀ˢ¹ η sin ψ ds,    n·δ²r = ∫₀ˢ¹ η² sin ψ ds

the constraint and the form Q = δ²(energy) − f δ²(constraint), with the contact force f ≥ 0 as its multiplier, are:

*Tip contact*, constraint d(r(1)) ≥ 0. Its first variation is −N, and its second n·δ²r + T²/ρ:

    Q = ∫ B η'² ds − f [∫ η² sin ψ ds + T²/ρ]          on all η with η(0) = 0 and N = 0.

*Tangential contact* at s1, constraint min over s of d(r(s)) ≥ 0. As s is free there, the first variation is again −N.
In the second, the contact slides: with G(s, ε) = d(r + ε δr + …) it is G_εε − G_sε²/G_ss, where
G_ss = 1/ρ − κ1 (the rod has its rest curvature κ1 = κ0(s1) at its contact), G_sε = T/ρ − η(s1) (the rod turns, and
meets a turned boundary) and G_εε = n·δ²r + T²/ρ. What is left has no 1/ρ any more, and so holds in an edge as well,
where ρ = 0:

    Q = ∫ B η'² ds − f [∫ η² sin ψ ds + (2 η(s1) T − ρ η(s1)² − κ1 T²)/(1 − ρ κ1)]

on [0, s1]; the free end does not take part.

(For ρ → ∞ the last term of a straight rod only says η(s1) = 0: it lies on a flat.) An equilibrium is stable if Q is
positive, and that its lowest eigenvalue vanishes just where the drive angle is stationary along a path of equilibria is
seen so: the change of φ(s) from one equilibrium on the path to the next obeys the linearised equations of equilibrium,
which are those of Q, and the constraint; it is a variation with the drive held just where the drive does not change.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp
from scipy.linalg import eigh, null_space

from tactile_bayes.arrays import Floats

Along = Callable[[Floats], Floats]


class Held(NamedTuple):
    """An equilibrium seen from the pivot in a forward sweep."""

    drive_angle: float
    holding_moment: float
    force: float
    slope_angle: float  # α
    radius: float  # ρ of the contour at the contact; zero in an edge
    arclength: float  # s1
    tip: bool
    curvature: Along = np.zeros_like  # κ0(s)
    rigidity: Along = np.ones_like  # b(s)


def held(
    contour, state, radius: float | None = None, *, curvature: Along = np.zeros_like, rigidity: Along = np.ones_like
) -> Held:
    """One state, a row of `equilibria` of a forward sweep; the radius is the contour's own if not given."""
    angle, moment, alpha, arclength = (
        float(state[name]) for name in ("drive_angle", "holding_moment", "slope_angle", "contact_arclength")
    )
    force, tip = float(np.hypot(state.force_x, state.force_y)), str(state.contact_phase.values) == "tip"
    radius = float(contour.radius_of_curvature(alpha)) if radius is None else radius
    return Held(angle, moment, force, alpha, radius, arclength, tip, curvature, rigidity)


def shape(rod: Held, arclengths: Floats) -> Floats:
    """Slope φ of the rod at arc lengths, increasing: φ' = κ0 + M/B and M' = f cos(φ − α) integrated from the pivot."""

    def bend(s: float, z: Floats) -> list[float]:
        return [float(rod.curvature(s)) + z[1] / float(rod.rigidity(s)), rod.force * np.cos(z[0] - rod.slope_angle)]

    start = [rod.drive_angle, -rod.holding_moment]
    solution = solve_ivp(
        bend, (0.0, rod.arclength), start, method="DOP853", t_eval=arclengths, rtol=1e-13, atol=1e-14, max_step=0.05
    )
    return solution.y[0]


def eigenvalues(rod: Held, terms: int = 24) -> Floats:
    """Eigenvalues of Q over ∫ η² ds, increasing.

    η is s times a polynomial, in Legendre's basis with `terms` terms; the integrals are Gauss's, and the constraint is
    kept by working in the null space of N. A tip on the point of an edge can leave it downhill to both sides, to first
    order: the lowest eigenvalue is −∞, and the others are those with T = 0.
    """
    node, weight = legendre.leggauss(2 * terms)
    node, weight = 0.5 * (node + 1.0), 0.5 * rod.arclength * weight
    values = legendre.legvander(2.0 * node - 1.0, terms - 1)
    slopes = 2.0 * values[:, :-1] @ legendre.legder(np.eye(terms))
    eta = node[:, None] * values
    eta_rate = (values + node[:, None] * slopes) / rod.arclength
    eta_end = np.ones(terms)  # every Legendre polynomial is 1 at 1

    psi = shape(rod, node * rod.arclength) - rod.slope_angle
    sin, cos = weight * np.sin(psi), weight * np.cos(psi)
    along = -(eta.T @ sin)
    pull = eta.T @ (sin[:, None] * eta)
    bound = [eta.T @ cos]
    if rod.tip and rod.radius > 0.0:
        pull += np.outer(along, along) / rod.radius
    elif rod.tip:
        bound.append(along)
    else:
        end = float(rod.curvature(rod.arclength))
        slid = np.outer(eta_end, along) + np.outer(along, eta_end) - rod.radius * np.outer(eta_end, eta_end)
        pull += (slid - end * np.outer(along, along)) / (1.0 - rod.radius * end)
    stiff = weight * rod.rigidity(node * rod.arclength)
    form = eta_rate.T @ (stiff[:, None] * eta_rate) - rod.force * pull
    free = null_space(np.array(bound))
    mass = eta.T @ (weight[:, None] * eta)
    found = eigh(free.T @ form @ free, free.T @ mass @ free, eigvals_only=True)
    return found if len(bound) == 1 else np.append(-np.inf, found)

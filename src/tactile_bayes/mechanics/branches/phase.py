"""Contact phases, and what each must offer to a branch.

At a contact the rod has two coordinates, the angle ψ1 from the force to the rod and the arc length s1. A phase holds
one of them fixed; the other is its unknown q. What is particular to a phase is here, with a case for each:

- `on_rod`: the coordinates from q, of which `beam_pose` gives the pose and its derivatives;
- `turning` and `sliding`: their derivatives by q, from which the equations of `equilibrium` have their tangent;
- `limit`: the q at which the phase ends;
- `following`: the phase that follows there, which begins at its own limit;
- `is_possible`: the q between which equilibria are sought.

A phase whose unknowns are others than (p, q, f) also needs equations of its own in `equilibrium.balance`.
"""

from __future__ import annotations

import math

from tactile_bayes.mechanics.compiler import inlined
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP

__all__ = ["following", "is_possible", "limit", "on_rod", "sliding", "touching", "turning"]

_LONGEST = 1.5
"""Largest arc length [L] at which tangential contact is sought: a Newton step may pass the tip by half the rod."""

_LEAST_PSI1, _MOST_PSI1 = -0.5 * math.pi, 1.5 * math.pi
"""ψ1 between which tip contact is sought: a quarter turn more than those of a rod on the outside of the contour."""


@inlined
def touching(tip: bool) -> int:
    """Phase of first contact."""
    return TIP if tip else TANGENTIAL


@inlined
def on_rod(phase: int, q: float, tangential_psi1: float) -> tuple[float, float]:
    """Angle ψ1 and arc length at the contact."""
    return (q, 1.0) if phase == TIP else (tangential_psi1, q)


@inlined
def turning(phase: int) -> float:
    """Derivative of ψ1 by q."""
    return 1.0 if phase == TIP else 0.0


@inlined
def sliding(phase: int) -> float:
    """Derivative of the arc length by q."""
    return 0.0 if phase == TIP else 1.0


@inlined
def limit(phase: int, tangential_psi1: float) -> tuple[float, float]:
    """Return the q at which the phase ends, and 1 if it grows toward that, −1 if it falls."""
    return (tangential_psi1, -1.0) if phase == TIP else (1.0, 1.0)


@inlined
def following(phase: int) -> int:
    """Phase that begins where one ends: q then moves away from its limit."""
    return TANGENTIAL if phase == TIP else TIP


@inlined
def is_possible(phase: int, q: float) -> bool:
    """False if an equilibrium is sought too far away."""
    return _LEAST_PSI1 <= q <= _MOST_PSI1 if phase == TIP else 0.0 <= q <= _LONGEST

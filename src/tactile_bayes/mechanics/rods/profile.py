"""Rest curvature and rigidity along a rod, as piecewise polynomials.

Quantities are dimensionless: arc length s from 0, the base, to 1, the tip; rest curvature in 1/L; rigidity in EI(0).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import check_number
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.rods.along import Along, GivenAlong, along, united

STEEPEST_TAPER = 0.95  # largest taper: the rod bends 1.6e5 times as easily at its tip as at its base
# Modes of the rest curvature. The first is nearly a turn of the base, and has 99 % of the variance of a traced rod's
# deflections; what five leave open are deflections of 2e-5 to 5e-5 L, and three 1.5e-4 L, which a load cell feels.
MOST_MODES = 5
_SAME = 1e-9  # difference of the rigidity at the base from one that counts as zero


class Profile(NamedTuple):
    """A rod in the form that the compiled forward model takes."""

    # Where cells begin, from base to tip, shape (n + 1,); the last one lies beyond the tip, with its values.
    edges: Floats
    # Coefficients of the rest curvature by powers of the arc length from the beginning of a cell, shape (n + 1, …).
    curvature: Floats
    rigidity: Floats  # coefficients of the rigidity without the taper, likewise
    taper: float  # t of a diameter that falls linearly to 1 − t at the tip: a factor (1 − t s)⁴ on the rigidity
    bend: float  # a number to be added to the rest curvature [1/L]
    sign: float  # −1 for the mirrored rod of backward sweeps, else 1
    modes: Floats  # coefficients of the stated rest curvature, and of its modes, likewise, shape (1 + modes, n + 1, …)
    shape: Floats  # amplitudes of the modes in `curvature`, shape (MOST_MODES,)

    def shaped(self, shape: Floats) -> Profile:
        """Return the rod with amplitudes of its modes, in arrays of its own."""
        curvature = self.modes[0] + np.tensordot(shape[: len(self.modes) - 1], self.modes[1:], 1)
        return self._replace(curvature=curvature, shape=shape)


class Rods(NamedTuple):
    """The rods of many contacts: arcs, or one rod, mirrored like the contacts."""

    curvature: Floats  # rest curvatures of arcs [1/L]; with a profile −1 for a mirrored rod, else 1, shape (n,)
    profile: Profile | None = None
    stem: float = 0.0  # rigid piece between pivot and rod [L]

    @property
    def are_straight(self) -> bool:
        """True if all are straight and uniform: in a stable contact they are bent one way."""
        return self.profile is None and not np.any(self.curvature)

    def take(self, where: Index | slice) -> Rods:
        return self._replace(curvature=self.curvature[where])


def rods_of(rods: Rods | ArrayLike, count: int) -> Rods:
    """Return rods from themselves, or from the rest curvatures of arcs."""
    given = rods if isinstance(rods, Rods) else Rods(np.asarray(rods))
    return given._replace(curvature=np.array(np.broadcast_to(given.curvature, (count,)), dtype=float))


def profile_of(
    rest_curvature: GivenAlong = 0.0,
    rigidity_profile: GivenAlong = 1.0,
    taper: float = 0.0,
    modes: Sequence[Along] = (),
) -> Profile:
    """Return the profile of a rod from its rest curvature [1/L], EI/EI0, taper and modes, as users give them (`Rod`).

    >>> profile = profile_of(rest_curvature=lambda s: 0.3 * s, rigidity_profile=([0.0, 0.5, 1.0], [1.0, 0.5, 0.4]))
    >>> profile.edges
    array([0. , 0.5, 1. ])
    """
    taper = check_number(
        "taper", taper, f"give a number from 0 (none) to {STEEPEST_TAPER}", least=0.0, most=STEEPEST_TAPER
    )
    bent = _pieces(along("rest_curvature", rest_curvature, 1.0))
    rigid = _pieces(along("rigidity_profile", rigidity_profile, 1.0, positive=True))
    base = rigid.coefficients[0][0]
    if abs(base - 1.0) > _SAME:
        raise ParameterError(
            f"rigidity_profile is {base:.6g} at the base: divide it by this value, since it is relative to the base"
        )
    bends = [bent, *modes]
    edges = united(*(each.edges for each in (*bends, rigid)))
    terms = max(len(each.coefficients[0]) for each in bends)
    rows = [np.pad(_on(edges, each), ((0, 0), (0, terms - len(each.coefficients[0])))) for each in bends]
    return Profile(edges, rows[0], _on(edges, rigid), taper, 0.0, 1.0, np.array(rows), np.zeros(MOST_MODES))


def _pieces(given: float | Along) -> Along:
    return given if isinstance(given, Along) else Along((0.0, 1.0), ((given,),))


def _on(edges: Floats, pieces: Along) -> Floats:
    """Coefficients on finer cells, and beyond the tip."""
    rows = np.pad(pieces.on(edges), ((0, 1), (0, 0)))
    rows[-1, 0] = pieces(edges[-1])
    return rows

"""The proposals by which walkers move."""

from __future__ import annotations

from typing import Any

import emcee

__all__ = ["differential_evolution"]


def differential_evolution() -> list[tuple[Any, float]]:
    """Moves of one ensemble and their shares: the difference of two other walkers, scaled, and now and then unscaled.

    New ones for each ensemble, since a move keeps its scale between two calls.
    """
    return [(emcee.moves.DEMove(), 0.9), (emcee.moves.DEMove(gamma0=1.0), 0.1)]

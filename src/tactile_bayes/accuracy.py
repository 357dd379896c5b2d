"""How accurately a path is followed."""

from __future__ import annotations

from typing import NamedTuple

from tactile_bayes.roots import ROUNDING

__all__ = ["Accuracy"]

_ROUGH_ORDER = 16
"""Up to this number of nodes interpolation errs by more than the rough tables of states do."""


class Accuracy(NamedTuple):
    """How accurately a path is followed."""

    exact: bool
    """Whether states and events are computed to rounding; else from tables, and as good as interpolation."""
    resolved: float
    """Share of the change of the drive angle on a segment by which an interpolant may miss it."""
    last_step: float
    """Newton step, as a share of the bracket, after which a root is taken for found."""
    roughly: bool
    """Whether the rough tables of states will do."""

    @classmethod
    def of(cls, exact_events: bool, order: int) -> Accuracy:
        """For paths to rounding, or for interpolation with `order` nodes on a segment."""
        if exact_events:
            return cls(exact=True, resolved=1e-8, last_step=ROUNDING, roughly=False)
        return cls(exact=False, resolved=1e-3, last_step=1e-6, roughly=order <= _ROUGH_ORDER)

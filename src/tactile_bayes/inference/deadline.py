"""A deadline: the moment from which on a search is content with what it has found."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from scipy.optimize import OptimizeResult, least_squares

from tactile_bayes.arrays import Floats

__all__ = ["NEVER", "Deadline"]


class _PassedError(Exception):
    """Ends a search from inside."""


@dataclass(frozen=True)
class Deadline:
    """The moment from which on a search is content with what it has found.

    Parameters
    ----------
    moment : float
        On the clock `time.monotonic` [s].

    Examples
    --------
    >>> Deadline.after(60.0).has_passed, Deadline.after(0.0).has_passed, Deadline.after(None).has_passed
    (False, True, False)
    """

    moment: float = math.inf

    @classmethod
    def after(cls, seconds: float | None) -> Deadline:
        """So many seconds from now; never, if None."""
        return cls() if seconds is None else cls(time.monotonic() + seconds)

    @property
    def has_passed(self) -> bool:
        return time.monotonic() >= self.moment

    @property
    def seconds_left(self) -> float | None:
        """A positive time, however short; None without a deadline."""
        return None if self.moment == math.inf else max(1e-9, self.moment - time.monotonic())

    def least_squares(
        self, residuals: Callable[..., Floats], start: Floats, jacobian: Callable[..., Floats], **options: Any
    ) -> OptimizeResult:
        """`scipy.optimize.least_squares`, from whose best point so far all is told if the deadline passes.

        It is exceeded by two calls of the residuals and of the Jacobian.
        """
        best = start

        def watched(point: Floats, *args: Any) -> Floats:
            if self.has_passed:
                raise _PassedError
            return residuals(point, *args)

        def watched_jacobian(point: Floats, *args: Any) -> Floats:
            nonlocal best
            best = point.copy()  # slopes are asked for where the search has come to, no step that fails
            return jacobian(point, *args)

        try:
            return least_squares(watched, start, watched_jacobian, **options)
        except _PassedError:
            return least_squares(residuals, best, jacobian, **{**options, "max_nfev": 1})


NEVER = Deadline()

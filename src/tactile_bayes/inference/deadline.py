"""A deadline: the time at which a search ends with its best result so far."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from scipy.optimize import OptimizeResult, least_squares

from tactile_bayes.arrays import Floats


class _PassedError(Exception):
    """Exception that ends a search."""


@dataclass(frozen=True)
class Deadline:
    """The time on the clock `time.monotonic` [s] at which a search ends with its best result so far."""

    moment: float = math.inf

    @classmethod
    def after(cls, seconds: float | None) -> Deadline:
        """Return the deadline in so many seconds from now; never, if None."""
        return cls() if seconds is None else cls(time.monotonic() + seconds)

    @property
    def has_passed(self) -> bool:
        """True after the deadline."""
        return time.monotonic() >= self.moment

    @property
    def seconds_left(self) -> float | None:
        """Time left [s], at least 1e-9; None without a deadline."""
        return None if self.moment == math.inf else max(1e-9, self.moment - time.monotonic())

    def least_squares(
        self, residuals: Callable[..., Floats], start: Floats, jacobian: Callable[..., Floats], **options: Any
    ) -> OptimizeResult:
        """Apply `scipy.optimize.least_squares`; after the deadline, return the result at the best point so far."""
        best = start

        def watched(point: Floats, *args: Any) -> Floats:
            if self.has_passed:
                raise _PassedError
            return residuals(point, *args)

        def watched_jacobian(point: Floats, *args: Any) -> Floats:
            nonlocal best
            best = point.copy()  # the Jacobian is only evaluated at accepted steps
            return jacobian(point, *args)

        try:
            return least_squares(watched, start, watched_jacobian, **options)
        except _PassedError:
            return least_squares(residuals, best, jacobian, **{**options, "max_nfev": 1})


NEVER = Deadline()  # no deadline

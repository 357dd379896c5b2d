"""Roots of many monotone functions at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["falling_root"]

Floats = NDArray[np.float64]
Index = NDArray[np.intp]


def falling_root(
    function: Callable[[Index, Floats], tuple[Floats, Floats]], lo: Floats, hi: Floats, start: Floats | None = None
) -> Floats:
    """Where functions that are positive at `lo` and not positive at `hi` change sign: Newton kept in its bracket.

    Parameters
    ----------
    function : callable
        From indices (which of the functions) and arguments to values and derivatives.
    lo, hi : ndarray, shape (n,)
        `lo` may be greater than `hi`.
    start : ndarray, shape (n,), optional
        First guess, between them; by default the middle.

    Returns
    -------
    ndarray, shape (n,)
        To 1e-14 of the bracket.
    """
    lo, hi = lo.astype(float), hi.astype(float)
    last_step = np.abs(hi - lo)
    settled = 1e-14 * last_step
    x = 0.5 * (lo + hi) if start is None else start.astype(float)
    active = np.arange(lo.size)
    for _ in range(100):
        if not active.size:
            break
        value, slope = function(active, x[active])
        positive = value > 0.0
        lo[active] = np.where(positive, x[active], lo[active])
        hi[active] = np.where(positive, hi[active], x[active])
        with np.errstate(divide="ignore", invalid="ignore"):
            new = x[active] - value / slope
        a, b = lo[active], hi[active]
        # Steps that do not shrink by half go round in circles, for instance about a kink.
        trusted = ((new - a) * (new - b) <= 0.0) & (np.abs(new - x[active]) <= 0.5 * last_step[active])
        new = np.where(trusted, new, 0.5 * (a + b))
        step = np.abs(new - x[active])
        x[active], last_step[active] = new, step
        active = active[(step > settled[active]) & (value != 0.0)]
    return x

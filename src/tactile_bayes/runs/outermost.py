"""Extremes of a choice among the values that were tried."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tactile_bayes.arrays import Floats


def outermost(choices: Iterable[tuple[Floats, float, str, str]]) -> str:
    """Return the extremes at which the best choice lies, as text; "" if it lies inside all ranges."""
    words: list[str] = []
    for tried, best, least, most in choices:
        if np.ptp(tried) > 0.0:
            words += [least] * bool(best == tried.min()) + [most] * bool(best == tried.max())
    return " and ".join(words)

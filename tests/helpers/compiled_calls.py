"""Compiled functions of numbers, called for arrays: they have no face of their own for Python."""

from collections.abc import Callable
from typing import Any

import numpy as np


def by_number(function: Callable[..., Any], outputs: int) -> Callable[..., Any]:
    """From arrays, shape (n,), to the rows, shape (n, outputs), that a compiled function makes of rows of arguments."""

    def of_arrays(*arguments):
        rows = np.stack(np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in arguments)), axis=-1)
        out = np.empty((rows.shape[0], outputs))
        function(rows, out)
        return out

    return of_arrays

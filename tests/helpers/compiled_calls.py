"""Compiled functions of numbers, called for arrays: they have no face of their own for Python."""

import functools
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

__all__ = ["by_number"]


@functools.cache
def by_number(function: Callable[..., Any], outputs: int) -> Callable[..., Any]:
    """From arrays of shape (n,) to what the function makes of each entry, flat, shape (n, outputs).

    Parameters
    ----------
    function : callable
        From numbers to a tuple of numbers, compiled.
    outputs : int
        How many these are.
    """

    @numba.njit(error_model="numpy")
    def of_rows(rows, out):
        for i in range(rows.shape[0]):
            for k, value in enumerate(function(rows[i])):
                out[i, k] = value

    def of_arrays(*arguments):
        rows = np.stack(np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in arguments)), axis=-1)
        out = np.empty((rows.shape[0], outputs))
        of_rows(rows, out)
        return out

    return of_arrays

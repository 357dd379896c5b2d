"""The scatter of values about zero, and of a signal about what is smooth, unmoved by a few outliers."""

from __future__ import annotations

import math

import numpy as np

from tactile_bayes.arrays import Floats

DEVIATION_OVER_MEDIAN = 1.4826  # standard deviation of a normal distribution about zero, over the median of the size


def robust_deviation(values: Floats) -> float:
    """Return the standard deviation of values about zero that a normal distribution with their median size has."""
    return DEVIATION_OVER_MEDIAN * float(np.median(np.abs(values))) if values.size else 0.0


def rough_noise(signal: Floats) -> float:
    """Standard deviation of the white noise on a smooth signal, shape (n_samples,), from its median second difference.
    Linear trends have none, and the median removes jumps. That of normal noise has √6 times its standard deviation."""
    return robust_deviation(np.diff(signal, n=2)) / math.sqrt(6.0)

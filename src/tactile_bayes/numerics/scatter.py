"""The scatter of values about zero, and of a signal about what is smooth, unmoved by a few outliers."""

from __future__ import annotations

import math

import numpy as np

from tactile_bayes.arrays import Floats

__all__ = ["DEVIATION_OVER_MEDIAN", "robust_deviation", "rough_noise"]

DEVIATION_OVER_MEDIAN = 1.4826
"""Standard deviation of a normal distribution about zero, over the median of the size."""


def robust_deviation(values: Floats) -> float:
    """Return the standard deviation of values about zero that a normal distribution with their median size has.

    Examples
    --------
    >>> normal = np.random.default_rng(1).normal(scale=3.0, size=100_000)
    >>> round(robust_deviation(normal), 1), robust_deviation(np.zeros(0))
    (3.0, 0.0)
    """
    return DEVIATION_OVER_MEDIAN * float(np.median(np.abs(values))) if values.size else 0.0


def rough_noise(signal: Floats) -> float:
    """Standard deviation of the white noise on a smooth signal, from its median second difference.

    Second differences remove linear trends, and the median removes jumps. For normal noise they have √6 times its
    standard deviation.

    Parameters
    ----------
    signal : array, shape (n_samples,)
        Signal in the order of measurement.

    Returns
    -------
    float
        In the unit of the signal; 0 for fewer than 3 samples.

    Examples
    --------
    >>> ramp, noise = np.linspace(0.0, 1.0, 20_000), np.random.default_rng(1).normal(size=20_000)
    >>> round(rough_noise(ramp + 0.02 * noise), 3)
    0.02
    """
    return robust_deviation(np.diff(signal, n=2)) / math.sqrt(6.0)

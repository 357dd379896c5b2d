"""The roughness of a signal: its white noise, without a model of the signal."""

from __future__ import annotations

import math

import numpy as np

from tactile_bayes.arrays import Floats

__all__ = ["rough_noise"]


def rough_noise(signal: Floats) -> float:
    """Standard deviation of the white noise on a smooth signal, from its median second difference.

    Second differences remove linear trends, and the median removes jumps. For normal noise they have √6 times its
    standard deviation, which is 1.4826 times the median of their size.

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
    bends = np.diff(signal, n=2)
    return 1.4826 * float(np.median(np.abs(bends))) / math.sqrt(6.0) if bends.size else 0.0

"""How likely each reading of a sensor is, given the loads and all the other readings."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.load_cell.data_sheet import DataSheet
from tactile_bayes.load_cell.likelihood import filtered, log_likelihood

__all__ = ["log_density_left_out"]

Floats = NDArray[np.float64]


def log_density_left_out(
    sheet: DataSheet, measured: ArrayLike, predicted: ArrayLike, noise_scale: ArrayLike = 1.0
) -> Floats:
    """Log-density of each sample given all the others; see `LoadCell.log_density_left_out`."""
    return log_likelihood(sheet, measured, predicted, noise_scale, pointwise=True, given=_given_others)


def _given_others(
    residual: Floats, noise: Floats, first: Floats, kept: float, step: Floats, bias: Floats
) -> tuple[Floats, Floats]:
    """What is new in each sample given all the others, and its variance; arguments as of `given_before`.

    With Q the inverse of the covariance of all samples r, they are (Q r)_i / Q_ii and 1 / Q_ii.
    """
    if kept == 1.0 or not np.any(bias):
        weighed, precision = _weighed(residual, noise, bias + first, kept, step)
    else:
        # A bias beside a drift that forgets takes its share of one dimension from Q: Sherman and Morrison.
        residual, ones, _ = np.broadcast_arrays(residual, 1.0, noise)
        (weighed, of_one), precision = _weighed(np.stack([residual, ones]), noise, first, kept, step)
        with np.errstate(divide="ignore"):
            known = 1.0 / bias + of_one.sum(axis=-2, keepdims=True)
        weighed = weighed - of_one * weighed.sum(axis=-2, keepdims=True) / known
        precision = precision - of_one**2 / known
    return weighed / precision, 1.0 / precision


def _weighed(residual: Floats, noise: Floats, first: Floats, kept: float, step: Floats) -> tuple[Floats, Floats]:
    """Q r and the diagonal of Q, by channel, of what is `filtered`, back from the last sample.

    The smoother of disturbances, which needs no matrices: Koopman 1993, doi 10.1093/biomet/80.1.117.
    """
    new, total = (np.moveaxis(values, -2, 0) for values in filtered(residual, noise, first, kept, step))
    noise = np.atleast_2d(noise)
    white = np.broadcast_to(np.moveaxis(noise, -2, 0), (len(total), *noise.shape[:-2], noise.shape[-1]))
    weighed, precision = np.empty(new.shape), np.empty(total.shape)
    pull, weight = np.zeros(new.shape[1:]), np.zeros(total.shape[1:])
    for i in reversed(range(len(total))):
        left = kept * white[i] / total[i]
        share = kept - left
        own, certain = new[i] / total[i], 1.0 / total[i]
        weighed[i] = own - share * pull
        precision[i] = certain + share**2 * weight
        pull = own + left * pull
        weight = certain + left**2 * weight
    return np.moveaxis(weighed, 0, -2), np.moveaxis(precision, 0, -2)

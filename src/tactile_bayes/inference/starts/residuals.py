"""Residuals of a record at parameters of a contour: whether noise explains them."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.load_cell.drift import Zero
from tactile_bayes.numerics.scatter import rough_noise

_FARTHEST = 5.0  # standard deviations at which residuals are clipped: a sample beside an event may be loaded or not


def left_over_noise(model: ContourModel, best: Floats) -> float:
    """Return the largest root mean square of a channel's residuals at the best parameters, over the noise between
    neighbouring ones; 0 if what wanders, or is off by what is integrated out, is inferred, which is no misfit."""
    cell = model.noise.cell
    if model.noise.of_discrepancy or cell.drift is not None or any(cell.bias_uncertainty):
        return 0.0
    left, noise = _residuals(model, best)[:, model.present], model.deviation[model.present]
    rough = np.maximum([rough_noise(channel) for channel in left.T], noise)
    return float(np.sqrt(np.mean(np.minimum(np.abs(left / rough), _FARTHEST) ** 2, axis=0)).max())


def _residuals(model: ContourModel, point: Floats) -> Floats:
    cell = model.likelihood.load_cell
    return np.asarray(model.likelihood.measured - cell.cut(cell.expected(model.loads(point[None])))[0])


def mean_square_left(model: ContourModel, point: Floats) -> float:
    """Return the mean square of the residuals at a point over a coarse noise, at least that of the data sheet, with
    outliers clipped. Beside a discrepancy they are those of each sample given the ones before it."""
    from tactile_bayes.load_cell.kalman import given_before  # numba takes a second to load

    known = np.maximum(model.deviation, model.likelihood.load_cell.noise)
    left, noise = _residuals(model, point)[:, model.present], model.of_samples(known)[:, model.present]
    discrepancy = model.discrepancy_at(point)
    if discrepancy is not None:
        none = np.zeros(left.shape[1])
        still = Zero.of(None, none, none)
        left, variance = given_before(left, noise**2, still, discrepancy.of(np.flatnonzero(model.present)))
        noise = np.sqrt(variance)
    return float(np.mean(np.minimum(np.abs(left / noise), _FARTHEST) ** 2))

"""Likelihood of a sensor's readings, given the loads."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import betaln, gammaln, hyp2f1, log_ndtr, stdtr

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.checks import check_array, check_optional
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell.data_sheet import DataSheet
from tactile_bayes.load_cell.discrepancy import Discrepancy
from tactile_bayes.load_cell.drift import Zero
from tactile_bayes.load_cell.memory import remembered
from tactile_bayes.record import CHANNELS

_LOG_2PI = math.log(2.0 * math.pi)

_NARROW = 1e-5  # width of a step of the reading, in scales of the noise, below which the density is constant on it
_FAR = -600.0  # logarithm of a probability below which it may underflow
_AT_LIMIT = 1e-9  # share of the range by which a reading at its end may differ from it


def log_likelihood(
    sheet: DataSheet,
    measured: ArrayLike,
    predicted: ArrayLike,
    noise_scale: ArrayLike = 1.0,
    pointwise: bool = False,
    discrepancy: Discrepancy | None = None,
    left_out: bool = False,
) -> Floats:
    """Log-density of readings, of dependent ones given those before, or all others; see `LoadCell`."""
    check_optional("discrepancy", discrepancy, Discrepancy)
    readings, loads, scale = _checked(measured, predicted, noise_scale)
    present = _present(sheet, readings)
    if not present.size:
        batch = np.broadcast_shapes(scale.shape[:-1], loads.shape[:-2])
        return np.zeros((*batch, len(readings)) if pointwise else batch)
    loads = remembered(loads, (sheet.lag, sheet.lag_seconds, sheet.play))
    expected = sheet.expected(loads)
    deviation = np.asarray(sheet.deviation(loads) * (scale[..., None, :] if scale.ndim else scale))
    if present.size < len(CHANNELS):
        readings, expected, deviation = readings[:, present], expected[..., present], deviation[..., present]
    if _is_plain(sheet) and discrepancy is None:
        return _white(readings, expected, deviation, pointwise)
    step, limit = sheet.resolution[present], sheet.limit[present]
    _refuse_beyond(readings, step, limit, present)
    by_sample = _dependent(sheet, readings, expected, deviation, present, discrepancy, left_out)
    if by_sample is None:
        if not (math.isfinite(sheet.degrees_of_freedom) or np.any(step) or np.any(np.isfinite(limit))):
            return _white(readings, expected, deviation, pointwise)
        by_sample = np.zeros(np.broadcast_shapes(expected.shape[:-1], deviation.shape[:-1]))
        for c, ends in enumerate(zip(step.tolist(), limit.tolist(), strict=True)):
            of_channel = readings[:, c], expected[..., c], deviation[..., c]
            by_sample += _channel(*of_channel, *ends, sheet.degrees_of_freedom)
    return np.asarray(by_sample if pointwise else by_sample.sum(axis=-1))


def _is_plain(sheet: DataSheet) -> bool:
    """Return whether noise is normal and white and readings are continuous, the case of inner loops."""
    limits = sheet.force_range, sheet.moment_range, sheet.degrees_of_freedom
    return all(map(math.isinf, limits)) and not (
        sheet.drift
        or sheet.force_resolution
        or sheet.moment_resolution
        or any(sheet.bias_uncertainty)
        or any(sheet.correlation)
    )


def checked_noise_scale(noise_scale: ArrayLike, loads: tuple[int, ...]) -> Floats:
    """Return factors on the white noise for loads of a shape, or refuse them."""
    scale = check_array("noise_scale", noise_scale, "give a positive factor, or one for each channel")
    if not (scale > 0).all():
        raise ParameterError(f"a noise_scale is {float(np.min(scale))!r}: give positive factors")
    try:
        np.broadcast_shapes(scale.shape, (*loads[:-2], len(CHANNELS)))
    except ValueError:
        raise ParameterError(
            f"noise_scale has shape {scale.shape} and predicted {loads}: give factors that broadcast to "
            f"{(*loads[:-2], len(CHANNELS))}, the last axis for the channels {', '.join(CHANNELS)}"
        ) from None
    return scale


# ---- independent samples


def _white(readings: Floats, expected: Floats, deviation: Floats, pointwise: bool) -> Floats:
    """Log-density of normal, independent samples and channels."""
    # Samples and channels are one axis, and a product forms the sum: an axis of three is several times slower.
    squares = expected.reshape(*expected.shape[:-2], readings.size) - readings.ravel()
    squares *= squares
    squares = squares.reshape(expected.shape)
    if deviation.ndim > 1 and deviation.shape[-2] > 1:  # by sample
        by_sample = -0.5 * squares / deviation**2 - np.log(deviation) - 0.5 * _LOG_2PI
        return np.asarray(by_sample.sum(axis=-1 if pointwise else (-2, -1)))
    deviation = deviation[..., 0, :] if deviation.ndim > 1 else deviation
    weight = -0.5 / deviation**2
    offset = -(np.log(deviation) + 0.5 * _LOG_2PI).sum(axis=-1)
    if pointwise:
        return np.asarray((squares @ weight[..., None])[..., 0] + offset[..., None])
    return np.asarray((np.ones(readings.shape[0]) @ squares * weight).sum(-1) + readings.shape[0] * offset)


def correlated_density(residual: Floats, deviation: Floats, steps: Floats, correlation: Floats) -> Floats:
    """Log-density of independent samples with correlated channels; NaN where a residual is NaN."""
    if np.any(steps):
        between = _covariance(deviation, steps, correlation)
        known = np.isfinite(between).all(axis=(-2, -1), keepdims=True)
        root: NDArray[np.floating[Any]] = np.linalg.cholesky(np.where(known, between, np.eye(correlation.shape[0])))
        deviation = np.ones(1)
        white = (np.linalg.inv(root) @ residual[..., None])[..., 0]
    else:
        root = np.linalg.cholesky(correlation)
        white = residual / deviation @ np.linalg.inv(root).T
    volume = np.log(deviation).sum(axis=-1) + np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)
    return np.asarray(-0.5 * (white**2).sum(axis=-1) - volume - 0.5 * correlation.shape[0] * _LOG_2PI)


def _covariance(deviation: Floats, steps: Floats, correlation: Floats) -> Floats:
    """Covariance of the channels of a reading: correlated noise and independent steps."""
    own = steps[..., None] * np.eye(correlation.shape[0])
    return np.asarray(deviation[..., :, None] * correlation * deviation[..., None, :] + own)


def _channel(
    readings: Floats, expected: Floats, scale: Floats, step: float, limit: float, degrees_of_freedom: float
) -> Floats:
    """Log-density of one channel, whose readings may have steps; those at the end of the range stand for all beyond."""
    residual = (readings - expected) / scale
    half = 0.5 * step / scale
    if step > 0.0:
        logs = _log_between(residual, half, degrees_of_freedom)
    else:
        logs = _log_density(residual, degrees_of_freedom) - np.log(scale)
    if math.isfinite(limit):
        at_limit = np.abs(readings) >= limit - max(0.5 * step, _AT_LIMIT * limit)
        half = np.broadcast_to(half, residual.shape)[..., at_limit]
        logs[..., at_limit] = _log_below(
            half - np.sign(readings[at_limit]) * residual[..., at_limit], degrees_of_freedom
        )
    return logs


def _log_density(z: Floats, degrees_of_freedom: float) -> Floats:
    if math.isinf(degrees_of_freedom):
        return -0.5 * z**2 - 0.5 * _LOG_2PI
    nu = degrees_of_freedom
    height = gammaln(0.5 * (nu + 1.0)) - gammaln(0.5 * nu) - 0.5 * math.log(nu * math.pi)
    return np.asarray(height - 0.5 * (nu + 1.0) * np.log1p(z**2 / nu))


def _log_below(z: Floats, degrees_of_freedom: float) -> Floats:
    if math.isinf(degrees_of_freedom):
        return np.asarray(log_ndtr(z))
    with np.errstate(divide="ignore"):
        logs = np.asarray(np.log(stdtr(degrees_of_freedom, z)))
    far = logs < _FAR
    if far.any():
        # The incomplete beta function as a hypergeometric function: DLMF 8.17.8.
        half, log_x = 0.5 * degrees_of_freedom, -np.log1p(z[far] ** 2 / degrees_of_freedom)
        x = np.exp(log_x)
        series = hyp2f1(half + 0.5, 1.0, half + 1.0, x)
        logs[far] = (
            half * log_x + 0.5 * np.log1p(-x) + np.log(series) - math.log(degrees_of_freedom) - betaln(half, 0.5)
        )
    return logs


def _log_between(place: Floats, half: Floats, degrees_of_freedom: float) -> Floats:
    """Logarithm of the probability within half a step of a place, standardised."""
    place = -np.abs(place)  # the tail in which probabilities keep their digits
    high = _log_below(place + half, degrees_of_freedom)
    with np.errstate(divide="ignore", invalid="ignore"):
        wide = high + np.log1p(-np.exp(_log_below(place - half, degrees_of_freedom) - high))
    narrow = _log_density(place, degrees_of_freedom) + np.log(2.0 * half)
    return np.where((2.0 * half < _NARROW) | ~np.isfinite(wide), narrow, wide)


# ---- dependent samples


def wandering_sizes(sheet: DataSheet) -> Floats:
    """Standard deviations of the unknown zero: bias and drift, shape (3,)."""
    bias = np.array(sheet.bias_uncertainty)
    return bias if sheet.drift is None else np.hypot(bias, sheet.drift.sizes)


def _dependent(
    sheet: DataSheet,
    readings: Floats,
    expected: Floats,
    deviation: Floats,
    present: Index,
    discrepancy: Discrepancy | None,
    left_out: bool,
) -> Floats | None:
    """Log-density of each sample given others; None if samples and channels are independent."""
    wanders = bool(np.any(wandering_sizes(sheet)[present]))
    correlation = sheet.correlation_matrix[np.ix_(present, present)]
    correlated = bool(np.any(correlation != np.eye(present.size)))
    if discrepancy is not None:
        _refuse_beside_discrepancy(sheet, discrepancy, correlated)
    elif not (wanders or correlated):
        return None
    refuse_inexact(sheet, readings, present, wanders, correlated, discrepancy is not None)
    residual, steps = readings - expected, sheet.resolution[present] ** 2 / 12.0
    if correlated and not wanders:
        return correlated_density(residual, deviation, steps, correlation)
    from tactile_bayes.load_cell.kalman import given_before, given_others  # numba takes a second to load

    given = given_others if left_out else given_before
    if not correlated:
        bias = np.array(sheet.bias_uncertainty)[present] ** 2
        sizes = bias if sheet.drift is None else sheet.drift.sizes[present] ** 2
        smooth = None if discrepancy is None else discrepancy.of(present)
        return normal_density(*given(residual, deviation**2 + steps, Zero.of(sheet.drift, sizes, bias), smooth))
    # Coordinates in which the white noise, which is stationary, has unit covariance and the drifts are independent.
    deviation = deviation[..., 0, :] if deviation.ndim > 1 else deviation
    root = np.linalg.cholesky(_covariance(deviation, steps, correlation))
    inverse = np.linalg.inv(root)
    share, axes = np.linalg.eigh(inverse * wandering_sizes(sheet)[present] ** 2 @ np.swapaxes(inverse, -1, -2))
    residual = residual @ np.swapaxes(np.swapaxes(axes, -1, -2) @ inverse, -1, -2)
    volume = np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)[..., None]
    none = np.zeros(present.size)
    zero = Zero.of(sheet.drift, share, none) if sheet.drift else Zero(share, none, none, 1.0)
    return normal_density(*given(residual, np.ones(present.size), zero)) - volume


def normal_density(deviation: Floats, variance: Floats) -> Floats:
    """Normal log-density of independent channels, summed over them."""
    return np.asarray(-0.5 * (deviation**2 / variance + np.log(variance) + _LOG_2PI).sum(axis=-1))


# ---- refusals


def _checked(measured: ArrayLike, predicted: ArrayLike, noise_scale: ArrayLike) -> tuple[Floats, Floats, Floats]:
    readings, loads = check_array("measured", measured), check_array("predicted", predicted)
    if readings.shape[1:] != (len(CHANNELS),) or loads.shape[-2:] != readings.shape:
        raise ParameterError(
            f"measured has shape {readings.shape} and predicted {loads.shape}: give (n_samples, 3) and "
            f"(..., n_samples, 3), with the channels {', '.join(CHANNELS)}"
        )
    return readings, loads, checked_noise_scale(noise_scale, loads.shape)


def _present(sheet: DataSheet, readings: Floats) -> Index:
    """Indices of the channels that are not missing."""
    absent = np.isnan(readings)
    present = np.flatnonzero(~absent.all(axis=0))
    for index in present:
        name = CHANNELS[index]
        if absent[:, index].any():
            raise ParameterError(
                f"measured misses sample {int(np.argmax(absent[:, index]))} of {name}, but has others: remove the "
                "sample, or set the whole channel to NaN"
            )
        refuse_silent(sheet, int(index))
    return present


def refuse_silent(sheet: DataSheet, index: int) -> None:
    """Refuse a channel that is measured without noise, which has no likelihood."""
    if sheet.noise[index] == 0:
        name = CHANNELS[index]
        source = "moment_noise" if name == "holding_moment" else "force_noise"
        raise ParameterError(
            f"{name} is measured, but the load cell has no noise on it: give LoadCell({source}=...) a positive "
            "standard deviation"
        )


def _refuse_beyond(readings: Floats, step: Floats, limit: Floats, present: Index) -> None:
    over = np.abs(readings) > limit * (1.0 + _AT_LIMIT) + 0.5 * step
    if np.any(over):
        sample, channel = np.argwhere(over)[0]
        raise ParameterError(
            f"sample {sample} of {CHANNELS[present[channel]]} reads {float(readings[sample, channel])!r}, beyond the "
            f"load cell's range of {float(limit[channel])!r}: is the range in the record's units?"
        )


def refuse_inexact(
    sheet: DataSheet, readings: Floats, present: Index, wanders: bool, correlated: bool, smooth: bool = False
) -> None:
    """Refuse combinations whose likelihood has no exact or nearly exact form; `smooth` beside a discrepancy."""
    what = "a discrepancy" if smooth else "drift or an unknown bias" if wanders else "correlated noise"
    if math.isfinite(sheet.degrees_of_freedom):
        raise ParameterError(
            f"the likelihood of {what} with outliers (degrees_of_freedom) has no closed form: leave one of them out"
        )
    at_limit = np.argwhere(sheet.cuts_off(readings, present))
    if at_limit.size:
        sample, channel = at_limit[0]
        raise ParameterError(
            f"sample {sample} of {CHANNELS[present[channel]]} is at the end of the load cell's range, and with {what} "
            "the likelihood of such a sample has no closed form: remove it, or leave one of the two out"
        )
    if wanders and correlated:
        if sheet.relative_noise:
            raise ParameterError(
                "drift or an unknown bias, correlated noise and relative_noise exclude each other: leave one out"
            )
        if sheet.drift is not None and any(sheet.bias_uncertainty[i] for i in present):
            raise ParameterError("drift, an unknown bias and correlated noise exclude each other: leave one out")


def _refuse_beside_discrepancy(sheet: DataSheet, discrepancy: Discrepancy, correlated: bool) -> None:
    """Refuse correlated noise beside a discrepancy, and drift in another order than its own."""
    if correlated:
        raise ParameterError(
            "a discrepancy and noise that is correlated between channels exclude each other: leave one of the two out"
        )
    if sheet.drift is not None and not discrepancy.course.is_measured_order:
        raise ParameterError(
            "a discrepancy is common to repeated sweeps, and a drift beside it requires that the samples of all sweeps "
            "from one pivot in one direction follow one another, with drive angles in order: describe the drift by "
            "bias_uncertainty, or infer one of the sweeps alone"
        )

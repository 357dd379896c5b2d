"""Prediction of one part of a record by another: each sweep, pivot or half alone predicts the rest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import stats

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import points_of, predicted_points
from tactile_bayes.inference.result import best_draw
from tactile_bayes.load_cell.lone_samples import wandering_deviation
from tactile_bayes.numerics.blocks import blocks
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.planning.record_information import NoiseWhitening, prior_precision, scaled_cell, whitening
from tactile_bayes.record import CHANNELS

_DIFFERENCE = 0.1  # step of differences, in posterior standard deviations
_MOST_CORRELATED = 6000  # largest number of readings whose covariance is factorised, in 0.3 GB
_TURN = 1e-4  # step of differences of the drive angle [rad]
# Second difference over a step, in standard deviations of the noise, above which a reading may jump at an event.
_JUMP = 0.01
_HALVINGS = 3  # largest number of times that a step is halved
# Standard deviations at which residuals are clipped: a sample beside an event may be loaded on either side of it.
_CLIPPED = 4.0
_SINGULAR = 1e-7  # eigenvalue of a covariance of standardised sums of residuals below which a direction is not measured


class Disagreement(NamedTuple):
    """Disagreement of one part of a record with what the other part predicts."""

    ratio: float  # mean square of the prediction errors over that of all residuals: F-distributed if the model holds
    # Number of directions of parameter space that the part measures, the first degrees of freedom of the ratio.
    measured: int
    # Change of each parameter by the part, over its standard deviation as expected before; shape (parameters,).
    moves: Floats


class LinearFit(NamedTuple):
    """A record around its least-squares optimum, in scaled parameters with independent readings of unit variance."""

    slopes: Floats  # derivatives of the readings, shape (samples, channels, parameters)
    residuals: Floats  # residuals at the optimum, shape (samples, channels)
    covariance: Floats  # covariance of the parameters, shape (parameters, parameters)
    prior: Floats  # precision of the prior, shape (parameters, parameters)
    zeros: Floats  # derivatives of the readings by the zero of each channel, shape (samples, channels, channels)

    @property
    def freedom(self) -> float:
        """Number of readings less that of the effective parameters."""
        used = np.trace(self.covariance @ self._information(np.ones(len(self.residuals), dtype=bool)))
        return float(self.residuals.size - used)

    @property
    def scatter(self) -> float:
        """Mean square of the residuals per degree of freedom; 1 if the noise is as assumed."""
        return float(np.sum(self.residuals**2) / self.freedom)

    def disagreement(self, rest: Flags) -> Disagreement:
        """Compare the samples `rest`, a mask of shape (samples,), with what all others predict.

        With residuals r of the rest, slopes J and joint covariance C, r has the covariance 1 − J C Jᵀ before the rest
        is read. It is projected on J, and on the zeros of channels, also if these are no parameters. The parameters
        change by C(1 + I C')Jᵀr, with the information I of the rest and the covariance C' without it.
        """
        slopes = self.slopes[rest].reshape(-1, self.slopes.shape[-1])
        projected = np.hstack([slopes, self.zeros[rest].reshape(len(slopes), -1)])
        score = projected.T @ self.residuals[rest].ravel()
        shared = projected.T @ slopes
        expected = projected.T @ projected - shared @ self.covariance @ shared.T
        scale = np.sqrt(np.maximum(np.sum(projected**2, axis=0), 1e-300))
        values, axes = np.linalg.eigh(expected / np.outer(scale, scale))
        measured = values > _SINGULAR
        squares = (axes.T @ (score / scale))[measured] ** 2 / values[measured]
        score, own = score[: slopes.shape[1]], shared[: slopes.shape[1]]
        before = np.linalg.inv(self._information(~rest) + self.prior)
        change = self.covariance @ (score + own @ (before @ score))
        spread = np.sqrt(np.maximum(np.diag(before - self.covariance), 0.0))
        count = int(np.count_nonzero(measured))
        with np.errstate(divide="ignore", invalid="ignore"):
            moves = np.where(spread > 1e-6, change / spread, 0.0)
        return Disagreement(float(squares.sum() / max(count, 1) / self.scatter), count, moves / np.sqrt(self.scatter))

    def _information(self, some: Flags) -> Floats:
        flat = self.slopes[some].reshape(-1, self.slopes.shape[-1])
        return np.asarray(flat.T @ flat)


class Linearisation:
    """Linear fits of records that were measured as that of a model, from the posterior's deviations, shape (d,)."""

    def __init__(self, model: ContourModel, scales: Floats) -> None:
        self.model = model
        self._count = len(model.forward_parameters)
        self._scales = np.maximum(scales[: self._count], 1e-12)
        precision = prior_precision(model)[: self._count, : self._count]
        names = model.forward_parameters
        means = [
            float(model.priors[name].mean()) if known > 0.0 else 0.0  # type: ignore[attr-defined]
            for name, known in zip(names, np.diag(precision), strict=True)
        ]
        self._mean, self._prior = np.array(means), precision * np.outer(self._scales, self._scales)
        margin, ends = 2.0 * _DIFFERENCE * self._scales, model.ends  # differences stay within the bounds
        self._low, self._high = ends.low[: self._count] + margin, ends.high[: self._count] - margin
        self._shared: NoiseWhitening | None = None
        cell, (samples, channels) = model.likelihood.load_cell, model.likelihood.measured.shape
        if samples * channels > _MOST_CORRELATED and np.any(wandering_deviation(cell, samples)):
            raise InferenceError(
                f"readings of {samples} samples that share a drift or an unknown bias are too many to be compared at "
                f"once, {_MOST_CORRELATED // channels} are possible: infer the bias, or take every so many samples"
            )

    def fits(self, readings: Floats, starts: Floats) -> list[LinearFit | None]:
        """Return fits of readings (records, samples, 3), each from a start, (records, d); None out of reach."""
        found: list[LinearFit | None] = []
        numbers = (2 * self._count + 3) * readings[0].size
        for block in blocks(len(readings), numbers):
            found += self._fits(readings[block], starts[block])
        return found

    def _fits(self, readings: Floats, points: Floats) -> list[LinearFit | None]:
        """Return the fits after one step; starts are draws of the posterior, or truths of predicted records."""
        changes = [change for _, change in self._around(readings, points)]
        costs = self._costs(readings, points)
        open_ = np.isfinite(costs)
        moved = points.copy()
        for halving in range(_HALVINGS):
            further = points.copy()
            step = 0.5**halving * np.array(changes) * self._scales
            further[:, : self._count] = np.clip(further[:, : self._count] + step, self._low, self._high)
            tried = np.flatnonzero(open_)
            if not tried.size:
                break
            better = tried[self._costs(readings[tried], further[tried]) < costs[tried]]
            moved[better] = further[better]
            open_[better] = False
        return [fit for fit, _ in self._around(readings, moved)]

    def _costs(self, readings: Floats, points: Floats) -> Floats:
        """Return the least-squares costs of points, shape (records,), by the load cell alone; infinite out of reach."""
        here, usable = self.model.readings(points)
        costs = np.full(len(points), np.inf)
        for k in np.flatnonzero(usable):
            residuals = self._whitening(points[k], here[k], None)[0](self._off(readings[k], here[k]))
            pull = (self._mean - points[k, : self._count]) / self._scales
            costs[k] = np.sum(np.clip(residuals, -_CLIPPED, _CLIPPED) ** 2) + pull @ self._prior @ pull
        return costs

    def _around(self, readings: Floats, points: Floats) -> list[tuple[LinearFit | None, Floats]]:
        """Return the fit around each point, None out of reach, and the scaled step to its optimum."""
        count, encoder = self._count, self.model.likelihood.load_cell.drive_angle_deviation > 0.0
        moves = _DIFFERENCE * np.vstack([np.zeros(count), np.diag(self._scales), -np.diag(self._scales)])
        many = np.repeat(points[:, None], len(moves) + 2 * encoder, axis=1)
        inside = np.clip(points[:, :count], self._low, self._high)
        many[:, 1 : len(moves), :count] = inside[:, None] + moves[1:]
        turns = np.zeros(many.shape[:2])
        if encoder:
            turns[:, -2:] = _TURN, -_TURN
        flat, usable = self.model.readings(many.reshape(-1, many.shape[-1]), turns.ravel())
        values = flat.reshape(*many.shape[:2], *flat.shape[1:])
        is_usable = usable.reshape(turns.shape)[:, 0]
        every = zip(readings, points, values, is_usable, strict=True)
        return [self._at(*each) if ok else (None, np.zeros(count)) for *each, ok in every]

    def _at(self, readings: Floats, point: Floats, values: Floats) -> tuple[LinearFit, Floats]:
        """Return the fit around a point, from the readings at it and around it, shape (2 d + 1 or 2 d + 3, n, 3)."""
        count = self._count
        here, more, less = values[0], values[1 : count + 1], values[count + 1 : 2 * count + 1]
        by_angle = (values[-2] - values[-1]) / (2.0 * _TURN) if len(values) > 2 * count + 1 else None
        white, noise = self._whitening(point, here, by_angle)
        jump = np.abs(more + less - 2.0 * here) / noise
        slopes = np.where(jump > np.maximum(_JUMP, 0.5 * np.abs(more - less) / noise), 0.0, more - less)
        by_parameters = white(np.moveaxis(slopes, 0, -1) / (2.0 * _DIFFERENCE))
        residuals = np.clip(white(self._off(readings, here)), -_CLIPPED, _CLIPPED)
        pull = (self._mean - point[:count]) / self._scales
        flat = by_parameters.reshape(-1, count)
        covariance = np.asarray(np.linalg.inv(flat.T @ flat + self._prior), dtype=np.float64)
        change = covariance @ (flat.T @ residuals.ravel() + self._prior @ pull)
        left = np.asarray(residuals[..., 0] - by_parameters @ change, dtype=np.float64)
        unit = np.broadcast_to(noise * np.eye(noise.size), (*here.shape, noise.size))
        zeros = white(unit)[..., self.model.present]
        return LinearFit(by_parameters, left, covariance, self._prior, zeros), change

    def _off(self, readings: Floats, expected: Floats) -> Floats:
        return np.nan_to_num(readings - expected)[..., None]

    def _whitening(self, point: Floats, expected: Floats, by_angle: Floats | None) -> tuple[NoiseWhitening, Floats]:
        """Return the whitening at a point, and the standard deviation of each channel, shape (3,)."""
        cell = scaled_cell(self.model.likelihood.load_cell, self.model.noise_scale(point[None])[0])
        noise = np.asarray(np.where(cell.noise > 0.0, cell.noise, 1.0), dtype=np.float64)
        if self._shared is not None:
            return self._shared, noise
        turned = np.zeros_like(expected) if by_angle is None else by_angle
        white = whitening(cell, expected, turned, self.model.present)
        if white.together is not None:  # errors that samples share make it costly
            self._shared = white
        return white, noise


FALSE_ALARM = 0.01  # probability of an alarm if the model holds
_RECORDS = 199  # number of predicted records with which the real one is compared
_FEWEST_RECORDS = 99  # least number of predicted records: with fewer an alarm would be impossible
_NOISE = "noise"


def split_prediction(posterior: xr.DataTree, model: ContourModel) -> xr.Dataset:
    """Predict each part of a record from all others, and compare.

    At the joint optimum the score of the rest is normal to first order: its quadratic form over the scatter of all
    residuals has an F distribution. Those of records that the posterior predicts, fitted alike, correct its mean
    (Bartlett 1937, doi 10.1098/rspa.1937.0109), and calibrate the least p-value of all parts. "noise" compares the
    scatter with that of predicted records: it differs only if the noise is known, since noise that is inferred explains
    any misfit.
    """
    points = points_of(posterior, model.names)
    predicted = predicted_readings(posterior)
    chosen = evenly_spread(len(predicted), _RECORDS)
    if chosen.size < _FEWEST_RECORDS:
        raise InferenceError(f"the posterior holds {chosen.size} predictions of the record, too few: sample longer")
    parts, linear = parts_of(model), Linearisation(model, points.std(axis=(0, 1)))
    drawn = best_draw(posterior)
    best = np.array([float(drawn[name]) for name in model.names])
    best[len(model.forward_parameters) :] = np.median(points, axis=(0, 1))[len(model.forward_parameters) :]
    starts = predicted_points(posterior, model.names)[chosen]
    records = np.stack([model.likelihood.measured, *(predicted[chosen] / model.likelihood.rod.load_units)])
    first, *others = linear.fits(records, np.vstack([best[None], starts]))
    if first is None:
        raise InferenceError("the most probable contour of the posterior is out of reach: infer it again")
    return _compared([first, *(fit for fit in others if fit is not None)], parts, model.forward_parameters)


def predicted_readings(posterior: xr.DataTree) -> Floats:
    """Return the records that a posterior predicts, shape (records, samples, 3); NaN where a channel is missing."""
    predicted = posterior["posterior_predictive"].to_dataset().transpose("chain", "draw", "sample")
    missing = np.full([predicted.sizes[name] for name in ("chain", "draw", "sample")], np.nan)
    channels = [predicted[name].values if name in predicted else missing for name in CHANNELS]
    return np.stack(channels, axis=-1).reshape(-1, missing.shape[-1], len(CHANNELS))


def parts_of(model: ContourModel) -> dict[str, Flags]:
    """Return the parts of a record that predict the rest, masks of shape (samples,) by name. They are each sweep
    segment and each pivot, of several, and both halves of the contacts of every segment."""
    likelihood = model.likelihood
    of_sample, count = likelihood.segments.of_sample, len(likelihood.segments)
    parts = {f"sweep {k + 1}": of_sample == k for k in range(count)} if count > 1 else {}
    places = list(map(tuple, likelihood.segments.bases.tolist()))
    bases = list(dict.fromkeys(places))
    if 1 < len(bases) < count:
        at = np.array([bases.index(place) for place in places])[of_sample]
        parts |= {f"pivot {k + 1}": at == k for k in range(len(bases))}
    loaded, early = ~model.found["unloaded"].values, np.zeros(of_sample.size, dtype=bool)
    for samples in likelihood.segments.samples:
        inside = samples[loaded[samples]] if loaded[samples].any() else samples
        early[samples[samples < inside[inside.size // 2]]] = True
    return parts | {"earlier half": early, "later half": ~early}


def _compared(fits: list[LinearFit], parts: Mapping[str, Flags], parameters: tuple[str, ...]) -> xr.Dataset:
    """Return the result for the first of the records, with the others as reference."""
    if len(fits) <= _FEWEST_RECORDS:
        raise InferenceError(f"only {len(fits) - 1} predicted records can be fitted, too few: sample longer")
    found = [[fit.disagreement(~part) for part in parts.values()] for fit in fits]
    ratios = np.array([[each.ratio for each in row] for row in found])
    measured = np.array([[max(each.measured, 1) for each in row] for row in found])
    freedom, scatter = (np.array([[getattr(fit, name)] for fit in fits]) for name in ("freedom", "scatter"))
    expected = freedom / np.maximum(freedom - 2.0, 1.0)
    inflated = np.mean((ratios / expected)[1:], axis=0)
    p_values = stats.f.sf(ratios / inflated, measured, freedom)
    below = stats.chi2.cdf(scatter / scatter[1:].mean() * freedom, freedom)
    p_values = np.hstack([p_values, 2.0 * np.minimum(below, 1.0 - below)])
    least = p_values.min(axis=1)
    overall = float(np.mean(least <= least[0]))
    moves = [*(each.moves for each in found[0]), np.full(len(parameters), np.nan)]
    return xr.Dataset(
        {
            "p_value": ("part", p_values[0]),
            "sd": ("part", stats.norm.isf(0.5 * np.maximum(p_values[0], 1e-300))),
            "moves": (("part", "parameter"), np.array(moves)),
            "overall_p_value": overall,
        },
        coords={"part": [*parts, _NOISE], "parameter": list(parameters)},
        attrs={"false_alarm": FALSE_ALARM, "passed": int(overall > FALSE_ALARM), "records": len(fits) - 1},
    )

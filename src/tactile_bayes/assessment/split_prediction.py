"""Prediction of one part of a record by another: each sweep, pivot or half alone predicts the rest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from scipy import stats

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.assessment.linear_fit import LinearFit, Linearisation
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import points_of, predicted_points
from tactile_bayes.inference.result import best_draw
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.record import CHANNELS

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
    """Return the parts of a record that predict the rest, masks of shape (samples,) by name.

    They are each sweep segment and each pivot, of several, and both halves of the contacts of every segment.
    """
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

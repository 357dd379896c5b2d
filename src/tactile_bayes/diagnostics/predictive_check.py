"""The posterior predictive check of a record."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.checks import check_probability
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_groups import FEWEST_PREDICTIONS
from tactile_bayes.inference.experiment import segments_of
from tactile_bayes.inference.result import posterior_draws, record_of, refuse_no_contour, refuse_not_finite
from tactile_bayes.load_cell.blocks import are_blocks
from tactile_bayes.numerics.scatter import rough_noise
from tactile_bayes.record import carried_sweeps, rows_of_sweeps, travels_of
from tactile_bayes.rig.parameters import GROUPS

# Ways in which a record can differ from those that the posterior predicts.
DISCREPANCIES = ("runs", "neighbours", "largest", "loaded", "zero")
_FEWEST_SAMPLES = 5  # number of loaded, or of unloaded, samples in a channel below which they are not judged
# Standard deviations at which residuals are clipped for all discrepancies except `largest`: one outlier is no run.
_OUTLYING = 4.0
# Running-mean widths in the loaded part of a sweep: misfit of one shape by another changes sign 3 to 5 times.
_WINDOWS = 8
_EXCESS = 1.2  # root mean square of loaded residuals over the noise between neighbours from which they count as larger
LOST_BELOW = 20.0  # log-probability below the median beyond which a draw belongs to a lost walker and is left out
_TINY = 1e-300


class Residuals(NamedTuple):
    """Standardised residuals of one channel: readings less the predictive median, over the predictive spread."""

    values: Floats  # shape (1 + predictions, samples); row 0 is the record itself
    scale: Floats  # predictive spread in the record's units, shape (samples,)
    loaded: Flags  # true for samples that the posterior expects to carry a load, shape (samples,)
    sweeps: tuple[Index, ...]  # rows of each sweep, in the order of measurement

    @property
    def stretches(self) -> list[Index]:
        """Rows of the loaded part of each sweep in which there are enough to judge."""
        parts = [rows[self.loaded[rows]] for rows in self.sweeps]
        return [rows for rows in parts if rows.size >= _FEWEST_SAMPLES]


def predictive_check(posterior: xr.DataTree, *, false_alarm: float = 1e-3) -> xr.Dataset:
    """Check a record against those that the posterior predicts: see `tactile_bayes.check`."""
    check_probability("false_alarm", false_alarm, "give a probability between 0 and 1, such as 1e-3")
    residuals = residuals_of(posterior)
    channels = list(residuals)
    predictions = len(residuals[channels[0]].values) - 1
    if predictions < FEWEST_PREDICTIONS:
        raise InferenceError(
            f"the tree holds {predictions} predictions of the record, too few to compare it with: sample longer"
        )
    discrepancies = np.stack([_discrepancies(of_channel) for of_channel in residuals.values()], axis=1)
    p_values, scores = _p_values(discrepancies), _scores(discrepancies)
    finite = scores[np.isfinite(scores).all(axis=-1)]
    overall = float(_p_values(finite.max(axis=0))) if finite.size else np.nan
    record, predicted = record_of(posterior), posterior["posterior_predictive"].to_dataset()
    per_reading = np.sqrt(record["block_readings"].values) if are_blocks(record) else 1.0
    worst = [_worst_stretch(of_channel) for of_channel in residuals.values()]
    means = [float(np.mean((r.values[0] * r.scale)[rows])) for r, rows in zip(residuals.values(), worst, strict=True)]
    first, last = np.array([rows[[0, -1]] for rows in worst]).T
    angle, travel = record["drive_angle"].values, travels_of(record)
    ends = {"worst_from_travel": ("channel", travel[first]), "worst_to_travel": ("channel", travel[last])}
    false_alarm = max(false_alarm, 1.0 / (1.0 + predictions))
    failed = overall <= false_alarm
    not_checked = "" if failed else _not_checked(residuals, p_values)
    smooth = _smooth(residuals, p_values, false_alarm) if failed else {}
    described = GROUPS["discrepancy"][0] in posterior["posterior"].data_vars
    return xr.Dataset(
        {
            "p_value": (("discrepancy", "channel"), p_values),
            "score": (("discrepancy", "channel"), scores[..., 0]),
            "worst_sweep": ("channel", record["sweep"].values[first]),
            "worst_from": ("channel", angle[first], {"units": "rad"}),
            "worst_to": ("channel", angle[last], {"units": "rad"}),
            **(ends if carried_sweeps(record) else {}),
            "worst_residual": ("channel", means),
            "neighbour_noise": ("channel", [_neighbour_noise(each, per_reading) for each in residuals.values()]),
            "smooth": ("channel", [np.nan if described else smooth.get(name, np.nan) for name in channels]),
            "overall_p_value": np.nan if not_checked else overall,
        },
        coords={
            "discrepancy": list(DISCREPANCIES),
            "channel": channels,
            "unit": ("channel", [str(predicted[name].attrs.get("units", "1")) for name in channels]),
        },
        attrs={
            "passed": int(not failed and not not_checked),
            "not_checked": not_checked,
            "false_alarm": false_alarm,
            "predictions": predictions,
        },
    )


def residuals_of(posterior: xr.DataTree) -> dict[str, Residuals]:
    """Return the residuals of the record and of every prediction, by channel."""
    refuse_no_contour(posterior, "posterior_predictive", "observed_data", "constant_data", "sample_stats")
    posterior_draws(posterior)
    predicted, record = posterior["posterior_predictive"].to_dataset(), record_of(posterior)
    sweeps, loaded = tuple(rows_of_sweeps(record["sweep"].values)), _loaded(posterior, record)
    log_probability = posterior["sample_stats"].to_dataset().lp
    found = (log_probability.sel(draw=predicted.draw) > float(log_probability.median()) - LOST_BELOW).values.ravel()
    residuals = {}
    refuse_not_finite("lp, the log-probability,", log_probability)
    for name, values in predicted.items():
        refuse_not_finite(f"the predicted {name}", values)
        of_draws = values.values.reshape(-1, loaded.size)[found]
        low, centre, high = np.quantile(of_draws, [0.025, 0.5, 0.975], axis=0)
        # At snap-off some draws are loaded and others not: such a sample must not outweigh all others.
        scale = (high - low) / 3.92
        scale = np.maximum(scale, float(np.median(scale)) or float(np.std(of_draws - centre)) or 1.0)
        rows = np.concatenate([record[name].values[None], of_draws])
        residuals[str(name)] = Residuals((rows - centre) / scale, scale, loaded, sweeps)
    return residuals


def _loaded(posterior: xr.DataTree, record: xr.Dataset) -> Flags:
    """Return True for samples between first contact and snap-off, at the posterior medians of these events."""
    events = posterior["events"].to_dataset().median(("chain", "draw"))
    segments = segments_of(posterior, record)
    along, place = segments.ways_of_samples, "travel" if segments.has_history else "drive_angle"
    loaded = np.zeros(along.size, dtype=bool)
    ends = np.sort(np.stack([events[f"first_{place}"].values, events[f"snap_off_{place}"].values]), axis=0)
    for own, low, high in zip(segments.samples, *ends, strict=True):
        loaded[own] = (along[own] >= low) & (along[own] <= high)
    return loaded


def _discrepancies(residuals: Residuals) -> Floats:
    """Return the `DISCREPANCIES` of every row, shape (5, rows); NaN where there are too few samples."""
    cut_off = np.clip(residuals.values, -_OUTLYING, _OUTLYING)
    squares, loaded = cut_off**2, residuals.loaded
    out = np.full((len(DISCREPANCIES), len(cut_off)), np.nan)
    out[2] = _ratio(np.abs(residuals.values).max(axis=1) ** 2, squares.mean(axis=1))
    enough, unloaded_enough = (np.count_nonzero(kind) >= _FEWEST_SAMPLES for kind in (loaded, ~loaded))
    if enough:
        energy = squares[:, loaded].mean(axis=1)
        if parts := residuals.stretches:
            steps = np.concatenate([np.diff(cut_off[:, rows], axis=1) for rows in parts], axis=1)
            means = np.concatenate([_running_mean(cut_off[:, rows]) for rows in parts], axis=1)
            rough = (steps**2).mean(axis=1)
            out[0], out[1] = _ratio((means**2).mean(axis=1), rough), _ratio(energy, rough)
    if unloaded_enough:
        quiet = squares[:, ~loaded].mean(axis=1)
        out[4] = np.abs(cut_off[:, ~loaded].mean(axis=1)) / np.sqrt(np.maximum(quiet, _TINY))
        if enough:
            out[3] = _ratio(energy, quiet)
    return out


def _ratio(above: Floats, below: Floats) -> Floats:
    """Return the logarithm of a ratio, whose distribution over records has no long tail."""
    return np.asarray(np.log(np.maximum(above, _TINY)) - np.log(np.maximum(below, _TINY)))


def _not_checked(residuals: dict[str, Residuals], p_values: Floats) -> str:
    """Return why no loaded samples were judged; "" if some were."""
    of_loaded = [DISCREPANCIES.index(name) for name in ("runs", "neighbours", "loaded")]
    if np.isfinite(p_values[of_loaded]).any():
        return ""
    loaded = max(int(np.count_nonzero(of_channel.loaded)) for of_channel in residuals.values())
    samples = "sample is" if loaded == 1 else "samples are"
    return f"{loaded} {samples} loaded, too few to judge: it takes {_FEWEST_SAMPLES} in a sweep"


def _smooth(residuals: dict[str, Residuals], p_values: Floats, false_alarm: float) -> dict[str, float]:
    """Return channels whose residuals are smooth and exceed the noise, with loaded residuals over that noise."""
    smooth, of_runs = {}, [DISCREPANCIES.index(name) for name in ("runs", "neighbours")]
    for (name, of_channel), p_value in zip(residuals.items(), p_values.T, strict=True):
        noise, loaded = _neighbour_noise(of_channel), of_channel.loaded
        if not np.any(p_value[of_runs] <= false_alarm) or not loaded.any() or not noise > 0.0:
            continue
        size = float(np.sqrt(np.mean(np.square(of_channel.values[0] * of_channel.scale)[loaded])))
        if size > _EXCESS * noise:
            smooth[name] = size / noise
    return smooth


def _width(samples: int) -> int:
    return max(2, samples // _WINDOWS)


def _running_mean(values: Floats) -> Floats:
    width = _width(values.shape[1])
    sums = np.cumsum(values, axis=1)
    sums[:, width:] = sums[:, width:] - sums[:, :-width]
    return np.asarray(sums[:, width - 1 :] / width)


def _p_values(discrepancies: Floats) -> Floats:
    """Return the share of entries at least as large as the first, over the last axis; NaN where the first is NaN."""
    shares = np.mean(discrepancies >= discrepancies[..., :1], axis=-1)
    return np.where(np.isnan(discrepancies[..., 0]), np.nan, shares)


def _scores(discrepancies: Floats) -> Floats:
    """Return discrepancies scaled so that the median over predictions is 0 and their 95 % quantile 1."""
    middle, high = np.quantile(discrepancies[..., 1:], [0.5, 0.95], axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((discrepancies - middle[..., None]) / (high - middle)[..., None])


def _worst_stretch(residuals: Residuals) -> Index:
    """Return the stretch of loaded samples of the real record whose mean residual is furthest from zero."""
    parts = residuals.stretches or list(residuals.sweeps)
    real = np.clip(residuals.values[:1], -_OUTLYING, _OUTLYING)
    best, found = -1.0, parts[0]
    for rows in parts:
        width = min(_width(rows.size), rows.size)
        if width < rows.size:
            means = np.abs(_running_mean(real[:, rows])[0]) * np.sqrt(width)
            start = int(np.argmax(means))
            if means[start] > best:
                best, found = float(means[start]), rows[start : start + width]
    return found


def _neighbour_noise(residuals: Residuals, weight: Floats | float = 1.0) -> float:
    """Return the real record's white noise, of the samples times their weight, without jumps (`rough_noise`)."""
    return rough_noise(residuals.values[0] * residuals.scale * weight)

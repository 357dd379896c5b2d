"""The check of a result: what is wrong with it, and what to do."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_optional, check_probability, refused
from tactile_bayes.contours.families import family_named
from tactile_bayes.diagnostics.findings import (
    NOISE_FACTOR,
    OFF_ZERO,
    Finding,
    contradiction,
    likely_causes,
    moved_zero,
    of_sweeps,
    quantity,
    zero_off,
)
from tactile_bayes.diagnostics.predictive_check import Residuals, predictive_check, residuals_of
from tactile_bayes.diagnostics.reach_edge import cut_off_parameters
from tactile_bayes.diagnostics.units_and_signs import unit_and_sign_findings
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.misfit import GAUGE, is_inferred, what_to_try
from tactile_bayes.inference.result import is_streamed, known_of, posterior_draws, record_of, refuse_no_contour
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.zero_load import quiet_zero_load
from tactile_bayes.reconstruction import AXIAL_ALARM, contact_sides, drive_histories
from tactile_bayes.record import CHANNELS, carried_sweeps
from tactile_bayes.record.origin import column_entry
from tactile_bayes.record.rig_entry import rig_entries, rig_entry
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.stated import memory_in, sensor_values
from tactile_bayes.tasks.documents import read_json
from tactile_bayes.uncertainty.budget import uncertainty_budget

HOLDS, NOT = "holds", "do not rely on it"  # conclusions of `trust`; another one is a reservation
_NOISES = ("noise_scale", "moment_noise", "force_noise", *GROUPS["discrepancy"])
CONTRADICTION = 1e-4  # probability of the misfit of single samples below which it is reported
_FEWEST_PRIOR_DRAWS = 500
# Distance of the posterior median beyond the prior's last draw from which it is reported, over the distance from the 5
# % quantile of the prior's draws to the last: some four standard deviations of a normal prior; a prior that is largest
# at its end has nothing beyond it.
_BEYOND = 0.5
# Pull of a normal prior on a zero, in standard deviations of the posterior, below which it is no matter.
_PULL = 0.5
_ZEROS = GROUPS["bias"]
# Width of the posterior over that of the prior above which the record is reported as uninformative.
_PRIOR_DOMINATED = 0.7
_SMALL = 0.05  # probability of a record below which a reader may take agreement for disagreement
_NARROWER = 0.9  # share of the band's half width below which it is said to be narrower
# Columns whose zero a parameter is.
_COLUMN_OF_ZERO = dict(zip((*_ZEROS, "drive_angle_offset"), (*CHANNELS, "drive_angle"), strict=True))
_USUAL = 0.95  # probability of the band if a posterior does not state one
_CAUSES = {
    "runs": "whose residuals do not scatter about zero but stay on one side",
    "neighbours": "whose residuals do not scatter about zero but stay on one side",
    "largest": "of which single samples are far off",
    "loaded": "whose loaded samples are further from the prediction than its unloaded ones",
    "zero": "whose unloaded samples are off zero",
}


@dataclass(frozen=True, eq=False)
class Check:
    """Result of `check`.

    Attributes
    ----------
    messages : tuple of Finding
        What is wrong, the most serious first, or that all is well: sentences, each with its `kind` and `details`.
    is_well : bool
        True if nothing is wrong, and the record was compared with what the posterior predicts.
    predictive : xr.Dataset or None
        That comparison, over "discrepancy" and "channel" (those that were measured); None if the tree holds fewer than
        100 predictions. p_value: share of records, predictions and the real one, that are at least as discrepant as the
        real one; NaN where there are too few samples. score: discrepancy above its median over predictions, over the
        same of their 95 % quantile; 1 is unusual, some tens are a visible misfit. overall_p_value: share of records of
        which the largest score is at least that of the real one; NaN if the check was not made.

        Over "channel": worst_sweep, worst_from and worst_to [rad], the stretch whose mean residual is largest, in
        standard errors (if the drive carries the base in some sweep, also worst_from_travel and worst_to_travel);
        worst_residual, that mean in the record's units; neighbour_noise, the standard deviation of white noise by
        second differences of neighbouring residuals, in the record's units; smooth, loaded residuals over that noise,
        if the check fails because they are smooth and larger, and no discrepancy is inferred, else NaN.

        Attributes: `passed` (0 or 1; 0 also if the check was not made), `not_checked`, why it was not made (there are
        too few loaded samples), else empty, `false_alarm` (the probability in effect), `predictions` (their number).
    knows_misfit : bool
        False if the misfit of single samples says nothing, since a reading depends on those before it (lag, play).
    budget : xr.Dataset or None
        From `uncertainty_budget`, if all is well and there is a band.
    """

    messages: tuple[Finding, ...]
    is_well: bool
    predictive: xr.Dataset | None
    knows_misfit: bool = True
    budget: xr.Dataset | None = None


class _Result(NamedTuple):
    """A posterior, and what is read of it."""

    posterior: xr.DataTree
    draws: xr.Dataset
    record: xr.Dataset
    cell: LoadCell
    family: str
    inferred: list[str]  # unknowns of the rig
    memory: set[str]  # kinds of memory that are stated, known or inferred

    @classmethod
    def of(cls, posterior: xr.DataTree) -> _Result:
        refuse_no_contour(posterior, "posterior")
        draws, record, attrs = posterior_draws(posterior), record_of(posterior), posterior.attrs
        cell, inferred = (
            LoadCell.from_record(record) or LoadCell(),
            read_json(attrs.get("nuisances", "[]"), "nuisances"),
        )
        memory = memory_in(sensor_values(cell), known_of(attrs), dict.fromkeys(inferred, True))
        return cls(posterior, draws, record, cell, str(attrs.get("family", GAUGE)), inferred, memory)


def check(
    posterior: xr.DataTree,
    contacts: xr.Dataset | None = None,
    trust: xr.Dataset | None = None,
    *,
    false_alarm: float = 1e-3,
) -> Check:
    """Check a posterior of a contour or a rig: what is wrong with it, or with its record.

    The noise that is inferred beside the contour absorbs misfit from any cause, so that the size of the residuals is
    uninformative. Their pattern is not: misfit is smooth in the drive angle and absent from unloaded samples.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`, or the `calibration.posterior` of a rig from `calibrate_rig`.
    contacts : xr.Dataset, optional
        From `reconstruct` by method="constrained", whose misfits show whether the loads of a sample agree.
    trust : xr.Dataset, optional
        From `tactile_bayes.trust` for this posterior.
    false_alarm : float
        Largest probability that the record of a right model is found unlike its predictions, in (0, 1); all
        discrepancies and channels together. With fewer than 1/false_alarm − 1 predictions it is 1/(1 + predictions).

    Returns
    -------
    Check
        Its messages report, in this order: loads that such a rod cannot have; a zero that is off and not inferred, or
        that moved; a record unlike the predictions, or misfit in its noise that these hide; reasons not to rely on the
        band (`trust`); ensembles that have not converged; noise twice as large as stated, or half; loads of a sample
        that contradict one another; unknowns of the rig that are nearly impossible under their prior; parameters that
        are cut off where the model has no path of the rod; smooth residuals; a check that was not made. The last, which
        are no faults, say that the prior sets the gap, which parameters the record hardly determines, and, where all is
        well, what sets the width of the band.

    Raises
    ------
    InferenceError
        If the tree is not such a result with its record and predictions, or has numbers that are not finite.
    ParameterError
        If `false_alarm` is not in (0, 1), or an argument is of another kind.

    Notes
    -----
    Residuals are readings less the median of the predicted ones, over half the width of their central 95 % interval
    (over 1.96), for the real record and for all predicted ones alike; so drift, correlated noise, outliers and
    resolution need no treatment of their own. Draws of lost walkers are left out. In each channel, with residuals
    clipped at 4 except for `largest`:

    - runs: mean square of the running mean over an eighth of the loaded part of a sweep, over that of the differences
      of neighbours;
    - neighbours: mean square of loaded residuals, over the same (von Neumann's ratio);
    - largest: largest residual over the root mean square;
    - loaded: mean square of loaded samples over that of unloaded ones;
    - zero: mean of the unloaded samples over their root mean square.

    The p-values are those of Gelman, Meng and Stern 1996 (Statistica Sinica 6, 733) with residuals about one centre.
    The posterior is inferred from the same record, so they are conservative: under a true model they are rarely small.
    A record that passes is not proven right: misfit below the noise over √(samples in a stretch) remains undetected.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, SamplerSettings, infer_contour, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.02, moment_noise=0.008)
    >>> measured = cell.measure(scan(paper_profile("III", q=0.5), drive_step=0.03).record, rng=1)
    >>> quick = SamplerSettings(ensembles=2, walkers=32, max_steps=50)
    >>> found = check(infer_contour(measured, rig=Rig(load_cell=cell, unknown="nothing"), rng=1, settings=quick))
    >>> print(found.messages[0].split(":")[0], found.messages[0].kind, bool(found.predictive.passed), sep=" | ")
    The family parabola and the rig as assumed do not describe the record | not described | False
    """
    check_probability("false_alarm", false_alarm, "give a probability between 0 and 1, such as 1e-3")
    result, attrs = _Result.of(posterior), posterior.attrs
    check_optional("contacts", contacts, xr.Dataset, "give what reconstruct returned")
    if trust is not None and "conclusion" not in getattr(trust, "attrs", {}):
        raise refused("trust", trust, "give what trust returned, or None")
    conclusion = HOLDS if trust is None else trust.attrs["conclusion"]
    try:
        predictive = predictive_check(posterior, false_alarm=false_alarm)
        not_checked = str(predictive.attrs["not_checked"])
    except InferenceError as error:  # there are too few draws
        predictive, not_checked = None, str(error)
    residuals = residuals_of(posterior)  # after the check has released its own: those of a long record are large
    unloaded = quiet_zero_load(result.record)
    against = [*unit_and_sign_findings(result.record), *doubtful_sides(attrs)]
    against += [*_off_zero(result, unloaded, residuals), *_moved_zero(result, unloaded)]
    noisier = 1.0 if predictive is None else _neighbours_over_stated(result.cell, predictive)
    failed = None if predictive is None or predictive.attrs["passed"] or not_checked else predictive
    noise = _noise(result, noisier, likely_causes(posterior) if failed is None else "")
    if failed is not None:
        against.append(_not_described(result, failed))
    elif noise and noise[0].kind == "misfit as noise":  # of draws that lie far apart
        against.append(noise.pop())
    if trust is not None and conclusion == NOT:
        against.append(Finding("not reliable", summary=trust.attrs["summary"]))
    if not attrs["converged"]:
        against.append(Finding("not converged", message=attrs["message"].replace("not converged", "NOT CONVERGED", 1)))
    beyond = _beyond_prior(result)
    against += [*noise, *_contradictions(result, contacts, noisier)]
    against += [*_beyond_findings(beyond, result), *_cut_off(result)]
    if predictive is not None:
        against += _smooth(predictive)
    drawn = "particles no longer depend on where they began" if is_streamed(attrs) else "ensembles agree"
    if not_checked and attrs["converged"]:
        but = "" if against else f"The {drawn}, but this does not say that the result is right. "
        against.append(Finding("not checked", but=but, reason=not_checked))
    is_well = not against
    if predictive is not None and is_well:
        against.append(Finding("all is well", drawn=drawn, p_value=_p_value(predictive)))
    if trust is not None and conclusion not in (NOT, HOLDS):
        against.append(Finding("reservation", summary=trust.attrs["summary"]))
    against += [*_prior_dominated(result, known=beyond), *_going_back(result)]
    has_band = is_well and result.family != GAUGE and "events" in posterior.children
    budget = budget_if_any(posterior) if has_band else None
    if budget is not None:
        against.append(_width_of_band(budget))
    return Check(tuple(against), is_well, predictive, not result.memory, budget)


def probability_of(posterior: xr.DataTree) -> float:
    """Return the probability of bands and intervals of a run."""
    return float(posterior.attrs.get("probability", _USUAL))


def budget_if_any(posterior: xr.DataTree) -> xr.Dataset | None:
    """Return what sets the width of the band, or None where there is none."""
    try:
        return uncertainty_budget(posterior, probability_of(posterior))
    except InferenceError:  # the rod touches none of its contours
        return None


def _p_value(predictive: xr.Dataset) -> str:
    """Return the probability of the record as text; beside a small one, that below which it would disagree."""
    p_value, alarm = float(predictive.overall_p_value), float(predictive.attrs["false_alarm"])
    return f"{p_value:.2g}" + f", still above the {alarm:.2g} of disagreement" * (p_value < _SMALL)


def _width_of_band(budget: xr.Dataset) -> Finding:
    """Report what sets the width of the contour's band."""
    unit, known = str(budget.half_width.attrs["units"]), ""
    names = ("half_width", "half_width_if_all_known", "half_width_of_shape")
    width, alone, shape = (float(budget[name]) for name in names)
    if alone < _NARROWER * width:
        least = budget.isel(unknown=int(np.argmin(budget.half_width_if_known.values)))
        narrowed = float(least.half_width_if_known)
        one = f"with {least.unknown.item()} known it would be ± {quantity(narrowed, unit)}, "
        known = f"; {one * (narrowed < _NARROWER * width)}with all of the rig, as by a gauge, ± {quantity(alone, unit)}"
    said = {"width": quantity(width, unit), "shape": quantity(shape, unit), "known": known}
    return Finding("width of the band", share=100.0 * float(budget.attrs["probability"]), **said)


def _going_back(result: _Result) -> list[Finding]:
    """Report sweeps about a pivot that go back in contact, where friction acts the other way, without a way forth.

    If all seem to, it is the sign of the moment.
    """
    record = result.record
    if not (is_inferred("friction", result.inferred) or result.posterior.attrs.get("friction", 0.0)):
        return []
    backward = contact_sides(record) < 0.0
    back = backward != (record["direction"].values == "backward")
    if not back.any() or back.all():
        return []
    history = drive_histories(record, backward, result.cell, rubs=True)
    sweeps = sorted(set(record["sweep"].values[back & (history == 0)].tolist()))
    said = {"sweeps": of_sweeps(sweeps, "go", past="went back"), "entry": rig_entry("friction", 0, "unknown")}
    return [Finding("no way forth", **said)] * bool(sweeps)


def doubtful_sides(attrs: Mapping[Any, Any]) -> list[Finding]:
    """Report sweeps whose side of contact is in doubt, from attributes of a posterior or of contacts."""
    if "doubtful_sides" not in attrs:
        return []
    sides = read_json(attrs["doubtful_sides"], "doubtful_sides")
    taken = ", ".join(f"sweep {sweep} as a {side} one" for sweep, side in sides.items())
    probability = attrs.get("sides_probability")
    sure = "" if probability is None else f", with probability {probability:.2g}"
    return [Finding("doubtful side", taken=taken, sure=sure)]


def _off_zero(result: _Result, found: xr.Dataset, residuals: dict[str, Residuals]) -> list[Finding]:
    """Report channels whose unloaded readings differ from what the posterior expects, though no zero is inferred."""
    record, off, entries = result.record, {}, {}
    inferred = {column for zero, column in _COLUMN_OF_ZERO.items() if zero in result.inferred}
    for name, of_channel in residuals.items():
        if name in inferred:
            continue  # a wrong model moves it
        unloaded = found.unloaded.values & ~of_channel.loaded
        uncertainty = float(found.bias_uncertainty.sel(channel=name))
        if np.count_nonzero(unloaded) < 3 or not math.isfinite(uncertainty):
            continue
        means = (of_channel.values * of_channel.scale)[:, unloaded].mean(axis=1)
        error = math.hypot(uncertainty, float(np.std(means[1:])))
        if abs(means[0]) > OFF_ZERO * error > 0.0:
            off[name] = float(means[0]), error, str(record[name].attrs.get("units", "1"))
            entries[name] = column_entry(record[name], added=-float(means[0]))
    how = f" as they are read ({rig_entries(entries)})" if all(entries.values()) else ""
    return zero_off(off, f"Take it out of the readings{how}, or give LoadCell.from_zero_load(record).")


def _moved_zero(result: _Result, found: xr.Dataset) -> list[Finding]:
    """Report channels whose zero moved although neither drift nor play is stated or inferred."""
    if result.cell.drift is not None or "play" in result.memory:
        return []
    p_values = dict(zip(found.channel.values.tolist(), found.same_bias_p_value.values.tolist(), strict=True))
    inferred = {name.removesuffix("_drift") for name in result.inferred}
    known = {name for name in CHANNELS if name.removeprefix("holding_") in inferred}
    return moved_zero(p_values, found.attrs["false_alarm"], known)


def _not_described(result: _Result, check: xr.Dataset) -> Finding:
    place = check.score.fillna(-np.inf).argmax(("discrepancy", "channel"))
    channel, cause = (str(check[dim].values[int(place[dim])]) for dim in ("channel", "discrepancy"))
    worst, predictions = check.sel(channel=channel), check.attrs["predictions"]
    residual = float(worst.worst_residual)
    # The share of predictions alone: the record itself is no prediction.
    like = round(float(check.overall_p_value) * (predictions + 1)) - 1
    friction = result.posterior.attrs.get("friction", 0.0)
    return Finding(
        "not described",
        family="gauge" if result.family == GAUGE else f"family {result.family}",
        like=like or "none",
        predictions=predictions,
        are="are" if like > 1 else "is",
        channel=channel,
        cause=_CAUSES[cause],
        sweep=int(worst.worst_sweep),
        stretch=_stretch(result.record, worst),
        residual="+" * (residual > 0.0) + quantity(residual, str(worst.unit.values)),
        result="rig" if result.family == GAUGE else "contour",
        advice=likely_causes(result.posterior) or what_to_try([result.family], result.inferred, friction=friction),
    )


def _stretch(record: xr.Dataset, worst: xr.Dataset) -> str:
    """Return drive angles, or travels of a base that is carried, from the beginning to the end of a stretch."""
    if int(worst.worst_sweep) not in carried_sweeps(record):
        return f"{math.degrees(worst.worst_from):.1f}° to {math.degrees(worst.worst_to):.1f}°"
    unit = str(record["base_x"].attrs.get("units", "1"))
    begin, end = (quantity(float(worst[f"worst_{name}_travel"]), unit) for name in ("from", "to"))
    return f"{begin} to {end}{' L' * (unit == '1')} of travel"


def _neighbours_over_stated(cell: LoadCell, check: xr.Dataset) -> float:
    """Return the scatter of neighbouring samples over the stated noise, the median of the channels; 1 if unknown.

    No more of the misfit than that can be noise.
    """
    stated = dict(zip(CHANNELS, np.hypot([*cell.standard_deviations.values()], cell.resolution / 12**0.5), strict=True))
    found = check.neighbour_noise
    ratios = [float(found.sel(channel=n)) / stated[n] for n in check.channel.values if 0.0 < stated[n] < math.inf]
    return float(np.median(ratios)) if ratios else 1.0


def _noise(result: _Result, noisier: float, causes: str) -> list[Finding]:
    if "noise_scale" not in result.draws:
        return []
    factor = float(result.draws["noise_scale"].median())
    if 1.0 / NOISE_FACTOR <= factor <= NOISE_FACTOR:
        return []
    if noisier < 0.5 * factor and factor > NOISE_FACTOR:
        alike = f"{noisier:.2g} times as much as stated" if abs(math.log(noisier)) > 0.2 else "as stated"
        return [Finding("misfit as noise", factor=f"{factor:.3g}", alike=alike, causes=f" {causes}".rstrip())]
    return [Finding("larger noise", factor=f"{factor:.3g}")]


def _contradictions(result: _Result, contacts: xr.Dataset | None, noisier: float) -> list[Finding]:
    """Report loads of single samples that contradict one another, under normal noise; outliers enlarge misfits."""
    if contacts is None or math.isfinite(result.cell.degrees_of_freedom) or result.memory:
        return []  # Step 2 knows of no memory
    chance, score = (float(contacts.attrs.get(name, math.nan)) for name in ("misfit_probability", "axial_score"))
    if not chance < CONTRADICTION or noisier > 0.75 * NOISE_FACTOR:  # more noise than stated explains it
        return []
    dragging = ""
    if score < -AXIAL_ALARM:
        friction = f"friction: infer it ({rig_entry('friction', 'default', 'unknown')})"
        if is_inferred("friction", result.inferred):
            friction = "more friction than was inferred"
        off = f"the force along the rod is too small by {-score:.0f} standard errors"
        dragging = f" In tangential contact {off}, as with {friction}."
    return [contradiction(chance, dragging)]


def _beyond_prior(result: _Result) -> dict[str, str]:
    """Return parameters whose posterior lies where the prior has almost no mass, each with its values as text.

    A zero that was not tared is ordinary: it is left out where the prior moves it little.
    """
    prior, said = result.posterior["prior"].to_dataset(), {}
    for name, values in result.draws.data_vars.items():
        believed = prior[name].values.ravel()
        if name in _NOISES or believed.size < _FEWEST_PRIOR_DRAWS:
            continue
        if name in _ZEROS and _pull(values.values, believed) < _PULL:
            continue
        median = float(values.median())
        least, low, high, most = np.quantile(believed, [0.0, 0.05, 0.95, 1.0])
        if not least - _BEYOND * (low - least) <= median <= most + _BEYOND * (most - high):
            unit = str(values.attrs.get("units", "1"))
            middle, first, last = (quantity(value, unit) for value in (median, least, most))
            said[str(name)] = f"{name} = {middle} (prior: {first} to {last})"
    return said


def _pull(values: Floats, believed: Floats) -> float:
    """Return how far a normal prior moves a parameter, in standard deviations of its posterior."""
    away = abs(float(np.median(values)) - float(np.median(believed)))
    return 2.0 * away * _width(values) / max(_width(believed), np.finfo(float).tiny) ** 2


def _beyond_findings(beyond: Mapping[str, str], result: _Result) -> list[Finding]:
    zeros = {
        column: column_entry(result.record[column], added=-float(result.draws[name].median()))
        for name, column in _COLUMN_OF_ZERO.items()
        if name in beyond
    }
    is_known = bool(zeros) and all(zeros.values())
    subtract = f"subtract a zero as its column is read ({rig_entries(zeros)}), " if is_known else ""
    return [Finding("beyond the prior", values=", ".join(beyond.values()), subtract=subtract)] * bool(beyond)


def _cut_off(result: _Result) -> list[Finding]:
    """Report parameters that are cut off where the model has no equilibria."""
    quantile, ends = {"above": 1.0, "below": 0.0}, []
    for name, end in cut_off_parameters(result.posterior).items():
        values = result.draws[name]
        last = quantity(float(values.quantile(quantile[end])), values.attrs.get("units", "1"))
        ends.append(f"{name} ({end} {last})")
    return [Finding("cut-off posterior", ends=", ".join(ends))] * bool(ends)


def _smooth(predictive: xr.Dataset) -> list[Finding]:
    """Suggest a discrepancy where residuals are smooth and larger than the noise."""
    smooth = predictive["smooth"].dropna("channel")
    named = [f"{name} ({ratio:.2g} times)" for name, ratio in zip(smooth.channel.values, smooth.values, strict=True)]
    entry = rig_entry("discrepancy", "default", "unknown")
    return [Finding("smooth misfit", channels=" and ".join(named), entry=entry)] * bool(named)


def _prior_dominated(result: _Result, known: Container[str]) -> list[Finding]:
    draws, prior = result.draws, result.posterior["prior"].to_dataset()
    asked = {*map(str, draws.data_vars)}
    if result.family != GAUGE:
        asked = {*family_named(result.family).parameters} - {*family_named(result.family).roughness}
    names = [str(name) for name in draws.data_vars if name in asked and name not in known and name not in _NOISES]
    names = [n for n in names if _width(draws[n].values) > _PRIOR_DOMINATED * _width(prior[n].values) > 0.0]
    return [Finding("set by the prior", names=", ".join(names))] * bool(names)


def _width(values: Floats) -> float:
    """Return the width of the central 68 % interval, two standard deviations of a normal distribution."""
    low, high = np.quantile(values, [0.16, 0.84])
    return float(high - low)

"""Verdicts: messages on what is wrong with a result, and what to do."""

from __future__ import annotations

import math
import warnings
from collections.abc import Container, Mapping
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_optional, refused
from tactile_bayes.contours.families import family_named
from tactile_bayes.diagnostics.reach_edge import cut_off_parameters
from tactile_bayes.diagnostics.record_check import Residuals, check_record, residuals_of
from tactile_bayes.diagnostics.units_and_signs import check_units_and_signs
from tactile_bayes.errors import DriftWarning, InferenceError
from tactile_bayes.inference.misfit import CHECK_RIG, GAUGE, is_inferred, what_to_try
from tactile_bayes.inference.result import is_streamed, posterior_draws, record_of, refuse_no_contour
from tactile_bayes.load_cell import LoadCell, zero_load
from tactile_bayes.reconstruction import AXIAL_ALARM, contact_sides, drive_histories
from tactile_bayes.record import CHANNELS, carried_sweeps
from tactile_bayes.record.origin import column_entry
from tactile_bayes.record.rig_entry import rig_entries, rig_entry
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.tasks.documents import read_json

_HOLDS, _NOT = "holds", "do not rely on it"  # conclusions of `trust`; another one is a reservation
_NOISES = ("noise_scale", "moment_noise", "force_noise", *GROUPS["discrepancy"])

NOISE_FACTOR = 2.0  # ratio of found to stated noise beyond which it is reported: data sheets are no more accurate
OFF_ZERO = 5.0  # standard errors by which a zero must differ from the stated one to be reported
CONTRADICTION = 1e-4  # probability of the misfit of single samples below which it is reported
_FEWEST_PRIOR_DRAWS = 500

# Distance of the posterior median beyond the prior's last draw from which it is reported, over the distance from the 5
# % quantile of the prior's draws to the last: some four standard deviations of a normal prior; a prior that is largest
# at its end has nothing beyond it.
_BEYOND = 0.5
# Width of the posterior over that of the prior above which the record is reported as uninformative.
_PRIOR_DOMINATED = 0.7
# Columns whose zero a parameter is.
_COLUMN_OF_ZERO = {
    "moment_bias": "holding_moment",
    "force_x_bias": "force_x",
    "force_y_bias": "force_y",
    "drive_angle_offset": "drive_angle",
}
_CAUSES = {
    "runs": "whose residuals do not scatter about zero but stay on one side",
    "neighbours": "whose residuals do not scatter about zero but stay on one side",
    "largest": "of which single samples are far off",
    "loaded": "whose loaded samples are further from the prediction than its unloaded ones",
    "zero": "whose unloaded samples are off zero",
}


def verdicts(
    posterior: xr.DataTree, contacts: xr.Dataset | None = None, trust: xr.Dataset | None = None
) -> tuple[str, ...]:
    """Judge a posterior of a contour or a rig: what is wrong, the most serious first, or that all is well.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`, or the `calibration.posterior` of a rig from `calibrate_rig`.
    contacts : xr.Dataset, optional
        From `reconstruct` by method="constrained", whose misfits show whether the loads of a sample agree.
    trust : xr.Dataset, optional
        From `tactile_bayes.trust` for this posterior.

    Returns
    -------
    tuple of str
        One or more sentences, of which the first says that all is well only if the record was checked. They report:
        loads that such a rod cannot have (`check_units_and_signs`); a zero that is off, or that moved; a record unlike
        the predictions of the posterior (`check_record`); reasons not to rely on the band (`trust`); ensembles that
        have not converged; noise twice as large as stated, or half; loads of a sample that contradict one another;
        unknowns of the rig that are nearly impossible under their prior; smooth residuals, which a discrepancy can
        describe; parameters that are cut off where the model has no path of the rod; a check that was not made, with
        the reason. The last, which are no faults, say that the prior sets the gap, and name parameters that the record
        hardly determines.

    Raises
    ------
    InferenceError
        If the tree is not such a result with its record and predictions, or has numbers that are not finite.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, SamplerSettings, infer_contour, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.02, moment_noise=0.008)
    >>> measured = cell.measure(scan(paper_profile("III", q=0.5), drive_step=0.03).record, rng=1)
    >>> quick = SamplerSettings(ensembles=2, walkers=32, max_steps=50)
    >>> found = verdicts(infer_contour(measured, rig=Rig(load_cell=cell, unknown="nothing"), rng=1, settings=quick))
    >>> print(found[0].split(":")[0])
    The family parabola and the rig as assumed do not describe the record
    """
    refuse_no_contour(posterior, "posterior")
    posterior_draws(posterior)
    record = record_of(posterior)
    check_optional("contacts", contacts, xr.Dataset, "give what reconstruct returned")
    if trust is not None and "conclusion" not in getattr(trust, "attrs", {}):
        raise refused("trust", trust, "give what trust returned, or None")
    try:
        check = check_record(posterior)
        not_checked = str(check.attrs["not_checked"])
    except InferenceError as error:  # there are too few draws
        check, not_checked = None, str(error)
    residuals = residuals_of(posterior)  # after the check has released its own: those of a long record are large
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DriftWarning)  # a message reports it
        unloaded = zero_load(record)
    against = [
        *check_units_and_signs(record),
        *doubtful_sides(posterior.attrs),
        *_off_zero(record, unloaded, residuals),
        *_moved_zero(posterior, record, unloaded),
    ]
    if check is not None and not check.attrs["passed"] and not not_checked:
        against.append(_not_described(posterior, check))
    if trust is not None and trust.attrs["conclusion"] == _NOT:
        against.append(str(trust.attrs["summary"]))
    if not posterior.attrs["converged"]:
        against.append(posterior.attrs["message"].replace("not converged", "NOT CONVERGED", 1) + ".")
    noisier = 1.0 if check is None else _neighbours_over_stated(record, check)
    beyond = _beyond_prior(posterior)
    against += [*_noise(posterior, noisier), *_contradictions(posterior, record, contacts, noisier)]
    against += _beyond_message(beyond, record, posterior)
    against += _cut_off_message(posterior)
    if check is not None and check.attrs["suggestion"]:
        against.append(check.attrs["suggestion"])
    drawn = "particles no longer depend on where they began" if is_streamed(posterior.attrs) else "ensembles agree"
    if not_checked and posterior.attrs["converged"]:
        but = "" if against else f"The {drawn}, but this does not say that the result is right. "
        against.append(f"{but}The record was NOT CHECKED against the predictions of the posterior: {not_checked}.")
    if check is not None and not against:
        p_value = float(check.overall_p_value)
        against.append(f"All is well: the {drawn}, and the record agrees with their predictions (p = {p_value:.2g}).")
    doubts = [] if trust is None or trust.attrs["conclusion"] in (_NOT, _HOLDS) else [str(trust.attrs["summary"])]
    return (*against, *doubts, *_prior_dominated(posterior, known=beyond), *_going_back(posterior, record))


def _going_back(posterior: xr.DataTree, record: xr.Dataset) -> list[str]:
    """Report sweeps about a pivot that go back in contact, where friction acts the other way, without a way forth.

    If all seem to, it is the sign of the moment.
    """
    if not (is_inferred("friction", _inferred(posterior)) or posterior.attrs.get("friction", 0.0)):
        return []
    backward = contact_sides(record) < 0.0
    back = backward != (record["direction"].values == "backward")
    if not back.any() or back.all():
        return []
    history = drive_histories(record, backward, LoadCell.from_record(record) or LoadCell(), rubs=True)
    sweeps = sorted(set(record["sweep"].values[back & (history == 0)].tolist()))
    if not sweeps:
        return []
    named = f"{'Sweeps' if len(sweeps) > 1 else 'Sweep'} {', '.join(map(str, sweeps))}"
    return [
        f"{named} went back in contact after no sweep on that side, so that friction is taken as on the way forth: add "
        f"the way forth to the record, or infer without friction ({rig_entry('friction', 0, 'unknown')}), and compare."
    ]


def _inferred(posterior: xr.DataTree) -> list[str]:
    """Return the unknowns of the rig of a run."""
    names: list[str] = read_json(posterior.attrs.get("nuisances", "[]"), "nuisances")
    return names


def doubtful_sides(attrs: Mapping[Any, Any]) -> list[str]:
    """Return a message on sweeps whose side of contact is in doubt, from attributes of a posterior or of contacts."""
    if "doubtful_sides" not in attrs:
        return []
    sides = read_json(attrs["doubtful_sides"], "doubtful_sides")
    taken = ", ".join(f"sweep {sweep} as a {side} one" for sweep, side in sides.items())
    probability = attrs.get("sides_probability")
    sure = "" if probability is None else f", with probability {probability:.2g}"
    return [
        f"The moment leaves the side of contact in doubt; taken is {taken}{sure}. Is the sign of "
        "the moment right, and the direction, and was the load cell tared?"
    ]


def _off_zero(record: xr.Dataset, found: xr.Dataset, residuals: dict[str, Residuals]) -> list[str]:
    """Report channels whose unloaded readings differ from what the posterior expects."""
    off, entries = [], {}
    for name, of_channel in residuals.items():
        unloaded = found.unloaded.values & ~of_channel.loaded
        uncertainty = float(found.bias_uncertainty.sel(channel=name))
        if np.count_nonzero(unloaded) < 3 or not math.isfinite(uncertainty):
            continue
        means = (of_channel.values * of_channel.scale)[:, unloaded].mean(axis=1)
        error = math.hypot(uncertainty, float(np.std(means[1:])))
        if abs(means[0]) > OFF_ZERO * error > 0.0:
            unit = _unit(record, name)
            off.append(f"{name} is off by {means[0]:.3g}{unit} ({abs(means[0]) / error:.0f} standard errors)")
            entries[name] = column_entry(record[name], added=-float(means[0]))
    if not off:
        return []
    how = f" as they are read ({rig_entries(entries)})" if all(entries.values()) else ""
    return [
        f"Without load the cell does not read what is stated: {', '.join(off)}. Was the tare forgotten? Take it out of "
        f"the readings{how}, or give LoadCell.from_zero_load(record)."
    ]


def _moved_zero(posterior: xr.DataTree, record: xr.Dataset, found: xr.Dataset) -> list[str]:
    """Report channels whose zero moved although no drift is stated or inferred."""
    cell = LoadCell.from_record(record)
    inferred = _inferred(posterior)
    level = found.attrs["false_alarm"] / max(int(np.isfinite(found.same_bias_p_value).sum()), 1)
    moved = [
        f"{name} (p = {p_value:.1g} if it had not)"
        for name, p_value in zip(found.channel.values.tolist(), found.same_bias_p_value.values.tolist(), strict=True)
        if p_value < level and f"{name.removeprefix('holding_')}_drift" not in inferred
    ]
    if not moved or (cell is not None and cell.drift is not None):
        return []
    return [
        f"The zero moved from one unloaded stretch to another, of {', '.join(moved)}: infer it, too "
        f"({rig_entry('drift', 'default', 'unknown')}), state the drift of the load cell, or tare before each sweep."
    ]


def _not_described(posterior: xr.DataTree, check: xr.Dataset) -> str:
    score = check.score.fillna(-np.inf)
    place = score.argmax(("discrepancy", "channel"))
    channel, cause = (str(score[dim].values[int(place[dim])]) for dim in ("channel", "discrepancy"))
    worst = check.sel(channel=channel)
    unit = "" if str(worst.unit.values) == "1" else f" {worst.unit.values}"
    family, predictions = posterior.attrs.get("family", GAUGE), check.attrs["predictions"]
    described, result = ("gauge", "rig") if family == GAUGE else (f"family {family}", "contour")
    # The share of predictions alone: the record itself is no prediction.
    like = round(float(check.overall_p_value) * (predictions + 1)) - 1
    return (
        f"The {described} and the rig as assumed do not describe the record: {like or 'none'} of {predictions} "
        f"records that the posterior predicts {'are' if like > 1 else 'is'} so far off. The worst channel is "
        f"{channel}, {_CAUSES[cause]}; in sweep {int(worst.worst_sweep)} from {_stretch(posterior, worst)} "
        f"it is off the prediction by {float(worst.worst_residual):+.2g}{unit}. "
        f"Do not use this {result}. "
        + what_to_try([family], _inferred(posterior), friction=posterior.attrs.get("friction", 0.0))
    )


def _stretch(posterior: xr.DataTree, worst: xr.Dataset) -> str:
    """Return drive angles, or travels of a base that is carried, from the beginning to the end of a stretch."""
    record = record_of(posterior)
    if int(worst.worst_sweep) not in carried_sweeps(record):
        return f"{float(worst.worst_from):.3g} to {float(worst.worst_to):.3g} rad"
    unit = _unit(record, "base_x") or " L"
    return f"{float(worst.worst_from_travel):.3g} to {float(worst.worst_to_travel):.3g}{unit} of travel"


def _neighbours_over_stated(record: xr.Dataset, check: xr.Dataset) -> float:
    """Return the scatter of neighbouring samples over the stated noise, the median of the channels; 1 if unknown.

    No more of the misfit than that can be noise.
    """
    cell = LoadCell.from_record(record) or LoadCell()
    stated = np.hypot(list(cell.standard_deviations.values()), cell.resolution / math.sqrt(12.0))
    ratios = [
        float(check.neighbour_noise.sel(channel=name)) / stated[CHANNELS.index(name)]
        for name in check.channel.values
        if 0.0 < stated[CHANNELS.index(name)] < math.inf
    ]
    return float(np.median(ratios)) if ratios else 1.0


def _noise(posterior: xr.DataTree, noisier: float) -> list[str]:
    draws = posterior_draws(posterior)
    if "noise_scale" not in draws:
        return []
    factor = float(draws["noise_scale"].median())
    if 1.0 / NOISE_FACTOR <= factor <= NOISE_FACTOR:
        return []
    said = f"The noise is {factor:.3g} times what the load cell states"
    if noisier < 0.5 * factor and factor > NOISE_FACTOR:
        alike = f"{noisier:.2g} times as much as stated" if abs(math.log(noisier)) > 0.2 else "as stated"
        return [f"{said}, but neighbouring samples scatter {alike}: the rest is misfit, not noise."]
    return [f"{said}, and neighbouring samples scatter alike: state the noise that it has, or are the units right?"]


def _contradictions(
    posterior: xr.DataTree, record: xr.Dataset, contacts: xr.Dataset | None, noisier: float
) -> list[str]:
    """Report loads of single samples that contradict one another, under normal noise; outliers enlarge misfits."""
    cell = LoadCell.from_record(record) or LoadCell()
    if contacts is None or math.isfinite(cell.degrees_of_freedom):
        return []
    chance = float(contacts.attrs.get("misfit_probability", math.nan))
    if not chance < CONTRADICTION or noisier > 0.75 * NOISE_FACTOR:  # more noise than stated explains it
        return []
    words = f"{chance:.1g}" if chance > 1e-99 else "below 1e-99"
    return [
        "The loads of single samples contradict one another, whatever the contour (noise explains it with probability "
        f"{words}): {CHECK_RIG}.{_dragging(posterior, float(contacts.attrs.get('axial_score', math.nan)))}"
    ]


def _dragging(posterior: xr.DataTree, axial_score: float) -> str:
    """Return a sentence on the force along the rod where friction explains it."""
    if not axial_score < -AXIAL_ALARM:
        return ""
    words = f" In tangential contact the force along the rod is too small by {-axial_score:.0f} standard errors, as "
    if is_inferred("friction", _inferred(posterior)):
        return f"{words}with more friction than was inferred."
    return f"{words}with friction: infer it ({rig_entry('friction', 'default', 'unknown')})."


def _beyond_prior(posterior: xr.DataTree) -> dict[str, str]:
    """Return parameters whose posterior lies where the prior has almost no mass, each with its values as text."""
    draws, prior = posterior_draws(posterior), posterior["prior"].to_dataset()
    said = {}
    for name in draws.data_vars:
        believed = prior[name].values.ravel()
        if name in _NOISES or believed.size < _FEWEST_PRIOR_DRAWS:
            continue
        median = float(draws[name].median())
        least, low, high, most = np.quantile(believed, [0.0, 0.05, 0.95, 1.0])
        if not least - _BEYOND * (low - least) <= median <= most + _BEYOND * (most - high):
            said[str(name)] = f"{name} = {median:.3g} (prior: {least:.3g} to {most:.3g})"
    return said


def _beyond_message(beyond: Mapping[str, str], record: xr.Dataset, posterior: xr.DataTree) -> list[str]:
    if not beyond:
        return []
    draws = posterior_draws(posterior)
    zeros = {
        column: column_entry(record[column], added=-float(draws[name].median()))
        for name, column in _COLUMN_OF_ZERO.items()
        if name in beyond
    }
    is_known = bool(zeros) and all(zeros.values())
    subtract = f"subtract a zero as its column is read ({rig_entries(zeros)}), " if is_known else ""
    return [
        f"The record contradicts the prior: {', '.join(beyond.values())}. Check the stated rod and drive "
        f"angle, {subtract}or give a wider prior (under [unknown] of rig.toml, or in the family)."
    ]


def _cut_off_message(posterior: xr.DataTree) -> list[str]:
    """Report parameters that are cut off where the model has no equilibria."""
    cut_off = cut_off_parameters(posterior)
    if not cut_off:
        return []
    draws = posterior_draws(posterior)
    least_most = {"above": 1.0, "below": 0.0}
    ends = [f"{name} ({end} {float(draws[name].quantile(least_most[end])):.3g})" for name, end in cut_off.items()]
    return [
        f"The posterior is CUT OFF where the model has no path of the rod, not by the record: {', '.join(ends)}. "
        "Intervals are too narrow on that side: is the family right, and the rod?"
    ]


def _prior_dominated(posterior: xr.DataTree, known: Container[str]) -> list[str]:
    draws, prior = posterior_draws(posterior), posterior["prior"].to_dataset()
    family = posterior.attrs.get("family", GAUGE)
    mute = {*_NOISES, *(() if family == GAUGE else family_named(family).roughness)}
    names = [str(name) for name in draws.data_vars if name not in mute and name not in known]
    names = [n for n in names if _width(draws[n].values) > _PRIOR_DOMINATED * _width(prior[n].values) > 0.0]
    if not names:
        return []
    return [f"The record adds little to the prior of {', '.join(names)}."]


def _width(values: Floats) -> float:
    """Return the width of the central 68 % interval, two standard deviations of a normal distribution."""
    low, high = np.quantile(values, [0.16, 0.84])
    return float(high - low)


def _unit(record: xr.Dataset, name: str) -> str:
    unit = str(record[name].attrs.get("units", "1"))
    return "" if unit == "1" else f" {unit}"

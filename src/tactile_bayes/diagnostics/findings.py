"""Findings on a record or a result: the table of their texts, by kind."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags
from tactile_bayes.inference.misfit import CHECK_RIG
from tactile_bayes.record.rig_entry import rig_entry

_UNITS = "check the units of the loads, and the rod's length and flexural rigidity."

TEXTS: Mapping[str, str] = {
    # Of loads, whatever the contour.
    "large loads": f"Forces reach {{largest}} EI/L²{{stated}}, more than such a rod can carry: {_UNITS}",
    "small loads": f"Forces reach {{largest}} EI/L²{{stated}} only, which hardly bends such a rod: {_UNITS}",
    "long lever": (
        "The holding moment is {lever} L times the force, but no contact is further from the pivot than L: " + _UNITS
    ),
    "force sign": (
        "force_y is negative in contact, but the object pushes the pivot's support up: its sign is wrong, or the frame."
    ),
    "moment sign": (
        "The holding moment has the sign of contacts on the other side in every sweep (it is positive where the drive "
        "turns counter-clockwise against the object): its sign is wrong, or the directions are, that is the sense of "
        "the drive angle."
    ),
    "doubtful side": (
        "The moment leaves the side of contact in doubt; taken is {taken}{sure}. Is the sign of the moment right, and "
        "the direction, and was the load cell tared?"
    ),
    "no fit": "The loads of {share} of the {loaded} loaded samples fit no contact of such a rod: {advice}.",
    "below the pivot": (
        "Of the {loaded} loaded samples {share} touch something below the pivot. Does the object reach there? If not, "
        "{advice}."
    ),
    "contradiction": (
        "The loads of single samples contradict one another, whatever the contour (noise explains it with probability "
        f"{{chance}}): {CHECK_RIG}.{{dragging}}"
    ),
    # Of channels.
    "dead channel": (
        "{channel} never changes: is it connected? If it is not measured, empty its column, or remove it and state "
        "{entry}."
    ),
    "cut off": "{readings} of {channel} {are} cut off at {largest}, the end of a range ({samples}){advice}.",
    "stuck": (
        "{readings} of {channel} {are} the same as before or after, for longer than its steps explain ({samples}): did "
        "the acquisition hang?"
    ),
    "outlier": "{readings} of {channel} {stand} out from {their} neighbours ({samples}): a knock? {advice}",
    "zero moved": (
        "The zero moved from one unloaded stretch to another, of {moved}: infer it, too ({entry}), state the drift of "
        "the load cell, or tare before each sweep."
    ),
    "far zero": "Without load the cell reads {zeros}, more than infer expects. Subtract it {how}.",
    "zero off": "Without load the cell does not read what is stated: {off}. Was the tare forgotten? {advice}",
    "noise not white": (
        "The noise is not white: {how}. {advice}, or have infer find a drift ({entry}), else bands come out too narrow."
    ),
    "noise not as stated": (
        "The noise of {channel} is {found} in unloaded samples, and stated as {stated}: state what it is, or are the "
        "units right?"
    ),
    # Of sweeps and samples.
    "no contact": (
        "No sweep shows contact: the loads do not change from beginning to end by more than noise. Does the rod touch, "
        "and are the load columns the right ones?"
    ),
    "sweep without contact": "{sweeps} no contact: leave it out, or is it another object's?",
    "stored twice": (
        "{count} {have} all the readings of the one before ({samples}): stored twice? Remove what is no measurement."
    ),
    "uneven steps": (
        "{steps} of the drive {differ} from the others ({samples}): were samples lost, or did the drive slip?"
    ),
    "begins in contact": "{sweeps} in contact: begin before first contact, which is informative on the contour.",
    "ends in contact": "{sweeps} in contact: continue until the rod snaps off, which is informative on the contour.",
    "few samples": "{sweeps} fewer than {fewest} samples in contact: take finer steps of the drive.",
    "no way forth": (
        "{sweeps} in contact after no sweep on that side, so that friction is taken as on the way forth: add the way "
        "forth to the record, or infer without friction ({entry}), and compare."
    ),
    # Of a result.
    "not described": (
        "The {family} and the rig as assumed do not describe the record: {like} of {predictions} records that the "
        "posterior predicts {are} so far off. The worst channel is {channel}, {cause}; in sweep {sweep} from {stretch} "
        "it is off the prediction by {residual}. Do not use this {result}. {advice}"
    ),
    "not reliable": "{summary}",
    "not converged": "{message}.",
    "larger noise": (
        "The noise is {factor} times what the load cell states, and neighbouring samples scatter alike: state the "
        "noise that it has, or are the units right?"
    ),
    "misfit as noise": (
        "The noise is {factor} times what the load cell states, but neighbouring samples scatter {alike}: the rest is "
        "misfit, not noise.{causes}"
    ),
    "beyond the prior": (
        "The record contradicts the prior: {values}. Check the stated rod and drive angle, {subtract}or give a wider "
        "prior (under [unknown] of rig.toml, or in the family)."
    ),
    "cut-off posterior": (
        "The posterior is CUT OFF where the model has no path of the rod, not by the record: {ends}. Intervals are too "
        "narrow on that side: is the family right, and the rod?"
    ),
    "smooth misfit": (
        "In contact the residuals of {channels} are larger than the noise between neighbouring samples, and smooth: "
        "where neither another family nor more of the rig describes them, infer a discrepancy of the model ({entry})."
    ),
    "not checked": "{but}The record was NOT CHECKED against the predictions of the posterior: {reason}.",
    "reservation": "{summary}",
    "set by the prior": "Of {names} the record says little more than the prior.",
    "width of the band": (
        "The {share:.4g} % band is ± {width}{known}; that of the shape alone, wherever it lies, ± {shape}."
    ),
    # Of a record or a result without any.
    "nothing wrong": "Nothing looks wrong.",
    "all is well": "All is well: the {drawn}, and the record agrees with their predictions (p = {p_value}).",
}

_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_SHOWN = 5  # largest number of samples that a finding lists
NOISE_FACTOR = 2.0  # ratio of found to stated noise beyond which it is reported: data sheets are no more accurate
OFF_ZERO = 5.0  # standard errors by which a zero must differ from the stated one to be reported
# Log-evidence above that of the model as it is from which a cause is named, and below the likeliest one's within which
# another one is not told apart from it: as one to a hundred and fifty.
_GAIN, _APART = 5.0, 5.0


class Finding(str):
    """A sentence on a record or a result, of a kind in `TEXTS`, with the details that it states."""

    kind: str
    details: Mapping[str, Any]

    def __new__(cls, kind: str, **values: Any) -> Finding:
        self = super().__new__(cls, TEXTS[kind].format(**values))
        self.kind, self.details = kind, values
        return self

    def __getnewargs_ex__(self) -> tuple[tuple[str], dict[str, Any]]:
        return (self.kind,), dict(self.details)


def contradiction(chance: float, dragging: str = "") -> Finding:
    """Return the finding that loads of single samples contradict one another, which noise does with a probability."""
    return Finding("contradiction", chance=f"{chance:.1g}" if chance > 1e-99 else "below 1e-99", dragging=dragging)


def quantity(value: float, unit: str) -> str:
    """Return a value with its unit as text, to three digits: angles in degrees, in SI with a prefix."""
    if unit == "1":
        return f"{value:.3g}"
    if unit == "rad":
        return f"{math.degrees(value):.3g}°"
    if not unit[0].isalpha():  # like 1/m
        return f"{value:.3g} {unit}"
    size, prefix = prefix_of(value)
    return f"{value / size:.3g} {prefix}{unit}"


def prefix_of(value: float) -> tuple[float, str]:
    """Return the size of the prefix that suits a value in SI, and the prefix."""
    if not abs(value) > 0.0:  # zero or NaN
        return _PREFIXES[0]
    return next((pair for pair in _PREFIXES if abs(value) >= pair[0]), _PREFIXES[-1])


def counted(flags: Flags, noun: str) -> str:
    """Return text like "3 readings"."""
    count = int(np.sum(flags))
    return f"{count} {noun}{'s' * (count != 1)}"


def listed(flags: Flags) -> str:
    """Return text like "samples 3, 5 to 9 and 12", neighbours joined."""
    where = np.flatnonzero(flags)
    runs = np.split(where, np.flatnonzero(np.diff(where) != 1) + 1)
    words = [f"{run[0]}" if run.size == 1 else f"{run[0]} to {run[-1]}" for run in runs]
    shown = joined(words) if len(words) <= _SHOWN else ", ".join([*words[:_SHOWN], "..."])
    return f"sample{'s' * (where.size != 1)} {shown}"


def joined(words: Sequence[str]) -> str:
    """Return words as a list that ends in "and"."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else list(words))


def of_sweeps(numbers: Sequence[int], verb: str, past: str = "") -> str:
    """Return text like "Sweeps 1 and 3 show", with the verb, or with its past form."""
    one = len(numbers) == 1
    return f"Sweep{'' if one else 's'} {joined(list(map(str, numbers)))} {past or verb + 's' * one}"


def moved_zero(p_values: Mapping[str, float], false_alarm: float, known: Container[str] = ()) -> list[Finding]:
    """Report channels whose zero moved between unloaded stretches, except those of which that is known."""
    level = false_alarm / max(sum(map(math.isfinite, p_values.values())), 1)
    moved = [
        f"{name} (p = {p_value:.1g} if it had not)"
        for name, p_value in p_values.items()
        if p_value < level and name not in known
    ]
    return [Finding("zero moved", moved=", ".join(moved), entry=rig_entry("drift", "default", "unknown"))] * bool(moved)


def zero_off(zeros: Mapping[str, tuple[float, float, str]], advice: str) -> list[Finding]:
    """Report channels whose zero is off what is expected: by how much, its standard error, and its unit."""
    off = [
        f"{name} is off by {quantity(away, unit)} ({abs(away) / error:.0f} standard errors)"
        for name, (away, error, unit) in zeros.items()
        if abs(away) > OFF_ZERO * error > 0.0
    ]
    return [Finding("zero off", off=", ".join(off), advice=advice)] * bool(off)


def likely_causes(posterior: xr.DataTree) -> str:
    """Return sentences on what describes the record, from the group "causes"; empty without it, or if nothing does."""
    if "causes" not in posterior.children:
        return ""
    causes = posterior["causes"].to_dataset()
    if "misread" in causes.attrs:
        return str(causes.attrs["misread"])
    said, missed = _said(causes), str(causes.attrs.get("no_time_for", ""))
    if not missed:
        return said
    return f"{said or 'Nothing that was tried describes it better.'} No time for: {missed}."


def _said(causes: xr.Dataset) -> str:
    gains = causes.log_evidence.values
    order = np.flatnonzero(gains > _GAIN)
    if not order.size:
        return ""
    names, remedies = causes.cause.values, causes.remedy.values
    first, describes = order[0], causes.describes.values == 1
    if not describes[first]:
        return f"Nothing that was tried describes it alone; nearest comes {names[first]}: infer with {remedies[first]}."
    alike = [k for k in order if describes[k] and gains[first] - gains[k] < _APART]
    others = [names[k] for k in order if describes[k] and k not in alike]
    more = f" Less likely, and possible: {joined(others)}." if others else ""
    if len(alike) == 1:
        return f"Most likely the cause is {names[first]}, which describes it: infer with {remedies[first]}.{more}"
    tries = "; or ".join(remedies[k] for k in alike)
    known = " or ".join(names[k] for k in alike)
    return (
        f"The cause is {known}, which this record does not tell apart: infer with {tries}. A sweep along a gauge, of "
        f"known contour, would tell (calibrate-rig).{more}"
    )

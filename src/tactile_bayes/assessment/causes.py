"""Causes of a misfit: which other rigs and families describe a record that the model does not."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from scipy import stats

from tactile_bayes.arrays import Floats
from tactile_bayes.assessment.assumptions import Alternative, alternatives_by_channel, alternatives_of, stated_cell
from tactile_bayes.contours import Contour, Smooth
from tactile_bayes.contours.family import ContourFamily, FamilyParameter
from tactile_bayes.contours.shape_free_family import ShapeFreeFamily
from tactile_bayes.diagnostics.findings import Finding, quantity
from tactile_bayes.diagnostics.inspection.inspection import inspect_record
from tactile_bayes.errors import TactileBayesError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.experiment import Experiment, contour_problem, experiment_of
from tactile_bayes.inference.misfit import CHECK_RIG
from tactile_bayes.inference.result import best_draw
from tactile_bayes.inference.starts.contour_optimum import cost_of_residuals, first_order, optimum_beside
from tactile_bayes.record import COLUMNS, rod_of
from tactile_bayes.record.rig_entry import rig_entries
from tactile_bayes.rig.stated import stated_values

# Slope angles at which a spot is sought, and standard deviation of its bell curve [rad].
PLACES = tuple(np.linspace(-1.2, 1.2, 17).round(6).tolist())
_WIDTH = 0.12
_SPREAD = 0.6  # prior deviation of the change of log ρ, as that of a shape-free contour
_NODES = Smooth.nodes(96)
_LARGEST = 8.0  # bound on log ρ about its median; that of a parabola is infinite where it is upright
_PARAMETER = FamilyParameter("change of the logarithm of the radius of curvature about a slope angle", 0)


@dataclass(frozen=True)
class LocalBends(ContourFamily):
    """Contours of another family whose log ρ(α) has a bell curve more about each of some slope angles."""

    family: ContourFamily
    places: tuple[float, ...]
    name: str = "local bends"

    @cached_property
    def bends(self) -> tuple[str, ...]:
        """Names of the sizes of the bell curves: positive ones are flat spots, negative ones corners."""
        return tuple(f"bend_{k + 1}" for k in range(len(self.places)))

    @cached_property
    def table(self) -> dict[str, FamilyParameter]:  # type: ignore[override]
        return {**dict.fromkeys(self.bends, _PARAMETER), **self.family.table}

    def build(self, *values: Any) -> Contour:
        sizes = np.stack(np.broadcast_arrays(*values[: len(self.places)]), axis=-1)
        drawn = self.family.build(*values[len(self.places) :])
        with np.errstate(all="ignore"):
            log_radius = np.log(np.asarray(drawn.radius_of_curvature(_NODES.reshape(-1, *[1] * len(drawn.shape)))))
        log_radius = np.moveaxis(log_radius, 0, -1)
        middle = np.nanmedian(log_radius, axis=-1, keepdims=True)
        log_radius = np.clip(np.where(np.isnan(log_radius), middle, log_radius), middle - _LARGEST, middle + _LARGEST)
        bells = np.exp(-0.5 * np.square((_NODES - np.array(self.places)[:, None]) / _WIDTH))
        x, y = drawn.point(0.0)
        return Smooth(log_radius + sizes @ bells, q=y, x_c=x)

    def fit(self, x: Floats, y: Floats) -> dict[str, float]:
        return {**dict.fromkeys(self.bends, 0.0), **self.family.fit(x, y)}


def with_bends(model: ContourModel, places: tuple[float, ...]) -> ContourModel:
    """Return the model whose contours may have a spot at each of some slope angles, of sizes that are unknown."""
    family = LocalBends(model.family, places)
    priors = {**dict.fromkeys(family.bends, stats.norm(0.0, _SPREAD)), **model.priors}
    return ContourModel(model.measured, family, model.unknowns, model.noise, priors)


COLUMNS_OF_CAUSES = ("log_evidence", "describes", "sought", "remedy")
_SECONDS = 45.0  # time limit of all searches [s], each of which takes about one, and shape-free four
# Share of the log-evidence to first order of what describes the record below which nothing else is sought, and of what
# does not, below which that is a surprise; and number of the likeliest causes that are then sought from all places.
_LIKELY, _CLOSELY = 0.3, 5
_LEAST = 0.03  # share of the log-evidence of what describes the record, below which a shape is not looked at closely
# Least share of what any shape explains that one spot explains, to be named in its place; and of the log-evidence of
# what describes the record, for a shape that does not.
_MOST = 0.5
_PRICE = float(np.log(len(PLACES)))  # of the places at which a spot is sought, in log-evidence
_SHAPE_FREE, _FLAT_SIDED = "family shape-free", "family flat-sided"


def causes(posterior: xr.DataTree) -> xr.Dataset:
    """Try what may be wrong with the rig or the family of a posterior that does not describe its record.

    Each parameter of the rig that is not inferred, also where it is known, is inferred, a spot that is flatter or more
    bent is put anywhere along the contour, and each other family is taken. First all are judged by score tests, the
    derivatives of the loads at the most probable parameters, in milliseconds; then the most probable parameters with
    the likeliest are sought, less than a second each, until one describes the record, and with those that are nearly as
    likely. If none does, the five likeliest are sought again, from more places. This takes 45 s at most; nothing is
    sampled.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`.

    Returns
    -------
    xr.Dataset
        Over "cause", those that describe the record first, then by log_evidence, above that of the model as it is, by
        Laplace's approximation for the noise as it is estimated from the record; describes, 1 if the rest is no more
        than that noise; sought, 0 if the log-evidence is of the score test alone; and remedy, the entries of rig.toml,
        or the family. The attribute no_time_for names those that were not sought for lack of time. If single samples
        fit no contact until a column is read otherwise (another sign, say), or the model describes all but some
        readings that stand out, nothing is tried, and the attribute misread is what `inspect_record` says of it.

    Raises
    ------
    InferenceError
        If the tree is no such result.
    ParameterError
        If a prior was a distribution of the caller's own, which the tree does not hold.

    See Also
    --------
    check : names the likeliest cause, if this is the group "causes" of the tree.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, SamplerSettings, infer_contour, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell, real = LoadCell(force_noise=0.02, moment_noise=0.008), Rig(unknown={"friction": 0.3})
    >>> measured = cell.measure(scan(paper_profile("III", q=0.5), real, drive_step=0.05).record, rng=1)
    >>> quick = SamplerSettings(ensembles=2, walkers=32, max_steps=50)
    >>> wrong = infer_contour(measured, rig=Rig(load_cell=cell, unknown="nothing"), rng=1, settings=quick)
    >>> causes(wrong).cause.values[0]
    'friction'
    """
    drawn = {str(name): float(value) for name, value in best_draw(posterior).data_vars.items()}
    return causes_beside(experiment_of(posterior), drawn)


def causes_beside(experiment: Experiment, found: Mapping[str, float], deadline: Deadline | None = None) -> xr.Dataset:
    """Return the `causes` of an experiment beside its most probable parameters."""
    seen = inspect_record(experiment.record, experiment.rig)
    misread = [finding for finding in seen.messages if _is_misread(finding)][:1]
    if misread and misread[0].kind == "no fit":
        return _of_readings(misread)
    tests = _Tests(experiment, found, deadline)
    if tests.own.fits and (outliers := [finding for finding in seen.messages if finding.kind == "outlier"]):
        return _of_readings(outliers)  # its optimum bears them, and the posterior does not
    every = [each for each in alternatives_of(experiment, seen) if each.kind != "fixed"]
    shape, spot = tests.any_shape()
    rows = tests.sought(tests.judged([each for each in every if each.kind == "added"]) + shape)
    if any(row.is_shape and row.log_evidence >= _least(row) * tests.known for row in rows[:2]):
        rows = [tests.placed(row, spot) if row.is_shape else row for row in rows]
        rows += tests.sought(tests.judged([e for e in every if e.kind == "family" and e.name != _SHAPE_FREE]))
    better = [f"{row.name} inferred" for row in rows if row.log_evidence > 0.0 or np.isneginf(tests.known)]
    rows += tests.sought(tests.judged(alternatives_by_channel(experiment, better)))
    if misread and not (tests.own.fits or any(row.describes for row in rows)):  # nothing lies below the pivot
        return _of_readings(misread)
    rows.sort(key=_rank)
    columns = {name: ("cause", [getattr(row, name) for row in rows]) for name in COLUMNS_OF_CAUSES}
    attrs = {"described": int(tests.own.fits), "no_time_for": ", ".join(tests.missed)}
    return xr.Dataset(columns, coords={"cause": [row.name for row in rows]}, attrs=attrs)


@dataclass(frozen=True, eq=False)
class _Cause:
    """What may be wrong, and what it explains, to first order until it is sought."""

    name: str
    remedy: str
    log_evidence: float  # above that of the model as it is
    model: ContourModel
    starts: list[dict[str, float]]
    moved: dict[str, float] | None = None  # a start beyond an edge, at which a search from the first may stay
    is_shape: bool = False
    # Cost of the model as it is by the samples and events that one with a memory takes, less that by its own.
    more: float = 0.0
    describes: int = 0  # 1 if it leaves no more than noise
    point: Floats | None = None  # the optimum, if it was sought

    @property
    def sought(self) -> int:
        """1 if the optimum was sought, else 0."""
        return int(self.point is not None)


def _rank(row: _Cause) -> tuple[bool, float]:
    """Place among others: those that describe the record first."""
    return not row.describes, -row.log_evidence


class _Tests:
    """Tests of what may be wrong with an experiment, beside its most probable parameters by name."""

    def __init__(self, experiment: Experiment, found: Mapping[str, float], deadline: Deadline | None) -> None:
        self.experiment, self._given = experiment, deadline
        self.missed: list[str] = []  # names of those that were not sought for lack of time
        self.known = self.likely = -np.inf  # log-evidence of what describes the record, and that to first order
        self.model = contour_problem(experiment).model
        sheets = stated_values(rod_of(experiment.record), stated_cell(experiment))
        stated = {**sheets, **self.model.unknowns.known}
        of_contour = {name: found[name] for name in self.model.family.parameters}
        # A wrong model may have a far-off rig; a shape-free contour, which follows most, is where the search left it.
        most = 1 if isinstance(self.model.family, ShapeFreeFamily) else None
        self.own = optimum_beside(self.model, [found, of_contour], deadline or NEVER, most)
        best = dict(zip(self.model.names, self.own.point.tolist(), strict=True))
        self.starts = [{**stated, **best}, {**stated, **found}, best]  # what is added as stated, and at its median

    @cached_property
    def deadline(self) -> Deadline:
        """The deadline as given, or that from the first search on: all has been compiled by then."""
        return self._given or Deadline.after(_SECONDS)

    def judged(self, alternatives: list[Alternative]) -> list[_Cause]:
        """Return alternatives, judged to first order where they add numbers; others have infinite evidence."""
        causes = []
        for each in alternatives:
            with suppress(TactileBayesError):  # what cannot be tried is no cause
                model, starts, gain, moved = contour_problem(each.experiment).model, self.starts, np.inf, None
                added = [name for name in model.forward_parameters if name not in self.model.forward_parameters]
                if added and each.kind == "added":
                    start = dict(starts[0])
                    for name in set(self.model.forward_parameters) - set(model.forward_parameters):
                        start |= dict.fromkeys(added, start[name])  # gains in place of the scale of rigidity
                    (step,) = first_order(model, start, [added])
                    gain, starts, moved = step.log_evidence, [step.start, *starts[1:]], step.moved
                name, is_shape = each.name.replace(" inferred", ""), each.kind == "family"
                more = 0.0
                if model.unknowns.memory and not self.model.unknowns.memory:
                    if model.likelihood.measured.shape == self.model.likelihood.measured.shape:
                        model.deviation = self.model.deviation
                    more = cost_of_residuals(model, self.starts[0]) - cost_of_residuals(self.model, self.starts[0])
                causes.append(_Cause(name, _remedy(each, self.experiment), gain, model, starts, moved, is_shape, more))
        return causes

    def any_shape(self) -> tuple[list[_Cause], _Cause | None]:
        """Return any smooth shape, judged by spots everywhere, and a spot at the likeliest place; maybe neither."""
        experiment, start = self.experiment, self.starts[0]
        if experiment.gauge is not None or experiment.own_family.name == "flat-sided":
            return [], None
        name = "flat-sided" if experiment.own_family.name == "shape-free" else "shape-free"
        found = self.judged([Alternative(f"family {name}", "family", replace(experiment, family=name))])
        model = with_bends(self.model, PLACES)
        bends = model.forward_parameters[: len(PLACES)]
        *each, together = first_order(model, start | dict.fromkeys(bends, 0.0), [*([bend] for bend in bends), bends])
        best = int(np.argmax([one.log_evidence for one in each]))
        place, moved = PLACES[best], each[best].start
        gain = each[best].log_evidence - _PRICE
        start = moved | {bends[0]: moved[bends[best]]}
        spot = _Cause("a flat spot or corner", "", gain, with_bends(self.model, (place,)), [start])
        return [replace(one, log_evidence=together.log_evidence) for one in found], spot

    def placed(self, shape: _Cause, spot: _Cause | None) -> _Cause:
        """Return any smooth shape, or a flat-sided one if only that describes the record, by the name of the spot."""
        spot = next(iter(self.sought([spot] if spot else [])), None)
        if spot is None or spot.point is None:
            return shape
        is_flat = bool(spot.point[0] > 0.0)
        if is_flat and not shape.describes and shape.name == _SHAPE_FREE:
            flat = Alternative(_FLAT_SIDED, "family", replace(self.experiment, family="flat-sided"))
            shape = next((row for row in self.sought(self.judged([flat])) if row.describes), shape)
        gain = spot.log_evidence - _PRICE
        if not gain > _MOST * shape.log_evidence > 0.0:
            return shape
        family = spot.model.family
        assert isinstance(family, LocalBends)
        x, _ = spot.model.contours(spot.point[None]).point(family.places[0])
        place = quantity(float(x[0]), COLUMNS["base_x"].unit_in(self.experiment.record.attrs["units"]))
        if spot.describes:
            shape = replace(shape, log_evidence=max(gain, shape.log_evidence))
        return replace(shape, name=f"{'flat spot' if is_flat else 'corner'} at x = {place}")

    def sought(self, causes: list[_Cause]) -> list[_Cause]:
        """Return causes with their optima: the likeliest to first order first, each from one place, and unless others
        are likelier; then the likeliest from all places if none describes the record, or one far less likely does."""
        rows: dict[_Cause, _Cause] = {}
        for each in sorted(causes, key=lambda one: -one.log_evidence):
            rows[each] = each
            if self.deadline.has_passed:
                self.missed.append(each.name)
            elif each.log_evidence > min(self.known, _LIKELY * self.likely):
                rows[each] = self._sought(each, 1)
        in_vain = [each for each, row in rows.items() if row.sought and not row.describes]
        for each in sorted(in_vain, key=lambda one: min(_rank(one), _rank(rows[one])))[:_CLOSELY]:
            is_likelier = self.likely < _LIKELY * each.log_evidence < np.inf
            if (np.isneginf(self.known) or is_likelier) and not self.deadline.has_passed:
                rows[each] = min(rows[each], self._sought(each), key=_rank)
        return sorted((row for row in rows.values() if np.isfinite(row.log_evidence)), key=_rank)

    def _sought(self, cause: _Cause, most: int | None = None) -> _Cause:
        """Return a cause with its optimum, from the first so many places or from all; as it is if it has none."""
        with suppress(TactileBayesError):
            found = optimum_beside(cause.model, cause.starts, self.deadline, most)
            if most and cause.moved and found.log_evidence + cause.more <= self.own.log_evidence:
                again = optimum_beside(cause.model, [cause.moved], self.deadline, most)
                found = max(found, again, key=lambda one: one.log_evidence)
            gain = found.log_evidence - self.own.log_evidence + cause.more
            if found.fits:
                self.known, self.likely = max(self.known, gain), max(self.likely, cause.log_evidence)
            return replace(cause, log_evidence=gain, describes=int(found.fits), point=found.point)
        return cause


def _least(shape: _Cause) -> float:
    """Return the share of the log-evidence of what describes the record from which a shape is looked at closely."""
    return _LEAST if shape.describes else _MOST


def _is_misread(finding: Finding) -> bool:
    """Return whether no contact fits the record as it is, and most do if a column is read otherwise."""
    correction = str(finding.details.get("advice", ""))
    return finding.kind in ("no fit", "below the pivot") and correction != CHECK_RIG and "friction" not in correction


def _of_readings(findings: list[Finding]) -> xr.Dataset:
    """Return causes of which none is sought, since readings are wrong."""
    none: dict[str, Any] = {name: ("cause", []) for name in COLUMNS_OF_CAUSES}
    return xr.Dataset(none, attrs={"misread": " ".join(findings)})


def _remedy(alternative: Alternative, experiment: Experiment) -> str:
    """Return the entries of rig.toml by which an alternative differs, or its family as an option."""
    if alternative.kind == "family":
        return f"--{alternative.name}"
    tables = ((each.rig.entries, stated_cell(each).entries()) for each in (alternative.experiment, experiment))
    pairs = zip(("unknown", "load_cell"), *tables, strict=True)
    changed = ((name, {n: v for n, v in new.items() if old.get(n) != v}) for name, new, old in pairs)
    return ", ".join(rig_entries(entries, name) for name, entries in changed if entries)

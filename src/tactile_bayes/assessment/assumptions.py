"""Effect of assumptions: the band again with each unknown added or fixed, and with each other family."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.comparison.families import SHAPES
from tactile_bayes.diagnostics.inspection.inspection import Inspection, inspect_record
from tactile_bayes.diagnostics.predictive_check import predictive_check
from tactile_bayes.errors import ParameterError, RecordError, StudyError, TactileBayesError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import Experiment, contour_problem
from tactile_bayes.inference.misfit import is_inferred
from tactile_bayes.inference.parameters.unknowns import belongs
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.numerics.random_numbers import Seed, child, seed_words
from tactile_bayes.record import CHANNELS, present_channels, rod_of
from tactile_bayes.rig.parameters import COMPLIANCES, MEMORY, STANDARD
from tactile_bayes.rig.stated import stated_values
from tactile_bayes.rig.unknown import DEFAULT
from tactile_bayes.tasks import Kind, Workers, keep_outcomes, open_results_store, versions_of
from tactile_bayes.uncertainty.band import contour_band, length_unit

# Unknowns of the rig, or groups of them, each of which is added or fixed.
_UNKNOWNS = (*STANDARD, "base", "drift", "gain", *MEMORY, *COMPLIANCES, "rest_curvature", "taper", "stem", "length")
_SETTINGS = SamplerSettings(ensembles=2, block_steps=25, max_r_hat=1.05, min_ess=400.0, max_steps=1000)
_EDGES = ("lower", "median", "upper")


class Alternative(NamedTuple):
    """An experiment that differs from another in one assumption."""

    name: str  # the assumption, such as "friction as stated"
    kind: str  # "fixed", "added" or "family"
    experiment: Experiment


class _Outcome(NamedTuple):
    """Band of an alternative."""

    band: tuple[tuple[float, ...], ...]  # lower ends, medians and upper ends at the grid points; empty if there is none
    fits: bool  # true if the record passes its check
    converged: bool
    message: str


@dataclass(frozen=True, eq=False)
class _Study:
    """Alternatives, and the grid points of their bands."""

    alternatives: tuple[Alternative, ...]
    x: Floats
    probability: float
    seed: Seed

    @property
    def identity(self) -> dict[str, str]:
        """Everything that determines the results, as text, for the results store."""
        return {each.name: repr(sorted(each.experiment.about.items())) for each in self.alternatives} | {
            "x": repr(self.x.tolist()),
            "probability": repr(self.probability),
            "seed": seed_words(self.seed),
            "settings": repr(_SETTINGS),
            **versions_of("tactile-bayes"),
        }


def band_by_assumption(
    posterior: xr.DataTree,
    alternatives: Sequence[Alternative],
    x: Floats,
    probability: float = 0.95,
    *,
    seed: Seed,
    out: str | os.PathLike[str] | None = None,
    workers: int | str | Workers | None = None,
) -> xr.Dataset:
    """Infer a record again under every other assumption, and compare the bands. Shapes: x (n,)."""
    study, count = _Study(tuple(alternatives), x, probability, seed), len(alternatives)
    with open_results_store(study.identity, out, _ALTERNATIVES) as store:
        kept = keep_outcomes(store, _inferred, study, count, workers=workers)
    outcomes = [kept[number] for number in range(count)]
    bands = np.array([outcome.band or np.full((len(_EDGES), x.size), np.nan) for outcome in outcomes])
    own = contour_band(posterior, x, probability)
    width = (own["upper"] - own["lower"]).values
    unit = length_unit(posterior)
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = (bands[:, 1] - own["median"].values) / width
    edges = {f"other_{name}": (("assumption", "grid"), bands[:, i], unit) for i, name in enumerate(_EDGES)}
    return xr.Dataset(
        {
            "kind": ("assumption", [each.kind for each in alternatives]),
            "fits": ("assumption", [int(each.fits) for each in outcomes]),
            "converged": ("assumption", [int(each.converged) for each in outcomes]),
            "message": ("assumption", [each.message for each in outcomes]),
            "moved": (("assumption", "grid"), moved, {"units": "1"}),
            **edges,
        },
        coords={"assumption": [each.name for each in alternatives], "grid_x": ("grid", x, unit)},
        attrs={"probability": probability},
    )


def alternatives_of(experiment: Experiment, seen: Inspection | None = None) -> list[Alternative]:
    """Return the experiments that differ in one assumption, except those that the record cannot identify."""
    names, known, found = set(experiment.unknowns.names), experiment.unknowns.known, []
    for group in _UNKNOWNS:
        members = {name for name in names if belongs(name, group)}
        if members:
            found.append(Alternative(f"{group} as stated", "fixed", _as_stated(experiment, members)))
        elif not any(belongs(name, group) for name in known):
            found += _added(experiment, group)
    said = [name for name in experiment.rig.entries if any(belongs(each, name) for each in known)]
    found += [each for name in said for each in _added(experiment, name)]
    found += _limited(experiment, seen or inspect_record(experiment.record, experiment.rig))
    families = [name for name in SHAPES if name != experiment.own_family.name]
    return [*found, *(Alternative(f"family {name}", "family", replace(experiment, family=name)) for name in families)]


def alternatives_by_channel(experiment: Experiment, names: Collection[str]) -> list[Alternative]:
    """Return for each alternative, by its name, that adds a lag or play of all channels those with it in one alone."""
    kinds = [what for what in MEMORY if f"{what} inferred" in names and len(present_channels(experiment.record)) > 1]
    return [each for what in kinds for name in MEMORY[what] for each in _added(experiment, name)]


def _as_stated(experiment: Experiment, names: Collection[str]) -> Experiment:
    """Return the experiment in which some parameters of the rig are known to be as stated."""
    stated = stated_values(rod_of(experiment.record), experiment.noise.cell)
    rig = experiment.rig
    found = None if rig.calibration is None else rig.calibration.without(names)
    said = {name: value for name, value in rig.entries.items() if name not in names}
    own = {name: stated.get(name, 0.0) for name in names}
    said |= {n: value for n, value in own.items() if not np.isnan(value)}  # NaN is a lag of channels that differ
    return replace(experiment, rig=replace(rig, unknown=said, calibration=found))


def _added(experiment: Experiment, group: str) -> list[Alternative]:
    """Return the alternative in which a parameter of the rig, or a group, is unknown; none if no record shows it."""
    names, label, other = experiment.unknowns.names, f"{group} inferred", experiment
    kind = next((what for what in MEMORY if belongs(group, what)), "")
    if kind and "blocks" in experiment.record.attrs:  # the samples between are gone
        return []
    if "lag" in kind and is_inferred("lag", names):
        return []
    if kind == "lag" and _added(experiment, f"{group}_seconds"):  # in place of it, since the record has times
        return []
    if group == "gain" and "rigidity_scale" in names:  # which has the same effect as all gains
        label += " for rigidity_scale"
        other = _as_stated(other, ["rigidity_scale"])
    other = replace(other, rig=other.rig.with_unknown(**{group: DEFAULT}))
    try:
        is_shown = bool(set(other.unknowns.names) - set(names))
    except (ParameterError, RecordError):  # it has the same effect as another unknown, or there are no times
        return []
    return [Alternative(label, "added", other)] if is_shown else []


def stated_cell(experiment: Experiment) -> LoadCell:
    """Return the load cell that is stated."""
    return experiment.rig.load_cell or LoadCell.from_record(experiment.record) or LoadCell()


def _limited(experiment: Experiment, seen: Inspection) -> list[Alternative]:
    """Return the alternative in which readings that stay at their largest value are cut off there; none without."""
    record, cell = experiment.record, stated_cell(experiment)
    at_end = seen.samples["cut_off"].values
    ends: dict[str, float] = {}
    for index, name in enumerate(CHANNELS):
        if at_end[:, index].any() and not np.isfinite(cell.limit[index]):
            entry = f"{name.removeprefix('holding_').split('_')[0]}_range"
            largest = float(f"{np.abs(record[name].values).max():.12g}")
            ends[entry] = max(ends.get(entry, 0.0), largest)
    if not ends:
        return []
    rig = replace(experiment.rig, load_cell=LoadCell.from_entries({**cell.entries(), **ends}))
    return [Alternative("range inferred", "added", replace(experiment, rig=rig))]


def _inferred(task: tuple[_Study, int]) -> _Outcome:
    """Return the band of an alternative; an error is an outcome as well."""
    study, number = task
    try:
        problem = contour_problem(study.alternatives[number].experiment)
        seed = child(study.seed, number)
        found = sampled(problem, seed=seed, settings=_SETTINGS, with_prior=False)
        found.draws.refuse_interrupted(study.alternatives[number].name)
        band = contour_band(found.tree, study.x, study.probability)
        fits = bool(predictive_check(found.tree).attrs["passed"])
    except TactileBayesError as error:
        return _Outcome((), False, False, f"{type(error).__name__}: {error}")
    edges = tuple(tuple(band[name].values.tolist()) for name in _EDGES)
    return _Outcome(edges, fits, found.draws.converged, found.draws.message)


def _decode(row: dict[str, Any]) -> _Outcome:
    band = tuple(tuple(np.nan if v is None else float(v) for v in edge) for edge in row["band"])
    return _Outcome(band, bool(row["fits"]), bool(row["converged"]), str(row["message"]))


_ALTERNATIVES = Kind("alternatives", StudyError, _Outcome._asdict, _decode)

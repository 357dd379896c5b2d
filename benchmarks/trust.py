"""Prints how often the conclusion of `tb.trust` is right, over simulated records of right and of wrong rigs.

Every row is one of the cases of `benchmarks.misspecification`: `trust` judges each posterior, without replicates, which
test the computation alone. A band of 95 % is compared with the truth: in the gap and beside it at grid points, and as a
whole. Of a record that the check finds not described, `tb.causes` names what is wrong: counted is how often the true
cause comes first, and among the first two. The last rows count all records, which are kept in results/trust.

With --causes, nothing is sampled: causes are sought beside the best fit, where it is taken as stated what is wrong.
With --cures, they are inferred again as the first of these causes says, and the band is compared with the truth.
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from benchmarks.misspecification import CASES, SETTINGS
from benchmarks.table import counts_and_names, folder_name, line, stored
from tactile_bayes.assessment.assumptions import alternatives_by_channel, alternatives_of
from tactile_bayes.assessment.causes import causes, causes_beside
from tactile_bayes.assessment.trust import trust
from tactile_bayes.calibration.calibrate import experiment_of
from tactile_bayes.calibration.replicate import make_replicate
from tactile_bayes.calibration.simulated_experiment import SimulatedExperiment
from tactile_bayes.calibration.simulation import simulate
from tactile_bayes.errors import TactileBayesError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.starts.contour_optimum import optimum_beside
from tactile_bayes.numerics.random_numbers import child

OUT = Path("results/trust")
PROBABILITY = 0.95
LOST = "lost"
NAMED = 5.0  # log-evidence above that of the model as it is from which a cause is named
# What is wrong, by the beginning of a case's name, as `tb.causes` calls it.
CAUSE = {
    "friction": "friction",
    "second base": "base",
    "EI": "rigidity_scale",
    "encoder": "drive_angle_offset",
    "backlash": "backlash",
    "load cell": "lever",
    "biases": "bias",
    "curved": "rest_curvature",
    "tapered": "taper",
    "drift": "drift",
    "flat spot": "family shape-free",
}

# Cases, with the ways to infer them that take parabolas.
CHOSEN = [(name, other) for name, runs in CASES.items() for other, run in runs.items() if "family" not in run.options]
CONCLUSIONS = ("holds", "holds, but the prior sets the gap", "do not rely on it")
Row = Mapping[str, Any]


def main(records: int = 6, *names: str) -> None:
    print(f"{records} records of each rig; bands of {PROBABILITY:.0%}; shares of conclusions, and of alarms\n")
    of_bands, of_conclusions = ("in the gap", "beside it", "whole"), ("holds", "prior", "do not")
    of_alarms = ("by parts", "by check", "cause", "of two", "lost")
    print(line("", (*of_bands, *of_conclusions, *of_alarms), 46), flush=True)
    every: list[Row] = []
    for name, other in CHOSEN:
        if names and name not in names:
            continue
        what = f"{name} {other}"
        identity = {"case": what, "probability": repr(PROBABILITY)}
        rows = stored(OUT / folder_name(what), identity, one, (name, other), records)
        every += rows
        print(line(what, cells(rows), 46), flush=True)
    counted = Counter((bool(row["whole"]), row["conclusion"]) for row in every if row["conclusion"] != LOST)
    print("\n" + line("the band as a whole", CONCLUSIONS, 24, 40))
    for held, words in ((True, "did hold"), (False, "did not hold")):
        print(line(words, (counted[held, said] for said in CONCLUSIONS), 24, 40))


def name_causes(records: int = 6, *names: str, cure: bool = False) -> None:
    """Print how often the true cause comes first, and among the first two, of records that the best fit leaves open;
    or the bands with what is shown for the first."""
    print(f"{records} records of each rig, best fits alone; shares are of the misfits\n")
    heads = ("in the gap", "beside it", "whole", "check") if cure else ("cause", "of two", "seconds")
    print(line("", ("misfits", *heads, "lost"), 30), flush=True)
    what, function, cells_of = ("cures", one_cure, cells_of_cures) if cure else ("causes", one_cause, cells_of_causes)
    every: list[Row] = []
    for name, runs in CASES.items():
        if not names or name in names:
            other = "as stated" if "as stated" in runs else ""
            rows = stored(OUT / folder_name(f"{what} of {name}"), {"case": name}, function, (name, other), records)
            every += rows
            print(line(name, cells_of(rows), 30), flush=True)
    print(line("all", cells_of(every), 30))


class Judged(NamedTuple):
    """Causes of the misfit of one record beside its best fit."""

    experiment: SimulatedExperiment
    own: Experiment  # that of the record
    causes: xr.Dataset
    is_misfit: bool
    seconds: float


def judged(task: tuple[tuple[str, str], int]) -> Judged:
    (name, other), number = task
    run = CASES[name][other]
    experiment = experiment_of(rng=2031, rig=run.rig, truth=run.truth, settings=SETTINGS, **run.options)
    for_record, *_ = child(experiment.seed, number).spawn(3)
    measured, truth = simulate(experiment, np.random.default_rng(for_record))[:2]
    model = experiment.problem_of(measured).model
    best = optimum_beside(model, [{name: truth[name] for name in model.forward_parameters if name in truth}])
    known = dict(zip(model.names, best.point.tolist(), strict=True))
    began, own = time.process_time(), replace(experiment.assumed, record=measured)
    found = causes_beside(own, known)
    seconds = time.process_time() - began
    is_open = not found.attrs.get("described", 0) or bool(found.log_evidence.values[:1] > NAMED)
    return Judged(experiment, own, found, is_open, seconds)


def one_cause(task: tuple[tuple[str, str], int]) -> Row:
    """Return the rank of the true cause of one record, and what comes first."""
    name = task[0][0]
    try:
        _, _, found, is_misfit, seconds = judged(task)
    except TactileBayesError as error:
        return {"conclusion": LOST, "summary": str(error)}
    named = found.cause.values.tolist()
    if "misread" in found.attrs:
        said = found.attrs["misread"]
        rank = 1.0 if name.startswith("outliers") and "neighbours" in said else 100.0
        return {"conclusion": "", "misfit": True, "rank": rank, "first": [said], "seconds": seconds}
    rank = _rank(name, named) if is_misfit else math.nan
    return {"conclusion": "", "misfit": is_misfit, "rank": rank, "first": named[:3], "seconds": seconds}


def one_cure(task: tuple[tuple[str, str], int]) -> Row:
    """Return how the band holds that the remedy of the first cause gives of one record."""
    try:
        experiment, own, found, is_misfit, _ = judged(task)
        if not is_misfit or not found.cause.size:
            return {"conclusion": "", "misfit": False}
        first = str(found.cause.values[0])
        first = "family shape-free" if first.startswith(("flat spot", "corner")) else first
        every = alternatives_of(own)
        every += alternatives_by_channel(own, [each.name for each in every])
        assumed = next(each.experiment for each in every if each.name.replace(" inferred", "") == first)
        truth = experiment.truth
        truth = replace(truth, rig=truth.rig or own.rig, family=truth.family or own.own_family)
        cured = replace(
            experiment,
            assumed=replace(assumed, record=experiment.assumed.record),
            truth=truth,
            settings=replace(SETTINGS, walkers=None),
            probability=PROBABILITY,
        )
        numbers = make_replicate(cured, task[1], throw=True).outcome.numbers
    except TactileBayesError as error:
        return {"conclusion": LOST, "summary": str(error)}
    done = {"check_passed": float(numbers["check_passed"]), "converged": float(numbers["converged"])}
    return {"conclusion": "", "misfit": True, "first": first, **bands_of(numbers), **done}


def bands_of(numbers: Mapping[str, float]) -> dict[str, float]:
    """Return the shares of places at which a band holds in the gap and beside it, and 1 if it does as a whole."""
    regions = ("in_gap", "beside")
    wholes = [numbers.get(f"simultaneous_{region}", math.nan) for region in regions]
    whole = float(np.nanmin(wholes)) if np.isfinite(wholes).any() else math.nan
    return {**{region: numbers.get(f"pointwise_{region}", math.nan) for region in regions}, "whole": whole}


def cells_of_cures(rows: list[Row]) -> list[str]:
    left = [row for row in rows if row["conclusion"] != LOST]
    cured = [row for row in left if row["misfit"]]
    means = [_mean(row[key] for row in cured) for key in ("in_gap", "beside", "whole", "check_passed")]
    shown = [f"{mean:.2f}" if mean == mean else "–" for mean in means]
    return [f"{len(cured)}/{len(left)}", *shown, str(len(rows) - len(left))]


def cells_of_causes(rows: list[Row]) -> list[str]:
    left = [row for row in rows if row["conclusion"] != LOST]
    ranks = [rank for rank in (row["rank"] for row in left) if rank is not None and not math.isnan(rank)]
    shares = [f"{_mean(float(rank <= most) for rank in ranks):.0%}" if ranks else "–" for most in (1.0, 2.0)]
    misfits = sum(row["misfit"] for row in left)
    seconds = f"{_mean(row['seconds'] for row in left):.1f}"
    return [f"{misfits}/{len(left)}", *shares, seconds, str(len(rows) - len(left))]


def one(task: tuple[tuple[str, str], int]) -> Row:
    """Return the conclusion on one record, and whether its band held."""
    (name, other), number = task
    run = CASES[name][other]
    options = {"rig": run.rig, "truth": run.truth, "settings": SETTINGS, **run.options}
    try:
        experiment = replace(experiment_of(rng=2031, **options), probability=PROBABILITY)
        replicate = make_replicate(experiment, number, throw=True)
        found = trust(replicate.posterior, rng=1, replicates=0, assumptions=False)
        numbers = replicate.outcome.numbers
        named = [] if numbers["check_passed"] else causes(replicate.posterior).cause.values.tolist()
    except TactileBayesError as error:
        return {"conclusion": LOST, "summary": str(error)}
    return {
        "conclusion": found.attrs["conclusion"],
        "summary": found.attrs["summary"],
        "split_p_value": float(found.split_p_value),
        "check_passed": float(numbers["check_passed"]),
        **bands_of(numbers),
        "rank": math.nan if numbers["check_passed"] else _rank(name, named),
    }


def _rank(case: str, named: list[str]) -> float:
    """Return the place of the true cause among those named, from 1; 100 if it is not there, NaN if none is known."""
    true = next((cause for words, cause in CAUSE.items() if case.startswith(words)), None)
    spots = ("flat spot", "corner") if true == "family shape-free" else ()
    places = [k for k, each in enumerate(named, start=1) if each == true or each.startswith(spots)]
    return math.nan if true is None else float(places[0]) if places else 100.0


def cells(rows: list[Row]) -> list[str]:
    left = [row for row in rows if row["conclusion"] != LOST]
    means = [_mean(row[key] for row in left) for key in ("in_gap", "beside", "whole")]
    shares = [np.mean([row["conclusion"] == said for row in left]) for said in CONCLUSIONS] if left else [math.nan] * 3
    shares += [_mean(row["split_p_value"] <= 0.01 for row in left), _mean(1.0 - row["check_passed"] for row in left)]
    ranks = [rank for rank in (row["rank"] for row in left) if rank is not None and not math.isnan(rank)]
    shares += [_mean(float(rank <= most) for rank in ranks) for most in (1.0, 2.0)]
    texts = [f"{share:.0%}" if share == share else "–" for share in shares]
    return [*(f"{mean:.2f}" for mean in means), *texts, str(len(rows) - len(left))]


def _mean(values: Any) -> float:
    """Return the mean of the numbers that are known; NaN if there are none."""
    known = [float(value) for value in values if value is not None and not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan


if __name__ == "__main__":
    counts, chosen = counts_and_names(sys.argv[1:])
    if {"--causes", "--cures"} & set(sys.argv):
        name_causes(*(counts or [6]), *chosen, cure="--cures" in sys.argv)
    else:
        main(*(counts or [6]), *chosen)

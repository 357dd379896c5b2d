"""Causes of a misfit: which other rigs and families describe a record that the model does not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.assessment.assumptions import Alternative, alternatives_by_channel, alternatives_of, stated_cell
from tactile_bayes.diagnostics.findings import Finding
from tactile_bayes.diagnostics.inspection.inspection import inspect_record
from tactile_bayes.errors import TactileBayesError
from tactile_bayes.inference.contour_problem import contour_problem
from tactile_bayes.inference.deadline import Deadline
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.misfit import CHECK_RIG
from tactile_bayes.inference.result import best_draw
from tactile_bayes.inference.starts.contour_optimum import ContourOptimum, optimum_beside
from tactile_bayes.inference.stored_experiment import experiment_of
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence
from tactile_bayes.record import rod_of
from tactile_bayes.record.rig_entry import rig_entries
from tactile_bayes.rig.stated import stated_values

_SECONDS = 120.0  # time limit of all searches [s], most of which take one or two


def causes(posterior: xr.DataTree, *, rng: Rng) -> xr.Dataset:
    """Try what may be wrong with the rig or the family of a posterior that does not describe its record.

    Each unknown of the rig that is not inferred is added, and each other family taken, and the most probable parameters
    are sought again, without sampling. It takes one or two seconds for each, and two minutes at most.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Random numbers.

    Returns
    -------
    xr.Dataset
        Over "cause", those that describe the record first, then by log_evidence, above that of the model as it is, by
        Laplace's approximation for the noise as it is estimated from the record; describes, 1 if the rest is no more
        than that noise; and remedy, the entries of rig.toml, or the family. If single samples fit no contact until a
        column is read otherwise (another sign, say), or the model describes all but some readings that stand out,
        nothing is tried, and the attribute misread is what `inspect_record` says of it.

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
    >>> causes(wrong, rng=1).cause.values[0]
    'friction'
    """
    experiment, seed = experiment_of(posterior), seed_sequence(rng)
    stated = stated_values(rod_of(experiment.record), stated_cell(experiment))
    drawn = {str(name): float(value) for name, value in best_draw(posterior).data_vars.items()}
    starts = [{**stated, **drawn}, drawn]  # what is added as stated, and at its prior's median
    seen = inspect_record(experiment.record, experiment.rig)
    if misread := [finding for finding in seen.messages if _is_misread(finding)]:
        return _of_readings(misread[:1])
    deadline = Deadline.after(_SECONDS)
    own = _optimum(experiment, starts, seed, deadline)
    if own.fits and (outliers := [finding for finding in seen.messages if finding.kind == "outlier"]):
        return _of_readings(outliers)  # its optimum bears them, and the posterior does not

    def tried(alternatives: list[Alternative]) -> Iterator[tuple[Alternative, ContourOptimum]]:
        for each in alternatives:
            with suppress(TactileBayesError):  # what cannot be tried is no cause
                yield each, _optimum(each.experiment, starts, seed, deadline)

    found = [*tried([each for each in alternatives_of(experiment, seen) if each.kind != "fixed"])]
    better = [each.name for each, one in found if one.log_evidence > own.log_evidence]
    found += tried(alternatives_by_channel(experiment, better))
    found.sort(key=lambda one: (not one[1].fits, -one[1].log_evidence))
    return xr.Dataset(
        {
            "log_evidence": ("cause", [one.log_evidence - own.log_evidence for _, one in found]),
            "describes": ("cause", [int(one.fits) for _, one in found]),
            "remedy": ("cause", [_remedy(each, experiment) for each, _ in found]),
        },
        coords={"cause": [each.name.replace(" inferred", "") for each, _ in found]},
        attrs={"described": int(own.fits)},
    )


def _is_misread(finding: Finding) -> bool:
    """Return whether no contact fits the record as it is, and most do if a column is read otherwise."""
    correction = str(finding.details.get("advice", ""))
    return finding.kind in ("no fit", "below the pivot") and correction != CHECK_RIG and "friction" not in correction


def _of_readings(findings: list[Finding]) -> xr.Dataset:
    """Return causes of which none is sought, since readings are wrong."""
    none: dict[str, Any] = {name: ("cause", []) for name in ("log_evidence", "describes", "remedy")}
    return xr.Dataset(none, attrs={"misread": " ".join(findings)})


def _optimum(
    experiment: Experiment, starts: list[dict[str, float]], seed: np.random.SeedSequence, deadline: Deadline
) -> ContourOptimum:
    return optimum_beside(contour_problem(experiment).model, starts, np.random.default_rng(seed), deadline)


def _remedy(alternative: Alternative, experiment: Experiment) -> str:
    """Return the entries of rig.toml by which an alternative differs, or its family as an option."""
    if alternative.kind == "family":
        return f"--{alternative.name}"
    tables = ((each.rig.entries, stated_cell(each).entries()) for each in (alternative.experiment, experiment))
    pairs = zip(("unknown", "load_cell"), *tables, strict=True)
    changed = ((name, {n: v for n, v in new.items() if old.get(n) != v}) for name, new, old in pairs)
    return ", ".join(rig_entries(entries, name) for name, entries in changed if entries)

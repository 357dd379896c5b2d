"""Which shape it was: families of contours compared by how well they explain a record."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.special import logsumexp
from threadpoolctl import threadpool_limits

from tactile_bayes.checks import check_function, check_mapping, check_names, check_probability, check_switch
from tactile_bayes.comparison.leave_one_out import difference, stacking_weights
from tactile_bayes.comparison.left_out import ForetoldSamples, foretold_samples
from tactile_bayes.comparison.verdict import verdict_on
from tactile_bayes.contours.families import family_named
from tactile_bayes.contours.shape_free_family import SHAPE_FREE
from tactile_bayes.diagnostics.record_check import check_record
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.contour_evidence import WIDTHS, ContourEvidence, contour_evidence
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.contour_problem import contour_problem
from tactile_bayes.inference.contour_start import Walk, walk_of
from tactile_bayes.inference.ensembles import Draws, Progress, SamplerSettings, Seed, settings_of, spawn
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.matched_priors import matched_priors
from tactile_bayes.inference.nuisances import STANDARD
from tactile_bayes.inference.priors import Prior
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rod import Rod
from tactile_bayes.record import record_hash, rod_of

__all__ = ["SHAPES", "compare_families"]

SHAPES = ("parabola", "circle", "ellipse", "power-law", "power-law/power-law", "shape-free")
"""Families that are compared by default: the last but one has flanks of two shapes."""

_USUAL = WIDTHS.index(1.0)

_GIVEN_UP = 100.0
"""By how much the likeliest contour of a family may be below the best evidence for the family not to be sampled."""

_HOPELESS = 20.0
"""By how much the largest log-likelihood of a family whose evidence is not to be had may be below the best evidence
for its probability to be none."""


class _Tried(NamedTuple):
    """What became of one family; of one that was given up, the first entry is all there is."""

    ceiling: float
    """Largest log-likelihood that was seen, which the evidence cannot exceed unless a better contour was missed."""
    draws: Draws | None = None
    evidence: ContourEvidence | None = None
    """None also where it is not to be had from the draws."""
    foretold: ForetoldSamples | None = None
    p_value: float = np.nan
    passed: bool = False


def compare_families(
    measured: xr.Dataset,
    *,
    families: Sequence[str] = SHAPES,
    load_cell: LoadCell | None = None,
    priors: Mapping[str, Mapping[str, Prior]] | None = None,
    seed: Seed,
    rod: Rod | None = None,
    friction: float | None = None,
    nuisances: Sequence[str] = STANDARD,
    leave_one_out: bool = True,
    false_alarm: float = 1e-3,
    settings: SamplerSettings | None = None,
    progress: Callable[[str, Progress], object] | None = None,
) -> xr.Dataset:
    """Which shape a record is of: the probability of each of several families of contours.

    Each family's posterior is inferred, and three things are asked of it, which need not agree. Its *evidence*, the
    density of the record under the family's prior, gives the probability that the contour is of this family if it is
    of one of them, all being as likely beforehand. *Leave-one-out* densities tell how well the family foretells a
    sample from all the others, and hardly depend on the prior. The *check* tells whether the record looks like one of
    the family at all: a family may be the most probable one and wrong.

    Parameters
    ----------
    measured : xr.Dataset
        A record, as of `infer_contour`.
    families : sequence of str
        Two at least; families of `infer_contour`.
    load_cell, rod, friction, nuisances
        As of `infer_contour`, and the same for all families.
    priors : mapping of str to mapping, optional
        By family, in place of some of the default priors (see Notes).
    seed : int or numpy.random.SeedSequence
        The same seed, the same result.
    leave_one_out : bool
        Whether leave-one-out densities are asked for, which takes as long again.
    false_alarm : float
        Probability at which the check finds fault with the family that is right.
    settings : SamplerSettings, optional
        Of every posterior.
    progress : callable, optional
        Is given a family and a `Progress` after each look at the diagnostics.

    Returns
    -------
    xr.Dataset
        Over "family":

        probability
            Given that the contour is of one of them; NaN throughout if the evidence of one is not to be had that might
            count.
        log_evidence, log_evidence_error
            Logarithm of the evidence, and the error of its computation; NaN where walkers did not find together.
        probability_by_width (prior_width, family)
            The same with priors of sizes, exponents, amplitude and length scale of ½, 1 and 2 times the width: where it
            depends on that much, the record says little.
        elpd, elpd_error
            Sum of the samples' leave-one-out log-densities, and the Monte-Carlo error of that.
        elpd_difference, elpd_difference_error
            Less that of the family with the largest, and its standard error from the scatter between samples. A
            difference of less than 4 is little (Sivula et al. 2020, arXiv:2008.10296).
        weight
            Of the mixture of families that foretells best (stacking; Yao et al. 2018, doi 10.1214/17-BA1091).
        largest_k (family)
            Largest Pareto k̂ of the importance sampling; above 0.7 its density cannot be trusted.
        p_value, fits
            Of `check_record`, and whether it passes.
        log_likelihood
            The largest where walkers start: near the family's best.
        sampled
            Whether the family was sampled: one whose largest log-likelihood is 100 below the best evidence is not, has
            no probability, and does not fit.
        converged, steps, seconds
            Of the posterior.

        And `log_density` (family, sample), leave-one-out. Attributes: `verdict` in words, `most_probable`, `none_fits`
        (1 if no family passes the check), `nuisances` that were inferred (JSON), `friction` as stated, `data_sha256`
        of the record.

    Raises
    ------
    RecordError, ParameterError, InferenceError
        As of `infer_contour`; ParameterError if there are not at least two different families.
    KeyboardInterrupt
        At Ctrl-C: of families some of which were cut short, nothing is to be said.

    Notes
    -----
    So that no family is favoured by its prior, sizes have priors for which the mean curvature of a flank is expected
    to be the same in all of them (`matched_priors`); everything else has the defaults of `infer_contour`. The evidence
    is that of contours within reach. It is found by bridge sampling (Meng & Wong 1996) from the posterior's draws.

    Unit of leave-one-out is a sample with its three channels. Where a load cell drifts or has an unknown bias, a
    sample's density is that given all other samples. Samples next to first contact and snap-off are foretold from a
    posterior that is inferred again without them, since importance sampling cannot reach contours that would have let
    go earlier; of a load cell that drifts they are left out, of all families alike.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, SamplerSettings, scan
    >>> from tactile_bayes.contours import Circle
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(Circle(0.8, q=0.5), drive_step=0.1).record, seed=1)
    >>> quick = SamplerSettings(ensembles=2, min_ess=200, max_r_hat=1.1)
    >>> options = {"load_cell": cell, "nuisances": [], "leave_one_out": False, "settings": quick}
    >>> found = compare_families(measured, families=["circle", "ellipse", "parabola"], seed=1, **options)
    >>> found.attrs["most_probable"], found.fits.values.tolist()
    ('circle', [True, True, False])
    """
    settings = settings_of(settings)
    check_switch("leave_one_out", leave_one_out)
    check_probability("false_alarm", false_alarm, "give a probability between 0 and 1, such as 1e-3")
    check_function("progress", progress)
    names = _checked(families, priors)
    experiment = Experiment(measured, SHAPE_FREE.name, load_cell, {}, rod, friction, nuisances)
    length = rod_of(experiment.record).length
    seeds = dict(zip(names, spawn(seed, len(names)), strict=True))
    tried: dict[str, _Tried] = {}
    problems = {}
    for name in names:
        own = {**matched_priors(name, length), **(priors or {}).get(name, {})}
        problems[name] = contour_problem(replace(experiment, family=name, priors=own))
    # What fits anything comes first: others that are far from fitting need not be sampled then.
    for name, problem in sorted(problems.items(), key=lambda item: item[0] != SHAPE_FREE.name):
        best = max((one.evidence.log_evidence[_USUAL] for one in tried.values() if one.evidence), default=-np.inf)
        of_family = spawn(seeds[name], 4)
        with threadpool_limits(1):
            walk = walk_of(problem.model, of_family[0], settings)
            ceiling = _ceiling(problem.model, walk)
        if ceiling < best - _GIVEN_UP:
            tried[name] = _Tried(ceiling)
            continue
        watch = None if progress is None else functools.partial(progress, name)
        found = sampled(problem, seed=of_family[1], settings=settings, progress=watch, walk=walk)
        found.draws.refuse_interrupted(name)
        try:
            evidence = contour_evidence(problem.model, found, np.random.default_rng(of_family[2]))
        except InferenceError:
            evidence = None
        foretold = foretold_samples(problem, found, seed=of_family[3], settings=settings) if leave_one_out else None
        check = check_record(found.tree, false_alarm=false_alarm)
        p_value, passed = float(check.overall_p_value), bool(check.attrs["passed"])
        tried[name] = _Tried(ceiling, found.draws, evidence, foretold, p_value, passed)
    asked = {name: problem.about[name] for name in ("nuisances", "friction")}
    return _labelled({name: tried[name] for name in names}, asked).assign_attrs(
        data_sha256=record_hash(experiment.record)
    )


def _ceiling(model: ContourModel, walk: Walk) -> float:
    """The largest log-likelihood where walkers start."""
    points, _ = walk.coordinates.parameters(walk.start.reshape(-1, len(model.names)))
    return float(np.max(model.log_probability(points) - model.log_prior(points)))


def _checked(families: Sequence[str], priors: Mapping[str, Mapping[str, Prior]] | None) -> list[str]:
    if isinstance(families, str):
        raise ParameterError(f"families is {families!r}: give several, like ['parabola', {families!r}]")
    names = [family_named(name).name for name in check_names("families", families)]
    if len(set(names)) < 2 or len(set(names)) < len(names):
        raise ParameterError(f"families are {', '.join(names) or 'none'}: give two or more different ones")
    check_mapping("priors", priors, "give those of each family by its name, {'circle': {'r': ...}}")
    for name, of_family in (priors or {}).items():
        if name not in names:
            raise ParameterError(f"there are priors for {name!r}, which is not among the families {', '.join(names)}")
        check_mapping(f"priors[{name!r}]", of_family, "give distributions by name of a parameter")
    return names


def _labelled(tried: Mapping[str, _Tried], asked: Mapping[str, Any]) -> xr.Dataset:
    evidences = np.full((len(tried), len(WIDTHS)), np.nan)
    errors = np.full(len(tried), np.nan)
    for i, one in enumerate(tried.values()):
        if one.evidence is not None:
            evidences[i], errors[i] = one.evidence.log_evidence, one.evidence.standard_error
    ceilings = np.array([one.ceiling for one in tried.values()])
    hopeless = np.isnan(errors) & (ceilings < np.nanmax(np.append(evidences, -np.inf)) - _HOPELESS)
    counted = np.where(hopeless[:, None], -np.inf, evidences)
    complete = not np.isnan(counted).any()
    by_width = np.exp(counted - logsumexp(counted, axis=0)) if complete else np.full(evidences.shape, np.nan)
    runs = [one.draws for one in tried.values()]
    variables = {
        "probability": ("family", by_width[:, _USUAL]),
        "log_evidence": ("family", evidences[:, _USUAL]),
        "log_evidence_error": ("family", errors),
        "log_likelihood": ("family", ceilings),
        "probability_by_width": (("prior_width", "family"), by_width.T),
        "p_value": ("family", [one.p_value for one in tried.values()]),
        "fits": ("family", [one.passed for one in tried.values()]),
        "sampled": ("family", [run is not None for run in runs]),
        "converged": ("family", [run is not None and run.converged for run in runs]),
        "steps": ("family", [0 if run is None else run.steps_run for run in runs]),
        "seconds": ("family", [0.0 if run is None else run.seconds for run in runs]),
    }
    foretold = [one.foretold for one in tried.values()]
    if any(of_family is not None for of_family in foretold):
        variables |= _left_out(foretold)
    result = xr.Dataset(variables, coords={"family": list(tried), "prior_width": list(WIDTHS)}, attrs=asked)
    result.attrs |= {
        "verdict": verdict_on(result),
        "most_probable": str(result.family.values[np.argmax(result.probability.values)]) if complete else "",
        "none_fits": int(not result.fits.any()),
    }
    return result


def _left_out(foretold: Sequence[ForetoldSamples | None]) -> dict[str, Any]:
    """NaN for families that were given up, whose weight is none."""
    known = [of_family for of_family in foretold if of_family is not None]
    sampled = np.array([of_family is not None for of_family in foretold])
    logs = np.array([of_family.log_density for of_family in known])
    common = np.isfinite(logs).all(axis=0)
    elpd = logs[:, common].sum(axis=1)
    apart = [difference(of_family, logs[np.argmax(elpd), common]) for of_family in logs[:, common]]
    columns = {
        "elpd": elpd,
        "elpd_error": [np.sqrt(np.sum(of_family.standard_error[common] ** 2)) for of_family in known],
        "elpd_difference": [one.difference for one in apart],
        "elpd_difference_error": [one.standard_error for one in apart],
        "weight": stacking_weights(logs[:, common]),
        "largest_k": [np.nanmax(of_family.pareto_k) for of_family in known],
    }
    every = np.full((len(foretold), logs.shape[1]), np.nan)
    every[sampled] = logs
    out: dict[str, Any] = {"log_density": (("family", "sample"), every)}
    for name, values in columns.items():
        of_all = np.full(len(foretold), 0.0 if name == "weight" else np.nan)
        of_all[sampled] = values
        out[name] = ("family", of_all)
    return out

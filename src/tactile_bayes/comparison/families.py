"""Comparison of families of contours by evidence, cross-validation and the check of the record."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.special import logsumexp
from threadpoolctl import threadpool_limits

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_function, check_probability, check_switch, refused
from tactile_bayes.comparison.leave_one_out import LeftOut, predicted_samples, stacking_weights
from tactile_bayes.contours.families import family_named
from tactile_bayes.contours.shape_free_family import SHAPE_FREE
from tactile_bayes.diagnostics.predictive_check import predictive_check
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.ensembles import Draws, Progress, SamplerSettings, settings_of
from tactile_bayes.inference.evidence import WIDTHS, Evidence, contour_evidence
from tactile_bayes.inference.experiment import Experiment, contour_problem
from tactile_bayes.inference.family import Family, family_of
from tactile_bayes.inference.misfit import what_to_try
from tactile_bayes.inference.parameters.priors import matched_priors, refuse_other_rig
from tactile_bayes.inference.starts.contour_start import walk_of
from tactile_bayes.numerics.random_numbers import Rng, spawn
from tactile_bayes.numerics.selection import evenly_spread
from tactile_bayes.record import record_hash, rod_of
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.tasks.documents import read_json
from tactile_bayes.uncertainty.rod_reach import reach_attributes

# Families that are compared by default; the last but one has flanks of two shapes.
SHAPES = ("parabola", "circle", "ellipse", "power-law", "power-law/power-law", "shape-free")
_USUAL = WIDTHS.index(1.0)

# Distance of a family's largest log-likelihood below the best log-evidence from which the family is not sampled.
GIVEN_UP = 100.0
# Distance of the largest log-likelihood of a family without evidence below the best log-evidence from which the
# family's probability is zero.
_HOPELESS = 20.0

_KEPT_DRAWS = 2000  # largest number of draws of a contour that are kept of each family
BY_DRAW = ("family", "contour_draw", "contour_parameter")
# Beginning of the verdict if no family passes the check.
NONE_FITS = "None fits: with the rig as assumed, the record does not look like one of any of these shapes"
_LIKELY = 0.05  # smallest probability with which a family is named


class _Tried(NamedTuple):
    """Result of one family; a family that is not sampled has the first entry alone."""

    ceiling: float  # largest log-likelihood found, which the evidence cannot exceed unless a better contour was missed
    draws: Draws | None = None
    evidence: Evidence | None = None  # None also where it cannot be computed from the draws
    predicted: LeftOut | None = None
    p_value: float = np.nan
    passed: bool = False


def compare_families(
    measured: xr.Dataset,
    families: Sequence[Family | str] = SHAPES,
    rig: Rig | None = None,
    *,
    rng: Rng,
    leave_one_out: bool = True,
    false_alarm: float = 1e-3,
    settings: SamplerSettings | None = None,
    progress: Callable[[str, Progress], object] | None = None,
) -> xr.Dataset:
    """Compare families of contours for a record, and return the probability of each.

    Each family is judged by three criteria, which need not agree. Its *evidence*, the density of the record under its
    prior, gives the probability that the contour is of this family if it is of one of them, with equal prior
    probabilities. *Leave-one-out* densities measure how well it predicts a sample from all others, and depend little on
    the prior. The *check* tests whether the record looks like one of it at all: the most probable one may be wrong.

    Parameters
    ----------
    measured : xr.Dataset
        A record, as for `infer_contour`.
    families : sequence of str or Family
        Two or more families of `infer_contour`; the distributions of a `Family` replace default priors (see Notes).
    rig : Rig, optional
        As in `infer_contour`, the same for all families.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Random numbers; the same seed gives the same result.
    leave_one_out : bool
        If True, leave-one-out densities are computed, which doubles the time.
    false_alarm : float
        Probability at which the check rejects the right family, in (0, 1).
    settings : SamplerSettings, optional
        Settings of the sampler for every posterior.
    progress : callable, optional
        Called with a family and a `Progress` after each diagnosis.

    Returns
    -------
    xr.Dataset
        Over "family":

        - probability, if the contour is of one of them; NaN throughout if an evidence that might count is missing;
        - log_evidence and log_evidence_error, of its computation; NaN where the ensembles did not agree;
        - probability_by_width, over "prior_width" too: with priors of sizes, exponents, amplitude and length scale ½, 1
          and 2 times as wide; if it depends on the width, the record is hardly informative;
        - elpd and elpd_error: expected log predictive density, the sum of the samples' leave-one-out log-densities, and
          its Monte-Carlo error;
        - elpd_difference and elpd_difference_error: elpd less that of the family with the largest, and its standard
          error from the scatter between samples; less than 4 is small (Sivula et al. 2020, arXiv:2008.10296);
        - weight in the mixture that predicts best (stacking; Yao et al. 2018, doi 10.1214/17-BA1091);
        - largest_k: largest Pareto k̂ of the importance sampling; above 0.7 its density is unreliable (Vehtari et al.
          2024, JMLR 25(72));
        - p_value and fits: overall p-value of `check`, and whether it passes; NaN and False where it was not made;
        - log_likelihood: the largest among the starting points of the walkers, near the family's maximum;
        - sampled: False if the largest log-likelihood is 100 below the best evidence; such a family has no probability,
          and does not fit;
        - converged, steps and seconds: convergence, number of steps and time [s] of the posterior;
        - contour_draws, over "contour_draw" and "contour_parameter": parameters in the family's order, of which
          `contour_band` computes a band averaged over families; NaN beyond their number, and if not sampled.

        `log_density` (family, sample) holds the leave-one-out log-densities. Attributes: `verdict`, a sentence;
        `most_probable`; `none_fits` (1 if no family passes the check); `nuisances`, those inferred (JSON); `friction`
        as stated; `data_sha256` of the record; `reach_left` and `reach_right`, the ends of what the rod can touch.

    Raises
    ------
    RecordError, ParameterError, InferenceError
        As for `infer_contour`; ParameterError also if there are fewer than two different families.
    KeyboardInterrupt
        At Ctrl-C, since families cannot be compared if sampling of some was cut short.

    Notes
    -----
    So that no family is favoured, sizes have priors under which the geometric mean radius of curvature of a flank has
    the same median and spread in all families (`matched_priors`); all else has the defaults of `infer_contour`. The
    evidence is that of contours within reach, by bridge sampling (Meng & Wong 1996) from the posterior's draws.

    Leave-one-out leaves out a sample with its three channels, given all the others if a load cell drifts or has an
    unknown bias. Samples next to first contact and snap-off are predicted from a posterior that is inferred again
    without them, since importance sampling cannot reach contours that would have let go earlier; if the load cell
    drifts, they are left out for all families alike.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, SamplerSettings, scan
    >>> from tactile_bayes.contours import Circle
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(Circle(1.0, q=0.5), drive_step=0.04).record, rng=1)
    >>> quick = SamplerSettings(ensembles=2, min_ess=200, max_r_hat=1.1)
    >>> options = {"rig": Rig(load_cell=cell, unknown="nothing"), "leave_one_out": False, "settings": quick}
    >>> found = compare_families(measured, ["circle", "ellipse", "parabola"], rng=1, **options)
    >>> found.attrs["most_probable"], found.fits.values.tolist()
    ('circle', [True, True, False])
    """
    settings = settings_of(settings)
    check_switch("leave_one_out", leave_one_out)
    check_probability("false_alarm", false_alarm, "give a probability between 0 and 1, such as 1e-3")
    check_function("progress", progress)
    compared = {family.name: family for family in checked_families(families)}
    experiment = Experiment(measured, rig_of(rig), SHAPE_FREE.name, settings.events)
    if experiment.rig.calibration is not None:
        refuse_other_rig(experiment.rig.calibration, experiment.about)
    length = rod_of(experiment.record).length
    seeds = dict(zip(compared, spawn(rng, len(compared)), strict=True))
    tried: dict[str, _Tried] = {}
    problems = {
        name: contour_problem(replace(experiment, family=matched(one, length))) for name, one in compared.items()
    }
    # The shape-free family fits any record and comes first, so that families far from fitting need not be sampled.
    for name, problem in sorted(problems.items(), key=lambda item: item[0] != SHAPE_FREE.name):
        best = max((one.evidence.log_evidence[_USUAL] for one in tried.values() if one.evidence), default=-np.inf)
        of_family = spawn(seeds[name], 4)
        with threadpool_limits(1):
            walk = walk_of(problem.model, of_family[0], settings)
            points, _ = walk.coordinates.parameters(walk.start.reshape(-1, len(problem.model.names)))
            ceiling = float(np.max(problem.model.log_probability(points) - problem.model.log_prior(points)))
        if ceiling < best - GIVEN_UP:
            tried[name] = _Tried(ceiling)
            continue
        watch = None if progress is None else functools.partial(progress, name)
        found = sampled(problem, seed=of_family[1], settings=settings, progress=watch, walk=walk)
        found.draws.refuse_interrupted(name)
        try:
            evidence = contour_evidence(problem.model, found, np.random.default_rng(of_family[2]))
        except InferenceError:
            evidence = None
        predicted = predicted_samples(problem, found, seed=of_family[3], settings=settings) if leave_one_out else None
        check = predictive_check(found.tree, false_alarm=false_alarm)
        p_value, passed = float(check.overall_p_value), bool(check.attrs["passed"])
        tried[name] = _Tried(ceiling, found.draws, evidence, predicted, p_value, passed)
    asked = {name: problem.about[name] for name in ("nuisances", "friction")}
    comparison = _labelled({name: tried[name] for name in compared}, asked)
    drawn = [(family, tried[name].draws) for name, family in compared.items()]
    comparison["contour_draws"] = (BY_DRAW, _contour_draws(drawn))
    record = experiment.record
    about = {"data_sha256": record_hash(record), "units": record.attrs["units"], **reach_attributes(record)}
    return comparison.assign_attrs(about)


def checked_families(families: Sequence[Family | str]) -> list[Family]:
    """Return the families that are to be compared."""
    if isinstance(families, str | Family):
        raise ParameterError(f"families is {families!r}: give several, like ['parabola', {families!r}]")
    listed: Any = families.tolist() if isinstance(families, np.ndarray) else families
    if not isinstance(listed, Sequence | Set):
        raise refused("families", families, "give several, like ['parabola', 'circle']")
    found = [family_of(family) for family in listed]
    names = [family.name for family in found]
    if len(set(names)) < 2 or len(set(names)) < len(names):
        raise ParameterError(f"families are {', '.join(names) or 'none'}: give two or more different ones")
    return found


def matched(family: Family, length: float) -> Family:
    """Return a family with matched priors of its sizes, for a rod of a length, where nothing is said of them."""
    return Family(family.name, **{**matched_priors(family.name, length), **family.priors, **family.known})


def with_known(family: Family, points: Floats) -> Floats:
    """Return all parameters of contours, shape (n, parameters), from points that begin with the unknown ones."""
    values: dict[str, Any] = {**family.known, **dict(zip(family.contours.parameters, points.T, strict=False))}
    every = [values[name] for name in family_named(family.name).parameters]
    return np.stack(np.broadcast_arrays(*every), axis=1)


def _labelled(tried: Mapping[str, _Tried], asked: Mapping[str, Any]) -> xr.Dataset:
    """Return the comparison of families; `asked` are further attributes."""
    found = list(tried.values())
    evidences = np.array([one.evidence.log_evidence if one.evidence else [np.nan] * len(WIDTHS) for one in found])
    errors = np.array([one.evidence.standard_error if one.evidence else np.nan for one in found])
    ceilings = np.array([one.ceiling for one in found])
    hopeless = np.isnan(errors) & (ceilings < np.nanmax(np.append(evidences, -np.inf)) - _HOPELESS)
    counted = np.where(hopeless[:, None], -np.inf, evidences)
    complete = not np.isnan(counted).any()
    by_width = np.exp(counted - logsumexp(counted, axis=0)) if complete else np.full(evidences.shape, np.nan)
    of_families = {
        "probability": by_width[:, _USUAL],
        "log_evidence": evidences[:, _USUAL],
        "log_evidence_error": errors,
        "log_likelihood": ceilings,
        "p_value": [one.p_value for one in found],
        "fits": [one.passed for one in found],
        "sampled": [one.draws is not None for one in found],
        "converged": [one.draws is not None and one.draws.converged for one in found],
        "steps": [one.draws.steps_run if one.draws else 0 for one in found],
        "seconds": [one.draws.seconds if one.draws else 0.0 for one in found],
    }
    result = xr.Dataset(
        {name: ("family", values) for name, values in of_families.items()}
        | {"probability_by_width": (("prior_width", "family"), by_width.T)}
        | _left_out([one.predicted for one in found]),
        coords={"family": list(tried), "prior_width": list(WIDTHS)},
        attrs=asked,
    )
    result.attrs["none_fits"] = int(np.isfinite(result.p_value.values).any() and not result.fits.any())
    result.attrs |= {
        "verdict": verdict_on(result),
        "most_probable": str(result.family.values[np.argmax(result.probability.values)]) if complete else "",
    }
    return result


def _contour_draws(drawn: Sequence[tuple[Family, Draws | None]]) -> Floats:
    """Return draws of the contours' parameters, evenly picked, shape (families, draws, parameters)."""
    sizes = [len(family_named(family.name).parameters) for family, _ in drawn]
    kept = [draws.samples.reshape(-1, len(draws.names)) for _, draws in drawn if draws is not None]
    count = min([_KEPT_DRAWS, *(len(samples) for samples in kept)])
    found = np.full((len(sizes), count, max(sizes)), np.nan)
    for of_family, size, (family, draws) in zip(found, sizes, drawn, strict=True):
        if draws is not None:
            every = draws.samples.reshape(-1, len(draws.names))
            of_family[:, :size] = with_known(family, every[evenly_spread(len(every), count)])
    return found


def _left_out(predicted: Sequence[LeftOut | None]) -> dict[str, Any]:
    """Return the leave-one-out variables, if there are any; NaN, with weight 0, for families that were not sampled."""
    known = [np.array(of_family) for of_family in predicted if of_family is not None]
    if not known:
        return {}
    sampled = np.array([of_family is not None for of_family in predicted])
    every = np.full((3, len(predicted), known[0].shape[1]), np.nan)
    every[:, sampled] = np.stack(known, axis=1)
    logs, errors, tails = every
    common = np.isfinite(logs[sampled]).all(axis=0)
    if np.count_nonzero(common) < 2:
        raise ParameterError("fewer than two samples are possible under all families: they cannot be compared")
    elpd, weight = logs[:, common].sum(axis=1), np.zeros(len(predicted))
    weight[sampled] = stacking_weights(logs[np.ix_(sampled, common)])
    # Equation 24 of Vehtari, Gelman & Gabry 2017, doi 10.1007/s11222-016-9696-4.
    behind = logs[:, common] - logs[np.nanargmax(elpd), common]
    of_families = {
        "elpd": elpd,
        "elpd_error": np.sqrt(np.sum(errors[:, common] ** 2, axis=1)),
        "elpd_difference": behind.sum(axis=1),
        "elpd_difference_error": np.sqrt(behind.shape[1]) * behind.std(axis=1, ddof=1),
        "weight": weight,
        "largest_k": np.fmax.reduce(tails, axis=1),
    }
    found: dict[str, Any] = {name: ("family", values) for name, values in of_families.items()}
    return found | {"log_density": (("family", "sample"), logs)}


def verdict_on(result: xr.Dataset) -> str:
    """Return the verdict on a comparison of families, from the result of `compare_families`."""
    names = [str(name) for name in result.family.values]
    fits, checked = result.fits.values, np.isfinite(result.p_value.values)
    if checked.any() and not fits.any():
        return f"{NONE_FITS} ({', '.join(names)}). Probabilities say which of them is the least wrong. " + what_to_try(
            names, read_json(result.attrs["nuisances"], "nuisances"), friction=result.attrs["friction"]
        )
    parts = []
    probability = result.probability.values
    if np.isnan(probability).any():
        lacking = [name for name, value in zip(names, result.log_evidence.values, strict=True) if np.isnan(value)]
        parts.append(f"No probabilities: the evidence of {', '.join(lacking)} cannot be computed from its draws")
    else:
        order = np.argsort(probability)[::-1]
        likely = [i for i in order if probability[i] >= _LIKELY]
        parts.append(", ".join(f"{names[i]} with probability {_share(probability[i])}" for i in likely))
        if checked[order[0]] and not fits[order[0]]:
            parts.append(f"but a record of a {names[order[0]]} would not look like this one")
        elif names[order[0]] == "shape-free":
            parts.append("that is, a smooth contour of none of the other shapes")
        firm = result.probability_by_width.values[:, order[0]]
        if firm.min() < 0.5 <= firm.max():
            parts.append(
                f"which depends on the width of the priors: from {_share(firm.min())} to {_share(firm.max())} with "
                "half and twice the width"
            )
    if not checked.any():
        parts.append("whether the record looks like one of them was not checked: too few samples are loaded")
    poor = [name for name, good in zip(names, (result.converged | ~result.sampled).values, strict=True) if not good]
    if poor:
        parts.append(f"not converged: {', '.join(poor)}")
    return "; ".join(parts)


def _share(probability: float) -> str:
    return "above 0.999" if probability > 0.999 else f"{probability:.2g}"

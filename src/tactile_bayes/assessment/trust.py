"""Trust in a posterior for one record: does its band hold here, and what does it rest on."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from tactile_bayes.arrays import Floats
from tactile_bayes.assessment.assumptions import alternatives_of, band_by_assumption
from tactile_bayes.assessment.posterior_calibration import posterior_calibration
from tactile_bayes.assessment.prior_sensitivity import prior_sensitivity
from tactile_bayes.assessment.sampling_error import sampling_error
from tactile_bayes.assessment.split_prediction import split_prediction
from tactile_bayes.assessment.wording import UNCONVERGED, conclusion, sentences
from tactile_bayes.checks import check_path, check_probability, check_switch, check_whole_number
from tactile_bayes.diagnostics.predictive_check import predictive_check
from tactile_bayes.diagnostics.result_check import probability_of
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.experiment import experiment_of
from tactile_bayes.inference.family import Family
from tactile_bayes.inference.result import contour_draws, read_result
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence, seed_words
from tactile_bayes.rig.rig import Rig
from tactile_bayes.tasks import TaskProgress, Workers, workers_of
from tactile_bayes.uncertainty.band import contour_band
from tactile_bayes.uncertainty.rod_reach import reach
from tactile_bayes.uncertainty.summary import gap_if_any

# Number of grid points of each region, the gap and both sides of it, at which the effect of the prior is computed.
_GRID_POINTS = 9
_EVERY = 5  # every so many grid points of the band, those of other assumptions are computed
_OF_CALIBRATION = ("rank_p_value", "coverage", "coverage_error", "coverage_replicates", "noticed_below")


def trust(
    run_or_posterior: str | os.PathLike[str] | xr.DataTree,
    *,
    replicates: int = 100,
    assumptions: bool = True,
    probability: float | None = None,
    family: Family | None = None,
    rig: Rig | None = None,
    rng: Rng,
    out: str | os.PathLike[str] | None = None,
    workers: int | str | Workers | None = None,
) -> xr.Dataset:
    """Judge whether the band of a posterior holds for this record, and what it rests on.

    Five questions are answered. *Do parts of the record agree?* Each sweep, each pivot, and the earlier and later half
    of the contacts alone predict the rest: this sees what the model lacks, such as friction, a zero that moves, a
    slipped pivot, a wrong family. *Does the computation hold here?* Truths are drawn from this posterior, records
    predicted from them, and both inferred again (posterior simulation-based calibration): this sees a wrong sampler,
    and says how often the intervals hold for objects and rigs like this one. *What does the prior do?* Prior and
    likelihood are raised to a power near one. *Which assumption matters?* The band is computed again with each unknown
    of the rig added or fixed, and with each other family. *How exact is the sampling?* The Monte-Carlo error of the
    band. The second and the fourth are asked of converged posteriors alone.

    Parameters
    ----------
    run_or_posterior : path-like or xr.DataTree
        Folder that `tactile-bayes infer` has written, its posterior.nc, or a result of `infer_contour`.
    replicates : int
        Number of truths that are drawn and inferred again, 0 for none; each takes one or two seconds on one core, some
        tens with a shape-free family.
    assumptions : bool
        Whether the band is computed again under other assumptions, in some ten seconds each.
    probability : float, optional
        Probability of the band, in (0, 1); by default that of the run, or 0.95.
    family, rig : Family and Rig, optional
        Arguments of `infer_contour`, needed only if one of their distributions is none of SciPy's, like a histogram.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Seed of all random numbers; the results do not depend on the number of workers.
    out : path-like, optional
        Folder of the replicates and alternatives: a run that was killed resumes.
    workers
        As in `calibrate`.

    Returns
    -------
    xr.Dataset
        The band over "x" [length]: lower, median, upper, and their lower_error, median_error and upper_error (share, of
        the width; draws, effective_draws, and draws_needed for a tenth of it); where the calibration shows that it is
        too narrow, corrected_lower and corrected_upper, its ends farther from the median by the factor of each region.

        Over "part": part_p_value, part_sd, moves (part, parameter); split_p_value of all; check_p_value of `check`.

        Over "quantity": sensitivity (quantity, component), set_by.

        If there are replicates: rank_p_value (ranked), coverage, coverage_error, coverage_replicates and noticed_below
        (claim), factor and corrected (region).

        Over "assumption", if asked for: kind, fits, converged, message; moved_in_gap and moved_beside, the largest
        distance of the medians over the width of the band there; over "grid" too: other_lower, other_median,
        other_upper, moved.

        Attributes: conclusion, "holds", "holds, but the prior sets the gap" or "do not rely on it"; summary, a sentence
        with the reasons; words, all sentences, one in a line; probability; draws_sha256 of the posterior.

    Raises
    ------
    ParameterError
        If an argument is impossible.
    InferenceError
        If there is no posterior of a contour with its predictions and unloaded samples, too few samples are loaded, or
        more than 2000 share a drift process or a bias that is integrated out.
    CalibrationError
        If `out` holds replicates of another posterior, or another run uses it.
    TaskError
        As in `calibrate`.

    Notes
    -----
    The alarm of the parts has a probability of at most 1 % if the model holds, that of the check 0.1 %, and that of the
    calibration 1 %. Faults that leave the readings as they are, such as a shift of pivot and object together, are
    unobservable for any of them.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, SamplerSettings, infer_contour, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> quick = SamplerSettings(ensembles=2, min_ess=200, max_r_hat=1.05)
    >>> for friction in (0.0, 0.005):
    ...     real = Rig(unknown={"friction": friction})
    ...     sweep = scan(paper_profile("II", q=0.5), real, drive_step=0.1).record
    ...     posterior = infer_contour(cell.measure(sweep, rng=1), rig=Rig(unknown="nothing"), rng=1, settings=quick)
    ...     print(trust(posterior, rng=1, replicates=0, assumptions=False).attrs["conclusion"])
    holds
    do not rely on it
    """
    check_whole_number("replicates", replicates, 0)
    check_switch("assumptions", assumptions)
    seed, workers = seed_sequence(rng), workers_of(workers)
    if out is not None:
        check_path("out", out, "give the path of a folder, or None")
    posterior = _posterior_of(run_or_posterior)
    chance = check_probability("probability", probability_of(posterior) if probability is None else probability)
    experiment = experiment_of(posterior, family, rig)
    if not experiment.events:
        raise InferenceError("the posterior leaves unloaded samples out (events=False): infer it with them")
    is_converged = bool(posterior.attrs.get("converged", 1))
    if not is_converged:
        replicates, assumptions = 0, False
    x = reach(posterior)
    regions = _regions(posterior, x, chance)
    with threadpool_limits(1):  # the arrays are small: threads would only wait for one another
        found, check, parts = _of_draws(posterior, experiment.model, x, chance, regions)
    others = alternatives_of(experiment) if assumptions else []
    calibrated: xr.Dataset | None = None

    def of_all(before: int) -> Workers:
        def report(now: TaskProgress) -> None:
            if workers.progress is not None:
                workers.progress(now._replace(done=before + now.done, wanted=replicates + len(others)))

        return Workers(workers.where, report)

    if replicates:
        calibrated = posterior_calibration(
            posterior, experiment, seed=seed, replicates=replicates, probability=chance, out=out, workers=of_all(0)
        )
        of_claims = calibrated[list(_OF_CALIBRATION)].rename(quantity="ranked")
        found = found.merge(of_claims).merge(calibrated[["factor", "corrected"]])
        found = found.assign(_corrected(found, regions))
    if assumptions:
        other = band_by_assumption(
            posterior, others, x[::_EVERY], chance, seed=seed, out=out, workers=of_all(replicates)
        )
        found = found.merge(other).assign(_moved(other, regions))
    concluded, summary = conclusion(found, check, parts, calibrated, is_converged)
    said = sentences(found, parts, calibrated, mute=experiment.contours.roughness)
    found.attrs = {
        "conclusion": concluded,
        "summary": summary,
        "words": "\n".join(said if is_converged else [*said, UNCONVERGED]),
        "probability": chance,
        "seed": seed_words(seed),
        "replicates": replicates,
        "calibration": "" if calibrated is None else str(calibrated.attrs["conclusion"]),
        "draws_sha256": draws_digest(posterior),
    }
    return found


def _of_draws(
    posterior: xr.DataTree, model: ContourModel, x: Floats, probability: float, regions: Mapping[str, Floats]
) -> tuple[xr.Dataset, xr.Dataset, xr.Dataset]:
    """Return what follows without further inference, the check of the record, and its parts."""
    check = predictive_check(posterior)
    if check.attrs["not_checked"]:
        raise InferenceError(f"there is nothing to judge this posterior by: {check.attrs['not_checked']}")
    parts = split_prediction(posterior, model)
    found = sampling_error(posterior, x, probability).assign(check_p_value=check.overall_p_value)
    found = found.merge(contour_band(posterior, x, probability)[["lower", "median", "upper"]])
    found = found.merge(parts.rename(p_value="part_p_value", sd="part_sd", overall_p_value="split_p_value"))
    return found.merge(prior_sensitivity(posterior, model, regions)), check, parts


def draws_digest(posterior: xr.DataTree) -> str:
    """Return the SHA-256 of the draws of a posterior."""
    digest = hashlib.sha256()
    for name, values in contour_draws(posterior).data_vars.items():
        digest.update(str(name).encode() + values.transpose("chain", "draw").values.tobytes())
    return digest.hexdigest()


def _posterior_of(given: str | os.PathLike[str] | xr.DataTree) -> xr.DataTree:
    if isinstance(given, xr.DataTree):
        return given
    path = check_path("run_or_posterior", given, "give the folder of a run, or a result of infer_contour")
    return read_result(path / "posterior.nc" if path.is_dir() else path)


def _regions(posterior: xr.DataTree, x: Floats, probability: float) -> dict[str, Floats]:
    """Return grid points in the gap and beside it; only beside, if the sweeps overlap or have one direction."""
    edges = gap_if_any(posterior, probability)
    left, right = (np.nan if edges is None else float(edges[end].sel(bound="median")) for end in ("left", "right"))
    if not left < right:
        return {"beside": np.linspace(x[0], x[-1], 2 * _GRID_POINTS)}
    flanks = [np.linspace(x[0], left, _GRID_POINTS), np.linspace(right, x[-1], _GRID_POINTS)]
    return {"in_gap": np.linspace(left, right, _GRID_POINTS + 2)[1:-1], "beside": np.concatenate(flanks)}


def _is_in_gap(x: xr.DataArray, regions: Mapping[str, Floats]) -> xr.DataArray:
    inside = regions.get("in_gap", np.full(1, np.nan))
    return (x > inside[0]) & (x < inside[-1])


def _moved(other: xr.Dataset, regions: Mapping[str, Floats]) -> dict[str, xr.DataArray]:
    """Return the largest distance of the medians in each region, over the width of the band."""
    sizes = abs(other["moved"].drop_attrs())
    sizes, in_gap = sizes.where(np.isfinite(sizes)), _is_in_gap(other["grid_x"], regions)
    return {
        f"moved_{name}": sizes.where(there).max("grid") for name, there in (("in_gap", in_gap), ("beside", ~in_gap))
    }


def _corrected(found: xr.Dataset, regions: Mapping[str, Floats]) -> dict[str, xr.DataArray]:
    """Return the band with its half widths multiplied by the factors of regions that are corrected; {} if none is."""
    if not found["corrected"].any():
        return {}
    factor = found["factor"].where(found["corrected"] == 1, 1.0)
    of_gap, beside = (factor.sel(region=region, drop=True) for region in ("in_gap", "beside"))
    wide = xr.where(_is_in_gap(found["x"], regions), of_gap, beside)
    return {
        f"corrected_{end}": (found["median"] + wide * (found[end] - found["median"])).assign_attrs(found[end].attrs)
        for end in ("lower", "upper")
    }

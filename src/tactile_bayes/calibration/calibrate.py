"""Simulation-based calibration: tests of posteriors against truths drawn from the prior."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.calibration.replicate import REPLICATES, Replicate, make_replicate, replicate, walkers_of
from tactile_bayes.calibration.simulated_experiment import Misspecification, SimulatedExperiment
from tactile_bayes.calibration.summary import summary
from tactile_bayes.checks import check_optional, check_path, check_switch, check_whole_number, refused
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import Experiment, usual_load_cell
from tactile_bayes.inference.family import Family
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.sweep import Drive, Rotation, drives_of, record_template
from tactile_bayes.tasks import ResultsStore, Workers, keep_outcomes, open_results_store

# Default drive angles [degrees], from before first contact to after snap-off in either direction.
_ANGLES = np.arange(-30.0, 211.0, 2.0)
_SETTINGS = SamplerSettings(ensembles=2, block_steps=25, max_r_hat=1.05, min_ess=200.0, max_steps=500)
# Settings of a second run if the first has not converged; the walkers of `infer_contour` adapt to a bent posterior.
_AGAIN = replace(_SETTINGS, max_steps=6000)


def calibrate(
    family: Family | str = "parabola",
    rig: Rig | None = None,
    *,
    rng: Rng,
    replicates: int = 200,
    drive: Drive | Sequence[Drive] | None = None,
    settings: SamplerSettings | None = None,
    truth: Rig | Misspecification | None = None,
    out: str | os.PathLike[str] | None = None,
    workers: int | str | Workers | None = None,
) -> xr.Dataset:
    """Test whether intervals hold: simulate records of truths drawn from the prior, infer, and compare.

    If a posterior is right, the rank of the truth among its draws is uniform, for every quantity (simulation-based
    calibration: Talts et al. 2018, arXiv:1804.06788), and bands, regions and intervals of 90 % hold in nine of ten
    replicates. Conversely, ranks that are not uniform prove that sampler, likelihood or prior are wrong; or, with a rig
    of its own for the simulation (`truth`), they show the effect of what inference assumes wrongly.

    An error in a replicate does not end the run: the replicate is lost, its message is the error, and no claim holds in
    it; `calibration_replicate` repeats it alone. An interrupt ends the run.

    Parameters
    ----------
    family : str or Family
        As in `infer_contour`; truths are drawn from the same priors.
    rig : Rig, optional
        As in `infer_contour`; what is unknown of it is drawn from the same priors. Its load cell, with noise, is by
        default one of force_noise 0.05 EI/L² and moment_noise 0.02 EI/L, and its rod the dimensionless one.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Seed of all random numbers; the results, except the seconds, do not depend on the number of workers.
    replicates : int
        Number of replicates; each takes some two seconds on one core.
    drive : Rotation, Translation or Motion, or a sequence of them, optional
        As in `scan`, except that drive angles do not depend on the contour, and so carry no information about it: by
        default every 2° from −30° to 210°, and as many samples where the base is carried.
    settings : SamplerSettings, optional
        By default 2 ensembles of 20 walkers, or two more than twice the parameters if that is larger, until R̂ is
        below 1.05 and the effective draws number 200, in 500 steps at most; if they do not converge, a second run with
        the walkers of `infer_contour`, in 6000 steps at most. Runs that end unconverged are counted.
    truth : Rig or Misspecification, optional
        The rig from which records are simulated, if it is another than inference assumes; its rod and load cell, where
        it states them, take the place of those of `rig`. The true value of an inferred parameter is that of the
        simulated rig relative to what `rig` states. A `Misspecification` has differences that no rig can state, too.
    out : path-like, optional
        Folder of the results store replicates.json: a run that was killed resumes, and one with more replicates
        begins with those that are stored.
    workers : int, str or Workers, optional
        Number of processes on this machine, by default one for each core; or the address of a Dask scheduler, such as
        "tcp://10.0.0.1:8786". `Workers` also names a function that is called with the progress after each task.

    Returns
    -------
    xr.Dataset
        Over "replicate", "quantity" (parameters, log-likelihood, angles of snap-off) and "claim":

        ranks (replicate, quantity)
            Rank of the truth among 99 draws; −1 if it is unknown, or at an end of its prior.
        rank_p_value (quantity)
            Probability that uniform ranks are as far from uniform, by simultaneous bands of their distribution
            (Säilynoja et al. 2022, doi 10.1007/s11222-022-10090-6).
        coverage, coverage_error, coverage_replicates (claim)
            Share of the replicates in which a claim holds, its standard error, and their number: pointwise and
            simultaneous bands in the gap and beside it, contact regions, the predicted angle of snap-off.
        noticed_below, noticed_above (claim)
            Coverages below and above the stated one that would have been detected as faults with the probability
            ``power``, by the binomial distribution; NaN if there is none.
        pointwise_in_gap and so on, width_, bias_ and off_ (mean width of the band, mean and largest distance of its
        median from the truth [length], in_gap and beside), check_passed, misfit_probability, axial_score, converged,
        effective_draws, evaluations, seconds, message, traceback (replicate)
            Results of each replicate; misfit_probability and axial_score, of single samples, only with a `truth`.

        Attributes: verdict, a text; conclusion, "calibrated", "not calibrated", "undecided" (more than 1 % of the
        replicates are lost, or more than 5 % did not converge) or "too few"; calibrated (0 or 1); lost and
        not_converged, numbers of replicates; false_alarm, the largest probability that right posteriors are not called
        calibrated; level, the p-value below which a single quantity or claim is at fault; the experiment. The smallest
        errors of normal posteriors that their ranks would have shown with the probability power: noticed_shift, in
        standard deviations, noticed_narrow and noticed_wide, factors by which these are too small or too large.

    Raises
    ------
    ParameterError
        If an argument is impossible.
    CalibrationError
        If `out` holds replicates of another experiment, or another run uses it.
    TaskError
        If processes died repeatedly in a replicate, or cannot start.

    Examples
    --------
    >>> from scipy import stats
    >>> family = Family("parabola", a=stats.uniform(0.4, 0.4))
    >>> found = calibrate(family, Rig(unknown="nothing"), replicates=2, rng=1, workers=1)
    >>> found.quantity.values.tolist()
    ['a', 'q', 'x_c', 'noise_scale', 'log_likelihood', 'snap_off_forward', 'snap_off_backward']
    >>> found.attrs["verdict"].partition(":")[0]
    'Too few replicates to judge'
    """
    replicates = check_whole_number("replicates", replicates, 1)
    experiment = experiment_of(family, rig, rng=rng, drive=drive, settings=settings, truth=truth)
    with open_results_store(experiment.identity, out, REPLICATES) as store:
        kept = keep_outcomes(store, replicate, experiment, replicates, workers=workers)
    return summary(experiment.identity, experiment.probability, kept)


def calibration_replicate(
    number: int,
    family: Family | str = "parabola",
    rig: Rig | None = None,
    *,
    out: str | os.PathLike[str] | None = None,
    throw: bool = True,
    **options: Any,
) -> Replicate:
    """Repeat one replicate of a calibration alone: the same record, the same posterior, or the same error.

    Parameters
    ----------
    number : int
        Number of the replicate, from 0 up.
    family, rig
        As they were given to `calibrate`.
    out : path-like, optional
        Folder of the calibration, to verify that it is the same one; nothing is written.
    throw : bool
        Whether the error of a replicate that is lost is raised; otherwise it is in the outcome.
    options
        Options of the calibration, as they were given to `calibrate`, except `replicates` and `workers`.

    Returns
    -------
    Replicate
        A named tuple with ``outcome``, ``truth``, ``measured`` and ``posterior``.

    Raises
    ------
    ParameterError
        If an argument is impossible.
    CalibrationError
        If `out` holds replicates of another experiment.

    Examples
    --------
    >>> from scipy import stats
    >>> family = Family("parabola", a=stats.uniform(0.4, 0.4))
    >>> again = calibration_replicate(1, family, Rig(unknown="nothing"), rng=1)
    >>> list(again.truth), "posterior" in again.posterior
    (['a', 'q', 'x_c', 'noise_scale'], True)
    """
    number = check_whole_number("number of the replicate", number, 0)
    check_switch("throw", throw)
    experiment = experiment_of(family, rig, **options)
    folder = None if out is None else check_path("out", out)
    ResultsStore(experiment.identity, folder, REPLICATES)  # refuses that of another experiment
    return make_replicate(experiment, number, throw=throw)


def experiment_of(
    family: Family | str = "parabola",
    rig: Rig | None = None,
    *,
    rng: Rng,
    drive: Drive | Sequence[Drive] | None = None,
    settings: SamplerSettings | None = None,
    truth: Rig | Misspecification | None = None,
) -> SimulatedExperiment:
    """Return the experiment that `calibrate` repeats, from the same arguments and defaults."""
    check_optional("settings", settings, SamplerSettings)
    if not isinstance(truth, Misspecification):
        check_optional("truth", truth, Rig, "give a Rig or a Misspecification")
        truth = Misspecification(truth)
    drives, rig = drives_of(drive), rig_of(rig)
    for one in drives:
        if isinstance(one, Rotation) and one.drive_angles is not None and np.size(one.drive_angles) < 3:
            raise refused("drive_angles", one.drive_angles, "give a list of at least 3 different finite numbers [rad]")
    rig = replace(rig, load_cell=rig.load_cell or usual_load_cell(rig.rod or Rod()))
    assert rig.load_cell is not None
    template = record_template(drives, np.radians(_ANGLES), rig.rod, rig.load_cell)
    experiment = SimulatedExperiment(
        Experiment(template, rig, family, (settings or _SETTINGS).events),
        drives,
        settings=settings or _SETTINGS,
        seed=seed_sequence(rng),
        truth=truth,
    )
    default = replace(_SETTINGS, walkers=walkers_of(len(experiment.assumed.priors)))
    return replace(experiment, settings=default, again=_AGAIN) if settings in (None, default) else experiment

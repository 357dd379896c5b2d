"""The posterior of a contour, given a whole record."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from tactile_bayes.checks import check_function, check_path
from tactile_bayes.contours import Contour
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import InferenceError, ParameterError, ReachError
from tactile_bayes.inference.contour_groups import drawn_groups, predicted_groups, prior_draws
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.coordinates import Coordinates
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles import Draws, Progress, SamplerSettings, sample, settings_of
from tactile_bayes.inference.experiment import ContourProblem, Experiment, contour_problem, identity_of
from tactile_bayes.inference.family import Family, Gauge
from tactile_bayes.inference.misfit import what_to_try
from tactile_bayes.inference.parameters.priors import rig_prior
from tactile_bayes.inference.result import provenance
from tactile_bayes.inference.starts.contour_start import Walk, walk_of
from tactile_bayes.numerics.random_numbers import Rng, Seed, seed_sequence, spawn
from tactile_bayes.reconstruction import CONTACT_SIDES
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.rig.unknown import expanded

_PRIOR_SECONDS = 3.0  # time limit for draws from the prior [s] if time is limited, since a rod may reach few contours


def infer_contour(
    measured: xr.Dataset,
    *,
    family: Family | str = "parabola",
    rig: Rig | None = None,
    rng: Rng,
    settings: SamplerSettings | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: Callable[[Progress], object] | None = None,
    keep: Callable[[xr.DataTree], object] | None = None,
) -> xr.DataTree:
    """Return the posterior of a contour's parameters from a whole record, by independent emcee ensembles.

    The likelihood includes the unloaded samples: a contour whose first contact or snap-off is earlier or later than
    the record shows is unlikely. Contours that some sweep of the record could not reach are excluded. The walkers start
    around a robust least-squares optimum, whose search begins at the contact points of Step 2 and at draws from the
    prior. Of more than 2,000 samples the likelihood takes blocks of neighbouring readings, or every so many samples
    where the noise does not allow it: the attribute `blocks` and the message state it, and groups by sample are of
    these. The sampler is emcee (Foreman-Mackey et al. 2013, doi 10.1086/670067), with proposals by differential
    evolution (ter Braak 2006, doi 10.1007/s11222-006-8769-1) and from fitted t distributions.

    Parameters
    ----------
    measured : xr.Dataset
        A record; SI or dimensionless, channels may be missing.
    family : str or Family
        Family of the contour by name: parabola, circle, ellipse, power-law, or one for each flank, like
        "parabola/power-law", on the left and on the right of a common vertex; "shape-free", any smooth contour; or
        "flat-sided", one with a flat side. As a `Family`, what is said of its parameters, in the record's units: a
        number is known, a distribution its prior.
    rig : Rig, optional
        Rod, load cell, and the unknowns of the rig, which are inferred beside the contour; by default those that the
        record states, with the unknowns of a real rig.
    rng : int, numpy.random.SeedSequence or numpy.random.Generator
        Random numbers. The same seed gives the same draws; a generator goes on, so that the next call has others.
    settings : SamplerSettings, optional
        Criteria of convergence, and limits of steps and time.
    checkpoint : path-like, optional
        Folder for this run alone, created if it does not exist, in which the state is stored every few seconds. A run
        that was interrupted in any way resumes from it when it is called again, with the same draws as without the
        interruption. A checkpoint of another record, model, seed or settings is refused with the difference, except
        for max_steps, max_seconds, min_ess and max_r_hat of the settings.
    progress : callable, optional
        Called with a `Progress` after each evaluation of the diagnostics.
    keep : callable, optional
        Called with the posterior as soon as it is drawn, without the derived groups (predictions, events, draws from
        the prior), so that it can be stored before they can fail.

    Returns
    -------
    xr.DataTree
        Groups in ArviZ's layout and the record's units, with one chain for each ensemble: `posterior`, `sample_stats`,
        `prior`, `posterior_predictive` and `log_likelihood` (by sample; for some of the draws), `events` (first contact
        and snap-off of each sweep segment, for 250 draws of each chain), `observed_data`, `constant_data`. Attributes:
        version, seed, settings, hash of the data, `converged` (0 or 1) and a `message`. A KeyboardInterrupt (Ctrl-C)
        during sampling ends the run and returns the draws so far, with `converged` 0 and a message to that effect;
        before sampling it is passed on.

    Raises
    ------
    RecordError
        If `measured` is no record.
    ParameterError
        If the family is unknown, `rng` is none of these, the load cell has noise on some channels, and
        none on another, two unknowns have the same effect, or the calibration of the rig is of another rod, load cell
        or unit.
    InferenceError
        If no sample carries a load, no contour of the family is found that the rod can reach, or the checkpoint is of
        another run, damaged or in use.

    Notes
    -----
    The default priors follow from pivot and rod length L alone, not from measured values. Vertex: within a rod length
    of the pivot sideways and in height, uniformly. Log-normal, with a standard deviation of 1 of the logarithm, are
    parabola's a, around 1/L; circle's r and ellipse's semi-axes a (sideways) and b, around L/2; and w of a power law,
    (y − q)/w = (|x − x_c|/w)ⁿ, around L. Its n − 1 is log-normal around 1 (0.7), n from 1.1 to 50. Shape-free contours
    are smooth: the logarithm of their radius of curvature is a random function of the slope angle (Matérn, ν = 5/2). r,
    its geometric mean, is log-normal like a circle's; amplitude, its standard deviation, around 0.7 (0.6); length_scale
    [rad] around 0.7 (0.4), from 0.15 to 4; z_1, z_2 …, its directions, are standard normal. flat_length of a flat side
    is log-normal around L/2 (0.7), flat_slope normal (1 rad). noise_scale is log-normal around 1 (0.5); unknown noises
    are log-uniform from 1e-6 to 10, in EI/L and EI/L². Those of the rig are in the table of `tactile-bayes rig
    --parameters`. In addition, contours are excluded that the rod would still cut after snap-off, or that a rod curved
    toward the object would touch twice.

    A discrepancy is a Gaussian process over the drive, ν = 3/2, of each channel and sweep segment, in proportion to the
    largest load and zero out of contact. It is refused beside outliers, correlated noise, errors of the encoder, and
    readings at the end of the range.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, SamplerSettings, scan
    >>> from tactile_bayes.contours import paper_profile
    >>> rig = Rig(load_cell=LoadCell(force_noise=0.05, moment_noise=0.02), unknown="nothing")
    >>> measured = rig.load_cell.measure(scan(paper_profile("II", q=0.5), drive_step=0.1).record, rng=1)
    >>> quick = SamplerSettings(min_ess=100, max_r_hat=1.1)
    >>> result = infer_contour(measured, family="parabola", rig=rig, rng=1, settings=quick)
    >>> bool(result.attrs["converged"]), list(result["posterior"].data_vars)
    (True, ['a', 'q', 'x_c', 'noise_scale'])
    """
    settings, seed = settings_of(settings), seed_sequence(rng)
    problem = contour_problem(Experiment(measured, rig_of(rig), family, settings.events))
    return sampled(problem, seed=seed, settings=settings, checkpoint=checkpoint, progress=progress, keep=keep).tree


def calibrate_rig(
    records: xr.Dataset,
    *,
    contour: Contour,
    rig: Rig | None = None,
    rng: Rng,
    settings: SamplerSettings | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: Callable[[Progress], object] | None = None,
    keep: Callable[[xr.DataTree], object] | None = None,
) -> Rig:
    """Return a rig whose unknowns have the posterior from sweeps along a gauge, whose contour is known.

    Likelihood, priors and sampler are those of `infer_contour`; the contour has no parameters. Stiffness, encoder
    offset, backlash, lever, gains, curve of the moment, compliance, and the rod's curvature, taper, stem and length
    last: their posterior is their joint prior in every later use of the rig, with their correlations. Zeros, drifts,
    noise and shifts of pivots belong to a record, and friction to the surfaces of rod and object: they stay as unknown
    as they were.

    Parameters
    ----------
    records : xr.Dataset
        A record of the gauge, with any number of sweeps, pivots and drives.
    contour : Contour
        Contour of the gauge in the coordinates and the unit of length of the record, one of a family. Its shape is
        taken as exact, and its position unless "gauge" is unknown.
    rig : Rig, optional
        The rig so far. If it has been calibrated by another record, of this gauge or of another one, the result rests
        on both.
    rng, settings, checkpoint, progress, keep
        As in `infer_contour`.

    Returns
    -------
    Rig
        The rig with a `calibration`, whose `posterior` is a tree as from `infer_contour`, without parameters of a
        contour; its attribute `gauge` describes it. `calibration.error` is the largest difference between quantiles of
        the draws and of the density fitted to them, along each parameter and principal axis, in standard deviations.

    Raises
    ------
    RecordError
        If `records` is no record.
    ParameterError
        If the contour is none of a family or holds several, or nothing of the rig is unknown; else as in
        `infer_contour`.
    InferenceError
        If the posterior has not converged, or nothing that is unknown lasts; else as in `infer_contour`.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, SamplerSettings, scan
    >>> from tactile_bayes.contours import Circle
    >>> from tactile_bayes.rig import NOTHING
    >>> pin, cell = Circle(r=0.2, q=0.5), LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(pin, drive_step=0.1).record, rng=1)
    >>> rig = Rig(load_cell=cell, unknown={**NOTHING, "rigidity_scale": "default"})
    >>> quick = SamplerSettings(min_ess=100, max_r_hat=1.1)
    >>> list(calibrate_rig(measured, contour=pin, rig=rig, rng=1, settings=quick).calibration.priors)
    ['rigidity_scale']
    """
    settings, rig, seed = settings_of(settings), rig_of(rig), seed_sequence(rng)
    experiment = Experiment(records, rig, events=settings.events, gauge=Gauge(contour))
    if not experiment.unknowns.names:
        raise ParameterError("nothing of the rig is unknown: say that one of its parameters is, like rigidity_scale")
    problem = contour_problem(experiment)
    drawn = sampled(problem, seed=seed, settings=settings, checkpoint=checkpoint, progress=progress, keep=keep)
    found = rig_prior(drawn.tree)
    left = {name: value for name, value in expanded(rig.entries).items() if name not in found.priors}
    return replace(rig, unknown=left, calibration=found)


class Sampled(NamedTuple):
    """A posterior, its draws as arrays, and the coordinates of the sampler."""

    tree: xr.DataTree
    draws: Draws
    coordinates: Coordinates


def sampled(
    problem: ContourProblem,
    *,
    seed: Seed,
    settings: SamplerSettings,
    checkpoint: str | os.PathLike[str] | None = None,
    progress: Callable[[Progress], object] | None = None,
    keep: Callable[[xr.DataTree], object] | None = None,
    walk: Walk | None = None,
    with_prior: bool = True,
) -> Sampled:
    """Return the posterior of a problem; arguments are as in `infer_contour`."""
    if checkpoint is not None:
        check_path("checkpoint", checkpoint, "give the path of a folder, or None")
    check_function("progress", progress)
    check_function("keep", keep)
    seeds = spawn(seed, 4)
    deadline = Deadline.after(settings.max_seconds)
    with threadpool_limits(1):  # the arrays are small: threads would only wait for one another
        if walk is None:
            # A run that resumes from a checkpoint must start at the same points, whatever the time limit was.
            problem, walk = _likeliest(problem, seeds[0], settings, NEVER if checkpoint is not None else deadline)
        model = problem.model
        refuse_beyond(model, walk)
        is_brief = walk.most_steps is not None and settings.max_steps is None
        steps = walk.most_steps if is_brief else settings.max_steps
        draws = sample(
            model.log_probability,
            walk.start,
            names=model.names,
            seed=seeds[1],
            settings=replace(settings, max_seconds=deadline.seconds_left, max_steps=steps),
            progress=progress,
            checkpoint=checkpoint,
            coordinates=walk.coordinates,
            identity=None if checkpoint is None else identity_of(problem.about),
        )
        tree = xr.DataTree.from_dict(drawn_groups(model, draws))
        tree.attrs = provenance(draws, seed=seed, settings=settings, **problem.about)
        if is_brief and not draws.converged and draws.steps_run == steps:
            tree.attrs["message"] += "; no more are made where the best parameters leave what no noise explains"
        if "blocks" in tree.attrs:
            tree.attrs["message"] += f"; the likelihood takes {tree.attrs['blocks']}"
        if keep is not None:
            keep(tree)
        groups = predicted_groups(model, draws, np.random.default_rng(seeds[2]))
        if with_prior:
            late = NEVER if settings.max_seconds is None else Deadline.after(_PRIOR_SECONDS)
            groups["prior"] = prior_draws(model, np.random.default_rng(seeds[3]), late)
    whole = xr.DataTree.from_dict({**{name: group.to_dataset() for name, group in tree.children.items()}, **groups})
    whole.attrs = tree.attrs
    return Sampled(whole, draws, walk.coordinates)


def refuse_beyond(model: ContourModel, walk: Walk) -> None:
    """Refuse a start whose parameters fit the record far better beyond the ends of their priors."""
    if walk.beyond:
        raise InferenceError(
            f"the best fit is outside the priors, at {walk.beyond}: give wider ones, or check units, rod and base. "
            + what_to_try([model.family.name], model.unknowns.names, friction=model.unknowns.friction)
        )


def _likeliest(
    problem: ContourProblem, seed: np.random.SeedSequence, settings: SamplerSettings, deadline: Deadline
) -> tuple[ContourProblem, Walk]:
    """Return the problem with the most evidence of those with all sides of contact, and the start of its walkers."""
    if not problem.others:
        return problem, walk_of(problem.model, seed, settings, deadline)
    found: list[tuple[float, ContourProblem, Walk]] = []
    failure: InferenceError | ReachError | None = None
    for one in (problem, *problem.others):
        try:
            walk = walk_of(one.model, seed, settings, deadline)
        except (InferenceError, ReachError) as error:
            failure = failure or error
            continue
        found.append((walk.log_evidence + one.log_prior_odds, one, walk))
    if not found and failure is not None:
        raise failure
    best, chosen, walk = max(found, key=lambda each: each[0])
    ratios = np.exp([each[0] - best for each in found]) if np.isfinite(best) else np.ones(len(found))
    doubt = {"doubtful_sides": chosen.about[CONTACT_SIDES], "sides_probability": float(1.0 / ratios.sum())}
    return chosen._replace(about={**chosen.about, **doubt}), walk


def contours_of(draws: xr.Dataset, family: str) -> Contour:
    """Return the contours of posterior or prior draws, with parameters of shape (all draws,)."""
    chosen = family_named(family)
    return chosen.build(*(draws[name].values.ravel() for name in chosen.parameters))

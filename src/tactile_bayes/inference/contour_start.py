"""Where the walkers of a contour posterior start, and in which coordinates they walk."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.shape_free_family import ShapeFreeFamily
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.contour_optimum import ContourOptimum, contact_fit, fitted_noise, optima_of, optimum_of
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles import (
    ANYTHING,
    Coordinates,
    Ends,
    Mixture,
    Proposal,
    Proposing,
    SamplerSettings,
    approximate,
    in_coordinates,
    learned,
    scatter_walkers,
)
from tactile_bayes.inference.flank_coordinates import FlankCoordinates
from tactile_bayes.inference.misfit import what_to_try
from tactile_bayes.inference.shape_free_posterior.optimum import whitening_at
from tactile_bayes.inference.start import Cloud, gather

__all__ = ["Walk", "walk_of"]

_OF_ROUGHNESS, _OF_NOISE, _OF_REST = 0.3, 0.1, 0.7
"""Standard deviations, half those of the walkers, of the logarithms of amplitude, length scale and noise, and of
coordinates whose posterior is nearly standard normal: wider in all of those at once is far out."""

_MUCH = 100
"""Loaded samples from which on what explains a record is not one of several contours that do."""

_TRIED = 9
"""Searches after which there is no other, unless none of them explains a record that says little."""

_AGAIN, _SURELY = 2, 4
"""Searches that end where others did, after which it is believed that there is nothing else, of a record that says
much and of another, if the posterior is nearly normal where they end."""

_EFFICIENT = 0.35
"""Efficiency of a proposal from which on the posterior is nearly normal around it."""

_SCOUTS = 6
"""Walkers for each parameter, at most, that learn in which coordinates the posterior is nearly normal."""

_OF_SCALE = 500
"""Draws from the prior that tell on which scale a coordinate varies."""

_HOPELESS = 100.0
"""Cost above the least from which on a place is not weighed."""

_SAME = 3.0
"""Distance from a mode, over that of its typical points, up to which a place belongs to it."""

_RARE = 9.0
"""Logarithm of how much less mass a mode may have than another to be left out: one draw in ten thousand."""

_POOR = 2.0
"""Mean square of what is left of a record, over its own roughness, from which on a search is worth its time."""


class Walk(NamedTuple):
    """Where walkers start, and in which coordinates."""

    start: Floats
    """(ensemble, walker, coordinate)."""
    coordinates: Coordinates
    log_evidence: float = -np.inf
    """Of the model, roughly, up to a constant of the number of parameters."""
    beyond: str = ""
    """What the record wants and the priors do not allow, in words."""


def walk_of(
    model: ContourModel, seed: np.random.SeedSequence, settings: SamplerSettings, deadline: Deadline = NEVER
) -> Walk:
    """Walkers scattered more widely than the posterior, around an optimum that is sought without help.

    Past the deadline every search ends with the step that it is in, and walkers start wherever something is probable.
    """
    rng = np.random.default_rng(seed)
    if isinstance(model.family, ShapeFreeFamily):
        return _whitened(model, seed, rng, settings, deadline)
    return _scattered(model, seed, rng, settings, deadline)


def _whitened(
    model: ContourModel,
    seed: np.random.SeedSequence,
    rng: np.random.Generator,
    settings: SamplerSettings,
    deadline: Deadline,
) -> Walk:
    """Of coordinates that are nearly standard normal it takes no more walkers than span them."""
    by_contacts = contact_fit(model)
    noise = fitted_noise(model, np.full((1, np.count_nonzero(model.present)), 1.0 / 1.4826))
    whitening = None
    if by_contacts is not None:
        rig = [float(model.priors[name].median()) for name in model.nuisances.names]  # type: ignore[attr-defined]
        whitening = whitening_at(model, np.concatenate([by_contacts, rig, noise]), rng, deadline)
    if whitening is None or (_misfit(model, whitening.centre) > _POOR and not deadline.has_passed):
        other = whitening_at(model, optimum_of(model, rng, deadline).point, rng, deadline)
        if whitening is None or _misfit(model, other.centre) < _misfit(model, whitening.centre):
            whitening = other
    log_probability = in_coordinates(model.log_probability, whitening)
    spread = np.full(whitening.middle.size, _OF_REST)
    spread[: whitening.bent] = [_OF_ROUGHNESS] * 2 + [_OF_NOISE] * len(model.noise.names)
    cloud = gather(log_probability, whitening.middle, np.diag(np.square(spread)), rng, deadline)
    count = len(spread)
    start = scatter_walkers(
        lambda points: np.where(log_probability(points) > cloud.floor_by(deadline), 0.0, -np.inf),
        cloud.draw,
        parameters=count,
        seed=seed,
        settings=replace(settings, walkers=settings.walkers or max(48, 2 * count)),
    )
    # Of a posterior that is standard normal in these coordinates the density in the middle is all that differs.
    return Walk(start, whitening, float(log_probability(whitening.middle[None])[0]))


def _misfit(model: ContourModel, point: Floats) -> float:
    """Mean square of what a point leaves of the record, over the record's own roughness, outliers cut off."""
    left = model.likelihood.measured - model.likelihood.load_cell.expected(model.loads(point[None]))[0]
    return float(np.mean(np.minimum(np.abs(left / model.deviation)[:, model.present], 5.0) ** 2))


class _Mode(NamedTuple):
    """One place where the posterior has mass."""

    optimum: ContourOptimum
    cloud: Cloud
    proposal: Proposal
    coordinates: Proposing
    """Of cloud and proposal."""
    usual: _Mode | None = None
    """The same in the model's own coordinates, if those are others."""


def _scattered(
    model: ContourModel,
    seed: np.random.SeedSequence,
    rng: np.random.Generator,
    settings: SamplerSettings,
    deadline: Deadline,
) -> Walk:
    """Walkers scattered twice as wide as a normal approximation of each mode, which they are then proposed from."""
    modes = _modes(model, rng, deadline)
    if len({mode.coordinates.digest for mode in modes}) > 1:
        modes = [mode.usual or mode for mode in modes]
    walked = modes[0].coordinates
    proposal = Mixture(tuple(mode.proposal for mode in modes))

    def floor() -> float:
        return min(mode.cloud.floor_by(deadline) for mode in modes)

    def draw(rng: np.random.Generator, count: int) -> Floats:
        counts = rng.multinomial(count, proposal.shares)
        points = [mode.cloud.draw(rng, int(each)) for mode, each in zip(modes, counts, strict=True)]
        return walked.parameters(np.concatenate(points)[rng.permutation(count)])[0]

    try:
        start = scatter_walkers(
            lambda points: np.where(model.log_probability(points) > floor(), 0.0, -np.inf),
            draw,
            parameters=len(model.names),
            seed=seed,
            settings=settings,
        )
    except InferenceError as error:
        point = modes[0].optimum.point
        best = ", ".join(f"{name} = {value:.6g}" for name, value in zip(model.names, point, strict=False))
        raise InferenceError(
            f"no {model.family.name} was found that describes the record (the nearest has {best}): are units, "
            "signs, drive angle, rod and base right? tactile-bayes inspect may tell. "
            + what_to_try([model.family.name], model.nuisances.names, friction=model.nuisances.friction)
        ) from error
    coordinates = walked.with_proposal(proposal)
    if proposal.efficiency < _EFFICIENT and not deadline.has_passed:
        size = len(model.names)
        scouts, scale = start.reshape(-1, size)[: _SCOUTS * size], _prior_scale(model, walked, rng)
        coordinates = learned(model.log_probability, walked.with_proposal(proposal), scouts, scale, rng, deadline)
    log_evidence = float(logsumexp([mode.proposal.log_mass for mode in modes]))
    return Walk(coordinates.of(start), coordinates, log_evidence, modes[0].optimum.beyond)


def _prior_scale(model: ContourModel, walked: Proposing, rng: np.random.Generator) -> Floats:
    """Half the distance in which two thirds of the prior lie, of each coordinate where it has one."""
    draws = np.stack([model.priors[name].rvs(_OF_SCALE, random_state=rng) for name in model.names], axis=1)
    low, high = np.nanquantile(walked.of(draws), [0.16, 0.84], axis=0)
    return np.asarray(0.5 * (high - low))


def _modes(model: ContourModel, rng: np.random.Generator, deadline: Deadline) -> list[_Mode]:
    """Where the posterior has mass, the most first: one, if that explains a record that says much; else all to which
    searches lead, weighed by their evidence.
    """
    found: list[_Mode] = []
    waiting: list[ContourOptimum] = []
    says_much = np.count_nonzero(~model.found["unloaded"].values) >= _MUCH
    again = 0
    for tried, optimum in enumerate(optima_of(model, rng, deadline), start=1):
        if not optimum.fits:
            waiting.append(optimum)
        elif _is_known(model, optimum, found):
            again += 1
        else:
            found.append(_mode(model, optimum, rng, deadline))
        normal = bool(found) and found[-1].proposal.efficiency > _EFFICIENT
        if says_much and (normal or again == _AGAIN):
            break
        if normal and again == _SURELY:
            break
        if tried >= _TRIED and (found or says_much):
            break
    for optimum in sorted(waiting, key=lambda one: one.cost):
        least = min((mode.optimum.cost for mode in found), default=optimum.cost)
        late = found and deadline.has_passed
        if optimum.cost < least + _HOPELESS and not late and not _is_known(model, optimum, found):
            found.append(_mode(model, optimum, rng, deadline))
    if not found:
        raise InferenceError("no contour was found that the rod can reach: are base, rod and units right?")
    found.sort(key=lambda mode: -mode.proposal.log_mass)
    return [mode for mode in found if mode is found[0] or mode.proposal.log_mass > found[0].proposal.log_mass - _RARE]


def _is_known(model: ContourModel, optimum: ContourOptimum, found: list[_Mode]) -> bool:
    """Whether an optimum belongs to a mode that was found."""
    point = optimum.point[None]
    far = _SAME * np.sqrt(point.size)
    return any(np.linalg.norm(mode.proposal.steps(mode.coordinates.of(point))) < far for mode in found)


def _mode(model: ContourModel, optimum: ContourOptimum, rng: np.random.Generator, deadline: Deadline) -> _Mode:
    """Approximate a mode around an optimum, in the coordinates in which the posterior is nearer to a normal one."""
    usual = _mode_in(model, optimum, model.coordinates, optimum.covariance, rng, deadline, model.walked_ends)
    if usual.proposal.efficiency > _EFFICIENT or deadline.has_passed:
        return usual
    flank = FlankCoordinates.where_touched(model, optimum.point)
    if flank is None:
        return usual
    covariance = flank.covariance(optimum.point, optimum.covariance)
    if not np.isfinite(covariance).all():  # the vertex is too near
        return usual
    mode = _mode_in(model, optimum, flank, covariance, rng, deadline)
    reaches_vertex = flank.reach_vertex(mode.proposal.draw(rng, _OF_SCALE)[0])
    if reaches_vertex or mode.proposal.efficiency < usual.proposal.efficiency:
        return usual
    return mode._replace(usual=usual)


def _mode_in(
    model: ContourModel,
    optimum: ContourOptimum,
    coordinates: Proposing,
    covariance: Floats,
    rng: np.random.Generator,
    deadline: Deadline,
    ends: Ends = ANYTHING,
) -> _Mode:
    target = in_coordinates(model.log_probability, coordinates)
    cloud = gather(target, coordinates.of(optimum.point[None])[0], covariance, rng, deadline, ends)
    proposal = approximate(target, cloud.centre, cloud.narrow_covariance, rng, deadline, ends)
    return _Mode(optimum, cloud, proposal, coordinates)

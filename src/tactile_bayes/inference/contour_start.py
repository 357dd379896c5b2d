"""Where the walkers of a contour posterior start, and in which coordinates they walk."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.contour_optimum import contact_fit, fitted_noise, optimum_of
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.ensembles import (
    Coordinates,
    Logarithms,
    SamplerSettings,
    approximate,
    in_coordinates,
    scatter_walkers,
)
from tactile_bayes.inference.nuisances import MAY_VANISH
from tactile_bayes.inference.shape_free_posterior.family import ShapeFreeFamily
from tactile_bayes.inference.shape_free_posterior.optimum import whitening_at
from tactile_bayes.inference.start import gather

__all__ = ["Walk", "walk_of"]

Floats = NDArray[np.float64]

_OF_ROUGHNESS, _OF_NOISE, _OF_REST = 0.3, 0.1, 0.7
"""Standard deviations, half those of the walkers, of the logarithms of amplitude, length scale and noise, and of
coordinates whose posterior is nearly standard normal: wider in all of those at once is far out."""

_POOR = 2.0
"""Mean square of what is left of a record, over its own roughness, from which on a search is worth its time."""


class Walk(NamedTuple):
    """Where walkers start, and in which coordinates."""

    start: Floats
    """(ensemble, walker, coordinate)."""
    coordinates: Coordinates
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
    return Walk(start, whitening)


def _misfit(model: ContourModel, point: Floats) -> float:
    """Mean square of what a point leaves of the record, over the record's own roughness, outliers cut off."""
    left = model.likelihood.measured - model.likelihood.load_cell.expected(model.loads(point[None]))[0]
    return float(np.mean(np.minimum(np.abs(left / model.deviation)[:, model.present], 5.0) ** 2))


def _scattered(
    model: ContourModel,
    seed: np.random.SeedSequence,
    rng: np.random.Generator,
    settings: SamplerSettings,
    deadline: Deadline,
) -> Walk:
    """Walkers scattered twice as wide as a normal approximation, which they are then proposed from."""
    optimum = optimum_of(model, rng, deadline)
    of_noise = np.arange(len(model.names)) >= len(model.located)
    around = Logarithms(of_noise)

    def log_probability(coordinates: Floats) -> Floats:
        return model.log_probability(around.parameters(coordinates)[0])

    cloud = gather(log_probability, around.of(optimum.point), optimum.covariance, rng, deadline)
    try:
        start = scatter_walkers(
            lambda points: np.where(model.log_probability(points) > cloud.floor_by(deadline), 0.0, -np.inf),
            lambda rng, count: around.parameters(cloud.draw(rng, count))[0],
            parameters=len(model.names),
            seed=seed,
            settings=settings,
        )
    except InferenceError as error:
        best = ", ".join(f"{name} = {value:.6g}" for name, value in zip(model.names, optimum.point, strict=False))
        raise InferenceError(
            f"no {model.family.name} was found that describes the record (the nearest has {best}): are units, "
            "signs, drive angle, rod, base and family right? tactile-bayes inspect may tell"
        ) from error
    positive = (model.low == 0.0) & ~np.isin(model.names, MAY_VANISH)
    walked = Logarithms(positive)
    centre = around.parameters(cloud.centre[None])[0]
    per_unit = np.where(positive & ~of_noise, 1.0 / centre[0], 1.0)
    proposal = approximate(
        in_coordinates(model.log_probability, walked),
        walked.of(centre)[0],
        cloud.narrow_covariance * np.outer(per_unit, per_unit),
        rng,
        deadline,
    )
    return Walk(walked.of(start), Logarithms(positive, proposal), optimum.beyond)

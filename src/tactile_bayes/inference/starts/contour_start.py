"""Starting points of the walkers of a contour posterior, and the coordinates in which it is sampled."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp, ndtr

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.shape_free_family import ShapeFreeFamily
from tactile_bayes.distributions import quantiles_of
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.coordinates import Coordinates, in_coordinates
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import Mixture, refined
from tactile_bayes.inference.ensembles import SamplerSettings, scatter_walkers
from tactile_bayes.inference.misfit import what_to_try
from tactile_bayes.inference.shape_free_posterior.observations import Observer, scale_names, white_scales
from tactile_bayes.inference.shape_free_posterior.whitening import Whitening, whitening_at
from tactile_bayes.inference.starts.cloud import gather
from tactile_bayes.inference.starts.contour_optimum import (
    are_alike,
    contact_fit,
    fitted_noise,
    optima_of,
    smooth_optima,
)
from tactile_bayes.inference.starts.modes import Modes
from tactile_bayes.inference.starts.residuals import left_over_noise, mean_square_left
from tactile_bayes.numerics.scatter import DEVIATION_OVER_MEDIAN

# Standard deviations, half those of the starting points, of the logarithms of amplitude and length scale, of that of
# noise, and of the other whitened coordinates: points that are farther out in all of these at once are improbable.
_ROUGHNESS_SPREAD, _NOISE_SPREAD, _WHITENED_SPREAD = 0.3, 0.1, 0.7
_CENTRAL = ndtr(np.array([-1.0, 1.0]))  # probabilities whose quantiles are two standard deviations apart
_PRIOR_DRAWS = 500  # among which the likeliest is sought
_LIKELIEST = 3  # draws of the prior from which a mode is sought, if the record's contact points do not lead to one
_SEARCHES = 3  # most by least squares, if nothing before them leads to one
_BETTER = 0.8  # share of the least cost so far below which one of them has ended elsewhere
_DRAWS_NEARBY = 100  # among which a possible one is sought where the centre of a mode is not
# Root mean square of a channel's residuals, over the noise between neighbours, that no noise explains, of a shape-free
# contour, which follows what families do not; and the steps that a verdict needs.
_SMOOTH_FREE, _STEPS_OF_A_VERDICT = 1.4, 25
_POOR_MISFIT = 2.0  # mean square of the standardised residuals above which a further search is made
_ALIKE = 1.05  # ratio of such misfits below which they are alike
_CLIPPED = 12.5  # misfit of any place where half the residuals are clipped


class Walk(NamedTuple):
    """Starting points of the walkers, and the coordinates in which they are sampled."""

    start: Floats  # (ensemble, walker, coordinate)
    coordinates: Coordinates
    log_evidence: float = -np.inf  # coarse one of the model, up to a constant of the number of parameters
    beyond: str = ""  # parameters that fit the record far better beyond the ends of their priors, as text
    most_steps: int | None = None  # those of a verdict, if what the best mode leaves is no noise


def walk_of(
    model: ContourModel, seed: np.random.SeedSequence, settings: SamplerSettings, deadline: Deadline = NEVER
) -> Walk:
    """Return walkers scattered more widely than the posterior, around optima that are found from the record alone."""
    start = _Start(model, seed, np.random.default_rng(seed), settings, deadline)
    return start.whitened() if isinstance(model.family, ShapeFreeFamily) else start.scattered()


class _Start(NamedTuple):
    """What the start of a posterior's walkers depends on."""

    model: ContourModel
    seed: np.random.SeedSequence
    rng: np.random.Generator
    settings: SamplerSettings
    deadline: Deadline

    def whitened(self) -> Walk:
        """Return the start in nearly standard normal coordinates, with no more walkers than span them."""
        model, rng, deadline = self.model, self.rng, self.deadline
        whitening = self._best_whitening()
        try:
            return self._whitened_around(whitening, whitening.middle)
        except InferenceError as error:
            if not deadline.has_passed:
                raise _nothing_describes(model, "shape-free contour") from error
        # Time is up, and nothing near where the search ended is possible: what is, however far off, will do.
        drawn, _ = model.draw_prior(rng, _PRIOR_DRAWS, deadline)
        point = drawn[np.argmax(model.log_probability(drawn))]
        whitening = whitening_at(model, point, rng, deadline)
        return self._whitened_around(whitening, whitening.of(point[None])[0])

    def _best_whitening(self) -> Whitening:
        """Return coordinates at the best mode to which the first points lead of which one explains the record."""
        found: list[tuple[tuple[bool, float, float], Whitening]] = []
        telling: list[float] = []  # misfits, but for what touches nothing, or clips most residuals
        for points in self._starting_points():
            for point in points:
                whitening = whitening_at(self.model, point, self.rng, self.deadline)
                misfit, top = mean_square_left(self.model, whitening.centre), self._top_near(whitening)
                explains = top > -np.inf and misfit < _POOR_MISFIT and not self._is_hopeless(whitening)
                found.append(((explains, top, -misfit), whitening))
                best, whitening = max(found, key=lambda one: one[0])
                if top > -np.inf and misfit < _CLIPPED:  # else all are alike
                    telling.append(misfit)
                if self.deadline.has_passed or (are_alike(telling, _ALIKE) and not best[0]):
                    return whitening
            if best[0]:
                break
        return whitening

    def _top_near(self, whitening: Whitening) -> float:
        """Return the log-probability at the centre or, where that is impossible, the largest of draws around it."""
        log_probability = in_coordinates(self.model.log_probability, whitening)
        top = float(log_probability(whitening.middle[None])[0])
        if top > -np.inf:
            return top
        draws = self.rng.normal(whitening.middle, _WHITENED_SPREAD, (_DRAWS_NEARBY, whitening.middle.size))
        return float(log_probability(draws).max())

    def _starting_points(self) -> Iterator[Iterable[Floats]]:
        """Yield parameters fitted to Step 2's contacts and the likeliest draws of the prior, or without contacts
        those of a circle, and at last those of searches."""
        model, rng, deadline = self.model, self.rng, self.deadline
        by_contacts = contact_fit(model)
        if by_contacts is None:
            yield smooth_optima(model, rng, deadline)
        else:
            of_white = fitted_noise(model, np.full((1, np.count_nonzero(model.present)), 1.0 / DEVIATION_OVER_MEDIAN))
            of_rig, of_discrepancy = map(model.prior_medians, (model.unknowns.names, model.noise.of_discrepancy))
            yield [np.concatenate([by_contacts, of_rig, of_white, of_discrepancy])]
            drawn, _ = model.draw_prior(rng, _PRIOR_DRAWS, deadline)
            yield drawn[np.argsort(Observer(model).log_density(drawn))[::-1][:_LIKELIEST]]
        least = np.inf
        for one in islice(optima_of(model, rng, deadline), _SEARCHES):
            if one.cost < _BETTER * least:
                least = one.cost
                yield [one.point]

    def _whitened_around(self, whitening: Whitening, centre: Floats) -> Walk:
        """Return the start around a centre, in whitening coordinates."""
        count, deadline = centre.size, self.deadline
        log_probability = in_coordinates(self.model.log_probability, whitening)
        spread = np.full(count, _WHITENED_SPREAD)
        spread[: whitening.bent] = np.minimum(_ROUGHNESS_SPREAD, _widths(self.model, scale_names(self.model)))
        spread[white_scales(self.model)] = _NOISE_SPREAD
        cloud = gather(log_probability, centre, np.diag(np.square(spread)), self.rng, deadline)
        if not cloud.is_possible:
            raise InferenceError("nothing near is possible")
        start = scatter_walkers(
            log_probability,
            cloud.draw,
            parameters=count,
            seed=self.seed,
            settings=replace(self.settings, walkers=self.settings.walkers or max(48, 2 * count)),
            floor=lambda: cloud.floor_by(deadline),
        )
        # If posteriors are standard normal in these coordinates, evidences differ as densities at the centre.
        log_evidence = float(log_probability(whitening.middle[None])[0])
        most_steps = _STEPS_OF_A_VERDICT if self._is_hopeless(whitening) else None
        return Walk(start, whitening, log_evidence, most_steps=most_steps)

    def _is_hopeless(self, whitening: Whitening) -> bool:
        return left_over_noise(self.model, whitening.centre) > _SMOOTH_FREE

    def scattered(self) -> Walk:
        """Return walkers scattered twice as widely as normal approximations of the modes, which serve as proposals."""
        model, rng, deadline = self.model, self.rng, self.deadline
        search = Modes(model, rng, deadline)
        modes = search.found_by_search()
        if any(mode.coordinates is not modes[0].coordinates for mode in modes):
            modes = [mode.usual or mode for mode in modes]
        common = modes[0].coordinates
        target = in_coordinates(model.log_probability, common)
        first = modes[0].optimum
        proposal = Mixture(tuple(mode.proposal for mode in modes))
        shares = proposal.shares
        if not search.is_hopeless:  # else a verdict does not need it
            refined_ones = (refined(target, mode.proposal, rng, deadline) for mode in modes)
            proposal = Mixture(tuple(part for each in refined_ones for part in each.parts))

        def draw(rng: np.random.Generator, count: int) -> Floats:
            counts = rng.multinomial(count, shares)
            points = [mode.cloud.draw(rng, int(each)) for mode, each in zip(modes, counts, strict=True)]
            return common.parameters(np.concatenate(points)[rng.permutation(count)])[0]

        try:
            start = scatter_walkers(
                model.log_probability,
                draw,
                parameters=len(model.names),
                seed=self.seed,
                settings=self.settings,
                floor=lambda: min(mode.cloud.floor_by(deadline) for mode in modes),
            )
        except InferenceError as error:
            best = ", ".join(f"{name} = {value:.6g}" for name, value in zip(model.names, first.point, strict=False))
            raise _nothing_describes(model, model.family.name, f" (the nearest has {best})") from error
        coordinates = replace(common, proposal=proposal)
        log_evidence = float(logsumexp([part.log_mass for part in proposal.parts]))
        most_steps = _STEPS_OF_A_VERDICT if search.is_hopeless else None
        return Walk(coordinates.of(start), coordinates, log_evidence, first.beyond, most_steps)


def _widths(model: ContourModel, names: Sequence[str]) -> Floats:
    """Return the standard deviations of the logarithms of sizes by their priors, from central quantiles."""
    ends = [quantiles_of(model.priors[name], name)(_CENTRAL) for name in names]
    return np.asarray(np.diff(np.log(ends), axis=1)[:, 0] / 2.0)


def _nothing_describes(model: ContourModel, what: str, nearest: str = "") -> InferenceError:
    """Return the error that states what to check, and what to try."""
    return InferenceError(
        f"no {what} was found that describes the record{nearest}: are units, signs, drive angle, rod and base right? "
        "tactile-bayes inspect checks them. "
        + what_to_try([model.family.name], model.unknowns.names, friction=model.unknowns.friction)
    )

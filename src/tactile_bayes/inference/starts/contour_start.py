"""Starting points of the walkers of a contour posterior, and the coordinates in which it is sampled."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.shape_free_family import ShapeFreeFamily
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.coordinates.base import Coordinates, in_coordinates
from tactile_bayes.inference.coordinates.flank import FlankCoordinates
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import ANYTHING, Ends, Mixture, Proposal
from tactile_bayes.inference.ensembles import SamplerSettings, scatter_walkers
from tactile_bayes.inference.importance import approximate
from tactile_bayes.inference.misfit import what_to_try
from tactile_bayes.inference.record_likelihood.likelihood import events_of
from tactile_bayes.inference.shape_free_posterior.observer import Observer
from tactile_bayes.inference.shape_free_posterior.optimum import whitening_at
from tactile_bayes.inference.shape_free_posterior.whitening import Whitening
from tactile_bayes.inference.starts.cloud import Cloud, gather
from tactile_bayes.inference.starts.contour_optimum import (
    ContourOptimum,
    contact_fit,
    fitted_noise,
    optima_of,
    optimum_of,
)
from tactile_bayes.inference.starts.pilot import standardise
from tactile_bayes.numerics.scatter import DEVIATION_OVER_MEDIAN

__all__ = ["Walk", "flank_at_contacts", "walk_of"]

# Standard deviations, half those of the starting points, of the logarithms of amplitude and length scale, of that of
# noise, and of the other whitened coordinates: points that are farther out in all of these at once are improbable.
_ROUGHNESS_SPREAD, _NOISE_SPREAD, _WHITENED_SPREAD = 0.3, 0.1, 0.7
_MANY_SAMPLES = 100  # loaded ones, from which an optimum that explains the record is taken for the only one
_MAX_SEARCHES = 9  # after which no other begins, unless none of them explains a record of few loaded samples
# Searches that end in known modes, after which no other mode is expected: for a record of many loaded samples, and for
# any record if the posterior is nearly normal around the last mode found.
_REPEATS, _REPEATS_FEW_SAMPLES = 2, 4
_EFFICIENT = 0.35  # efficiency of a proposal above which the posterior is nearly normal around it
# Efficiency of the proposal in coordinates of a flank, over that in the model's own, from which they are preferred: a
# ridge that bends beyond the draws of the importance sampling looks straight.
_FLANK_EFFICIENCY = 0.4
_SCALE_DRAWS = 500  # from which the extent of a proposal is estimated, or the prior searched
_MAX_EXCESS_COST = 100.0  # above the smallest cost, from which an optimum is disregarded
_MODE_RADIUS = 3.0  # distance from a mode, over that of typical points of its proposal, within which an optimum is its
_MAX_LOG_MASS_RATIO = 9.0  # from which the smaller mode is left out: one draw in ten thousand
_LIKELIEST = 3  # draws of the prior from which a mode is sought, if the record's contact points do not lead to one
_POOR_MISFIT = 2.0  # mean square of the standardised residuals above which a further search is made


class Walk(NamedTuple):
    """Starting points of the walkers, and the coordinates in which they are sampled."""

    start: Floats  # (ensemble, walker, coordinate)
    coordinates: Coordinates
    log_evidence: float = -np.inf  # coarse one of the model, up to a constant of the number of parameters
    beyond: str = ""  # parameters that fit the record far better beyond the ends of their priors, as text


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
        drawn, _ = model.draw_prior(rng, _SCALE_DRAWS, deadline)
        point = drawn[np.argmax(model.log_probability(drawn))]
        whitening = whitening_at(model, point, rng, deadline)
        return self._whitened_around(whitening, whitening.of(point[None])[0])

    def _best_whitening(self) -> Whitening:
        """Return coordinates at the best mode to which the first points lead of which one explains the record."""
        best: tuple[tuple[bool, float, float], Whitening] | None = None
        for points in self._starting_points():
            for point in points:
                if best is None or not self.deadline.has_passed:
                    whitening = whitening_at(self.model, point, self.rng, self.deadline)
                    misfit, centre = _misfit(self.model, whitening.centre), whitening.centre[None]
                    rank = misfit < _POOR_MISFIT, float(self.model.log_probability(centre)[0]), -misfit
                    if best is None or rank > best[0]:
                        best = rank, whitening
            if best is not None and (best[0][0] or self.deadline.has_passed):
                break
        assert best is not None  # a search has a result, or raises
        return best[1]

    def _starting_points(self) -> Iterator[Iterable[Floats]]:
        """Yield parameters fitted to Step 2's contacts, the likeliest of some draws of the prior, those of a search."""
        model = self.model
        by_contacts = contact_fit(model)
        if by_contacts is not None:
            of_white = fitted_noise(model, np.full((1, np.count_nonzero(model.present)), 1.0 / DEVIATION_OVER_MEDIAN))
            of_rig, of_discrepancy = map(model.prior_medians, (model.unknowns.names, model.noise.of_discrepancy))
            yield [np.concatenate([by_contacts, of_rig, of_white, of_discrepancy])]
        drawn, _ = model.draw_prior(self.rng, _SCALE_DRAWS, self.deadline)
        yield drawn[np.argsort(Observer(model).log_density(drawn))[::-1][:_LIKELIEST]]
        yield [optimum_of(model, self.rng, self.deadline).point]

    def _whitened_around(self, whitening: Whitening, centre: Floats) -> Walk:
        """Return the start around a centre, in whitening coordinates."""
        noise, count, deadline = self.model.noise, centre.size, self.deadline
        log_probability = in_coordinates(self.model.log_probability, whitening)
        spread = np.full(count, _WHITENED_SPREAD)
        spread[: whitening.bent] = _ROUGHNESS_SPREAD
        spread[2 : 2 + len(noise.of_white)] = _NOISE_SPREAD
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
        rest = slice(whitening.bent, None)
        whitening, start = standardise(self.model.log_probability, whitening, start, rest, self.rng, deadline)
        return Walk(start, whitening, log_evidence)

    def scattered(self) -> Walk:
        """Return walkers scattered twice as widely as normal approximations of the modes, which serve as proposals."""
        model, rng, deadline = self.model, self.rng, self.deadline
        modes = _Modes(model, rng, deadline).found_by_search()
        if any(mode.coordinates is not modes[0].coordinates for mode in modes):
            modes = [mode.usual or mode for mode in modes]
        common = modes[0].coordinates
        proposal = Mixture(tuple(mode.proposal for mode in modes))

        def draw(rng: np.random.Generator, count: int) -> Floats:
            counts = rng.multinomial(count, proposal.shares)
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
            point = modes[0].optimum.point
            best = ", ".join(f"{name} = {value:.6g}" for name, value in zip(model.names, point, strict=False))
            raise _nothing_describes(model, model.family.name, f" (the nearest has {best})") from error
        coordinates = common.with_proposal(proposal)
        log_evidence = float(logsumexp([mode.proposal.log_mass for mode in modes]))
        return Walk(coordinates.of(start), coordinates, log_evidence, modes[0].optimum.beyond)


def _nothing_describes(model: ContourModel, what: str, nearest: str = "") -> InferenceError:
    """Return the error that states what to check, and what to try."""
    return InferenceError(
        f"no {what} was found that describes the record{nearest}: are units, signs, drive angle, rod and base right? "
        "tactile-bayes inspect checks them. "
        + what_to_try([model.family.name], model.unknowns.names, friction=model.unknowns.friction)
    )


def _misfit(model: ContourModel, point: Floats) -> float:
    """Return the mean square of the residuals at a point, over a coarse noise of the record, with outliers clipped."""
    left = model.likelihood.measured - model.likelihood.load_cell.expected(model.loads(point[None]))[0]
    return float(np.mean(np.minimum(np.abs(left / model.deviations)[:, model.present], 5.0) ** 2))


class _Mode(NamedTuple):
    """Mode of the posterior."""

    optimum: ContourOptimum
    cloud: Cloud
    proposal: Proposal
    coordinates: Coordinates  # of the cloud and the proposal
    usual: _Mode | None = None  # the mode in the model's own coordinates, if those are others


class _Modes:
    """Modes of the posterior that were found so far."""

    def __init__(self, model: ContourModel, rng: np.random.Generator, deadline: Deadline) -> None:
        self.model, self.rng, self.deadline = model, rng, deadline
        self.found: list[_Mode] = []
        self._own = model.coordinates

    def found_by_search(self) -> list[_Mode]:
        """Return modes, that with the most mass first: one if it explains many loaded samples, else all of mass."""
        found = self.found
        for optimum in sorted(self._not_explaining(), key=lambda one: one.cost):
            least = min((mode.optimum.cost for mode in found), default=optimum.cost)
            late = found and self.deadline.has_passed
            if optimum.cost < least + _MAX_EXCESS_COST and not late and not self._is_known(optimum):
                found.append(self._around(optimum))
        if not found:
            raise InferenceError("no contour was found that the rod can reach: are base, rod and units right?")
        found.sort(key=lambda mode: -mode.proposal.log_mass)
        least_mass = found[0].proposal.log_mass - _MAX_LOG_MASS_RATIO
        return [mode for mode in found if mode is found[0] or mode.proposal.log_mass > least_mass]

    def _not_explaining(self) -> list[ContourOptimum]:
        """Search, find the modes of optima that explain the record, and return the other optima."""
        others, repeats = [], 0
        many_samples = bool(np.count_nonzero(~self.model.found["unloaded"].values) >= _MANY_SAMPLES)
        for tried, optimum in enumerate(optima_of(self.model, self.rng, self.deadline), start=1):
            if not optimum.fits:
                others.append(optimum)
            elif self._is_known(optimum):
                repeats += 1
            else:
                self.found.append(self._around(optimum))
            if self._are_all(repeats, tried, many_samples):
                break
        return others

    def _are_all(self, repeats: int, tried: int, many_samples: bool) -> bool:
        """Return True if no further search is worth while, after so many, of which so many ended in known modes."""
        normal = bool(self.found) and self.found[-1].proposal.efficiency > _EFFICIENT
        if many_samples and (normal or repeats == _REPEATS):
            return True
        if normal and repeats == _REPEATS_FEW_SAMPLES:
            return True
        return tried >= _MAX_SEARCHES and (bool(self.found) or many_samples)

    def _is_known(self, optimum: ContourOptimum) -> bool:
        """Return True if an optimum belongs to a mode that was found before."""
        point = optimum.point[None]
        far = _MODE_RADIUS * np.sqrt(point.size)
        return any(np.linalg.norm(mode.proposal.steps(mode.coordinates.of(point))) < far for mode in self.found)

    def _around(self, optimum: ContourOptimum) -> _Mode:
        """Approximate a mode in the coordinates in which it is nearer to normal; modes on a flank share them."""
        model, point = self.model, optimum.point
        usual = self._in(self._own, optimum, optimum.covariance, model.walked_ends)
        if usual.proposal.efficiency > _EFFICIENT or self.deadline.has_passed:
            return usual
        flanks = dict.fromkeys([*(mode.coordinates for mode in self.found), flank_at_contacts(model, point)])
        for flank in flanks:  # each once, since modes share them
            if not isinstance(flank, FlankCoordinates):
                continue
            covariance = flank.covariance(point, optimum.covariance)
            if not np.isfinite(covariance).all():  # the vertex is too near, or on the other side
                continue
            mode = self._in(flank, optimum, covariance)._replace(usual=usual)
            is_better = bool(self.found) or mode.proposal.efficiency > _FLANK_EFFICIENCY * usual.proposal.efficiency
            if is_better and not flank.reach_vertex(mode.proposal.draw(self.rng, _SCALE_DRAWS)[0]):
                return mode
        return usual

    def _in(
        self, coordinates: Coordinates, optimum: ContourOptimum, covariance: Floats, ends: Ends = ANYTHING
    ) -> _Mode:
        target, centre = in_coordinates(self.model.log_probability, coordinates), coordinates.of(optimum.point[None])[0]
        cloud = gather(target, centre, covariance, self.rng, self.deadline, ends)
        proposal = approximate(target, cloud.centre, cloud.narrow_covariance, self.rng, self.deadline, ends)
        return _Mode(optimum, cloud, proposal, coordinates)


def flank_at_contacts(model: ContourModel, point: Floats) -> FlankCoordinates | None:
    """Return coordinates of a flank at the middle of the contacts predicted at a point, shape (parameters,)."""
    if not FlankCoordinates.describe(model.family.name):
        return None
    at = point[None]
    events = events_of(model.likelihood, model.contours(at), model.rig(at), exact=False)
    x = float(np.mean([events["first_contact_x"], events["snap_off_contact_x"]]))
    return FlankCoordinates.at(model.family.name, model.names, model.coordinates, point, x)

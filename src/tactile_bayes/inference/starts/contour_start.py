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
from tactile_bayes.inference.coordinates import Coordinates, in_coordinates
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import LogProbability, Mixture, at_maximum, refined
from tactile_bayes.inference.ensembles import SamplerSettings, scatter_walkers
from tactile_bayes.inference.ensembles.moves import moves_in
from tactile_bayes.inference.ensembles.run_state import Block, make_block
from tactile_bayes.inference.ensembles.walkers import first_random_state
from tactile_bayes.inference.misfit import what_to_try
from tactile_bayes.inference.shape_free_posterior.observations import Observer
from tactile_bayes.inference.shape_free_posterior.whitening import Whitening, whitening_at
from tactile_bayes.inference.starts.cloud import gather
from tactile_bayes.inference.starts.contour_optimum import contact_fit, fitted_noise, optimum_of, smooth_optimum
from tactile_bayes.inference.starts.modes import Modes
from tactile_bayes.load_cell.drift import Zero
from tactile_bayes.numerics.scatter import DEVIATION_OVER_MEDIAN, rough_noise

# Standard deviations, half those of the starting points, of the logarithms of amplitude and length scale, of that of
# noise, and of the other whitened coordinates: points that are farther out in all of these at once are improbable.
_ROUGHNESS_SPREAD, _NOISE_SPREAD, _WHITENED_SPREAD = 0.3, 0.1, 0.7
_PRIOR_DRAWS = 500  # among which the likeliest is sought
_LIKELIEST = 3  # draws of the prior from which a mode is sought, if the record's contact points do not lead to one
_SEARCHES = 3  # for an optimum, if these draws do not lead to a mode, either
_FARTHEST = 5.0  # standard deviations at which residuals are clipped: a sample beside an event may be loaded or not
# Root mean square of a channel's residuals, over the noise between neighbours, that no noise explains, of a family and
# of a shape-free contour, which follows what families do not; and the steps that a verdict needs.
_SMOOTH, _SMOOTH_FREE, _STEPS_OF_A_VERDICT = 2.5, 1.4, 50
_POOR_MISFIT = 2.0  # mean square of the standardised residuals above which a further search is made


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
        best: tuple[tuple[bool, float, float], Whitening] | None = None
        for points in self._starting_points():
            for point in points:
                if best is None or not self.deadline.has_passed:
                    whitening = whitening_at(self.model, point, self.rng, self.deadline)
                    misfit, centre = mean_square_left(self.model, whitening.centre), whitening.centre[None]
                    rank = misfit < _POOR_MISFIT, float(self.model.log_probability(centre)[0]), -misfit
                    if best is None or rank > best[0]:
                        best = rank, whitening
            if best is not None and (best[0][0] or self.deadline.has_passed):
                break
        assert best is not None  # a search has a result, or raises
        return best[1]

    def _starting_points(self) -> Iterator[Iterable[Floats]]:
        """Yield parameters fitted to Step 2's contacts and the likeliest draws of the prior, or without contacts
        those of a circle, and at last those of a search."""
        model, rng, deadline = self.model, self.rng, self.deadline
        by_contacts = contact_fit(model)
        if by_contacts is None:
            yield [smooth_optimum(model, rng, deadline)]
            yield [optimum_of(model, rng, deadline).point]
            return
        of_white = fitted_noise(model, np.full((1, np.count_nonzero(model.present)), 1.0 / DEVIATION_OVER_MEDIAN))
        of_rig, of_discrepancy = map(model.prior_medians, (model.unknowns.names, model.noise.of_discrepancy))
        yield [np.concatenate([by_contacts, of_rig, of_white, of_discrepancy])]
        drawn, _ = model.draw_prior(rng, _PRIOR_DRAWS, deadline)
        yield drawn[np.argsort(Observer(model).log_density(drawn))[::-1][:_LIKELIEST]]
        yield [optimum_of(model, rng, deadline, _SEARCHES).point]

    def _whitened_around(self, whitening: Whitening, centre: Floats) -> Walk:
        """Return the start around a centre, in whitening coordinates."""
        noise, count, deadline = self.model.noise, centre.size, self.deadline
        log_probability = in_coordinates(self.model.log_probability, whitening)
        spread = np.full(count, _WHITENED_SPREAD)
        spread[: whitening.bent] = _ROUGHNESS_SPREAD
        spread[2 : 2 + len(noise.of_white)] = _NOISE_SPREAD
        if noise.of_discrepancy:  # which makes residuals alike, as the approximation does not know
            whitening = _at_mode(log_probability, whitening, centre, spread, deadline)
            log_probability, centre = in_coordinates(self.model.log_probability, whitening), whitening.middle
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
        is_hopeless = _left_over_noise(self.model, whitening.centre) > _SMOOTH_FREE
        if not (noise.of_discrepancy or is_hopeless):  # else a verdict does not need it
            rest = slice(whitening.bent, None)
            whitening, start = standardise(self.model.log_probability, whitening, start, rest, self.rng, deadline)
        return Walk(start, whitening, log_evidence, most_steps=_STEPS_OF_A_VERDICT if is_hopeless else None)

    def scattered(self) -> Walk:
        """Return walkers scattered twice as widely as normal approximations of the modes, which serve as proposals."""
        model, rng, deadline = self.model, self.rng, self.deadline
        modes = Modes(model, rng, deadline).found_by_search()
        if any(mode.coordinates is not modes[0].coordinates for mode in modes):
            modes = [mode.usual or mode for mode in modes]
        common = modes[0].coordinates
        target = in_coordinates(model.log_probability, common)
        first = modes[0].optimum
        is_hopeless = not first.fits and _left_over_noise(model, first.point) > _SMOOTH
        proposal = Mixture(tuple(mode.proposal for mode in modes))
        shares = proposal.shares
        if not is_hopeless:  # else a verdict does not need it
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
        most_steps = _STEPS_OF_A_VERDICT if is_hopeless else None
        return Walk(coordinates.of(start), coordinates, log_evidence, first.beyond, most_steps)


def _nothing_describes(model: ContourModel, what: str, nearest: str = "") -> InferenceError:
    """Return the error that states what to check, and what to try."""
    return InferenceError(
        f"no {what} was found that describes the record{nearest}: are units, signs, drive angle, rod and base right? "
        "tactile-bayes inspect checks them. "
        + what_to_try([model.family.name], model.unknowns.names, friction=model.unknowns.friction)
    )


def _left_over_noise(model: ContourModel, best: Floats) -> float:
    """Return the largest root mean square of a channel's residuals at the best parameters, over the noise between
    neighbouring ones; 0 if what wanders, or is off by what is integrated out, is inferred, which is no misfit."""
    cell = model.noise.cell
    if model.noise.of_discrepancy or cell.drift is not None or any(cell.bias_uncertainty):
        return 0.0
    left, noise = _residuals(model, best)[:, model.present], model.deviation[model.present]
    rough = np.maximum([rough_noise(channel) for channel in left.T], noise)
    return float(np.sqrt(np.mean(np.minimum(np.abs(left / rough), _FARTHEST) ** 2, axis=0)).max())


def _residuals(model: ContourModel, point: Floats) -> Floats:
    cell = model.likelihood.load_cell
    return np.asarray(model.likelihood.measured - cell.cut(cell.expected(model.loads(point[None])))[0])


def mean_square_left(model: ContourModel, point: Floats) -> float:
    """Return the mean square of the residuals at a point over a coarse noise, with outliers clipped. Beside a
    discrepancy they are those of each sample given the ones before it."""
    from tactile_bayes.load_cell.kalman import given_before  # numba takes a second to load

    left, noise = _residuals(model, point)[:, model.present], model.deviations[:, model.present]
    discrepancy = model.discrepancy_at(point)
    if discrepancy is not None:
        none = np.zeros(left.shape[1])
        still = Zero(none, none, none, 1.0)
        left, variance = given_before(left, noise**2, still, discrepancy.of(np.flatnonzero(model.present)))
        noise = np.sqrt(variance)
    return float(np.mean(np.minimum(np.abs(left / noise), _FARTHEST) ** 2))


def _at_mode(
    log_probability: LogProbability, base: Whitening, centre: Floats, spread: Floats, deadline: Deadline
) -> Whitening:
    """Return coordinates standardised by the curvature of the log-density at its maximum, sought from a centre."""
    middle, root = at_maximum(log_probability, centre, np.diag(spread), deadline)
    bent, precision = base.bent, np.linalg.inv(root @ root.T)
    given_bent = np.linalg.cholesky(np.linalg.inv(precision[bent:, bent:]))
    return replace(base, scales=np.exp(middle[:bent])).standardised(middle[bent:], given_bent)


_STEPS = (40, 80, 160, 320)  # of each pilot run
# Gain of a further change, and share of the steps that move a walker, below and above which no further run is made.
_GOOD_GAIN, _GOOD_MOVING = 0.3, 0.55
_MIN_VARIANCE = 1e-3  # of these coordinates that is believed


def standardise(
    log_probability: LogProbability,
    base: Whitening,
    start: Floats,
    columns: slice,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
) -> tuple[Whitening, Floats]:
    """Return coordinates nearer to standard normal, by pilot runs, and the start, (ensembles, walkers, d), in them."""
    random = first_random_state(np.random.SeedSequence(int(rng.integers(2**63))))
    best, start, points = base, start.copy(), start[0]
    for steps in _STEPS:
        if deadline.has_passed:
            break
        density = in_coordinates(log_probability, best)
        first = Block(points[None, None], density(points)[None, None], (random,))
        block = make_block(density, moves_in(best), first, steps, deadline)
        if not block.whole:
            raise KeyboardInterrupt
        (random,), points = block.random_states, block.samples[0, -1].copy()
        late = np.swapaxes(block.samples[0, block.steps // 2 :], 0, 1)
        normal, gain = _cross_validated(late[..., columns])
        best = best.standardised(normal.mean, normal.root)
        for each in (start, points):
            each[..., columns] = normal.standard(each[..., columns])
        moving = np.mean(np.any(np.diff(late, axis=1) != 0.0, axis=-1))
        if moving > _GOOD_MOVING and gain < _GOOD_GAIN:
            break
    return best, start


class _Normal(NamedTuple):
    """Normal distribution of coordinates that should be nearly standard normal."""

    mean: Floats
    root: Floats

    @classmethod
    def fitted(cls, draws: Floats, independent: float) -> _Normal:
        """Return the distribution fitted to draws, (n, k), as many of which as said are independent. Only principal
        axes count whose variances differ from one by more than that number explains (Marchenko & Pastur 1967, doi
        10.1070/SM1967v001n04ABEH001994), less their bias (Baik & Silverstein 2006, doi 10.1016/j.jmva.2005.08.003)."""
        variances, axes = np.linalg.eigh(np.cov(draws.T))
        variances = np.maximum(variances, _MIN_VARIANCE)  # if few walkers have moved
        ratio = variances.size / independent
        unlike = np.abs(np.sqrt(variances) - 1.0) > np.sqrt(ratio)
        variances, axes = variances[unlike], axes[:, unlike]
        twice = variances + 1.0 - ratio
        true = 0.5 * (twice + np.sign(variances - 1.0) * np.sqrt(np.maximum(twice**2 - 4.0 * variances, 0.0)))
        root = np.sqrt(np.maximum(true, _MIN_VARIANCE))
        return cls(draws.mean(axis=0), np.eye(draws.shape[1]) + axes * (root - 1.0) @ axes.T)

    def gain(self, draws: Floats) -> float:
        """Return by how much the mean log-density of draws, (n, k), exceeds that of the standard normal one."""
        squares = np.mean(np.sum(draws**2 - self.standard(draws) ** 2, axis=1))
        return float(0.5 * squares - np.linalg.slogdet(self.root).logabsdet)

    def standard(self, points: Floats) -> Floats:
        """Return points, (…, k), standardised by this distribution."""
        return np.asarray(np.linalg.solve(self.root, (points - self.mean)[..., None])[..., 0])


def _cross_validated(draws: Floats) -> tuple[_Normal, float]:
    """Return a normal distribution fitted to draws (walkers, steps, k), and its gain for draws of other walkers. How
    many draws are independent is the number with which a fit to each half of the walkers suits the other best."""
    halves = [half.reshape(-1, draws.shape[-1]) for half in np.array_split(draws, 2)]
    gains = {}
    for number in len(draws) * 2.0 ** np.arange(-1, 8):
        fits = [_Normal.fitted(half, 0.5 * number) for half in halves]
        gains[number] = float(np.mean([fit.gain(other) for fit, other in zip(fits, halves[::-1], strict=True)]))
    best = max(gains, key=gains.__getitem__)
    return _Normal.fitted(np.concatenate(halves), best), gains[best]

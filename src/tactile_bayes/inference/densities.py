"""Densities of proposals (normal, Student's t, mixtures, between bounds), their adaptation, and weights of draws."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import gammaln, logsumexp, ndtr

from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.inference.deadline import NEVER, Deadline

LogProbability = Callable[[Floats], Floats]
Random = np.random.Generator | np.random.RandomState  # emcee's moves have legacy generators
WIDENING = 1.1  # scale over that of the fitted points: too wide a proposal costs less than too narrow a one
_FREEDOM = 10.0  # degrees of freedom: tails are heavier than normal ones, at little cost
_MAX_REDRAWS = 40  # times that points out of bounds are drawn again
# Truncation points of a normal distribution [sd from its mean]: farther ones have no effect, or lose most draws.
_CUTS = np.linspace(-4.0, 1.0, 101)
_ROUNDS = 10  # of expectation and maximisation
# Points that the prior of a part's covariance weighs, and its width over that of all.
_PRIOR_POINTS, _PRIOR_WIDTH = 5.0, 0.3


def normalised(logs: Floats) -> Floats:
    """Return weights of sum one from their logarithms, shape (n,)."""
    with np.errstate(invalid="ignore"):  # −inf less the largest remains −inf
        weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())


def effective_number(weights: Floats) -> Floats:
    """Return the effective number (Kish's) of weights of sum one along the first axis."""
    return np.asarray(1.0 / np.sum(weights**2, axis=0))


def flattened(logs: Floats, least: float) -> Floats:
    """Return weights of sum one from their logarithms, shape (n,), made more equal until `least` are effective."""
    power = 1.0
    while effective_number(weights := normalised(power * logs)) < least:
        power *= 0.8
    return weights


@dataclass(frozen=True, eq=False)
class Ends:
    """Bounds of each coordinate of a target, shape (parameters,) each, or () for all coordinates."""

    low: Floats
    high: Floats

    def hold(self, points: Floats) -> Flags:
        """Return True for points, shape (n, parameters), within the bounds."""
        return np.asarray(((points > self.low) & (points < self.high)).all(axis=1))

    def drawn(self, draw: Callable[[int], Floats], count: int) -> Floats:
        """Return draws within the bounds; others are drawn again, up to a largest number of times."""
        points = draw(count)
        for _ in range(_MAX_REDRAWS):
            out = np.flatnonzero(~self.hold(points))
            if not out.size:
                break
            points[out] = draw(out.size)
        return points


ANYTHING = Ends(np.array(-np.inf), np.array(np.inf))


@dataclass(frozen=True, eq=False)
class Proposal:
    """Multivariate Student's t distribution between bounds; normal for infinite degrees of freedom."""

    mean: Floats  # (parameters,)
    root: Floats  # lower-triangular Cholesky factor of the scale matrix
    efficiency: float = 0.0  # effective share of draws when weighted by the target
    log_mass: float = -np.inf  # log of the target's integral where it is covered, up to a constant of their number
    ends: Ends = ANYTHING
    freedom: float = _FREEDOM

    @classmethod
    def fitted(cls, points: Floats, weights: Floats | None = None, ends: Ends = ANYTHING) -> Proposal:
        """Fit a proposal to points, (n, parameters), with weights of sum one, in any units of the parameters. The
        points are taken for draws of a normal distribution that is truncated at the lower bounds."""
        weights = np.full(len(points), 1.0 / len(points)) if weights is None else weights
        mean = weights @ points
        centred = points - mean
        deviation = np.sqrt(weights @ centred**2)
        _refuse_constant(deviation, np.abs(mean))
        standard = centred / deviation
        correlation = (weights[:, None] * standard).T @ standard / (1.0 - np.sum(weights**2))
        above = (mean - ends.low) / deviation
        for j in np.flatnonzero(above < -_CUTS[0]):
            shift, extra = untruncated(above[j], correlation[j, j])
            along = correlation[:, j] / correlation[j, j]
            mean = mean + deviation * along * shift
            correlation = correlation + extra * np.outer(along, along)
        return cls(mean, WIDENING * deviation[:, None] * np.linalg.cholesky(correlation), ends=ends)

    @property
    def constant(self) -> float:
        """What `log_density` lacks."""
        size, nu = self.mean.size, self.freedom
        if math.isinf(nu):
            return -0.5 * size * math.log(2.0 * math.pi)
        return float(gammaln(0.5 * (nu + size)) - gammaln(0.5 * nu) - 0.5 * size * math.log(math.pi * nu))

    def draw(self, random: Random, count: int) -> tuple[Floats, Floats]:
        """Return points within the bounds, shape (count, parameters), and their `log_density`."""
        points = self.ends.drawn(lambda count: self.draw_unbounded(random, count), count)
        return points, self.log_density(points)

    def draw_unbounded(self, random: Random, count: int) -> Floats:
        """Return points of the distribution without bounds, shape (count, parameters)."""
        steps = random.standard_normal((count, self.mean.size))
        if math.isfinite(self.freedom):
            steps = steps / np.sqrt(random.chisquare(self.freedom, count) / self.freedom)[:, None]
        return np.asarray(self.mean + steps @ self.root.T)

    def log_density(self, points: Floats) -> Floats:
        """Return the log-density without bounds at points, (n, parameters), up to a constant of their number."""
        squares = np.sum(self.steps(points) ** 2, axis=1)
        if math.isinf(self.freedom):
            return np.asarray(-0.5 * squares - self._log_volume)
        power = -0.5 * (self.freedom + self.mean.size)
        return np.asarray(power * np.log1p(squares / self.freedom) - self._log_volume)

    def steps(self, points: Floats) -> Floats:
        """Return the standardised points, shape (n, parameters): relative to the mean, in units of the scale."""
        return np.asarray((points - self.mean) @ self._inverse.T)

    @cached_property
    def _inverse(self) -> Floats:
        return np.asarray(solve_triangular(self.root, np.eye(self.mean.size), lower=True))

    @cached_property
    def _log_volume(self) -> float:
        return float(np.log(np.diag(self.root)).sum())


@dataclass(frozen=True, eq=False)
class Mixture:
    """Several proposals, each for a mode of the target, or a piece of its ridge."""

    parts: tuple[Proposal, ...]

    @classmethod
    def fitted(
        cls, points: Floats, bent: Sequence[int], parts: int, ends: Ends = ANYTHING, weights: Floats | None = None
    ) -> Mixture:
        """Fit a mixture, normal in the columns `bent`, to points, (n, parameters), by expectation and maximisation.
        Given these, all others have one normal distribution, with a mean linear in them. The weights have the sum
        one."""
        weights = np.full(len(points), 1.0 / len(points)) if weights is None else weights
        mean = weights @ points
        deviation = np.sqrt(weights @ (points - mean) ** 2)
        _refuse_constant(deviation, np.abs(points).max(axis=0))
        standard, root = (points - mean) / deviation, np.sqrt(weights)[:, None]
        slopes = np.linalg.lstsq(root * standard[:, bent], root * standard, rcond=None)[0]  # of `bent`, themselves
        rest = standard - standard[:, bent] @ slopes
        left = (weights[:, None] * rest).T @ rest
        left[bent] = left[:, bent] = 0.0
        found = []
        for size, middle, covariance in zip(*_pieces(standard[:, bent], parts, weights), strict=True):
            root = WIDENING * deviation[:, None] * np.linalg.cholesky(slopes.T @ covariance @ slopes + left)
            found.append(Proposal(mean + deviation * (middle @ slopes), root, log_mass=float(np.log(size)), ends=ends))
        return cls(tuple(found))

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.parts[0].mean.size

    @property
    def ends(self) -> Ends:
        return self.parts[0].ends

    def draw(self, random: Random, count: int) -> tuple[Floats, Floats]:
        """Return points within the bounds, shape (count, parameters), and their `log_density`."""
        points = self.ends.drawn(lambda count: self.draw_unbounded(random, count), count)
        return points, self.log_density(points)

    @cached_property
    def shares(self) -> Floats:
        """Shares of the parts, in proportion to the target's integral; equal if no integral is known."""
        masses = np.array([part.log_mass for part in self.parts])
        return normalised(masses if np.any(np.isfinite(masses)) else np.zeros(masses.size))

    @property
    def efficiency(self) -> float:
        """Efficiency of the mixture, as if each part covered its own mode alone."""
        each = np.array([part.efficiency for part in self.parts])
        return float(1.0 / np.sum(self.shares / each)) if np.all(each > 0.0) else 0.0

    def draw_unbounded(self, random: Random, count: int) -> Floats:
        counts = random.multinomial(count, self.shares)
        parts = [part.draw_unbounded(random, int(each)) for part, each in zip(self.parts, counts, strict=True)]
        return np.concatenate(parts)[random.permutation(count)]

    def log_density(self, points: Floats) -> Floats:
        with np.errstate(divide="ignore"):  # a part without mass has no share
            shares = np.log(self.shares)
        each = [share + part.log_density(points) for share, part in zip(shares, self.parts, strict=True)]
        return np.asarray(np.logaddexp.reduce(each))


def _refuse_constant(deviation: Floats, size: Floats) -> None:
    """Raise numpy.linalg.LinAlgError if a deviation, shape (d,), is no more than rounding of numbers of a size."""
    if not np.all(deviation > 1e-12 * size):
        raise np.linalg.LinAlgError("a parameter is the same in all points")


def untruncated(above: float, variance: float) -> tuple[float, float]:
    """Return changes of mean and variance that undo truncation at a bound `above` below the mean, in deviations. A
    half-normal distribution becomes the normal one of which it is a half."""
    if above >= -_CUTS[0]:
        return 0.0, 0.0
    mills = np.exp(-0.5 * _CUTS**2) / (np.sqrt(2.0 * np.pi) * ndtr(-_CUTS))
    narrow = np.sqrt(1.0 - mills * (mills - _CUTS))
    cut = np.interp(-above, -(mills - _CUTS) / narrow, _CUTS)
    scale = 1.0 / np.interp(cut, _CUTS, narrow)
    return float(-above - cut * scale), float(variance * (scale**2 - 1.0))


def _pieces(points: Floats, count: int, weights: Floats) -> tuple[Floats, Floats, Floats]:
    """Return shares, (count,), means, (count, k), and covariances of a mixture of normal distributions of points."""
    whole, numbers = np.cov(points.T, aweights=weights).reshape(2 * points.shape[1:]), len(points) * weights
    order = np.argsort(points @ np.linalg.eigh(whole)[1][:, -1], kind="stable")
    shares = np.empty((count, len(points)))
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    shares[:, order] = np.eye(count)[np.minimum(count * below, count - 1).astype(int)].T
    for _ in range(_ROUNDS):
        counted = shares * numbers
        sizes = counted.sum(axis=1) + 1e-9
        means = counted @ points / sizes[:, None]
        off = points - means[:, None]
        covariances = (counted[:, None] * off.swapaxes(1, 2)) @ off
        covariances += _PRIOR_POINTS * _PRIOR_WIDTH**2 * whole
        covariances /= (sizes + _PRIOR_POINTS)[:, None, None]
        roots = np.linalg.cholesky(covariances)
        squares = np.sum(np.square(off @ np.linalg.inv(roots).swapaxes(1, 2)), axis=2)
        volumes = np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
        logs = (np.log(sizes) - volumes)[:, None] - 0.5 * squares
        shares = np.exp(logs - logs.max(axis=0))
        shares /= shares.sum(axis=0)
    return sizes / sizes.sum(), means, covariances


LARGEST_K = 0.7  # Pareto k̂ above which weights are not reliable (Vehtari et al. 2024, JMLR 25(72))
_ADAPTATIONS = 8  # of adaptation, at most
_DRAWS = 60  # per parameter in each round
_GOOD = 0.6  # efficiency from which no further round is made
_TRIED, _HOPELESS = 3, 0.02  # rounds after which none is made if the best is no more efficient
_MASS_DRAWS = 4000  # from which the mass of a proposal within the bounds is estimated
_MIN_EFFECTIVE = 5  # effective draws per parameter for a covariance; weights are made more equal to reach it
# Four pieces have the efficiency of eight: 5 to 57 % for seven posteriors along bent ridges that a single one covers to
# 1 to 10 %. After the fewest rounds an efficiency that is enough is no luck; after the usual number, little is gained
# unless some of the last rounds were better than all before.
_PIECES, _FEWEST, _USUAL, _IN_VAIN, _MOST, _ENOUGH = 4, 4, 16, 6, 24, 0.5
BENT = 0.25  # efficiency of a single proposal below which pieces are tried: along bent ridges it is seldom more
EFFICIENT = 0.35  # efficiency of a proposal above which ensembles converge in some hundred steps
_DRAWS_OF_PIECES = 120  # per parameter in each of these rounds


def weighed(logs: Floats) -> tuple[Floats, Floats]:
    """Return log-weights of sum one along the first axis, and the log of the given ones' mean, the evidence."""
    with np.errstate(invalid="ignore"):
        total = logsumexp(logs, axis=0)
        return np.asarray(logs - total), np.asarray(total - np.log(len(logs)))


def pareto_smoothed(logs: Floats, efficiency: float = 1.0) -> tuple[Floats, float]:
    """Return log-weights of sum one with the largest ones smoothed, and Pareto's k̂, for logs of shape (n,)."""
    from arviz_stats.base.array import array_stats  # loads Matplotlib

    smoothed, k = array_stats.psislw(-logs, r_eff=efficiency)  # weights are exp(−argument)
    return np.asarray(smoothed), float(k)


def approximate(
    log_probability: LogProbability,
    centre: Floats,
    covariance: Floats,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
    ends: Ends = ANYTHING,
    first: int = 1,
) -> Proposal:
    """Approximate a target by rounds of adaptive importance sampling, from guesses at mean and covariance. The most
    efficient round, from the `first` on, gives the result (Oh & Berger 1992, doi 10.1080/00949659208810407)."""
    best = proposal = Proposal(centre, WIDENING * np.asarray(np.linalg.cholesky(covariance)), ends=ends)
    for rounds in range(1, _ADAPTATIONS + 1):
        if deadline.has_passed:
            break
        points, density = proposal.draw(rng, _DRAWS * centre.size)
        surplus = log_probability(points) - density
        if not np.isfinite(surplus).sum() > _MIN_EFFECTIVE * centre.size:
            break
        efficiency = float(effective_number(normalised(surplus))) / len(points)
        if efficiency > best.efficiency and rounds >= first:
            log_mass = float(logsumexp(surplus) - np.log(len(points)))
            log_mass += _log_within(proposal, rng)
            best = replace(proposal, efficiency=efficiency, log_mass=log_mass)
        if best.efficiency >= _GOOD or (rounds >= _TRIED and best.efficiency < _HOPELESS):
            break
        try:
            proposal = Proposal.fitted(points, flattened(surplus, _MIN_EFFECTIVE * centre.size), ends)
        except np.linalg.LinAlgError:
            break
    return best


_FIRST_WIDTH, _WIDTH = 0.01, 0.3  # of differences, in units of the guess and then of the curvature found before
_ROOM, _NEARER = 0.45, 0.9  # largest width, and step, over the distance to an end
_MOST_STEPS, _LEAST_GAIN = 12, 0.3  # of Newton's method, and the gain of log-density below which it ends
_FLATTEST = 0.04  # least curvature that is believed, in units of the one before
_LENGTHS = 2.0 ** -np.arange(-1.0, 9.0)  # of a step, among which the best is taken


def at_maximum(
    log_probability: LogProbability, centre: Floats, root: Floats, deadline: Deadline = NEVER, ends: Ends = ANYTHING
) -> tuple[Floats, Floats]:
    """Return the maximum of a smooth target near a centre, and a root of the inverse of its curvature there. Newton's
    method takes differences along the columns of the last such root, first of a guess."""
    size, value, width = centre.size, -np.inf, _FIRST_WIDTH
    one, two = np.triu_indices(size, 1)
    for _ in range(_MOST_STEPS):
        if deadline.has_passed:
            break
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.minimum(centre - ends.low, ends.high - centre)[:, None] / np.abs(root)
        widths = np.fmin(width, _ROOM * np.fmin.reduce(room, axis=0))
        along = np.diag(widths)
        pairs = along[one] + along[two]
        points = centre + np.concatenate([np.zeros((1, size)), along, -along, pairs, -pairs]) @ root.T
        values = log_probability(points)
        here, (ahead, back) = values[0], values[1 : 2 * size + 1].reshape(2, size)
        with np.errstate(divide="ignore", invalid="ignore"):  # beside what is impossible
            slope = (ahead - back) / (2.0 * widths)
            bend = 2.0 * here - ahead - back
            twice = 2.0 * here - values[2 * size + 1 :].reshape(2, -1).sum(axis=0)
            curvature = np.diag(bend / widths**2)
            curvature[two, one] = (twice - bend[one] - bend[two]) / (2.0 * widths[one] * widths[two])
        if not (np.isfinite(slope).all() and np.isfinite(curvature).all()):
            break
        sizes, axes = np.linalg.eigh(curvature, UPLO="L")
        sizes = np.maximum(np.abs(sizes), _FLATTEST)  # steps go up where the target is convex, too
        steps = _LENGTHS[:, None] * (root @ (axes @ ((axes.T @ slope) / sizes)))
        further = centre + np.clip(steps, _NEARER * (ends.low - centre), _NEARER * (ends.high - centre))
        points, values = np.concatenate([points, further]), np.append(values, log_probability(further))
        root, width = root @ (axes / np.sqrt(sizes)) @ axes.T, _WIDTH
        best = int(np.argmax(values))
        centre, value, gain = points[best], float(values[best]), float(values[best]) - value
        if gain < _LEAST_GAIN:
            break
    return centre, root


def _log_within(proposal: Proposal | Mixture, rng: np.random.Generator) -> float:
    """Return the logarithm of the share of a proposal's mass within its bounds."""
    if proposal.ends is ANYTHING:
        return 0.0
    within = proposal.ends.hold(proposal.draw_unbounded(rng, _MASS_DRAWS)).mean()
    return float(np.log(max(within, 1.0 / _MASS_DRAWS)))


def refined(
    log_probability: LogProbability, proposal: Proposal, rng: np.random.Generator, deadline: Deadline = NEVER
) -> Mixture:
    """Return a mixture of pieces that cover a bent target, if a proposal covers it poorly; else that alone. All draws
    are weighed by the mean density of all proposals so far (Cornuet et al. 2012, doi
    10.1111/j.1467-9469.2011.00756.x). The efficiency is that of draws of the last mixture, or of the one before."""
    size, best, since = proposal.mean.size, 0.0, 0
    mixture, rounds = Mixture((proposal,)), list[tuple[Mixture, float]]()
    points, values = np.empty((0, size)), np.empty(0)
    while proposal.efficiency < BENT and len(rounds) < _MOST and not deadline.has_passed:
        drawn, density = mixture.draw(rng, _DRAWS_OF_PIECES * size)
        found = log_probability(drawn)
        efficiency = float(effective_number(normalised(found - density))) / len(drawn)
        since, best = (0, efficiency) if efficiency > best else (since + 1, best)
        mixture = Mixture(tuple(replace(part, efficiency=efficiency) for part in mixture.parts))
        is_enough = len(rounds) >= _FEWEST and efficiency >= _ENOUGH
        if is_enough or (len(rounds) >= _USUAL and since >= _IN_VAIN):
            break
        rounds.append((mixture, _log_within(mixture, rng)))
        points, values = np.concatenate([points, drawn]), np.append(values, found)
        surplus = values - logsumexp([one.log_density(points) - within for one, within in rounds], axis=0)
        log_mass = float(logsumexp(surplus) + np.log(len(rounds) / len(points)))
        try:
            weights = flattened(surplus, _PIECES * _MIN_EFFECTIVE * size)
            pieces = Mixture.fitted(points, range(size), _PIECES, proposal.ends, weights)
        except np.linalg.LinAlgError:
            break
        parts = (replace(part, efficiency=efficiency, log_mass=part.log_mass + log_mass) for part in pieces.parts)
        mixture = Mixture(tuple(parts))
    return mixture

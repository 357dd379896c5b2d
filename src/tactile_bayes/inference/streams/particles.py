"""Weighted particles of a posterior, and their way from one record to a longer one."""

from __future__ import annotations

from functools import partial
from typing import Any

import emcee
import numpy as np
from scipy.optimize import brentq
from scipy.special import logsumexp

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.coordinates import in_coordinates
from tactile_bayes.inference.densities import LogProbability, Mixture, Proposal, effective_number, normalised
from tactile_bayes.inference.ensembles.moves import FittedMove, step_ensembles
from tactile_bayes.inference.streams.stream_state import WIDER, StreamState
from tactile_bayes.numerics.selection import resampled

# Number of parts of the mixture by which particles along a bent ridge move: 0.28 of its proposals for the first 28
# samples of a double sweep were accepted, 0.20 of those of 4 parts, 0.29 of 12, and 0.05 of a single distribution.
_PARTS = 8
# Shares of accepted proposals below which a mixture is taken, and above which a single distribution is tried again.
_POOR, _GOOD = 0.3, 0.45
# Shares of steps by differences of particles, and where hardly any proposal of a fitted distribution is accepted.
_DIFFERENCES, _MOSTLY_DIFFERENCES = 0.1, 0.5
_HARDLY = 0.1  # share of accepted proposals below which that is so
_RISING = 3.0  # increase of the mean log-density in a step, in standard errors, of particles on their way up


class Mover:
    """Moves particles by distributions fitted to half of them, now and then by differences. `rises`: the mean
    log-density rose in the last step of a fitted distribution by more than chance explains."""

    def __init__(self, model: ContourModel, random: np.random.RandomState) -> None:
        ends = model.walked_ends
        self.rises = False
        self._random = random
        self._single = FittedMove(fit=partial(Proposal.fitted, ends=ends))
        self._mixture = FittedMove(fit=partial(Mixture.fitted, bent=model.of_path, parts=_PARTS, ends=ends))
        self._fitted, self._accepted = self._single, 1.0

    def step(self, target: LogProbability, ensemble: Floats, density: Floats) -> tuple[Floats, Floats]:
        """Return the ensemble, shape (1, particles, coordinates), and its log-density after a step."""
        move = self._next()
        there, now = step_ensembles(target, [(move, 1.0)], [self._random], ensemble, density)
        if move is self._fitted:
            self._accepted = float(np.mean(np.any(there != ensemble, axis=-1)))
            self.rises = bool(now.mean() - density.mean() > _RISING * now.std() / np.sqrt(now.size))
        return there, now

    def _next(self) -> Any:
        """Return the next move, by what share of the proposals of the last fitted distribution was accepted."""
        by_differences = _DIFFERENCES if self._accepted > _HARDLY else _MOSTLY_DIFFERENCES
        if self._random.rand() < by_differences:
            return emcee.moves.DEMove()
        if self._fitted is self._single and self._accepted < _POOR:
            self._fitted = self._mixture
        elif self._fitted is self._mixture and self._accepted > _GOOD:
            self._fitted = self._single
        return self._fitted


_LEAST_SHARE = 0.35  # effective number of particles over their number below which they are resampled and moved
# Largest correlation of a parameter before and after the moves at which these end, after the last stage of an update
# and after each before it. With 0.5 in place of 0.35, evidences were too small by a factor of 0.7.
DECORRELATED, _BRIDGED = 0.2, 0.35
# Largest increase of the mean log-density in the moves of a stage, over its standard deviation, of particles that
# represented a posterior before, whose moves change it by chance alone: with 1,000 particles it was 0.15 at most, and
# 0.5 to 1.2 in the last stage of particles on their way to a posterior that was 4 to 54 deviations off.
SETTLED = 0.4
LOST_ONCE = 1.2  # that increase in any stage, of particles that lost the posterior: evidences were then too small by 7
_MOST_STEPS, _BRIDGE_STEPS = 40, 10  # after these stages; up to the first one while the log-density rises
_MOST_STAGES = 200  # of an update


class Particles:
    """Weighted particles of the record so far, from those of the record before, or from the prior (None).
    `log_integral` is that of prior times likelihood within reach; `log_ratios` are predictive densities of the new
    samples with wider noise, over those with the model's; `correlation`, `shift`, `rise` are as in `Stream.update`."""

    def __init__(self, model: ContourModel, old: StreamState | None, count: int, random: np.random.Generator) -> None:
        self.model = model
        self.stages, self.steps, self.evaluations = 0, 0, 0
        self.correlation, self.shift, self.rise = np.nan, 0.0, 0.0
        self._mover = Mover(model, np.random.RandomState(random.integers(2**32)))
        self._generator = random
        self._before: ContourModel | None = None
        self._added: list[str] = []
        if old is None:
            points, share = model.draw_prior(random, count)
            self.points = points[np.arange(count) % len(points)]
            self.log_weights, self.log_integral = np.full(count, -np.log(count)), float(np.log(share))
        else:
            self._before = old.experiment.model
            self._added = [name for name in model.names if name not in self._before.names]
            columns = dict(zip(self._before.names, old.points.T, strict=True))
            columns |= {name: model.priors[name].rvs(count, random_state=random) for name in self._added}
            self.points = np.stack([columns[name] for name in model.names], axis=1)
            self.log_weights, self.log_integral = old.log_weights, old.log_integral
        self._coordinates = model.coordinates
        self._is_continued = _is_continued(self._before, model)
        self.values, wider = self._with_wider_noise(self.points)
        self._old = model.log_prior(self.points) if old is None else old.values + self._log_prior_of_added(self.points)
        expected = logsumexp(self.log_weights[:, None] + wider, axis=0) + self.log_integral
        self._run()
        self.log_ratios = np.asarray(expected - self.log_integral)

    def _with_wider_noise(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the log-density of points, (n,), and that of new samples with wider noise, (n, factors). It is NaN if
        there is a discrepancy, which may couple a sample to later ones."""
        model = self.model
        values, wider = model.log_prior(points), np.full((len(points), len(WIDER)), -np.inf)
        had = 0 if self._before is None else len(self._before.likelihood.measured)
        for which in model.possible(values):
            self.evaluations += which.size
            loads, usable, discrepancy = model.loads_and_discrepancy(points[which])
            scale, score = model.noise_scale(points[which]), model.likelihood.score
            values[which] += score(loads, usable, scale, discrepancy=discrepancy)
            for k, factor in enumerate(WIDER) if discrepancy is None else ():
                wider[which, k] = score(loads, usable, factor * scale, pointwise=True)[:, had:].sum(axis=1)
            if discrepancy is not None:
                wider[which] = np.nan
        return values, wider

    def _both(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the log-density of points with the new samples, and that without them, both with all parameters."""
        model, before = self.model, self._before
        if before is None:
            self.evaluations += len(points)
            return model.log_probability(points), model.log_prior(points)
        own = points[:, [model.names.index(name) for name in before.names]]
        new, old = model.log_prior(points), before.log_prior(own) + self._log_prior_of_added(points)
        for which in model.possible(new):
            self.evaluations += which.size
            felt, usable = model.felt(points[which])
            if self._is_continued:
                part = felt[:, :, : len(before.likelihood.measured)].copy()
                old[which] += before.log_likelihood_of(own[which], part, usable)
            else:
                old[which] += before.log_likelihood(own[which])
            new[which] += model.log_likelihood_of(points[which], felt, usable)
        return new, old

    def _log_prior_of_added(self, points: Floats) -> Floats:
        added = (self.model.priors[name].logpdf(points[:, self.model.names.index(name)]) for name in self._added)
        return np.asarray(sum(added, start=np.zeros(len(points))))

    def _run(self) -> None:
        power = 0.0
        while power < 1.0:
            with np.errstate(invalid="ignore"):
                ratio = self.values - self._old
            ratio[np.isnan(ratio)] = -np.inf
            if not np.any(np.isfinite(ratio)):
                raise InferenceError(
                    "no particle explains the new samples: check them, or begin a stream with more particles"
                )
            target, step = _LEAST_SHARE * len(ratio), 1.0 - power

            def excess(part: float, ratio: Floats = ratio, target: float = target) -> float:
                return float(effective_number(normalised(self.log_weights + part * ratio))) - target

            if not self.stages and excess(step) >= 0.0:
                self._weigh(ratio)
                return
            self.stages += 1
            if excess(step) < 0.0:
                low = 1e-12 * step
                step = brentq(excess, low, step, xtol=1e-14) if excess(low) > 0.0 else max(low, 1e-3 * step)
                if self.stages > _MOST_STAGES:
                    raise InferenceError(
                        f"the new samples took more than {_MOST_STAGES} stages: give more particles, or smaller blocks"
                    )
                power += step
            else:
                power = 1.0
            self._weigh(step * ratio)
            picked = resampled(np.exp(self.log_weights), len(self.log_weights), self._generator)
            self.points, self.values, self._old = self.points[picked], self.values[picked], self._old[picked]
            self.log_weights = np.full(len(picked), -np.log(len(picked)))
            self._move(power)

    def _weigh(self, logs: Floats) -> None:
        weighted = self.log_weights + logs
        total = float(logsumexp(weighted))
        self.log_weights, self.log_integral = weighted - total, self.log_integral + total

    def _move(self, power: float) -> None:
        """Move the particles by the steps of an ensemble, after the last stage until they have decorrelated."""
        coordinates, last = self._coordinates, power == 1.0

        def target(points: Floats) -> Floats:
            if last:
                self.evaluations += len(points)
                return self.model.log_probability(points)
            new, old = self._both(points)
            return _between(new, old, power)

        at = coordinates.of(self.points)
        began = at
        ensemble = at[None]
        _, log_jacobian = coordinates.parameters(at)
        density = (_between(self.values, self._old, power) + log_jacobian)[None]
        transformed = in_coordinates(target, coordinates)
        enough, at_first = DECORRELATED if last else _BRIDGED, density.mean()
        for step in range(_MOST_STEPS):
            ensemble, density = self._mover.step(transformed, ensemble, density)
            self.steps += 1
            self.correlation = _correlation(began, ensemble[0])
            is_enough = self.correlation < enough or (not last and step + 1 >= _BRIDGE_STEPS)
            if step and is_enough and not self._mover.rises:
                break
        self.rise = float((density.mean() - at_first) / max(density.std(), 1e-12))
        self.shift = max(self.shift, self.rise)
        self.points, log_jacobian = coordinates.parameters(ensemble[0])
        if last:
            self.values = density[0] - log_jacobian
        else:
            self.values, self._old = self._both(self.points)


def _is_continued(before: ContourModel | None, model: ContourModel) -> bool:
    """Return True if a record's first samples have their paths as before: the same sides, and no history of a drive."""
    if before is None or model.likelihood.segments.has_history:
        return False
    sides = before.likelihood.segments.signs_of_samples
    return np.array_equal(sides, model.likelihood.segments.signs_of_samples[: len(sides)])


def _between(new: Floats, old: Floats, power: float) -> Floats:
    """Return the log-density between two, −inf where either is."""
    if power == 1.0:
        return new
    with np.errstate(invalid="ignore"):
        values = power * new + (1.0 - power) * old
    return np.where(np.isnan(values), -np.inf, values)


def _correlation(before: Floats, after: Floats) -> float:
    """Return the largest correlation of a column with itself, before and after, in absolute value."""
    one, two = before - before.mean(axis=0), after - after.mean(axis=0)
    norm = np.sqrt((one**2).sum(axis=0) * (two**2).sum(axis=0))
    return float(np.max(np.abs((one * two).sum(axis=0)) / np.where(norm > 0.0, norm, np.inf)))

"""Several independent emcee ensembles, run until R̂ and the effective sample size say that they agree.

The walkers of one ensemble propose from one another and are not independent, so a convergence test across walkers
means nothing. Here a chain is a whole ensemble, several of them run side by side from their own starts and random
numbers, and the diagnostics compare ensembles.

The draws of a chain are laid out walker-major: each walker's history in one piece, one walker after the other. Laid
out step by step, neighbours in the array would be different walkers, and any estimate of autocorrelation would take
the draws for nearly independent.

The proposals are differential evolution (ter Braak 2006, doi 10.1007/s11222-006-8769-1; Nelson et al. 2014,
doi 10.1088/0067-0049/210/1/11): the difference of two other walkers, scaled, and one time in ten unscaled, which lets
a walker jump between separated modes. The snooker proposal of emcee 3.1.6 does not leave the target invariant and is
not used.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import emcee
import numpy as np
from arviz_stats.base.array import array_stats
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.errors import InferenceError, ParameterError

__all__ = ["Draws", "Progress", "SamplerSettings", "Seed", "sample", "scatter_walkers"]

Floats = NDArray[np.float64]
LogProbability = Callable[[Floats], Floats]
Seed = int | np.random.SeedSequence

_GROWTH = 1.25
"""Steps at one diagnosis over steps at the one before: all diagnoses together then cost five times the last."""

_DRAWS_PER_WALKER = 5
"""Effective draws that the mean walker must have given: what is discarded then outlasts five autocorrelation times."""

_TAIL = (0.05, 0.95)
"""Quantiles whose effective sample size is the tail's."""

_CONVERGED = "converged"
_OUT_OF_STEPS = "not converged, the steps allowed ran out"
_OUT_OF_TIME = "not converged, the time allowed ran out"
_INTERRUPTED = "not converged, interrupted"


@dataclass(frozen=True)
class SamplerSettings:
    """How many walkers walk, and when they may stop.

    Parameters
    ----------
    ensembles : int
        Number of independent ensembles, the chains of the result.
    walkers : int, optional
        Number of walkers of each ensemble, even and at least twice the number of parameters. By default the larger of
        32 and six times the number of parameters: the effective draws per evaluation hardly depend on it (Gaussian
        targets of 2 to 14 dimensions, 2 to 12 walkers per dimension), and a vectorised target and emcee itself are
        faster with more of them, but every one of them has to forget its start.
    block_steps : int
        Steps before the first look at the diagnostics, and the least between later ones, which come when the number of
        steps has grown by a quarter.
    max_r_hat : float
        Every parameter's rank-normalised R̂ must be below this (1.01: Vehtari et al. 2021, doi 10.1214/20-BA1221).
    min_ess : float
        Every parameter's effective sample size, in the bulk and in the tails, must reach this.
    max_steps : int
        Steps after which each ensemble stops, converged or not.
    max_seconds : float, optional
        Time after which the ensembles stop [s]. A run that ends by it is not reproducible from its seed.

    Raises
    ------
    ParameterError
        If a value is impossible.

    Examples
    --------
    >>> SamplerSettings(min_ess=400).walkers_for(9)
    54
    """

    ensembles: int = 4
    walkers: int | None = None
    block_steps: int = 50
    max_r_hat: float = 1.01
    min_ess: float = 1000.0
    max_steps: int = 20_000
    max_seconds: float | None = None

    def __post_init__(self) -> None:
        for name in ("ensembles", "walkers", "block_steps", "max_steps"):
            value = getattr(self, name)
            if value is None and name == "walkers":
                continue
            if isinstance(value, bool) or not isinstance(value, int | np.integer):
                raise ParameterError(f"{name} is {value!r}: give a whole number")
        if self.ensembles < 2:
            raise ParameterError(
                f"{self.ensembles} ensembles: give at least 2 (4 is better), since convergence is judged by comparing "
                "independent ensembles; walkers of one ensemble are not independent"
            )
        if self.walkers is not None and (self.walkers < 4 or self.walkers % 2):
            raise ParameterError(f"{self.walkers} walkers: give an even number of at least 4, or None for the default")
        if self.block_steps < 1:
            raise ParameterError(f"block_steps is {self.block_steps}: give at least 1")
        if self.max_steps < 1:
            raise ParameterError(f"max_steps is {self.max_steps}: give at least 1")
        if not self.max_r_hat > 1.0:
            raise ParameterError(f"max_r_hat is {self.max_r_hat!r}: R̂ is 1 at best, give a little more, like 1.01")
        if not (math.isfinite(self.min_ess) and self.min_ess > 0.0):
            raise ParameterError(f"min_ess is {self.min_ess!r}: give a positive number")
        if self.max_seconds is not None and not self.max_seconds > 0.0:
            raise ParameterError(f"max_seconds is {self.max_seconds!r}: give a positive time [s], or None for no limit")

    def walkers_for(self, parameters: int) -> int:
        """Number of walkers of each ensemble for a target of this many parameters."""
        if self.walkers is None:
            return max(32, 6 * parameters)
        _refuse_few_walkers(self.walkers, parameters)
        return self.walkers


@dataclass(frozen=True)
class Progress:
    """Where a run stands after a block of steps."""

    steps: int
    """Steps that each ensemble has made."""
    max_steps: int
    r_hat: float
    """Largest R̂ of all parameters."""
    ess: float
    """Smallest effective sample size of all parameters, bulk or tail."""
    seconds: float
    """Time since the start [s]."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws from a posterior, and how far to trust them."""

    samples: Floats
    """(chain, draw, parameter): a chain is an ensemble, its draws lie walker-major."""
    log_probability: Floats
    """(chain, draw)."""
    names: tuple[str, ...]
    walkers: int
    steps_kept: int
    """Steps of each walker that are in `samples`: the second half of those it made."""
    steps_run: int
    r_hat: Floats
    """Rank-normalised R̂ per parameter across ensembles, each cut in early and late steps: a common drift shows too."""
    ess_bulk: Floats
    """Effective sample size of the bulk, per parameter."""
    ess_tail: Floats
    """The smaller effective sample size of the 5 % and 95 % quantiles, per parameter."""
    acceptance: Floats
    """Share of accepted proposals, per ensemble, over the steps kept."""
    autocorrelation_time: Floats
    """emcee's integrated autocorrelation time [steps] per parameter, mean over ensembles.

    Infinite where a walker is stuck. emcee takes each walker's own mean off, so over few autocorrelation times it
    comes out too small.
    """
    evaluations: int
    """Points at which the log-probability was computed."""
    seconds: float
    converged: bool
    message: str
    """In words, how the run ended."""
    stuck: int
    """Number of walkers that did not move in all the steps kept."""

    def by_walker(self) -> Floats:
        """The samples as (chain, walker, step, parameter)."""
        chains, _, parameters = self.samples.shape
        return self.samples.reshape(chains, self.walkers, self.steps_kept, parameters)


class _Diagnosis:
    """What the second half of a run says about itself."""

    def __init__(self, samples: Floats) -> None:
        """`samples`: (chain, step, walker, parameter)."""
        half = samples.shape[1] // 2
        halves = np.concatenate([samples[:, :half], samples[:, half : 2 * half]])
        self.r_hat = _each(array_stats.rhat, _walker_major(halves), method="rank")
        laid_out = _walker_major(samples)
        self.ess_bulk = _each(array_stats.ess, laid_out, method="bulk")
        self.ess_tail = _each(array_stats.ess, laid_out, method="tail", prob=_TAIL)

    @property
    def worst_r_hat(self) -> int:
        return int(np.argmax(np.where(np.isnan(self.r_hat), np.inf, self.r_hat)))

    @property
    def worst_ess(self) -> int:
        return int(np.argmin(np.nan_to_num(self.ess)))

    @property
    def ess(self) -> Floats:
        return np.minimum(self.ess_bulk, self.ess_tail)

    def satisfies(self, max_r_hat: float, min_ess: float) -> bool:
        return bool(np.all(self.r_hat < max_r_hat) and np.all(self.ess >= min_ess))

    def in_words(self, names: Sequence[str]) -> str:
        i, j = self.worst_r_hat, self.worst_ess
        return (
            f"largest R̂ {self.r_hat[i]:.4f} ({names[i]}), smallest effective sample size {self.ess[j]:.0f} ({names[j]})"
        )


def _each(statistic: Callable[..., Floats], draws: Floats, **options: object) -> Floats:
    """A statistic of ArviZ per parameter of (chain, draw, parameter); NaN where there are too few draws for it."""
    if draws.shape[1] < 8:
        return np.full(draws.shape[-1], np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(statistic(draws, chain_axis=0, draw_axis=1, **options), dtype=float)


def _walker_major(samples: Floats) -> Floats:
    """(chain, step, walker, …) → (chain, walker · step, …)."""
    swapped = np.swapaxes(samples, 1, 2)
    return np.ascontiguousarray(swapped).reshape(swapped.shape[0], -1, *swapped.shape[3:])


class _CheckedTarget:
    """The log-probability with its answer checked and its evaluations counted."""

    def __init__(self, log_probability: LogProbability, names: Sequence[str]) -> None:
        self.log_probability = log_probability
        self.names = names
        self.evaluations = 0

    def __call__(self, points: Floats) -> Floats:
        values = np.asarray(self.log_probability(points), dtype=float)
        if values.shape != points.shape[:1]:
            raise InferenceError(
                f"the log-probability of {points.shape[0]} points came back with shape {values.shape}: it has to take "
                f"an array (n, {len(self.names)}) and return one of shape (n,)"
            )
        self.evaluations += values.size
        wrong = np.isnan(values) | (values == np.inf)
        if np.any(wrong):
            i = int(np.argmax(wrong))
            where = ", ".join(f"{name} = {value!r}" for name, value in zip(self.names, points[i].tolist(), strict=True))
            raise InferenceError(
                f"the log-probability is {values[i]} at {where}: it has to be a number, or −inf where the point is "
                "impossible"
            )
        return values


class _Together:
    """Evaluates what several ensembles ask for at the same time in one call: a vectorised target likes many points.

    Every ensemble runs in a thread of its own and waits here until the others have asked as well; they make the same
    number of requests a step. What an ensemble is answered does not depend on the others.
    """

    def __init__(self, target: LogProbability, ensembles: int) -> None:
        self._target = target
        self._asked: list[Floats] = [np.empty(0)] * ensembles
        self._answers: list[Floats] = []
        self._error: BaseException | None = None
        self._meeting = threading.Barrier(ensembles, action=self._evaluate)

    def target_of(self, ensemble: int) -> LogProbability:
        def ask(points: Floats) -> Floats:
            self._asked[ensemble] = points
            self._meeting.wait()
            if self._error is not None:
                raise self._error
            return self._answers[ensemble]

        return ask

    def _evaluate(self) -> None:
        try:
            values = self._target(np.concatenate(self._asked))
            self._answers = np.split(values, np.cumsum([len(points) for points in self._asked])[:-1])
        except BaseException as error:  # every ensemble raises it, in its own thread
            self._error = error

    def step(self, states: Iterator[Any]) -> Any:
        """The next state of an ensemble; one that fails lets the others go."""
        try:
            return next(states)
        except BaseException:
            self._meeting.abort()
            raise


def _refuse_few_walkers(walkers: int, parameters: int) -> None:
    if walkers < 2 * parameters:
        raise ParameterError(
            f"{walkers} walkers for {parameters} parameters: give at least {2 * parameters}, or the proposals of half "
            "an ensemble do not span the space"
        )


def _spawn(seed: Seed, count: int) -> list[np.random.SeedSequence]:
    """Independent seeds; the same for the same seed, however often it has been asked before."""
    if isinstance(seed, np.random.SeedSequence):
        fresh = np.random.SeedSequence(seed.entropy, spawn_key=seed.spawn_key, pool_size=seed.pool_size)
    elif isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ParameterError(f"seed is {seed!r}: give a whole number from 0 up, or a numpy.random.SeedSequence")
    else:
        fresh = np.random.SeedSequence(int(seed))
    return fresh.spawn(count)


def _ensemble(start: Floats, values: Floats, target: LogProbability, seed: np.random.SeedSequence) -> Iterator[Any]:
    """Endless states of one ensemble."""
    walkers, parameters = start.shape
    moves = [(emcee.moves.DEMove(), 0.9), (emcee.moves.DEMove(gamma0=1.0), 0.1)]
    sampler: Any = emcee.EnsembleSampler(walkers, parameters, target, moves=moves, vectorize=True)
    sampler.log_prob_fn = target  # without emcee's wrapper, which prints when the target raises
    given: Any = np.random.RandomState(np.random.MT19937(seed)).get_state()
    sampler.random_state = given
    taken = sampler.random_state
    if not (taken[0] == given[0] and np.array_equal(taken[1], given[1]) and taken[2:] == given[2:]):
        raise InferenceError("emcee did not take the random state that it was given: use version 3.1.6 or a later 3.1")
    states: Iterator[Any] = sampler.sample(emcee.State(start, log_prob=values), iterations=None, store=False)
    return states


class _Block:
    """Consecutive steps of all ensembles; fewer than planned if time runs out or an interrupt comes."""

    def __init__(
        self,
        pool: ThreadPoolExecutor,
        together: _Together,
        ensembles: Sequence[Iterator[Any]],
        walkers: int,
        parameters: int,
        planned: int,
    ) -> None:
        self._pool = pool
        self._together = together
        self._ensembles = ensembles
        self._samples = np.empty((len(ensembles), planned, walkers, parameters))
        self._values = np.empty((len(ensembles), planned, walkers))
        self.steps = 0

    def run(self, deadline: float) -> str:
        """Make the steps; the answer is empty or says what cut them short."""
        try:
            while self.steps < self._samples.shape[1]:
                waiting = [self._pool.submit(self._together.step, states) for states in self._ensembles]
                failures = [failure for failure in (one.exception() for one in waiting) if failure is not None]
                for failure in sorted(failures, key=lambda f: isinstance(f, threading.BrokenBarrierError)):
                    raise failure
                for k, one in enumerate(waiting):
                    state = one.result()
                    self._samples[k, self.steps], self._values[k, self.steps] = state.coords, state.log_prob
                self.steps += 1
                if time.monotonic() > deadline:
                    return _OUT_OF_TIME
        except KeyboardInterrupt:
            return _INTERRUPTED
        return ""

    @property
    def samples(self) -> Floats:
        return self._samples[:, : self.steps]

    @property
    def values(self) -> Floats:
        return self._values[:, : self.steps]


def _check_start(start: ArrayLike, names: Sequence[str], settings: SamplerSettings) -> Floats:
    points = np.array(start, dtype=float)
    if points.ndim != 3 or points.shape[0] != settings.ensembles or points.shape[2] != len(names):
        raise ParameterError(
            f"start has shape {points.shape}: it has to be (ensembles, walkers, parameters) = "
            f"({settings.ensembles}, walkers, {len(names)})"
        )
    walkers = points.shape[1]
    if settings.walkers is not None and walkers != settings.walkers:
        raise ParameterError(f"start has {walkers} walkers in an ensemble, but the settings ask for {settings.walkers}")
    if walkers % 2:
        raise ParameterError(f"start has {walkers} walkers in an ensemble: give an even number, it moves by halves")
    _refuse_few_walkers(walkers, len(names))
    if not np.all(np.isfinite(points)):
        raise InferenceError(f"{np.count_nonzero(~np.isfinite(points))} numbers of start are not finite")
    for k, ensemble in enumerate(points):
        if not emcee.ensemble.walkers_independent(ensemble):
            raise InferenceError(
                f"the walkers of ensemble {k} start in a plane (or all at one point), which they could never leave: "
                "scatter them in every direction of parameter space"
            )
    return points


def _autocorrelation_time(samples: Floats) -> Floats:
    """emcee's τ [steps] of (chain, step, walker, parameter), averaged over chains."""
    if samples.shape[1] < 2:
        return np.full(samples.shape[-1], np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.array([emcee.autocorr.integrated_time(chain, tol=0) for chain in samples])
    still = np.all(samples == samples[:, :1], axis=1).any(axis=1)  # (chain, parameter)
    return np.where(still, np.inf, times).mean(axis=0)


def sample(
    log_probability: LogProbability,
    start: ArrayLike,
    *,
    names: Sequence[str],
    seed: Seed,
    settings: SamplerSettings | None = None,
    progress: Callable[[Progress], object] | None = None,
) -> Draws:
    """Draw from a posterior with independent ensembles of differential-evolution walkers.

    The ensembles run in step. After `block_steps` steps, and whenever their number has grown by a quarter, the second
    half of the steps so far is judged: rank-normalised R̂ across ensembles, each cut in early and late steps, and
    effective sample size in bulk and tails (Vehtari et al. 2021, doi 10.1214/20-BA1221). The run stops when every
    parameter satisfies the settings, and every walker has on average given five effective draws.

    Parameters
    ----------
    log_probability : callable
        Takes an array (n, parameters), returns (n,): log of the target density up to a constant, −inf outside its
        support.
    start : array_like, shape (ensembles, walkers, parameters)
        Where each walker starts, every point with a finite log-probability. Start wider than the posterior, or R̂
        cannot tell a part of it from the whole; `scatter_walkers` helps.
    names : sequence of str
        Names of the parameters, for messages.
    seed : int or numpy.random.SeedSequence
        The same seed gives the same draws.
    settings : SamplerSettings, optional
    progress : callable, optional
        Is given a `Progress` after each look at the diagnostics.

    Returns
    -------
    Draws
        `converged` says whether the settings were satisfied. A KeyboardInterrupt ends the run, and what has been drawn
        by then is returned, with `converged` false; before the first step it is passed on.

    Raises
    ------
    ParameterError
        If shapes do not fit or there are too few walkers.
    InferenceError
        If walkers start outside the support or in a plane, or the log-probability is NaN or +inf somewhere.

    Examples
    --------
    >>> start = np.random.default_rng(1).normal(size=(4, 32, 1))
    >>> draws = sample(lambda x: -0.5 * x[:, 0] ** 2, start, names=["x"], seed=2)
    >>> draws.converged, draws.samples.shape[0]
    (True, 4)
    """
    began = time.monotonic()
    settings = SamplerSettings() if settings is None else settings
    names = tuple(names)
    if not names or len(set(names)) != len(names):
        raise ParameterError(f"names are {names!r}: give each parameter a name of its own")
    points = _check_start(start, names, settings)
    chains, walkers, parameters = points.shape
    target = _CheckedTarget(log_probability, names)
    values = np.array([target(ensemble) for ensemble in points])
    outside = int(np.count_nonzero(np.isneginf(values)))
    if outside:
        raise InferenceError(
            f"{outside} of {values.size} walkers start where the log-probability is −inf: "
            "start them inside the support, for instance with scatter_walkers"
        )
    together = _Together(target, chains)
    ensembles = [
        _ensemble(place, value, together.target_of(k), own)
        for k, (place, value, own) in enumerate(zip(points, values, _spawn(seed, chains), strict=True))
    ]

    deadline = math.inf if settings.max_seconds is None else began + settings.max_seconds
    enough = max(settings.min_ess, _DRAWS_PER_WALKER * chains * walkers)
    kept, kept_values = np.empty((chains, 0, walkers, parameters)), np.empty((chains, 0, walkers))
    steps, ending = 0, ""
    with ThreadPoolExecutor(chains) as pool:
        while not ending:
            planned = max(settings.block_steps, math.ceil((_GROWTH - 1.0) * steps))
            block = _Block(pool, together, ensembles, walkers, parameters, min(planned, settings.max_steps - steps))
            ending = block.run(deadline)
            dropped = steps - kept.shape[1]
            steps += block.steps
            if not steps:
                raise KeyboardInterrupt
            later_half = slice(steps // 2 - dropped, None)
            kept = np.concatenate([kept, block.samples], axis=1)[:, later_half]
            kept_values = np.concatenate([kept_values, block.values], axis=1)[:, later_half]
            try:
                diagnosis = _Diagnosis(kept)
            except KeyboardInterrupt:
                ending, diagnosis = _INTERRUPTED, _Diagnosis(kept)
            if ending != _INTERRUPTED and diagnosis.satisfies(settings.max_r_hat, enough):
                ending = _CONVERGED
            elif not ending and steps == settings.max_steps:
                ending = _OUT_OF_STEPS
            if progress is not None:
                worst = float(diagnosis.r_hat[diagnosis.worst_r_hat]), float(diagnosis.ess[diagnosis.worst_ess])
                try:
                    progress(Progress(steps, settings.max_steps, *worst, time.monotonic() - began))
                except KeyboardInterrupt:
                    ending = ending or _INTERRUPTED

    moved = np.any(kept[:, 1:] != kept[:, :-1], axis=-1)  # (chain, step, walker)
    stuck = int(np.count_nonzero(~moved.any(axis=1))) if moved.size else 0
    message = f"{ending} after {steps} steps: {diagnosis.in_words(names)}"
    if ending != _CONVERGED:
        message += f"; wanted are R̂ below {settings.max_r_hat:g} and an effective sample size of {enough:.0f}"
    if stuck:
        message += f"; {stuck} of {chains * walkers} walkers did not move in the steps kept: look where they sit"
    return Draws(
        samples=_walker_major(kept),
        log_probability=_walker_major(kept_values),
        names=names,
        walkers=walkers,
        steps_kept=kept.shape[1],
        steps_run=steps,
        r_hat=diagnosis.r_hat,
        ess_bulk=diagnosis.ess_bulk,
        ess_tail=diagnosis.ess_tail,
        acceptance=moved.mean(axis=(1, 2)) if moved.size else np.full(chains, np.nan),
        autocorrelation_time=_autocorrelation_time(kept),
        evaluations=target.evaluations,
        seconds=time.monotonic() - began,
        converged=ending == _CONVERGED,
        message=message,
        stuck=stuck,
    )


def scatter_walkers(
    log_probability: LogProbability,
    draw: Callable[[np.random.Generator, int], Floats],
    *,
    parameters: int,
    seed: Seed,
    settings: SamplerSettings | None = None,
    max_rounds: int = 100,
) -> Floats:
    """Starting points for `sample`: random points, redrawn until each has a finite log-probability.

    Parameters
    ----------
    log_probability : callable
        The target, as `sample` takes it.
    draw : callable
        Takes a random generator and n, returns n points (n, parameters), scattered more widely than the posterior:
        draws from the prior, or from a widened normal approximation.
    parameters : int
        Number of parameters.
    seed : int or numpy.random.SeedSequence
        Each ensemble draws from its own stream.
    settings : SamplerSettings, optional
        Says how many ensembles of how many walkers.
    max_rounds : int
        Points that are drawn at most for each walker, on average.

    Returns
    -------
    ndarray, shape (ensembles, walkers, parameters)

    Raises
    ------
    InferenceError
        If too few points lie inside the support.

    Examples
    --------
    >>> def log_probability(x):
    ...     return np.where(x[:, 0] > 0, -x[:, 0], -np.inf)
    >>> start = scatter_walkers(log_probability, lambda rng, n: rng.normal(size=(n, 1)), parameters=1, seed=1)
    >>> start.shape, bool(np.all(start > 0))
    ((4, 32, 1), True)
    """
    settings = SamplerSettings() if settings is None else settings
    walkers = settings.walkers_for(parameters)
    # A step aside, so that the streams differ from those that the same seed gives to the ensembles themselves.
    seeds = _spawn(seed, 2 * settings.ensembles)[settings.ensembles :]
    start = np.empty((settings.ensembles, walkers, parameters))
    for k, each in enumerate(seeds):
        rng = np.random.default_rng(each)
        found, drawn = 0, 0
        while found < walkers:
            if drawn >= max_rounds * walkers:
                raise InferenceError(
                    f"only {found} of {drawn} random starting points have a finite log-probability and {walkers} are "
                    "needed: draw them closer to a point that is known to be possible"
                )
            points = np.asarray(draw(rng, walkers), dtype=float)
            points = points[np.isfinite(log_probability(points))][: walkers - found]
            start[k, found : found + len(points)] = points
            found, drawn = found + len(points), drawn + walkers
    return start

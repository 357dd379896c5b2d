"""The run: blocks of steps of all ensembles until they agree, or the budget is spent."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.ensembles.diagnosis import Diagnosis, autocorrelation_time, lost_walkers, walker_major
from tactile_bayes.inference.ensembles.draws import Draws
from tactile_bayes.inference.ensembles.settings import SamplerSettings
from tactile_bayes.inference.ensembles.target import CheckedTarget, LogProbability, Together
from tactile_bayes.inference.ensembles.walkers import Seed, checked_start, spawn, walking_ensemble

__all__ = ["Progress", "sample"]


Floats = NDArray[np.float64]

_GROWTH = 1.25
"""Steps at one diagnosis over steps at the one before: all diagnoses together then cost five times the last."""

_DRAWS_PER_WALKER = 5
"""Effective draws that the mean walker must have given: what is discarded then outlasts five autocorrelation times."""

_CONVERGED = "converged"

_OUT_OF_STEPS = "not converged, the steps allowed ran out"

_OUT_OF_TIME = "not converged, the time allowed ran out"

_INTERRUPTED = "not converged, interrupted"


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


class _Block:
    """Consecutive steps of all ensembles; fewer than planned if time runs out or an interrupt comes."""

    def __init__(
        self,
        pool: ThreadPoolExecutor,
        together: Together,
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
            self._together.abort()  # an ensemble may wait for others that were never asked to step
            return _INTERRUPTED
        return ""

    @property
    def samples(self) -> Floats:
        return self._samples[:, : self.steps]

    @property
    def values(self) -> Floats:
        return self._values[:, : self.steps]


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
    parameter satisfies the settings, every walker has on average given five effective draws, and none is lost where
    nothing is probable.

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
    points = checked_start(start, names, settings)
    chains, walkers, parameters = points.shape
    target = CheckedTarget(log_probability, names)
    values = np.array([target(ensemble) for ensemble in points])
    outside = int(np.count_nonzero(np.isneginf(values)))
    if outside:
        raise InferenceError(
            f"{outside} of {values.size} walkers start where the log-probability is −inf: "
            "start them inside the support, for instance with scatter_walkers"
        )
    together = Together(target, chains)
    ensembles = [
        walking_ensemble(place, value, together.target_of(k), own)
        for k, (place, value, own) in enumerate(zip(points, values, spawn(seed, chains), strict=True))
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
                diagnosis = Diagnosis(kept)
            except KeyboardInterrupt:
                ending, diagnosis = _INTERRUPTED, Diagnosis(kept)
            lost = lost_walkers(kept_values)
            if ending != _INTERRUPTED and not lost and diagnosis.satisfies(settings.max_r_hat, enough):
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
    if lost:
        message += (
            f"; {lost} of {chains * walkers} walkers are lost where nothing is probable: results are not to be used"
        )
    if stuck:
        message += f"; {stuck} of {chains * walkers} walkers did not move in the steps kept: look where they sit"
    return Draws(
        samples=walker_major(kept),
        log_probability=walker_major(kept_values),
        names=names,
        walkers=walkers,
        steps_kept=kept.shape[1],
        steps_run=steps,
        r_hat=diagnosis.r_hat,
        ess_bulk=diagnosis.ess_bulk,
        ess_tail=diagnosis.ess_tail,
        acceptance=moved.mean(axis=(1, 2)) if moved.size else np.full(chains, np.nan),
        autocorrelation_time=autocorrelation_time(kept),
        evaluations=target.evaluations,
        seconds=time.monotonic() - began,
        converged=ending == _CONVERGED,
        message=message,
        stuck=stuck,
    )

"""The run: blocks of steps of all ensembles until they agree, or the budget is spent, and its draws."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.inference.coordinates import Coordinates, in_coordinates
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import LogProbability
from tactile_bayes.inference.ensembles.checkpoint import Checkpoint, identity_of_run, open_checkpoint
from tactile_bayes.inference.ensembles.diagnosis import (
    Diagnosis,
    Mode,
    autocorrelation_time,
    modes_message,
    modes_of,
    walker_major,
)
from tactile_bayes.inference.ensembles.moves import moves_in
from tactile_bayes.inference.ensembles.run_state import Block, RunState, make_block, next_diagnosis
from tactile_bayes.inference.ensembles.settings import SamplerSettings
from tactile_bayes.inference.ensembles.walkers import CheckedTarget, first_random_state
from tactile_bayes.numerics.random_numbers import Seed, spawn
from tactile_bayes.numerics.selection import evenly_spread


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws from a posterior, with their convergence diagnostics."""

    samples: Floats  # shape (chain, draw, parameter): a chain is an ensemble, with its draws walker-major
    log_probability: Floats  # shape (chain, draw)
    names: tuple[str, ...]
    walkers: int
    steps_kept: int  # number of steps of each walker in `samples`: every `every`-th of the second half of its steps
    steps_run: int
    r_hat: Floats  # rank-normalised, across ensembles, each split in early and late steps to detect drift
    ess_bulk: Floats  # effective sample size of the bulk, per parameter
    ess_tail: Floats  # the smaller effective sample size of the 5 % and 95 % quantiles, per parameter
    acceptance: Floats  # share of accepted proposals, per ensemble, over the steps kept
    # emcee's integrated autocorrelation time [steps] per parameter, mean over ensembles. It is infinite if a walker is
    # stuck. emcee subtracts each walker's own mean, so that the estimate is too small over few autocorrelation times.
    autocorrelation_time: Floats
    evaluations: int  # points at which the log-probability was computed, in earlier calls with a checkpoint too
    seconds: float  # sampling time [s], including the steps of earlier calls with a checkpoint
    converged: bool
    message: str  # reason for the end of the run, with the worst diagnostics
    stuck: int  # number of walkers that did not move in all the steps kept
    modes: tuple[Mode, ...] = ()  # modes of the ensembles, if each ensemble is stationary but they disagree; else empty
    every: int = 1  # thinning: 1, or a power of two if the second half of the steps would take too much memory

    def refuse_interrupted(self, what: str) -> None:
        """Raise the interrupt that ended the run, for callers that cannot use a part of it."""
        if "interrupted" in self.message:
            raise KeyboardInterrupt(f"interrupted while sampling {what}: there is no result")

    def evenly(self, most: int) -> Index:
        """Return the indices of at most so many draws of each chain, evenly spread."""
        return evenly_spread(self.samples.shape[1], most)


_PER_WALKER = 3  # effective draws, at least: the half that is left out exceeds as many autocorrelation times
_ADAPTED = 100  # steps up to which coordinates are fitted to those kept at each diagnosis
_TELLING = 25  # steps from which a walker that made none is stuck: some move rarely, also by chance
_CONVERGED = "converged"
_OUT_OF_STEPS = "not converged, the steps allowed ran out"
_OUT_OF_TIME = "not converged, the time allowed ran out"
_INTERRUPTED = "not converged, interrupted"


@dataclass(frozen=True)
class Progress:
    """State of a run at a diagnosis."""

    steps: int  # number of steps that each ensemble has made
    max_steps: int
    r_hat: float  # largest R̂ of all parameters
    ess: float  # smallest effective sample size of all parameters, bulk or tail
    seconds: float  # time since the start [s], including the steps of earlier calls with a checkpoint


def sample(
    log_probability: LogProbability,
    start: ArrayLike,
    *,
    names: Sequence[str],
    seed: Seed,
    settings: SamplerSettings | None = None,
    progress: Callable[[Progress], object] | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    identity: Mapping[str, str] | None = None,
    coordinates: Coordinates | None = None,
) -> Draws:
    """Draw from a posterior with independent ensembles of walkers, which propose from one another, until they agree.

    `start`, (ensembles, walkers, parameters), in the coordinates, should be wider than the posterior, or R̂ cannot
    distinguish a part of it from the whole. The second half of the steps, or those since a lost walker was taken back,
    is diagnosed after `block_steps`, and whenever their number has grown by a quarter (Vehtari et al. 2021, doi
    10.1214/20-BA1221): the run stops when settings are satisfied, with three effective draws per walker on average, and
    no walker lost. A KeyboardInterrupt after the first step ends it. With a checkpoint a run resumes, bit by bit;
    `identity` states what determines the log-probability.
    """
    began = time.monotonic()
    settings = SamplerSettings() if settings is None else settings
    names, points = tuple(names), np.array(start, dtype=float)
    with ExitStack() as stack:
        stored = None
        if checkpoint is not None:
            about = identity_of_run(identity, points, names, seed, settings)
            stored = stack.enter_context(open_checkpoint(checkpoint, about))
        target = CheckedTarget(log_probability, names)
        run = _Run(target, coordinates or Coordinates(), settings, stored, progress, began)
        run.begin(points, seed)
        while not run.ending or run.diagnosis is None:
            try:
                run.advance()
                run.diagnose()
            except KeyboardInterrupt:
                if not run.steps:
                    raise
                run.ending = run.ending or _INTERRUPTED
        return run.draws()


@dataclass
class _Run:
    """A run of ensembles: where it is, when it is diagnosed next, and why it has ended."""

    target: CheckedTarget
    coordinates: Coordinates
    settings: SamplerSettings
    stored: Checkpoint | None
    progress: Callable[[Progress], object] | None
    began: float
    state: RunState = field(init=False)
    diagnosis: Diagnosis | None = None  # of the state as it is
    ending: str = ""
    is_late: bool = False
    due: int = 0  # number of steps of the next diagnosis

    def __post_init__(self) -> None:
        limit = self.settings.max_seconds
        self.deadline = NEVER if limit is None else Deadline(self.began + limit)

    @property
    def steps(self) -> int:
        return self.state.steps

    @property
    def enough(self) -> float:
        """Effective sample size that is enough."""
        return max(self.settings.min_ess, _PER_WALKER * self.state.last.log_probability[:, 0].size)

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.began

    def begin(self, points: Floats, seed: Seed) -> None:
        """Begin at starting points, or at the stored state."""
        stored, ended_at = self.stored, 0
        if stored is not None and stored.exists:
            self.state = stored.read(self.coordinates, points.shape)
            self.began -= stored.seconds
            self.target.evaluations = points[..., 0].size * (1 + self.steps)
            ended_at = self.steps if stored.is_end else 0
        else:
            density = in_coordinates(self.target, self.coordinates)
            values = np.array([density(ensemble) for ensemble in points])
            randoms = tuple(first_random_state(own) for own in spawn(seed, len(points)))
            self.state = RunState.begin(self.coordinates, Block(points[:, None], values[:, None], randoms))
        # A run that was killed before a diagnosis is diagnosed where it is.
        self.due = ended_at or next_diagnosis(self.steps - 1, self.settings.block_steps)

    def advance(self) -> None:
        """Make the steps up to the next diagnosis, block by block."""
        self.due = min(self.due, self.settings.most_steps)
        while self.steps < self.due and not (self.is_late or self.ending):
            steps = min(self.settings.block_steps, self.due - self.steps)
            coordinates = self.state.coordinates
            density = in_coordinates(self.target, coordinates)
            block = make_block(density, moves_in(coordinates), self.state.last, steps, self.deadline)
            self.diagnosis = None
            self.state = self.state.append(block)
            if not block.whole:
                raise KeyboardInterrupt
            if self.stored is not None:
                self.stored.write(self.state, self.seconds)
            self.is_late = self.deadline.has_passed

    def diagnose(self) -> None:
        """Diagnose the steps that are kept, and say whether the run ends, or when it is diagnosed next."""
        settings = self.settings
        self.state = self.state.halved()
        self.diagnosis = found = Diagnosis(self.state.half.samples)
        if not self.ending:
            satisfied = found.satisfies(settings.max_r_hat, self.enough)
            spent = _OUT_OF_TIME if self.is_late else _OUT_OF_STEPS if self.steps >= settings.most_steps else ""
            self.ending = _CONVERGED if satisfied and not np.any(self.state.were_lost()) else spent
        if self.stored is not None and self.ending not in ("", _INTERRUPTED):
            self.stored.write(self.state, self.seconds, is_end=True)
        if self.progress is not None:
            worst = float(found.r_hat[found.worst_r_hat]), float(found.ess[found.worst_ess])
            self.progress(Progress(self.steps, settings.most_steps, *worst, self.seconds))
        if not self.ending and self.steps == next_diagnosis(self.steps - 1, settings.block_steps):
            self.state = self.state.recovered()
            if self.steps <= max(_ADAPTED, settings.block_steps):
                self.state = self.state.adapted()
        self.due = next_diagnosis(self.steps, settings.block_steps)

    def draws(self) -> Draws:
        """Return the steps kept of a run that has ended, with the message on its end."""
        state, found, settings, names = self.state, self.diagnosis, self.settings, tuple(self.target.names)
        assert found is not None
        chains, _, walkers, _ = state.last.samples.shape
        converged, half = self.ending == _CONVERGED, state.half
        moved = half.moved[:, 1:]  # not in the first step of those kept, before which nothing is known
        stuck = int(np.count_nonzero(~moved.any(axis=1))) if moved.size else 0
        acceptance = moved.mean(axis=(1, 2)) if moved.size else np.full(chains, np.nan)
        by_chance = chains * walkers * (1.0 - acceptance.mean()) ** moved.shape[1]
        lost = int(np.count_nonzero(state.were_lost()))
        modes = () if converged else modes_of(half.samples, half.values, names)
        message = f"{self.ending} after {state.steps} step{'' if state.steps == 1 else 's'}: {found.message(names)}"
        if not converged:
            message += f"; criteria: R̂ below {settings.max_r_hat:g} and an effective sample size of {self.enough:.0f}"
        if modes:
            message += f"; {modes_message(modes)}"
        of_walkers = f"of {chains * walkers} walkers"
        if lost:
            message += f"; {lost} {of_walkers} were where the posterior is improbable: do not use the results"
        if stuck > by_chance + 3.0 * np.sqrt(by_chance) and moved.shape[1] >= _TELLING:
            message += f"; {stuck} {of_walkers} did not move in the steps kept: look at their positions"
        return Draws(
            samples=walker_major(half.samples),
            log_probability=walker_major(half.values),
            names=names,
            walkers=walkers,
            steps_kept=half.samples.shape[1],
            every=state.every,
            steps_run=state.steps,
            r_hat=found.r_hat,
            ess_bulk=found.ess_bulk,
            ess_tail=found.ess_tail,
            acceptance=acceptance,
            autocorrelation_time=state.every * autocorrelation_time(half.samples),
            evaluations=self.target.evaluations,
            seconds=self.seconds,
            converged=converged,
            message=message,
            stuck=stuck,
            modes=modes,
        )

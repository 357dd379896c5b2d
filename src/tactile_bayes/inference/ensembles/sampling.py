"""The run: blocks of steps of all ensembles until they agree, or the budget is spent."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.coordinates.base import Coordinates, in_coordinates
from tactile_bayes.inference.densities import LogProbability
from tactile_bayes.inference.ensembles.block import Block, make_block, next_diagnosis
from tactile_bayes.inference.ensembles.checkpoint import Checkpoint, open_checkpoint
from tactile_bayes.inference.ensembles.diagnosis import Diagnosis, autocorrelation_time, lost_walkers, walker_major
from tactile_bayes.inference.ensembles.draws import Draws
from tactile_bayes.inference.ensembles.identity import identity_of_run
from tactile_bayes.inference.ensembles.modes import modes_message, modes_of
from tactile_bayes.inference.ensembles.moves import moves_in
from tactile_bayes.inference.ensembles.run_state import RunState
from tactile_bayes.inference.ensembles.settings import SamplerSettings
from tactile_bayes.inference.ensembles.walkers import CheckedTarget, checked_start, first_random_state
from tactile_bayes.numerics.random_numbers import Seed, spawn

__all__ = ["Progress", "sample"]


# Smallest mean number of effective draws per walker: the discarded half then exceeds five autocorrelation times.
_DRAWS_PER_WALKER = 5
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
    """Draw from a posterior with independent ensembles of walkers, which propose from one another.

    The ensembles run in step. After `block_steps` steps, and whenever their number has grown by a quarter, the second
    half of the steps so far is diagnosed: rank-normalised R̂ across ensembles, each split in early and late steps, and
    effective sample size in bulk and tails (Vehtari et al. 2021, doi 10.1214/20-BA1221). The run stops when every
    parameter satisfies the settings, the walkers have given five effective draws each on average, and none is lost
    where nothing is probable. A few that are lost are taken back to where others of their ensemble were. `start`,
    (ensembles, walkers, parameters), is in the coordinates; it should be wider than the posterior, or R̂ cannot
    distinguish a part of it from the whole.

    A KeyboardInterrupt after the first step ends the run with the draws so far. A run with a checkpoint may be killed
    at any moment: called again it resumes after the last finished block, and its draws are, bit by bit, those of an
    uninterrupted run; one that has ended is not made again. `identity` states what determines the log-probability. Of
    the settings, `max_steps`, `max_seconds`, `min_ess` and `max_r_hat` may change from call to call.
    """
    began = time.monotonic()
    settings = SamplerSettings() if settings is None else settings
    names = tuple(names)
    if not names or len(set(names)) != len(names):
        raise ParameterError(f"names are {names!r}: give each parameter a name of its own")
    points = checked_start(start, names, settings)
    chains, walkers, _ = points.shape
    target = CheckedTarget(log_probability, names)
    coordinates = coordinates or Coordinates()
    density = in_coordinates(target, coordinates)
    settings = replace(settings, min_ess=max(settings.min_ess, _DRAWS_PER_WALKER * chains * walkers))
    deadline = math.inf if settings.max_seconds is None else began + settings.max_seconds
    due, stored = 0, None
    with ExitStack() as stack:
        if checkpoint is not None:
            about = identity_of_run(identity, points, names, seed, settings, coordinates)
            stored = stack.enter_context(open_checkpoint(checkpoint, about, points.shape))
        if stored is not None and stored.steps:
            state = _resumed(stored, coordinates, points)
            began, target.evaluations = began - stored.seconds, chains * walkers * (1 + state.steps)
            due = state.steps if stored.ended_at == state.steps else 0
        else:
            state = RunState.begin(coordinates, _first_block(points, density, seed))
        due = due or next_diagnosis(state.steps - 1, settings.block_steps)  # also if it was killed before a diagnosis

        ending, late, diagnosis = "", False, None
        while not ending or diagnosis is None:
            try:
                due = min(due, settings.max_steps)
                while state.steps < due and not (late or ending):
                    steps = min(settings.block_steps, due - state.steps)
                    block = make_block(density, moves_in(coordinates), state.last, steps, deadline)
                    diagnosis = None
                    state = state.append(block)
                    if not block.whole:
                        raise KeyboardInterrupt
                    if stored is not None:
                        stored.write(block, time.monotonic() - began)
                    late = time.monotonic() > deadline
                state, diagnosis = state.diagnose()
                if not ending:
                    enough = diagnosis.satisfies(settings.max_r_hat, settings.min_ess)
                    spent = _OUT_OF_TIME if late else _OUT_OF_STEPS if state.steps >= settings.max_steps else ""
                    ending = _CONVERGED if enough and not np.any(state.lost()) else spent
                if stored is not None and ending not in ("", _INTERRUPTED):
                    stored.note_end()
                if progress is not None:
                    worst = float(diagnosis.r_hat[diagnosis.worst_r_hat]), float(diagnosis.ess[diagnosis.worst_ess])
                    progress(Progress(state.steps, settings.max_steps, *worst, time.monotonic() - began))
                if state.steps == next_diagnosis(state.steps - 1, settings.block_steps):  # not where a budget ended
                    state = state.recovered()
                due = next_diagnosis(state.steps, settings.block_steps)
            except KeyboardInterrupt:
                if not state.steps:
                    raise
                ending = ending or _INTERRUPTED

    return _draws(state, diagnosis, ending, names, settings, target.evaluations, time.monotonic() - began)


def _first_block(points: Floats, density: LogProbability, seed: Seed) -> Block:
    """Return the starting points as a block of one step."""
    values = np.array([density(ensemble) for ensemble in points])
    outside = int(np.count_nonzero(np.isneginf(values)))
    if outside:
        raise InferenceError(
            f"{outside} of {values.size} walkers start where the log-probability is −inf: "
            "start them inside the support, for instance with scatter_walkers"
        )
    randoms = tuple(first_random_state(own) for own in spawn(seed, len(points)))
    return Block(points[:, None], values[:, None], randoms)


def _resumed(stored: Checkpoint, coordinates: Coordinates, points: Floats) -> RunState:
    """Return the state after the last stored block; the steps before its second half are not read."""
    unknown = Block(points[:, None], np.full(points.shape[:2], np.nan)[:, None], ())
    state = RunState.begin(coordinates, unknown, stored.steps // 2, stored.steps)
    for block in stored.read(since=stored.steps // 2):
        state = state.append(block)
    return state


def _draws(
    state: RunState,
    diagnosis: Diagnosis,
    ending: str,
    names: tuple[str, ...],
    settings: SamplerSettings,
    evaluations: int,
    seconds: float,
) -> Draws:
    """Return the second half of a run that has ended, with the message on its end."""
    chains, _, walkers, _ = state.last.samples.shape
    converged, half, moved = ending == _CONVERGED, state.half, state.moved
    stuck = int(np.count_nonzero(~moved.any(axis=1))) if moved.size else 0
    lost = int(np.count_nonzero(lost_walkers(half.values)))
    modes = () if converged else modes_of(half.samples, half.values, names)
    message = f"{ending} after {state.steps} step{'' if state.steps == 1 else 's'}: {diagnosis.message(names)}"
    if not converged:
        message += f"; criteria: R̂ below {settings.max_r_hat:g} and an effective sample size of {settings.min_ess:.0f}"
    if modes:
        message += f"; {modes_message(modes)}"
    if lost:
        message += f"; {lost} of {chains * walkers} walkers are lost in improbable regions: do not use the results"
    if stuck:
        message += f"; {stuck} of {chains * walkers} walkers did not move in the steps kept: look at their positions"
    return Draws(
        samples=walker_major(half.samples),
        log_probability=walker_major(half.values),
        names=names,
        walkers=walkers,
        steps_kept=half.samples.shape[1],
        every=state.every,
        steps_run=state.steps,
        r_hat=diagnosis.r_hat,
        ess_bulk=diagnosis.ess_bulk,
        ess_tail=diagnosis.ess_tail,
        acceptance=moved.mean(axis=(1, 2)) if moved.size else np.full(chains, np.nan),
        autocorrelation_time=state.every * autocorrelation_time(half.samples),
        evaluations=evaluations,
        seconds=seconds,
        converged=converged,
        message=message,
        stuck=stuck,
        modes=modes,
    )

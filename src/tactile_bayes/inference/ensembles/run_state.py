"""The state of a run: its last block of steps, from which it continues, and the second half of its steps."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.inference.coordinates import Coordinates
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import LogProbability
from tactile_bayes.inference.ensembles.diagnosis import lost_walkers
from tactile_bayes.inference.ensembles.moves import Moves, step_ensembles
from tactile_bayes.inference.ensembles.walkers import RandomState, generator_at

_GROWTH = 1.25  # ratio of the steps at two successive diagnoses: all diagnoses together then cost five times the last


@dataclass(frozen=True, eq=False)
class Block:
    """Consecutive steps of all ensembles, and the random states with which they continue."""

    samples: Floats  # shape (chain, step, walker, coordinate)
    log_probability: Floats  # shape (chain, step, walker)
    random_states: tuple[RandomState, ...]  # after the last step, with whose samples they determine the next step
    whole: bool = True  # false if an interrupt ended the block; the ensembles then do not continue

    @property
    def steps(self) -> int:
        return self.samples.shape[1]


def make_block(target: LogProbability, moves: Moves, last: Block, steps: int, deadline: Deadline = NEVER) -> Block:
    """Make the steps after a block, which its last one determines: at least one, fewer after deadline or interrupt."""
    points, values = last.samples[:, -1], last.log_probability[:, -1]
    randoms = [generator_at(state) for state in last.random_states]
    states = last.random_states
    samples, log_probability = (np.empty((len(a), steps, *a.shape[1:])) for a in (points, values))
    made, whole = 0, True
    try:
        while made < steps and not (made and deadline.has_passed):
            points, values = step_ensembles(target, moves, randoms, points, values)
            samples[:, made], log_probability[:, made] = points, values
            states = tuple(tuple(random.get_state()) for random in randoms)
            made += 1
    except KeyboardInterrupt:
        whole = False
    return Block(samples[:, :made], log_probability[:, :made], states, whole)


def next_diagnosis(steps: int, block_steps: int) -> int:
    """Return the number of steps at which a run that has made `steps` is diagnosed next."""
    due = block_steps
    while due <= steps:
        due += math.ceil((_GROWTH - 1.0) * due)
    return due


_MAX_STORED = 4_000_000  # numbers of all ensembles, beyond which steps are thinned: 32 MB, 6 s for a diagnosis
_MAX_LOST = 0.1  # largest share of the walkers of an ensemble that are taken back


class StoredSteps(NamedTuple):
    """Consecutive steps, some of them stored."""

    numbers: Index  # numbers of the stored steps, counted from 1
    samples: Floats  # parameters after the stored steps, shape (chain, step, walker, parameter)
    values: Floats  # their log-probability, shape (chain, step, walker)
    moved: Flags  # True if a walker moved in a step, for all steps, shape (chain, step, walker)


@dataclass(frozen=True, eq=False)
class RunState:
    """State of a run: its last step, from which it continues, and the second half of its steps."""

    coordinates: Coordinates  # in which the parameters are sampled
    last: Block  # last block, whose last step determines the next one
    steps: int  # number of steps of each ensemble
    parts: tuple[StoredSteps, ...]  # the second half of the steps at least, in order
    taken_back: Index  # number of the step after which a walker was last taken back, 0 if never, (chain, walker)

    @classmethod
    def begin(cls, coordinates: Coordinates, start: Block) -> RunState:
        """Return the state of a run before its first step."""
        samples, values = start.samples[:, :0], start.log_probability[:, :0]
        empty = StoredSteps(np.empty(0, dtype=np.intp), samples, values, np.empty(values.shape, dtype=bool))
        return cls(coordinates, start, 0, (empty,), np.zeros_like(start.log_probability[:, 0], dtype=np.intp))

    @property
    def every(self) -> int:
        """Thinning: a power of two that follows from the number of steps and the shape alone."""
        every, half = 1, self.steps - self.steps // 2
        while half // every * self.last.samples[:, 0].size > _MAX_STORED:
            every *= 2
        return every

    def append(self, block: Block) -> RunState:
        """Return the state after another block."""
        if not block.steps:
            return self
        after = replace(self, last=block, steps=self.steps + block.steps)
        numbers = np.arange(self.steps, after.steps) + 1
        stored = numbers % after.every == 0
        before = np.concatenate([self.last.samples[:, -1:], block.samples[:, :-1]], axis=1)
        moved = np.any(block.samples != before, axis=-1)
        samples = block.samples[:, stored]
        points, log_jacobian = self.coordinates.parameters(samples.reshape(-1, samples.shape[-1]))
        values = block.log_probability[:, stored] - log_jacobian.reshape(samples.shape[:-1])
        part = StoredSteps(numbers[stored], points.reshape(samples.shape), values, moved)
        return replace(after, parts=(*self.parts, part))

    @property
    def kept(self) -> int:
        """Number of steps that are kept: the second half, less those before a walker was last taken back, if any."""
        since = self.steps - int(self.taken_back.max(initial=0))
        return min(self.steps - self.steps // 2, since if since >= self.every else self.steps)

    def halved(self) -> RunState:
        """Return the state with the steps that are kept as the only part."""
        numbers, *columns = zip(*self.parts, strict=True)
        number = np.concatenate(numbers)
        samples, values, moved = (np.concatenate(column, axis=1) for column in columns)
        kept = (number > self.steps - self.kept) & (number % self.every == 0)
        moved = moved[:, moved.shape[1] - self.kept :]
        return replace(self, parts=(StoredSteps(number[kept], samples[:, kept], values[:, kept], moved),))

    @property
    def half(self) -> StoredSteps:
        """The steps that are kept, of a state from `halved`."""
        (half,) = self.parts
        return half

    def lost(self) -> Flags:
        """Return True for walkers that are lost in the later half of the steps kept, (chain, walker)."""
        return lost_walkers(self.half.values[:, self.half.values.shape[1] // 2 :])

    def were_lost(self) -> Flags:
        """Return True for walkers with steps kept in which they were lost, (chain, walker)."""
        earlier = lost_walkers(self.half.values[:, : self.half.values.shape[1] // 2])
        return earlier | self.lost() | (self.taken_back > self.steps - self.kept)

    def adapted(self) -> RunState:
        """Return the state in coordinates that are fitted to the steps kept of walkers that are not lost."""
        if not self.coordinates.fitted:
            return self
        last, before, kept = self.last, self.coordinates, np.moveaxis(self.half.samples, 1, 2)[~self.lost()]
        coordinates = before.adapted(before.of(kept.reshape(-1, kept.shape[-1])).reshape(kept.shape))
        points, growth = before.parameters(last.samples[:, -1].reshape(-1, kept.shape[-1]))
        there = coordinates.of(points)
        if not np.isfinite(there).all():
            return self
        changed = (coordinates.parameters(there)[1] - growth).reshape(last.samples[:, 0].shape[:2])
        there, values = there.reshape(last.samples[:, :1].shape), last.log_probability[:, -1:] + changed[:, None]
        return replace(self, coordinates=coordinates, last=replace(last, samples=there, log_probability=values))

    def recovered(self) -> RunState:
        """Return the state with few lost walkers taken back to where others were; many that are lost may be a mode."""
        lost = self.lost()
        few = lost & (lost.mean(axis=1, keepdims=True) <= _MAX_LOST)
        if not few.any():
            return self
        last = replace(self.last, samples=self.last.samples.copy(), log_probability=self.last.log_probability.copy())
        for chain in np.flatnonzero(few.any(axis=1)):
            missing = np.flatnonzero(few[chain])
            others = np.flatnonzero(~lost[chain])[: missing.size]
            there = self.coordinates.of(self.half.samples[chain, 0, others])
            values = self.half.values[chain, 0, others] + self.coordinates.parameters(there)[1]
            last.samples[chain, -1, missing], last.log_probability[chain, -1, missing] = there, values
        return replace(self, last=last, taken_back=np.where(few, self.steps, self.taken_back))

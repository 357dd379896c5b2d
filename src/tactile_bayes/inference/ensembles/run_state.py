"""The state of a run: its last step, from which it continues, and the second half of its steps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.inference.coordinates.base import Coordinates
from tactile_bayes.inference.ensembles.block import Block
from tactile_bayes.inference.ensembles.diagnosis import Diagnosis, lost_walkers

__all__ = ["RunState", "StoredSteps"]


# Largest count of stored numbers of all ensembles, beyond which steps are thinned: 32 MB, and 6 s for a diagnosis.
_MAX_STORED = 4_000_000
_MAX_LOST = 0.1  # largest share of the walkers of an ensemble that are taken back


class StoredSteps(NamedTuple):
    """Consecutive steps, some of them stored."""

    first: int  # number of the first step, counted from 1
    numbers: Index  # numbers of the stored steps
    samples: Floats  # samples of the stored steps, shape (chain, step, walker, parameter)
    values: Floats  # their log-probability, shape (chain, step, walker)
    moved: Flags  # True if a walker moved in a step, for all steps, shape (chain, step, walker)

    def since(self, steps: int, every: int) -> StoredSteps:
        """Return the part after so many steps of the run, with every `every`-th step."""
        first = max(self.first, steps + 1)
        stored = (self.numbers >= first) & (self.numbers % every == 0)
        moved = self.moved[:, first - self.first :]
        return StoredSteps(first, self.numbers[stored], self.samples[:, stored], self.values[:, stored], moved)


@dataclass(frozen=True, eq=False)
class RunState:
    """State of a run: its last step, from which it continues, and the second half of its steps."""

    coordinates: Coordinates  # coordinates in which the parameters are sampled
    last: Block  # last block, whose last step determines the next one
    steps: int  # number of steps of each ensemble
    # Thinning: a power of two that follows from the number of steps and the shape alone, so that a resumed run stores
    # the same steps as an uninterrupted one.
    every: int
    half: StoredSteps  # second half of the steps at the last diagnosis, as parameters
    recent: tuple[StoredSteps, ...] = ()  # blocks since then, in the coordinates

    @classmethod
    def begin(cls, coordinates: Coordinates, start: Block, steps: int = 0, planned: int = 0) -> RunState:
        """Return the state of a run without stored steps."""
        samples, values = start.samples[:, :0], start.log_probability[:, :0]
        empty = StoredSteps(steps + 1, np.empty(0, dtype=np.intp), samples, values, np.empty(values.shape, dtype=bool))
        return cls(coordinates, start, steps, _thinning(max(steps, planned), start), empty)

    def append(self, block: Block) -> RunState:
        """Return the state after another block."""
        if not block.steps:
            return self
        numbers = self.steps + 1 + np.arange(block.steps)
        stored = numbers % self.every == 0
        before = np.concatenate([self.last.samples[:, -1:], block.samples[:, :-1]], axis=1)
        part = StoredSteps(
            self.steps + 1,
            numbers[stored],
            block.samples[:, stored],
            block.log_probability[:, stored],
            np.any(block.samples != before, axis=-1),
        )
        recent = (*self.recent, part)
        return replace(self, last=block, steps=self.steps + block.steps, recent=recent)

    def diagnose(self) -> tuple[RunState, Diagnosis]:
        """Return the state with earlier steps dropped, and the diagnosis of its second half."""
        every = _thinning(self.steps, self.last)
        parts = [part.since(self.steps // 2, every) for part in (self.half, *map(self._as_parameters, self.recent))]
        _, numbers, *columns = zip(*parts, strict=True)
        joined = (np.concatenate(column, axis=1) for column in columns)
        half = StoredSteps(parts[0].first, np.concatenate(numbers), *joined)
        return replace(self, every=every, half=half, recent=()), Diagnosis(half.samples)

    def lost(self) -> tuple[Flags, Flags]:
        """Return True for walkers lost in the earlier and in the later half of the steps kept, (chain, walker) each."""
        middle = self.half.values.shape[1] // 2
        return lost_walkers(self.half.values[:, :middle]), lost_walkers(self.half.values[:, middle:])

    def recovered(self) -> RunState:
        """Return the state with lost walkers where others of their ensemble were in the first of the steps kept.

        Where many are lost, they stay: that may be a mode.
        """
        _, lost = self.lost()
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
        return replace(self, last=last)

    @property
    def moved(self) -> Flags:
        """True if a walker moved in a step, for all of the second half except the first; (chain, step, walker)."""
        return self.half.moved[:, 1:]

    def _as_parameters(self, part: StoredSteps) -> StoredSteps:
        shape = part.samples.shape
        points, log_jacobian = self.coordinates.parameters(part.samples.reshape(-1, shape[-1]))
        return part._replace(samples=points.reshape(shape), values=part.values - log_jacobian.reshape(shape[:-1]))


def _thinning(steps: int, block: Block) -> int:
    every, half = 1, steps - steps // 2
    while half // every * block.samples[:, 0].size > _MAX_STORED:
        every *= 2
    return every

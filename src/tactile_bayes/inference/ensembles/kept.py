"""The steps of a run that are kept: its second half, thinned if it would take too much memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.inference.ensembles.block import Block
from tactile_bayes.inference.ensembles.coordinates import Coordinates

__all__ = ["KeptSteps"]


_MOST = 4_000_000
"""Largest count of numbers kept of all ensembles, beyond which steps are thinned: 32 MB, and 6 s for a diagnosis."""


class _Part(NamedTuple):
    """Consecutive steps, of which some are kept."""

    first: int
    """Number of the first step, counted from 1."""
    numbers: Index
    """Numbers of the steps whose samples are kept."""
    samples: Floats
    """Samples of the steps kept, shape (chain, step, walker, parameter)."""
    values: Floats
    """Their log-probability, shape (chain, step, walker)."""
    moved: Flags
    """True if a walker moved in a step, for all steps, shape (chain, step, walker)."""

    def since(self, steps: int, every: int) -> _Part:
        """Return the part after so many steps of the run, with every `every`-th step."""
        first = max(self.first, steps + 1)
        kept = (self.numbers >= first) & (self.numbers % every == 0)
        return _Part(
            first,
            self.numbers[kept],
            self.samples[:, kept],
            self.values[:, kept],
            self.moved[:, first - self.first :],
        )


class KeptSteps:
    """The second half of the steps made, every `every`-th of them, as parameters.

    `every` is a power of two that follows from the number of steps and the shape alone, so that a run that resumes from
    a checkpoint keeps the same steps as an uninterrupted one.

    Parameters
    ----------
    coordinates : Coordinates
        Coordinates in which the parameters are sampled.
    last : ndarray, shape (chain, walker, parameter)
        The coordinates before the first step that is appended.
    steps : int
        Number of steps before the first step that is appended.
    made : int
        Number of steps at the next diagnosis, if known.
    """

    def __init__(self, coordinates: Coordinates, last: Floats, steps: int = 0, made: int = 0) -> None:
        self._coordinates, self._last, self._steps = coordinates, last, steps
        self.every = self._thinning(max(steps, made))
        self._parts: list[_Part] = []

    def append(self, block: Block) -> None:
        """Append a block; if an interrupt comes, nothing is appended."""
        if not block.steps:
            return
        numbers = self._steps + 1 + np.arange(block.steps)
        kept = numbers % self.every == 0
        samples, values = block.samples[:, kept], block.log_probability[:, kept]
        points, growth = self._coordinates.parameters(samples.reshape(-1, samples.shape[-1]))
        before = np.concatenate([self._last[:, None], block.samples[:, :-1]], axis=1)
        part = _Part(
            self._steps + 1,
            numbers[kept],
            points.reshape(samples.shape),
            values - growth.reshape(values.shape),
            np.any(block.samples != before, axis=-1),
        )
        self._parts, self._last, self._steps = [*self._parts, part], block.samples[:, -1], self._steps + block.steps

    def second_half(self) -> tuple[Floats, Floats]:
        """Return samples, (chain, step, walker, parameter), and log-probability; earlier steps are dropped."""
        self.every = self._thinning(self._steps)
        parts = [part.since(self._steps // 2, self.every) for part in self._parts]
        joined = (np.concatenate(columns, axis=1) for columns in zip(*(part[2:] for part in parts), strict=True))
        whole = _Part(parts[0].first, np.concatenate([part.numbers for part in parts]), *joined)
        self._parts = [whole]
        return whole.samples, whole.values

    @property
    def moved(self) -> Flags:
        """True if a walker moved in a step of the second half except its first, kept or not; (chain, step, walker)."""
        return self._parts[0].moved[:, 1:]

    def _thinning(self, steps: int) -> int:
        every, half = 1, steps - steps // 2
        while half // every * self._last.size > _MOST:
            every *= 2
        return every

"""The steps of a run that are kept: its second half, thinned where that is more than memory should hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.ensembles.block import Block
from tactile_bayes.inference.ensembles.coordinates import Coordinates

__all__ = ["KeptSteps"]


_MOST = 4_000_000
"""Numbers of all ensembles, above which only every second step is kept, and so on: 32 MB, and 6 s for a diagnosis."""


class _Part(NamedTuple):
    """Consecutive steps."""

    first: int
    """The number of the first one, counted from 1."""
    numbers: NDArray[np.intp]
    """Of those whose samples are kept."""
    samples: Floats
    """(chain, step, walker, parameter), of those kept."""
    values: Floats
    """Their log-probability."""
    moved: NDArray[np.bool_]
    """(chain, step, walker): whether a walker moved in a step, of all steps."""

    def since(self, steps: int, every: int) -> _Part:
        """What comes after so many steps of the run, of it every so manieth step."""
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
    """The second half of the steps that were made, every `every`-th of them, as parameters.

    `every` is a power of two that follows from the number of steps and the shape alone, so that a run that goes on from
    a checkpoint keeps the same as one that was never stopped.

    Parameters
    ----------
    coordinates : Coordinates
        In which walkers walk.
    last : ndarray, shape (chain, walker, parameter)
        The coordinates before the first step that is appended.
    steps : int
        Steps that were made before it, of which `made` have been made in all when they are judged next.
    """

    def __init__(self, coordinates: Coordinates, last: Floats, steps: int = 0, made: int = 0) -> None:
        self._coordinates, self._last, self._steps = coordinates, last, steps
        self.every = self._thinning(max(steps, made))
        self._parts: list[_Part] = []

    def append(self, block: Block) -> None:
        """Keep what a block adds; all of it, or, if an interrupt comes, nothing."""
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
        """Samples, (chain, step, walker, parameter), and their log-probability; what came before is dropped."""
        self.every = self._thinning(self._steps)
        parts = [part.since(self._steps // 2, self.every) for part in self._parts]
        joined = (np.concatenate(columns, axis=1) for columns in zip(*(part[2:] for part in parts), strict=True))
        whole = _Part(parts[0].first, np.concatenate([part.numbers for part in parts]), *joined)
        self._parts = [whole]
        return whole.samples, whole.values

    @property
    def moved(self) -> NDArray[np.bool_]:
        """(chain, step, walker): whether a walker moved in the steps that `second_half` began with, but for the first,
        whether they are kept or not.
        """
        return self._parts[0].moved[:, 1:]

    def _thinning(self, steps: int) -> int:
        every, half = 1, steps - steps // 2
        while half // every * self._last.size > _MOST:
            every *= 2
        return every

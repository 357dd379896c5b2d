"""Random streams of records, which depend on the seed and the number of the record only."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats, Index

CONTOUR, NOISE = 0, 1  # purposes of streams: the distributions of a specification, and the load cell


def streams(seed: int, records: Index, purpose: int) -> list[np.random.Generator]:
    """Make the generators of many records."""
    seeds = (np.random.SeedSequence(seed, spawn_key=(record, purpose)) for record in records.tolist())
    return [np.random.Generator(np.random.PCG64(one)) for one in seeds]


class Together:
    """Many generators with the interface of one: the first axis of the result runs over them."""

    def __init__(self, generators: list[np.random.Generator]) -> None:
        self._generators = generators

    def standard_normal(self, shape: tuple[int, ...]) -> Floats:
        return np.stack([one.standard_normal(shape[1:]) for one in self._generators])

    def chisquare(self, degrees_of_freedom: float, shape: tuple[int, ...]) -> Floats:
        return np.stack([one.chisquare(degrees_of_freedom, shape[1:]) for one in self._generators])

"""Random numbers of a call: what users give as `rng`, and seeds that follow from it."""

from __future__ import annotations

import math

import numpy as np

from tactile_bayes.checks import check_whole_number

Seed = int | np.random.SeedSequence  # gives the same numbers in every call
# A seed, or a generator that every call draws from, so that the next call has other numbers.
Rng = Seed | np.random.Generator
_HINT = "give a whole number from 0 up, a numpy.random.SeedSequence or a numpy.random.Generator"


def seed_sequence(rng: Rng) -> np.random.SeedSequence:
    """Return a sequence that has not spawned any: of the seed, or of 128 bits that the generator draws."""
    if isinstance(rng, np.random.SeedSequence):
        return np.random.SeedSequence(rng.entropy, spawn_key=rng.spawn_key, pool_size=rng.pool_size)
    if isinstance(rng, np.random.Generator):
        return np.random.SeedSequence(int.from_bytes(rng.bytes(16), "little"))
    return np.random.SeedSequence(check_whole_number("rng", rng, 0, _HINT, most=math.inf))


def generator(rng: Rng) -> np.random.Generator:
    """Return the generator itself, or one that begins at the seed."""
    return rng if isinstance(rng, np.random.Generator) else np.random.default_rng(seed_sequence(rng))


def spawn(seed: Rng, count: int) -> list[np.random.SeedSequence]:
    """Return independent seeds, the same at every call with the same seed."""
    return seed_sequence(seed).spawn(count)


def child(seed: Seed, *key: int) -> np.random.SeedSequence:
    """Return the seed of a task, by its numbers."""
    parent = seed_sequence(seed)
    return np.random.SeedSequence(parent.entropy, spawn_key=(*parent.spawn_key, *key), pool_size=parent.pool_size)


def words(seed: Seed) -> list[int]:
    """Return the numbers of which a seed is made."""
    sequence = seed_sequence(seed)
    return [*np.atleast_1d(np.array(sequence.entropy, dtype=object)).tolist(), *sequence.spawn_key]


def seed_words(seed: Seed) -> str:
    """Return a seed as text, for an attribute."""
    sequence = seed_sequence(seed)
    return f"{sequence.entropy}" + (f", spawn key {sequence.spawn_key}" if sequence.spawn_key else "")


def whole_seed(seed: Seed) -> str:
    """Return all of a seed that determines random numbers, as text."""
    return f"{seed_words(seed)}, pool of {seed_sequence(seed).pool_size}"

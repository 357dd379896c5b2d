"""The identity of a run, as names and strings, so that no run resumes with the steps of another."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from importlib.metadata import version

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.coordinates.base import Coordinates
from tactile_bayes.inference.ensembles.settings import SamplerSettings
from tactile_bayes.numerics.random_numbers import Seed, whole_seed

__all__ = ["changes", "identity_of_run"]


# Entries that follow from the others, if those are complete.
_START, _COORDINATES = _CONSEQUENCES = ("starting points", "coordinates of the walkers")
_MAX_CHARACTERS = 60  # largest number of characters of an entry in an error message


def identity_of_run(
    identity: Mapping[str, str] | None,
    start: Floats,
    names: Sequence[str],
    seed: Seed,
    settings: SamplerSettings,
    coordinates: Coordinates,
) -> dict[str, str]:
    """Return all that determines the draws: the caller's identity of the log-probability, and the sampler's entries."""
    chains, walkers, _ = start.shape
    entries = {} if identity is None else dict(identity)
    rest = {
        "names of parameters": ", ".join(names),
        "number of ensembles": str(chains),
        "walkers of an ensemble": str(walkers),
        "block_steps": str(settings.block_steps),
        "seed of the ensembles": whole_seed(seed),
        _START: hashlib.sha256(np.ascontiguousarray(start, dtype="<f8").tobytes()).hexdigest(),
        _COORDINATES: coordinates.digest,
        "version of emcee": version("emcee"),
    }
    for name, value in entries.items():
        if not (isinstance(name, str) and isinstance(value, str)):
            raise ParameterError(f"the identity has {name!r}: {value!r}: give strings, they are compared as they are")
        if name in rest:
            raise ParameterError(f"the identity has {name!r}, which the sampler adds itself: leave it out")
    return {**entries, **rest}


def changes(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Return the entries that differ, each as text with its old and new value."""
    found = []
    differing = [name for name in {**now, **before} if before.get(name) != now.get(name)]
    for name in [name for name in differing if name not in _CONSEQUENCES] or differing:
        was, has_become = before.get(name), now.get(name)
        first = _first_difference(was or "", has_become or "")
        found.append(f"{name} (was {_shown(was, first)}, now {_shown(has_become, first)})")
    return found


def _first_difference(one: str, other: str) -> int:
    pairs = enumerate(zip(one, other, strict=False))
    return next((i for i, (a, b) in pairs if a != b), min(len(one), len(other)))


def _shown(text: str | None, at: int) -> str:
    """Return an entry, shortened to the surroundings of a position."""
    if text is None:
        return "not stated"
    if len(text) <= _MAX_CHARACTERS:
        return repr(text)
    begin = max(0, min(at - _MAX_CHARACTERS // 3, len(text) - _MAX_CHARACTERS))
    end = begin + _MAX_CHARACTERS
    return ("…" if begin else "") + repr(text[begin:end]) + ("…" if end < len(text) else "")

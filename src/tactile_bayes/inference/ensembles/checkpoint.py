"""The checkpoint of a run, one file per block, from which the run resumes after it was killed at any moment."""

from __future__ import annotations

import hashlib
import json
import os
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.inference.coordinates.base import Coordinates
from tactile_bayes.inference.ensembles.run_state import Block
from tactile_bayes.inference.ensembles.settings import SamplerSettings
from tactile_bayes.inference.ensembles.walkers import RandomState
from tactile_bayes.numerics.random_numbers import Seed, whole_seed
from tactile_bayes.tasks import alone_in, is_temporary, write_atomically
from tactile_bayes.tasks.documents import read_json

__all__ = ["Checkpoint", "changes", "identity_of_run", "open_checkpoint"]

_START, _COORDINATES = _CONSEQUENCES = ("starting points", "coordinates of the walkers")  # follow from the others
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


_DESCRIPTION = "checkpoint.json"
_KIND = "ensembles of tactile-bayes"
_FORMAT = 1
_BLOCK = re.compile(r"block-(\d{8,})-(\d{8,})\.npz")  # first step, from 0, and that after the last


class Checkpoint:
    """The blocks of one run in a folder.

    Each file is written whole and holds all that the next step depends on, so that the last file is the state of the
    run. No block is written twice.
    """

    def __init__(self, folder: Path, identity: Mapping[str, str], shape: tuple[int, int, int]) -> None:
        """Open the folder for a run of this identity and shape, (chains, walkers, parameters)."""
        self._folder = folder
        self._identity = dict(identity)
        self._shape = shape
        self.ended_at = 0
        """Number of steps at which the run last ended, diagnosed; 0 if it never has."""
        self._ends = self._stored_ends()
        self.seconds = 0.0
        """Sampling time up to the last block that was read or written [s]."""

    @property
    def steps(self) -> int:
        """Number of stored steps of each ensemble."""
        return self._ends[-1] if self._ends else 0

    def read(self, since: int) -> Iterator[Block]:
        """Yield the steps from `since` on, block by block."""
        for begin, end in pairwise([0, *self._ends]):
            if end > since:
                block, dropped = self._read(begin, end), max(0, since - begin)
                yield replace(
                    block, samples=block.samples[:, dropped:], log_probability=block.log_probability[:, dropped:]
                )

    def write(self, block: Block, seconds: float) -> None:
        """Append a block that was finished after `seconds` [s] of the whole run."""
        if not self._ends:
            self._write_description()
        end = self.steps + block.steps
        path = self._folder / _name(self.steps, end)
        if path.exists():
            raise InferenceError(f"another run is at work on {self._folder}, {path.name} is there: wait for it to end")
        _, keys, positions, has_gauss, gauss = zip(*block.random_states, strict=True)
        with write_atomically(path) as temporary:
            np.savez(
                temporary,
                samples=block.samples,
                log_probability=block.log_probability,
                random_keys=np.array(keys, dtype=np.uint32),
                random_positions=np.array(positions, dtype=np.int64),
                random_has_gauss=np.array(has_gauss, dtype=np.int64),
                random_gauss=np.array(gauss, dtype=np.float64),
                seconds=np.float64(seconds),
            )
        self._ends.append(end)
        self.seconds = seconds

    def note_end(self) -> None:
        """Record that the run ended after the last block, diagnosed."""
        if self.ended_at != self.steps:
            self.ended_at = self.steps
            self._write_description()

    def _write_description(self) -> None:
        table = {"kind": _KIND, "format": _FORMAT, "judged": self.ended_at, "identity": self._identity}
        text = json.dumps(table, indent=1, ensure_ascii=False)
        with write_atomically(self._folder / _DESCRIPTION) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

    def _stored_ends(self) -> list[int]:
        """Return the ends of the stored blocks, in steps; refuse blocks of another run, or with gaps."""
        files = sorted(path.name for path in self._folder.iterdir() if not is_temporary(path))
        if _DESCRIPTION in files:
            self.ended_at = self._read_description()
        elif files:
            raise InferenceError(
                f"{self._folder} holds {files[0]!r} and no {_DESCRIPTION}, so it is no checkpoint: give a folder "
                "that is empty or not there yet"
            )
        end, ends = 0, []
        for begin, stop in sorted((int(m[1]), int(m[2])) for m in map(_BLOCK.fullmatch, files) if m):
            if begin != end or stop <= begin:
                raise InferenceError(
                    f"{self._folder} has no block that begins with step {end}, but {_name(begin, stop)}: put the "
                    "missing file back, or move away all blocks after it, and the run makes them again"
                )
            end = stop
            ends.append(end)
        return ends

    def _read_description(self) -> int:
        """Return the number of steps at which the run last ended; refuse the description of another run."""
        path = self._folder / _DESCRIPTION
        try:
            table = read_json(path.read_bytes(), "it")
            if table["kind"] != _KIND:
                raise ValueError(f"it is of kind {table['kind']!r}")
            number = int(table["format"])
            if number != _FORMAT:
                raise InferenceError(
                    f"{path} has format {number}, and this version reads format {_FORMAT}: use the version that "
                    "began it, or give another folder"
                )
            identity = {name: str(value) for name, value in table["identity"].items()}
            judged = int(table["judged"])
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            raise InferenceError(
                f"{path} is not the description of a checkpoint, or damaged ({error!r}): put a copy of it back, or "
                "give another folder"
            ) from error
        if found := changes(identity, self._identity):
            raise InferenceError(
                f"{self._folder} is the checkpoint of another run, which differs in {'; '.join(found)}: give another "
                "folder, or what was given then (only max_steps, max_seconds, min_ess and max_r_hat may change)"
            )
        return judged

    def _read(self, begin: int, end: int) -> Block:
        path = self._folder / _name(begin, end)
        chains, walkers, parameters = self._shape
        try:
            with zipfile.ZipFile(path) as archive:
                if archive.testzip() is not None:
                    raise ValueError("a checksum differs")
            with np.load(path, allow_pickle=False) as arrays:
                samples, values = arrays["samples"], arrays["log_probability"]
                keys, positions = arrays["random_keys"], arrays["random_positions"].tolist()
                has_gauss, gauss = arrays["random_has_gauss"].tolist(), arrays["random_gauss"].tolist()
                seconds = float(arrays["seconds"])
            if samples.shape != (chains, end - begin, walkers, parameters) or values.shape != samples.shape[:3]:
                raise ValueError(f"its samples have shape {samples.shape}")
            columns = zip(["MT19937"] * chains, keys, positions, has_gauss, gauss, strict=True)
            states = tuple(RandomState(*column) for column in columns)
        except Exception as error:  # a damaged archive fails its readers in many ways
            raise InferenceError(
                f"{path} is damaged or cannot be read ({error}): put a copy of it back, or move it and the blocks "
                "after it away, and the run makes them again"
            ) from error
        self.seconds = seconds
        return Block(samples, values, states)


def _name(begin: int, end: int) -> str:
    return f"block-{begin:08d}-{end:08d}.npz"


@contextmanager
def open_checkpoint(
    path: str | os.PathLike[str], identity: Mapping[str, str], shape: tuple[int, int, int]
) -> Iterator[Checkpoint]:
    """Open the checkpoint in a folder, created if missing, and lock it for this run."""
    folder = Path(path).resolve()
    with alone_in(folder, InferenceError):
        yield Checkpoint(folder, identity, shape)

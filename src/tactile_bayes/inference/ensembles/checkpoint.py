"""The checkpoint of a run: one file with its state, from which the run resumes after it was killed at any moment."""

from __future__ import annotations

import hashlib
import io
import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.coordinates import Coordinates
from tactile_bayes.inference.ensembles.run_state import Block, RunState, StoredSteps
from tactile_bayes.inference.ensembles.settings import SamplerSettings
from tactile_bayes.numerics.random_numbers import Seed, whole_seed
from tactile_bayes.tasks import alone_in, check_format, differences, is_temporary, versions_of, write_atomically
from tactile_bayes.tasks.documents import read_json

_START = "starting points"  # they follow from the other entries
_MOST_NAMED = 20  # largest number of differing entries that a message names


def identity_of_run(
    identity: Mapping[str, str] | None, start: Floats, names: Sequence[str], seed: Seed, settings: SamplerSettings
) -> dict[str, str]:
    """Return all that determines the draws: the caller's identity of the log-probability, and the sampler's entries."""
    chains, walkers, _ = start.shape
    return {
        **(identity or {}),
        "names of parameters": ", ".join(names),
        "number of ensembles": str(chains),
        "walkers of an ensemble": str(walkers),
        "block_steps": str(settings.block_steps),
        "seed of the ensembles": whole_seed(seed),
        _START: hashlib.sha256(np.ascontiguousarray(start, dtype="<f8").tobytes()).hexdigest(),
        **versions_of("emcee"),
    }


_FILE, _KIND, _FORMAT = "checkpoint.npz", "ensembles of tactile-bayes", 4
_FITTED = "fitted_"  # before the names of what draws have changed of the coordinates
_SECONDS = 5.0  # least time between two files, of up to 32 MB: a killed run makes the steps of this time again


class Checkpoint:
    """The state of one run in a folder, in a file that is written whole each time."""

    seconds = 0.0  # sampling time up to the stored state [s]
    is_end = False  # True if the run ended at the stored state, diagnosed

    def __init__(self, folder: Path, identity: Mapping[str, str]) -> None:
        """Open the folder for a run of this identity; refuse that of another run, and one with other files."""
        self._path, self._identity = folder / _FILE, dict(identity)
        self._due = time.monotonic() + _SECONDS
        self._steps = 0
        others = sorted(path.name for path in folder.iterdir() if path != self._path and not is_temporary(path))
        if self.exists:
            with self._opened() as arrays:
                self._read_description(str(arrays["description"]))
        elif others:
            raise InferenceError(
                f"{folder} holds {others[0]!r} and no {_FILE}, so it is no checkpoint: give a folder that is empty or "
                "not there yet"
            )

    @property
    def exists(self) -> bool:
        return self._path.exists()

    def read(self, coordinates: Coordinates, shape: tuple[int, ...]) -> RunState:
        """Return the stored state of the run in coordinates, for places of shape (chains, walkers, coordinates)."""
        with self._opened() as arrays:
            places, values = arrays["places"], arrays["densities"]
            last = Block(places[:, None], values[:, None], tuple(map(tuple, self._random_states)))
            half = StoredSteps(*(arrays[name] for name in ("numbers", "samples", "log_probability", "moved")))
            coordinates = coordinates.refitted({name: arrays[_FITTED + name] for name in coordinates.fitted})
            state = RunState(coordinates, last, self._steps, (half,), arrays["taken_back"])
            if places.shape != shape or half.moved.shape[1] != state.kept:
                raise ValueError(f"it has places of shape {places.shape} after {half.moved.shape[1]} steps")
            return state

    def write(self, state: RunState, seconds: float, *, is_end: bool = False) -> None:
        """Store a state that was reached after `seconds` [s] of the whole run; if it is no end, only now and then."""
        is_stored = (self._steps, self.is_end) == (state.steps, is_end)
        if is_stored or not (is_end or time.monotonic() >= self._due):
            return
        half, last = state.halved().half, state.last
        states = [(name, key.tolist(), *rest) for name, key, *rest in last.random_states]
        about = {"kind": _KIND, "format": _FORMAT, "steps": state.steps, "seconds": seconds, "is_end": is_end}
        about |= {"random_states": states, "identity": self._identity}
        fitted: dict[str, Any] = {_FITTED + name: values for name, values in state.coordinates.fitted.items()}
        with write_atomically(self._path) as temporary:
            np.savez(
                temporary,
                description=np.array(json.dumps(about, ensure_ascii=False)),
                places=last.samples[:, -1],
                densities=last.log_probability[:, -1],
                numbers=half.numbers,
                samples=half.samples,
                log_probability=half.values,
                moved=half.moved,
                taken_back=state.taken_back,
                **fitted,
            )
        self._steps, self.seconds, self.is_end = state.steps, seconds, is_end
        self._due = time.monotonic() + _SECONDS

    def _read_description(self, text: str) -> None:
        """Read what the file states of the run; refuse that of another one."""
        table = read_json(text, "its description")
        if table["kind"] != _KIND:
            raise ValueError(f"it is of kind {table['kind']!r}")
        other = "or give another folder"
        check_format(table["format"], _FORMAT, lambda what: InferenceError(f"{self._path} {what}: {other}"), _FORMAT)
        there = {name: str(value) for name, value in table["identity"].items()}
        before, now = ({n: v for n, v in each.items() if n != _START} for each in (there, self._identity))
        if found := differences(before, now, most=_MOST_NAMED) or differences(there, self._identity):
            raise InferenceError(
                f"{self._path.parent} is the checkpoint of another run: {found}; give another folder, or what was "
                "given then (only max_steps, max_seconds, min_ess and max_r_hat may change)"
            )
        self._steps, self.seconds, self.is_end = int(table["steps"]), float(table["seconds"]), bool(table["is_end"])
        self._random_states = table["random_states"]

    @contextmanager
    def _opened(self) -> Iterator[Mapping[str, Any]]:
        """Yield the arrays of the file; refuse a damaged one."""
        try:
            with np.load(io.BytesIO(self._path.read_bytes()), allow_pickle=False) as arrays:
                yield arrays
        except InferenceError:
            raise
        except Exception as error:  # a damaged archive fails its readers in many ways
            raise InferenceError(
                f"{self._path} is damaged or cannot be read ({error}): put a copy of it back, or move it away, and the "
                "run begins again"
            ) from error


@contextmanager
def open_checkpoint(path: str | os.PathLike[str], identity: Mapping[str, str]) -> Iterator[Checkpoint]:
    """Open the checkpoint in a folder, created if missing, and lock it for this run."""
    folder = Path(path).resolve()
    with alone_in(folder, InferenceError):
        yield Checkpoint(folder, identity)

"""The production of a data set: shard by shard, on many workers, and resumable."""

from __future__ import annotations

import hashlib
import os
import reprlib
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from tactile_bayes.checks import check_path
from tactile_bayes.datasets.card import CARD, card
from tactile_bayes.datasets.manifest import MANIFEST, Manifest, read_manifest, versions_here, write_manifest
from tactile_bayes.datasets.shard import file_in, shard_file, write_shard
from tactile_bayes.datasets.specification import UNNAMED, Specification, entries, meaning
from tactile_bayes.datasets.specification_reading import read_specification
from tactile_bayes.errors import SpecificationError
from tactile_bayes.tasks import (
    TaskProgress,
    Workers,
    alone_in,
    refuse_replacing,
    run_tasks,
    workers_of,
    write_atomically,
)

# Share of the time that is spent on the manifest: shards that it does not list when the run is killed are repeated.
_WRITING_SHARE = 0.05
_MOST_NAMED = 3  # largest number of differences between two specifications that a message names
_LONGEST_VALUE = 60  # largest number of characters of a value in the message


def generate(
    spec: str | os.PathLike[str] | Mapping[str, Any] | Specification,
    out: str | os.PathLike[str],
    *,
    workers: int | str | Workers | None = None,
) -> Path:
    """Make the data set that a specification describes, or continue it.

    The run may be killed at any moment and started again: files are written atomically, and existing ones are kept. The
    numbers do not depend on the workers, nor on the order of their work. In a script, call it under
    `if __name__ == "__main__":`, since each process begins by importing the script; otherwise it raises TaskError.

    Parameters
    ----------
    spec : path-like, mapping or Specification
        A TOML file, its content as nested mappings, or a specification.
    out : path-like
        Folder for the shards (NetCDF), manifest.json, and README.md, the data card; it is created if necessary.
    workers : int, str or Workers, optional
        As in `calibrate`. Workers of a scheduler need access to the folder under the same path; progress is reported
        in records, after each shard.

    Returns
    -------
    Path
        Path of the manifest.

    Raises
    ------
    SpecificationError
        If the specification is invalid, no contour is reached in 1000 draws, or the folder contains another data set,
        or one that was begun with other versions, whose numbers may differ, or another run uses it.
    ParameterError
        If `workers` is not a positive number, the scheduler does not answer, or a file would replace the specification.
    TaskError
        If processes die repeatedly over a shard, or cannot start.
    OSError
        If a file cannot be written. Finished shards are kept.

    Examples
    --------
    >>> import tempfile
    >>> contours = [{"family": "parabola", "a": {"uniform": [0.3, 3.0]}, "q": {"uniform": [0.3, 0.7]}}]
    >>> spec = {"records": 4, "seed": 1, "contours": contours, "load_cell": {"moment_noise": 0.02}}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     manifest = generate(spec, folder, workers=1)
    ...     sorted(path.name for path in manifest.parent.iterdir())
    ['README.md', 'manifest.json', 'shard-000000.nc']
    """
    workers, folder = workers_of(workers), check_path("out", out, "give the path of a folder").resolve()
    if isinstance(spec, str | os.PathLike):
        refuse_replacing([folder / MANIFEST, folder / CARD, *folder.glob("shard-*.nc")], [Path(spec)])
    spec = spec if isinstance(spec, Specification) else read_specification(spec)
    with alone_in(folder, SpecificationError):
        manifest = _begun(spec, folder)
        done = {shard.file for shard in manifest.shards}
        tasks = [(spec.text, n, str(folder)) for n in range(spec.shards) if shard_file(n) not in done]
        began, before = time.monotonic(), manifest.made
        next_write = began
        try:
            with closing(run_tasks(write_shard, tasks, workers=workers)) as results:
                for _, written in results:
                    manifest = manifest.having(written)
                    if (now := time.monotonic()) >= next_write:
                        write_manifest(manifest, folder)
                        next_write = time.monotonic() + (time.monotonic() - now) / _WRITING_SHARE
                    if workers.progress is not None:
                        made = manifest.made - before
                        workers.progress(TaskProgress(manifest.made, spec.records, made, time.monotonic() - began))
        finally:
            write_manifest(manifest, folder)
        _finish(spec, manifest, folder)
    return folder / MANIFEST


def _finish(spec: Specification, manifest: Manifest, folder: Path) -> None:
    """Write the data card, and the manifest with its checksum."""
    content = card(spec, manifest).encode()
    with write_atomically(file_in(folder, CARD)) as temporary:
        temporary.write_bytes(content)
    write_manifest(replace(manifest, card_sha256=hashlib.sha256(content).hexdigest()), folder)


def _begun(spec: Specification, folder: Path) -> Manifest:
    """Return the manifest of the data set in a folder, without incomplete files."""
    shards, has_manifest = list(folder.glob("shard-*.nc")), (folder / MANIFEST).exists()
    if not has_manifest and (strangers := [*shards, *folder.glob(CARD)]):
        raise SpecificationError(
            f"{folder} holds {strangers[0].name}, but no {MANIFEST}: choose another folder, or empty this one, as "
            "the same specification makes the same files again; or put a copy of the manifest back"
        )
    manifest = read_manifest(folder) if has_manifest else Manifest.of(spec)
    if not manifest.shards:
        for file in shards:  # of an interrupted run
            file.unlink()
        manifest = Manifest.of(spec)
        write_manifest(manifest, folder)
        return manifest
    if manifest.specification_sha256 != spec.sha256:
        raise _other(manifest, spec, folder)
    here, sizes = versions_here(), {path.name: path.stat().st_size for path in shards if path.is_file()}
    kept = (shard for shard in manifest.shards if sizes.get(file_in(folder, shard.file).name) == shard.bytes)
    manifest = replace(manifest, shards=tuple(kept))
    other = [f"{name} {was} (now {here.get(name)})" for name, was in manifest.versions.items() if here.get(name) != was]
    if other and not manifest.is_complete:
        raise SpecificationError(
            f"{folder} was made with {', '.join(other)}, and numbers may differ in the last digit: use those "
            "versions, or start again in another folder"
        )
    return manifest


def _other(manifest: Manifest, spec: Specification, folder: Path) -> SpecificationError:
    there, here = (entries(meaning(text)) for text in (manifest.specification, spec.text))
    keys = [key for key in {**there, **here} if there.get(key) != here.get(key)]
    named = [f"{key} {_described(there, key)} there and {_described(here, key)} here" for key in keys[:_MOST_NAMED]]
    named += [f"{len(keys) - _MOST_NAMED} more"] if len(keys) > _MOST_NAMED else []
    name = "" if manifest.name == UNNAMED else f" ({manifest.name!r})"
    correction = "choose another folder, or give the specification that its manifest states"
    if keys == ["records"]:
        correction = "a data set does not grow: choose another folder, where the first records will be the same"
    return SpecificationError(
        f"{folder} holds a data set of another specification{name}, {', '.join(named)}: {correction}"
    )


def _described(said: Mapping[str, Any], key: str) -> str:
    if key not in said:
        return "is left out"
    value = said[key]
    text = str(int(value)) if isinstance(value, float) and value.is_integer() else reprlib.repr(value)
    return f"is {text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 1] + '…'}"

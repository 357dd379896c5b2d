"""The verification of a data set: its bytes against the manifest, and regenerated numbers."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile_bayes.checks import check_function, check_path, check_whole_number
from tactile_bayes.datasets.card import CARD
from tactile_bayes.datasets.collection import read_shard
from tactile_bayes.datasets.generation import generate_records
from tactile_bayes.datasets.manifest import Manifest, read_manifest
from tactile_bayes.datasets.shard import Written, file_in, records_as_dataset
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.datasets.specification_reading import read_text
from tactile_bayes.errors import SpecificationError
from tactile_bayes.numerics.selection import evenly_spread


class Verification(NamedTuple):
    """Progress of a verification.

    Examples
    --------
    >>> Verification(files=3, wanted=12).wanted
    12
    """

    files: int  # number of files that are verified, unchanged or identical when regenerated
    wanted: int


def verify(
    path: str | os.PathLike[str], *, regenerate: int = 0, progress: Callable[[Verification], object] | None = None
) -> Manifest:
    """Check every byte of a data set against its manifest.

    Parameters
    ----------
    path : path-like
        Folder of the data set.
    regenerate : int
        Number of shards, evenly spread, that are generated again and compared number by number; with other versions of
        the libraries they may differ in the last digit.
    progress : callable, optional
        Called with a `Verification` after each file, and after each regenerated file.

    Returns
    -------
    Manifest
        Manifest of the data set.

    Raises
    ------
    SpecificationError
        If a file is missing, not listed, or changed, the data set is not complete, or a regenerated number differs; the
        message names the first such file.
    ParameterError
        If `regenerate` is not a number of shards.

    Examples
    --------
    >>> import tempfile
    >>> from tactile_bayes.datasets import generate
    >>> spec = {"records": 2, "seed": 1, "contours": [{"family": "circle", "r": 0.5, "q": 0.3}]}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     generate(spec, folder, workers=1).name, verify(folder, progress=print).records
    Verification(files=1, wanted=1)
    ('manifest.json', 2)
    """
    check_whole_number("regenerate", regenerate, 0, "give a number of shards, 0 for none")
    check_function("progress", progress)
    folder = check_path("path", path, "give the folder of a data set")
    manifest = read_manifest(folder)
    spec = read_text(manifest.specification)
    again = evenly_spread(len(manifest.shards), regenerate)
    done, wanted = count(1), len(manifest.shards) + again.size

    def note() -> None:
        if progress is not None:
            progress(Verification(next(done), wanted))

    for shard in manifest.shards:
        _check(file_in(folder, shard.file), shard.sha256, shard.bytes)
        note()
    if manifest.card_sha256:
        _check(file_in(folder, CARD), manifest.card_sha256)
    listed = {shard.file for shard in manifest.shards}
    strangers = sorted(file.name for file in folder.glob("shard-*.nc") if file.name not in listed)
    if strangers:
        raise SpecificationError(
            f"{folder / strangers[0]} is not in the manifest: run dataset generate again, or delete it"
        )
    if not (manifest.is_complete and manifest.card_sha256):
        raise SpecificationError(
            f"{folder} has {manifest.made} of {manifest.records} records: run dataset generate again"
        )
    for number in again.tolist():
        _compare(spec, manifest, folder, manifest.shards[number])
        note()
    return manifest


def _check(file: Path, sha256: str, size: int | None = None) -> None:
    if not file.is_file():
        raise SpecificationError(f"{file} is missing: dataset generate makes it again")
    with open(file, "rb") as content:
        found = hashlib.file_digest(content, "sha256").hexdigest()
    if found != sha256 or size not in (None, file.stat().st_size):
        raise SpecificationError(f"{file} is not as it was written: delete it, and dataset generate makes it again")


def _compare(spec: Specification, manifest: Manifest, folder: Path, shard: Written) -> None:
    """Refuse a shard that differs when it is made again."""
    path = folder / shard.file
    records = generate_records(spec, shard.first, shard.first + shard.records)
    again, stored = records_as_dataset(spec, records), read_shard(folder, shard)
    for name, variable in again.variables.items():
        if not (name in stored and np.array_equal(stored[name], variable, equal_nan=variable.dtype.kind == "f")):
            versions = ", ".join(f"{library} {number}" for library, number in manifest.versions.items())
            raise SpecificationError(f"{path}: {name} differs when it is made again (it was made with {versions})")
    for name, number in records.counts.items():
        if getattr(shard, name) != number:
            raise SpecificationError(
                f"{path}: {name} is {number} when it is made again, and the manifest states {getattr(shard, name)}: "
                "put a copy of the manifest back"
            )

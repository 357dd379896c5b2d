"""The manifest of a data set: its specification, versions, and complete files."""

from __future__ import annotations

import functools
import hashlib
import json
import platform
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_type_hints

from tactile_bayes.datasets.shard import Written, file_in, shard_file
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.datasets.specification_reading import read_text
from tactile_bayes.errors import SpecificationError
from tactile_bayes.tasks import check_format, write_atomically
from tactile_bayes.tasks.documents import read_json

MANIFEST = "manifest.json"

_FORMAT = 2  # version of the format; version 1 had other random numbers for the same seed
_CORRECTION = (
    "put a copy of it back, or run dataset generate with the same specification into another folder, which makes the "
    "same files again"
)
_OF_SPECIFICATION = ("name", "specification_sha256", "seed", "records", "shard_records")
_version_of = functools.cache(version)  # which reads a folder of files each time
_LIBRARIES = ("tactile-bayes", "numpy", "scipy", "xarray", "h5netcdf", "h5py")


@dataclass(frozen=True)
class Manifest:
    """Manifest of a data set, a JSON file beside its shards."""

    name: str
    specification: str  # its text
    specification_sha256: str  # of its meaning
    seed: int
    records: int
    shard_records: int
    versions: Mapping[str, str]  # of Python and of the libraries on which numbers and bytes depend
    shards: tuple[Written, ...] = ()  # complete files, by number
    card_sha256: str = ""  # of the data card; "" as long as there is none

    @classmethod
    def of(cls, spec: Specification) -> Manifest:
        """Return the manifest of a data set without files."""
        return cls(spec.name, spec.text, spec.sha256, spec.seed, spec.records, spec.shard_records, versions_here())

    def having(self, written: Written) -> Manifest:
        """Return the manifest with a further file."""
        return replace(self, shards=tuple(sorted([*self.shards, written], key=lambda shard: shard.first)))

    @property
    def made(self) -> int:
        """Number of records in the existing files."""
        return sum(shard.records for shard in self.shards)

    @property
    def is_complete(self) -> bool:
        return self.made == self.records

    @property
    def redrawn(self) -> Counter[str]:
        """Numbers of rejected draws by reason, in the existing files."""
        return sum((Counter(shard.redrawn) for shard in self.shards), Counter())

    @property
    def strained(self) -> int:
        """Number of records with a sweep in which the strain of the rod exceeds the model."""
        return sum(shard.strained for shard in self.shards)

    @property
    def untouched(self) -> int:
        """Number of sweeps without a sample in contact."""
        return sum(shard.untouched for shard in self.shards)


def versions_here() -> dict[str, str]:
    return {"python": platform.python_version(), **{name: _version_of(name) for name in _LIBRARIES}}


def write_manifest(manifest: Manifest, folder: Path) -> None:
    """Write a manifest atomically."""
    with write_atomically(file_in(folder, MANIFEST)) as temporary:
        temporary.write_bytes(_content(_table(manifest)))


def _table(manifest: Manifest) -> dict[str, Any]:
    """Return the entries of the file, without its checksum."""
    sums = {"complete": manifest.is_complete, "redrawn": dict(sorted(manifest.redrawn.items()))}
    sums |= {"strained": manifest.strained, "untouched": manifest.untouched}
    return {"format": _FORMAT, **sums, **asdict(manifest), "shards": [shard._asdict() for shard in manifest.shards]}


def read_manifest(folder: Path) -> Manifest:
    """Read the manifest in a folder."""
    path = file_in(folder, MANIFEST)
    try:
        content = path.read_bytes()
        table = read_json(content, "it")
        table.pop("sha256")
        if content != _content(table):
            raise SpecificationError(f"{path} is not as it was written, its own checksum differs: {_CORRECTION}")
        again = "or make it again in another folder"
        check_format(table["format"], _FORMAT, lambda what: SpecificationError(f"{path} {what}: {again}"), _FORMAT)
        shards = tuple(Written(**shard) for shard in table["shards"])
        rest = {name: table[name] for name in Manifest.__dataclass_fields__ if name != "shards"}
        manifest = Manifest(**rest, shards=shards)
        _check(manifest)
        _refuse_other(table, _table(manifest))
        return manifest
    except (FileNotFoundError, NotADirectoryError):
        lost = f", but shards: {_CORRECTION}" if any(folder.glob("shard-*.nc")) else ""
        raise SpecificationError(f"{folder} holds no data set: there is no {MANIFEST}{lost}") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, SpecificationError):
            raise
        raise SpecificationError(f"{path} is no manifest of a data set ({error}): {_CORRECTION}") from error


def _check(manifest: Manifest) -> None:
    """Check that entries have their types, and that shards are those of the records of the specification, in order."""
    _refuse_unless_typed(manifest)
    if not all(isinstance(text, str) for text in [*manifest.versions.keys(), *manifest.versions.values()]):
        raise ValueError("its versions are not texts")
    try:
        stated = vars(Manifest.of(read_text(manifest.specification)))
    except SpecificationError as error:
        raise ValueError(f"its specification is none: {error}") from error
    _refuse_other(vars(manifest), {name: stated[name] for name in _OF_SPECIFICATION})
    before = -1
    for shard in manifest.shards:
        _refuse_unless_typed(shard)
        number, offset = divmod(shard.first, manifest.shard_records)
        records = min(manifest.shard_records, manifest.records - shard.first)
        if offset or number <= before or shard.records != records or shard.file != shard_file(number):
            raise ValueError(f"{shard.file!r} from record {shard.first} on is no file of this data set")
        if not re.fullmatch("[0-9a-f]{64}", shard.sha256):
            raise ValueError(f"{shard.file} has no SHA-256")
        if shard.strained > shard.records:
            raise ValueError(f"{shard.file} has {shard.records} records, and {shard.strained} of them are strained")
        before = number


def _refuse_other(entries: Mapping[str, Any], right: Mapping[str, Any]) -> None:
    """Refuse entries that differ from those which follow from the rest of the manifest."""
    for name, value in right.items():
        if entries[name] != value or isinstance(entries[name], bool) is not isinstance(value, bool):
            raise ValueError(f"its {name} is {entries[name]!r}, and {value!r} follows from its other entries")


def _refuse_unless_typed(of: Manifest | Written) -> None:
    """Refuse texts and counts that are none."""
    entries = {name: (getattr(of, name), kind) for name, kind in get_type_hints(type(of)).items()}
    if isinstance(of, Written):
        entries |= {reason: (count, int) for reason, count in of.redrawn.items()}
    for name, (value, kind) in entries.items():
        if kind in (str, int) and (type(value) is not kind or (kind is int and value < 0)):
            raise ValueError(f"its {name} is {value!r}")


def _content(table: Mapping[str, Any]) -> bytes:
    """Return the bytes of the file, which ends with a checksum of its content."""
    digest = hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()
    return (json.dumps({**table, "sha256": digest}, indent=1, ensure_ascii=False) + "\n").encode()

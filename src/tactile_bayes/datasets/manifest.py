"""The manifest of a data set: what it was made from, and which of its files are whole."""

from __future__ import annotations

import hashlib
import json
import platform
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tactile_bayes.datasets.shard import Written
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.errors import SpecificationError
from tactile_bayes.tasks import write_atomically

__all__ = ["MANIFEST", "Manifest", "read_manifest", "versions_here", "write_manifest"]

MANIFEST = "manifest.json"

_FORMAT = 2
"""1 had other random numbers of the same seed."""
_REMEDY = (
    "put a copy of it back, or run dataset generate with the same specification into another folder, which makes the "
    "same files again"
)
_LIBRARIES = ("tactile-bayes", "numpy", "scipy", "xarray", "h5netcdf", "h5py")


@dataclass(frozen=True)
class Manifest:
    """What lies beside the shards of a data set, as JSON.

    Attributes
    ----------
    name : str
    specification : str
        Its text.
    specification_sha256 : str
        Of what it says.
    seed, records, shard_records : int
        As the specification says.
    versions : mapping of str to str
        Of Python and the libraries that the numbers and the bytes of the files follow from.
    shards : tuple of Written
        Files that are whole, by number.
    card_sha256 : str
        Of the data card; "" as long as there is none.
    """

    name: str
    specification: str
    specification_sha256: str
    seed: int
    records: int
    shard_records: int
    versions: Mapping[str, str]
    shards: tuple[Written, ...] = field(default=())
    card_sha256: str = ""

    @classmethod
    def of(cls, spec: Specification) -> Manifest:
        """The manifest of a data set of which nothing is there yet."""
        return cls(spec.name, spec.text, spec.sha256, spec.seed, spec.records, spec.shard_records, versions_here())

    def having(self, written: Iterable[Written]) -> Manifest:
        """With more files."""
        return replace(self, shards=tuple(sorted([*self.shards, *written], key=lambda shard: shard.first)))

    @property
    def is_complete(self) -> bool:
        return sum(shard.records for shard in self.shards) == self.records

    @property
    def redrawn(self) -> Counter[str]:
        """Draws that came to nothing, by the reason, in the files that are there."""
        return sum((Counter(shard.redrawn) for shard in self.shards), Counter())

    @property
    def strained(self) -> int:
        """Records in these files with a sweep in which the rod is strained beyond the model."""
        return sum(shard.strained for shard in self.shards)

    @property
    def untouched(self) -> int:
        """Sweeps in these files without any sample in contact."""
        return sum(shard.untouched for shard in self.shards)


def versions_here() -> dict[str, str]:
    return {"python": platform.python_version(), **{name: version(name) for name in _LIBRARIES}}


def write_manifest(manifest: Manifest, folder: Path) -> None:
    """Write a manifest whole."""
    table = {"format": _FORMAT, "complete": manifest.is_complete, "redrawn": dict(sorted(manifest.redrawn.items()))}
    table |= {"strained": manifest.strained, "untouched": manifest.untouched}
    table |= {**asdict(manifest), "shards": [shard._asdict() for shard in manifest.shards]}
    with write_atomically(folder / MANIFEST) as temporary:
        temporary.write_bytes(_content(table))


def read_manifest(folder: Path) -> Manifest:
    """The manifest in a folder.

    Raises
    ------
    SpecificationError
        If there is none, or it is not as it was written.
    """
    path = folder / MANIFEST
    try:
        content = path.read_bytes()
        table = json.loads(content)
        table.pop("sha256")
        if content != _content(table):
            raise SpecificationError(f"{path} is not as it was written, its own checksum differs: {_REMEDY}")
        if table["format"] != _FORMAT:
            raise SpecificationError(
                f"{path} has format {table['format']}, and this version reads format {_FORMAT}: take the version that "
                "it was made with, or make it again in another folder"
            )
        shards = tuple(Written(**shard) for shard in table["shards"])
        rest = {name: table[name] for name in Manifest.__dataclass_fields__ if name != "shards"}
        return Manifest(**rest, shards=shards)
    except (FileNotFoundError, NotADirectoryError):
        lost = f", but shards: {_REMEDY}" if any(folder.glob("shard-*.nc")) else ""
        raise SpecificationError(f"{folder} holds no data set: there is no {MANIFEST}{lost}") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, SpecificationError):
            raise
        raise SpecificationError(f"{path} is no manifest of a data set ({error}): {_REMEDY}") from error


def _content(table: Mapping[str, Any]) -> bytes:
    """The file, which ends with a checksum of what it says."""
    digest = hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()
    return (json.dumps({**table, "sha256": digest}, indent=1, ensure_ascii=False) + "\n").encode()

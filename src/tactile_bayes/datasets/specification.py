"""The specification of a data set: contours, sweeps, load cell and number of records; its text and its meaning."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tactile_bayes.arrays import Index
from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.contours.family import ContourFamily
from tactile_bayes.datasets.variations import Variation
from tactile_bayes.errors import ParameterError, SpecificationError
from tactile_bayes.record import Frame
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.tasks.documents import read_toml, toml_key, toml_value

UNNAMED = "unnamed"

SCAN = {"bases": [[0.0, 0.0]], "directions": ["forward", "backward"], "samples": 180, "margin": 0.1}
# Default values of keys; a specification with an explicit default is the same.
DEFAULTS = {
    "name": UNNAMED,
    "description": "",
    "shard_records": 500,
    "precision": "double",
    "each_contour": False,
    "scan": SCAN,
    "load_cell": {"frame": "fixed"},
    "rod": {"diameter": 0.0},
    "unknown": "nothing",
}
_AT_HAND = 2**14  # number of samples in a block: a column of them takes 128 kB


@dataclass(frozen=True)
class Group:
    """Contours of one family, with a distribution for each parameter."""

    family: str
    weight: float
    distributions: Mapping[str, Variation]


@dataclass(frozen=True)
class Drive:
    """Drive angles of a sweep: `samples` evenly spaced ones from `begin` to `end` [rad], or about the contact, with
    `margin` before first contact and after snap-off, in shares of the angle between them.
    """

    samples: int
    begin: float | None
    end: float | None
    margin: float


@dataclass(frozen=True)
class Specification:
    """Complete description of a data set; `read_specification` makes one.

    Attributes
    ----------
    text, name, description : str
        Text of the specification; name and description of the data set.
    records, shard_records, seed : int
        Number of records in all, and in each file; seed of the random numbers.
    groups : tuple of Group
        Families of contours.
    each_group : bool
        Whether the groups are used in turn, and not drawn.
    rod : mapping of str to Variation
        Numbers of `Rod`, of a dimensionless data set without length and flexural_rigidity; or youngs_modulus [N/m²].
    bases : tuple of (Variation, Variation)
        Pivots (x, y) [m, or rod lengths], about each of which there are sweeps in all of the `directions`.
    directions : tuple of str
    translations : tuple of mapping of str to Variation
        Sweeps in which the base is carried along a line, in place of pivots: base[0], base[1], travel or step [m, or
        rod lengths], heading, drive_angle, and turn, the change of the drive angle on the way [rad].
    drive : Drive
        Number of samples, and drive angles of rotations.
    load_cell : mapping of str to Variation
        Entries of a data sheet, in the units of the data set.
    unknown : mapping of str to Variation
        Deviations of the rig from what rod and load cell state, without those that are as stated.
    calibration : RigPrior, optional
        Joint distribution of those that a calibration has found.
    frame : {"fixed", "turning"}
        Frame of the load cell.
    single : bool
        Whether files contain numbers of 32 bits.

    Examples
    --------
    >>> from tactile_bayes.datasets import read_specification
    >>> read_specification({"records": 10, "seed": 1, "contours": [{"family": "circle", "r": 0.5, "q": 0.3}]}).shards
    1
    """

    text: str
    name: str
    description: str
    records: int
    shard_records: int
    seed: int
    groups: tuple[Group, ...]
    each_group: bool
    rod: Mapping[str, Variation]
    bases: tuple[tuple[Variation, Variation], ...]
    directions: tuple[str, ...]
    translations: tuple[Mapping[str, Variation], ...]
    drive: Drive
    load_cell: Mapping[str, Variation]
    unknown: Mapping[str, Variation]
    calibration: RigPrior | None
    frame: Frame
    single: bool

    @property
    def units(self) -> str:
        """ "SI" or "dimensionless"."""
        return "SI" if "length" in self.rod else "dimensionless"

    @property
    def sha256(self) -> str:
        """SHA-256 of the meaning of the specification; see `meaning`."""
        return hashlib.sha256(json.dumps(meaning(self.text), sort_keys=True).encode()).hexdigest()

    @property
    def has_thickness(self) -> bool:
        """True if the rod has, or may have, a diameter."""
        return self._may_have("diameter")

    @property
    def has_taper(self) -> bool:
        """True if the rod is, or may be, tapered."""
        return self._may_have("taper") or "taper" in self.unknown

    def _may_have(self, name: str) -> bool:
        said = self.rod.get(name)
        return said is not None and (said.kind not in ("constant", "each") or any(said.numbers))

    @property
    def friction(self) -> float | None:
        """Coulomb's coefficient if it is known, None if it differs from record to record."""
        said = self.unknown.get("friction")
        return 0.0 if said is None else said.numbers[0] if said.kind == "constant" else None

    @property
    def shards(self) -> int:
        return -(-self.records // self.shard_records)

    @property
    def sweeps(self) -> tuple[tuple[int, str], ...]:
        """Pivot and direction of each sweep of a record; empty if the base is carried."""
        return tuple((base, direction) for base in range(len(self.bases)) for direction in self.directions)

    @property
    def sweep_count(self) -> int:
        """Number of sweeps of a record."""
        return len(self.sweeps) + len(self.translations)

    def blocks(self, records: int) -> list[Index]:
        """Split the indices of records into blocks whose samples fit into a processor's cache."""
        samples = records * self.sweep_count * self.drive.samples
        return np.array_split(np.arange(records), max(1, -(-samples // _AT_HAND)))

    @property
    def distributions(self) -> tuple[tuple[str, Variation], ...]:
        """All distributions with their keys, in the order in which numbers are drawn."""
        tables = {
            **{f"contours[{g}].": group.distributions for g, group in enumerate(self.groups)},
            "rod.": self.rod,
            **{f"scan.bases[{b}]": {"[0]": x, "[1]": y} for b, (x, y) in enumerate(self.bases)},
            **{f"scan.translations[{k}].": one for k, one in enumerate(self.translations)},
            "load_cell.": self.load_cell,
            "unknown.": self.unknown,
        }
        return tuple(
            (prefix + name, distribution)
            for prefix, distributions in tables.items()
            for name, distribution in distributions.items()
        )

    @property
    def numbers(self) -> tuple[str, ...]:
        """Keys of all numbers of a record: those of distributions, and a flexural rigidity that follows from others."""
        follows = ("rod.flexural_rigidity",) if "youngs_modulus" in self.rod else ()
        return (*(key for key, _ in self.distributions), *follows)

    @property
    def combinations(self) -> int:
        """Number of combinations of the entries of all lists."""
        return math.prod(count for _, count in self.lists)

    @property
    def lists(self) -> tuple[tuple[str, int], ...]:
        """Keys of the lists that are used in turn, with their lengths: the last changes fastest."""
        found = {"contours": len(self.groups)} if self.each_group else {}
        for key, distribution in self.distributions:
            axis, count = distribution.axis or key, len(distribution.numbers)
            if distribution.kind == "each" and found.setdefault(axis, count) != count:
                raise SpecificationError(
                    f"{key} has {count} numbers, and another list on the axis {distribution.axis!r} has {found[axis]}: "
                    "lists that advance in step are equally long"
                )
        return tuple(found.items())


def meaning(text: str) -> dict[str, Any]:
    """Return the meaning of a specification's text, without comments, layout, notation and written defaults."""
    said = without(DEFAULTS, read_toml(text))
    said["contours"] = [
        without({"weight": 1.0, **left_out(FAMILIES[group["family"]])}, group) for group in said["contours"]
    ]
    return dict(canonical(said))


def left_out(family: ContourFamily) -> dict[str, Any]:
    """Default values of the parameters of a family: x_c = 0, and standard normal weights."""
    standard = {"normal": [0.0, 1.0]}
    return {
        "x_c": 0.0,
        **{n: standard for n, entry in family.table.items() if entry.prior and entry.prior.distribution == "norm"},
    }


def canonical(value: Any) -> Any:
    """Return a TOML value with one kind of number."""
    if isinstance(value, dict):
        return {key: canonical(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [canonical(inner) for inner in value]
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) <= 2**53:
        return float(value)
    return value


def without(defaults: Mapping[str, Any], said: Mapping[str, Any]) -> dict[str, Any]:
    """Remove keys with default values, and tables that contain no others."""
    found = {}
    for key, value in said.items():
        default = defaults.get(key)
        if isinstance(default, Mapping) and isinstance(value, Mapping):
            value = without(default, value)
            default = {}
        if canonical(value) != canonical(default):
            found[key] = value
    return found


def entries(said: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a canonical specification says by its keys, as `contours[0].q`; a distribution is one value."""
    tables = {key: value for key, value in said.items() if isinstance(value, Mapping)}
    tables |= {f"contours[{k}]": group for k, group in enumerate(said["contours"])}
    found = {key: value for key, value in said.items() if key not in ("contours", *tables)}
    return found | {f"{table}.{name}": value for table, inner in tables.items() for name, value in inner.items()}


def toml_of(table: Mapping[str, Any]) -> str:
    """Convert a mapping of numbers, words, lists and mappings to TOML, with inline values."""
    try:
        return "".join(f"{toml_key(str(key))} = {toml_value(value)}\n" for key, value in table.items())
    except ParameterError as error:
        raise SpecificationError(f"a specification cannot be written: {error}") from error

"""The specification of a data set: contours, sweeps, load cell, and the number of records."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tactile_bayes.arrays import Index
from tactile_bayes.checks import check_switch
from tactile_bayes.datasets.specification_text import meaning
from tactile_bayes.datasets.variations import Variation
from tactile_bayes.errors import SpecificationError
from tactile_bayes.record import Frame
from tactile_bayes.rig.rig_prior import RigPrior

_AT_HAND = 2**14  # number of samples in a block: a column of them takes 128 kB


@dataclass(frozen=True)
class Group:
    """Contours of one family, with a distribution for each parameter."""

    family: str
    weight: float
    distributions: Mapping[str, Variation]


@dataclass(frozen=True)
class Drive:
    """Drive angles of a sweep: `samples` evenly spaced ones from `begin` to `end` [rad], or about the contact.

    About the contact, `margin` is the range before first contact and after snap-off, in shares of the angle between
    them.
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
    text : str
        Text of the specification.
    name, description : str
        Name and description of the data set.
    records, shard_records : int
        Number of records in all, and in each file.
    seed : int
        Seed of the random numbers.
    groups : tuple of Group
        Families of contours.
    each_group : bool
        Whether the groups are used in turn, and not drawn.
    rod : mapping of str to Variation
        Numbers of `Rod`, of a dimensionless data set without length and flexural_rigidity; or youngs_modulus [N/m²].
    bases : tuple of (Variation, Variation)
        Pivots (x, y) [m, or rod lengths].
    directions : tuple of str
        Directions of the sweeps about each pivot.
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

    def __post_init__(self) -> None:
        check_switch("each_group", self.each_group)
        check_switch("single", self.single)

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
        """Return whether a quantity of the rod may differ from zero."""
        distribution = self.rod.get(name)
        return distribution is not None and (distribution.is_drawn or any(distribution.numbers))

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

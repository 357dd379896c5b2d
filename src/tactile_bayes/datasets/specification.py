"""The specification of a data set: what is drawn, how it is swept and measured, and how many times."""

from __future__ import annotations

import hashlib
import json
import math
import os
import tomllib
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.datasets.families import FAMILIES, FLANKS, Family, rule_of
from tactile_bayes.datasets.laws import Law, law_of
from tactile_bayes.datasets.specification_text import canonical, toml_of, without
from tactile_bayes.errors import ContourError, ParameterError, SpecificationError
from tactile_bayes.load_cell import LoadCell, OrnsteinUhlenbeck
from tactile_bayes.record import FRAMES, LOAD_CELL_UNITS, Frame
from tactile_bayes.rod import Rod

__all__ = ["UNNAMED", "Drive", "Group", "Specification", "meaning", "read_specification", "read_text"]

Floats = NDArray[np.float64]

UNNAMED = "unnamed"

_MOST_SHARDS = 1_000_000
_MOST_NAMED = 8
"""Keys in a refusal of one that there is not."""

_LARGEST_SEED = 2**63 - 1

_AT_HAND = 2**14
"""Samples in a block: a column of them is 128 kB."""

_SCAN = {
    "bases": [[0.0, 0.0]],
    "directions": ["forward", "backward"],
    "samples": 180,
    "margin": 0.1,
    "friction": 0.0,
}
_DEFAULTS = {
    "name": UNNAMED,
    "description": "",
    "shard_records": 500,
    "precision": "double",
    "each_contour": False,
    "scan": _SCAN,
    "load_cell": {"frame": "fixed"},
    "rod": {"diameter": 0.0},
}
"""What is meant where a key is left out; written out it says the same."""

_TABLES: Mapping[str, Iterable[str]] = {
    "": ("name", "description", "records", "seed", "shard_records", "precision", "each_contour"),
    "rod.": ("length", "flexural_rigidity", "diameter"),
    "scan.": ("bases", "directions", "samples", "from_degrees", "to_degrees", "margin", "friction"),
    "load_cell.": ("frame", *LOAD_CELL_UNITS),
}
"""The keys of each table."""


@dataclass(frozen=True)
class Group:
    """Contours of one family, with a law for each parameter."""

    family: str
    weight: float
    laws: Mapping[str, Law]


@dataclass(frozen=True)
class Drive:
    """The drive angles of a sweep: between two of them, or about the contact.

    Parameters
    ----------
    samples : int
        In each sweep, evenly spaced.
    begin, end : float, optional
        Least and greatest angle [rad]; backward sweeps go from the greatest to the least.
    margin : float
        Where those are left out: unloaded samples before first contact and after snap-off, each as a share of the
        angle between them.
    """

    samples: int
    begin: float | None
    end: float | None
    margin: float


@dataclass(frozen=True)
class Specification:
    """All that the numbers of a data set follow from; `read_specification` makes one.

    Attributes
    ----------
    text : str
        What was read.
    name, description : str
    records, shard_records : int
        How many in all, and in each file.
    seed : int
    groups : tuple of Group
    each_group : bool
        Whether the groups come one after the other, and are not drawn.
    rod : mapping of str to Law
        length, flexural_rigidity and diameter; empty where everything is in rod lengths.
    bases : tuple of (Law, Law)
    directions : tuple of str
    drive : Drive
    friction : float
    load_cell : mapping of str to Law
        Entries of a data sheet.
    frame : {"fixed", "turning"}
        Of the load cell.
    single : bool
        Whether files hold numbers of 32 bits.
    """

    text: str
    name: str
    description: str
    records: int
    shard_records: int
    seed: int
    groups: tuple[Group, ...]
    each_group: bool
    rod: Mapping[str, Law]
    bases: tuple[tuple[Law, Law], ...]
    directions: tuple[str, ...]
    drive: Drive
    friction: float
    load_cell: Mapping[str, Law]
    frame: Frame
    single: bool

    @property
    def units(self) -> str:
        """ "SI" or "dimensionless"."""
        return "SI" if self.rod else "dimensionless"

    @property
    def sha256(self) -> str:
        """Of what the specification means; see `meaning`."""
        return hashlib.sha256(json.dumps(meaning(self.text), sort_keys=True).encode()).hexdigest()

    @property
    def has_thickness(self) -> bool:
        """Whether the rod has a diameter, or may have one."""
        return bool(self.rod) and (self.rod["diameter"].is_drawn or any(self.rod["diameter"].numbers))

    @property
    def shards(self) -> int:
        return -(-self.records // self.shard_records)

    @property
    def sweeps(self) -> tuple[tuple[int, str], ...]:
        """Base and direction of each sweep of a record."""
        return tuple((base, direction) for base in range(len(self.bases)) for direction in self.directions)

    def blocks(self, records: int) -> list[NDArray[np.intp]]:
        """Indices of so many records in blocks, each with no more samples than a processor has at hand at once."""
        samples = records * len(self.sweeps) * self.drive.samples
        return np.array_split(np.arange(records), max(1, -(-samples // _AT_HAND)))

    @property
    def laws(self) -> tuple[tuple[str, Law], ...]:
        """Every law with its key, in the order in which numbers are drawn."""
        found = [
            (f"contours[{g}].{name}", law) for g, group in enumerate(self.groups) for name, law in group.laws.items()
        ]
        found += [(f"rod.{name}", law) for name, law in self.rod.items()]
        for b, pair in enumerate(self.bases):
            found += [(f"scan.bases[{b}][{axis}]", law) for axis, law in enumerate(pair)]
        return (*found, *((f"load_cell.{name}", law) for name, law in self.load_cell.items()))

    @property
    def combinations(self) -> int:
        """Of the entries of all lists."""
        return math.prod(count for _, count in self.lists)

    @property
    def lists(self) -> tuple[tuple[str, int], ...]:
        """What comes one after the other, with the number of turns: the last changes fastest."""
        found = {"contours": len(self.groups)} if self.each_group else {}
        for key, law in self.laws:
            if law.kind == "each" and found.setdefault(law.axis or key, len(law.numbers)) != len(law.numbers):
                raise SpecificationError(
                    f"{key} has {len(law.numbers)} numbers, and another list on the axis {law.axis!r} has "
                    f"{found[law.axis or key]}: lists that advance in step are equally long"
                )
        return tuple(found.items())


def read_specification(source: str | os.PathLike[str] | Mapping[str, Any]) -> Specification:
    """The specification in a TOML file, or in a mapping of the same form.

    Parameters
    ----------
    source : path-like or mapping

    Raises
    ------
    SpecificationError
        If a key is unknown, missing or has an impossible value; the message names it.
    OSError
        If there is no such file.

    Examples
    --------
    >>> contours = [{"family": "parabola", "a": {"uniform": [0.3, 3.0]}, "q": {"uniform": [0.3, 0.7]}}]
    >>> spec = read_specification({"records": 100, "seed": 1, "contours": contours})
    >>> spec.shards, spec.units
    (1, 'dimensionless')
    """
    if isinstance(source, Mapping):
        text, where = toml_of(source), "specification"
    else:
        where = str(source)
        try:
            text = Path(source).read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise SpecificationError(f"{where}: not a text in UTF-8: {error.reason} at byte {error.start}") from error
    try:
        return read_text(text)
    except SpecificationError as error:
        raise SpecificationError(f"{where}: {error}") from error


def meaning(text: str) -> dict[str, Any]:
    """What the text of a specification says; comments, layout, whether a number is written 1 or 1.0, and whether a key
    is left out or written with the value that it has then, do not count."""
    said = without(_DEFAULTS, tomllib.loads(text))
    said["contours"] = [
        without({"weight": 1.0, **FAMILIES[group["family"]].optional}, group) for group in said["contours"]
    ]
    return dict(canonical(said))


def read_text(text: str) -> Specification:
    """The specification that a TOML text states; see `read_specification`."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SpecificationError(f"not TOML: {error}") from error
    if not table:
        raise SpecificationError("it is empty: `tactile-bayes dataset example` prints one to start from")
    return _Reader(table).specification(text)


class _Reader:
    """Takes a parsed specification apart."""

    def __init__(self, table: dict[str, Any]) -> None:
        self.table = table

    def specification(self, text: str) -> Specification:
        table = self.table
        _refuse_unknown(table, (*_TABLES[""], "contours", "rod", "scan", "load_cell"), "")
        each = table.get("each_contour", _DEFAULTS["each_contour"])
        if not isinstance(each, bool):
            raise SpecificationError(f"each_contour is {each!r}: write true or false")
        precision = table.get("precision", _DEFAULTS["precision"])
        if precision not in ("double", "single"):
            raise SpecificationError(f"precision is {precision!r}: write 'double' or 'single'")
        scan = _table(table, "scan")
        _refuse_unknown(scan, _TABLES["scan."], "scan.")
        load_cell = dict(_table(table, "load_cell"))
        frame = load_cell.pop("frame", "fixed")
        if not isinstance(frame, str) or frame not in FRAMES:
            raise SpecificationError(f"load_cell.frame is {frame!r}: write 'fixed' or 'turning'")
        found = Specification(
            text=text,
            name=_text(table, "name"),
            description=_text(table, "description"),
            records=1,
            shard_records=_whole(table.get("shard_records", _DEFAULTS["shard_records"]), "shard_records", 1, 100_000),
            seed=_whole(table.get("seed"), "seed", 0, _LARGEST_SEED),
            groups=self._groups(each),
            each_group=each,
            rod=self._rod(),
            bases=_bases(scan.get("bases", _SCAN["bases"])),
            directions=_directions(scan.get("directions", _SCAN["directions"])),
            drive=_drive(scan),
            friction=_number(scan.get("friction", _SCAN["friction"]), "scan.friction", 0.0, 0.84),
            load_cell=_load_cell(load_cell),
            frame=frame,
            single=precision == "single",
        )
        turns = found.combinations
        records = table.get("records", turns if found.lists else None)
        records = _whole(records, "records", 1, _MOST_SHARDS * found.shard_records)
        if records % turns:
            raise SpecificationError(
                f"records is {records}, but the lists of 'each' make {turns} combinations: give a multiple of it"
            )
        return Specification(**{**vars(found), "records": records})

    def _groups(self, each: bool) -> tuple[Group, ...]:
        groups = self.table.get("contours")
        if isinstance(groups, dict):
            raise SpecificationError(
                "contours is one table: write [[contours]], in two pairs of brackets, for each family"
            )
        if not isinstance(groups, list) or not groups or not all(isinstance(group, dict) for group in groups):
            raise SpecificationError("there are no contours: give at least one table [[contours]], with its family")
        found = []
        for index, group in enumerate(groups):
            key = f"contours[{index}]"
            name = group.get("family")
            if not isinstance(name, str) or name not in FAMILIES:
                joined = f"{' or '.join(FLANKS)} on either side, as in 'parabola/circle'"
                found_is = f"is {name!r}" if "family" in group else "is missing"
                raise SpecificationError(
                    f"{key}.family {found_is}: choose from {', '.join(FLANKS)}, shape-free, or two flanks ({joined})"
                )
            family = FAMILIES[name]
            _refuse_unknown(group, ("family", "weight", *family.parameters, *family.optional), f"{key}.")
            missing = [parameter for parameter in family.parameters if parameter not in group]
            if missing:
                raise SpecificationError(f"{key} is a {name} and has no {missing[0]}: give a number or a law")
            weight = _number(group.get("weight", 1.0), f"{key}.weight", 0.0, 1e9)
            if weight == 0.0 or (each and "weight" in group):
                why = "it must be positive" if not each else "with each_contour every family comes as often"
                raise SpecificationError(f"{key}.weight is {weight!r}: {why}")
            values = {**family.optional, **group}
            names = (*family.parameters, *family.optional)
            laws = {parameter: law_of(values[parameter], f"{key}.{parameter}") for parameter in names}
            _refuse_negative({n: law for n, law in laws.items() if n in ("radius", "length_scale")}, f"{key}.")
            _refuse_no_contour(family, laws, key)
            found.append(Group(name, weight, laws))
        return tuple(found)

    def _rod(self) -> dict[str, Law]:
        rod = _table(self.table, "rod")
        _refuse_unknown(rod, _TABLES["rod."], "rod.")
        if not rod:
            return {}
        if "length" not in rod or "flexural_rigidity" not in rod:
            raise SpecificationError(
                "rod needs length [m] and flexural_rigidity [N m²]; without [rod] lengths are in rod lengths"
            )
        laws = {name: law_of(rod.get(name, 0.0), f"rod.{name}") for name in _TABLES["rod."]}
        _refuse_negative(laws, "rod.", or_zero={"diameter"})
        try:
            Rod(*(law.at(np.full(1, 0.5), np.zeros(1, dtype=np.intp))[0] for law in laws.values()))
        except ParameterError as error:
            raise SpecificationError(f"rod: {error}") from error
        return laws


def _load_cell(table: Mapping[str, Any]) -> dict[str, Law]:
    _refuse_unknown(table, _TABLES["load_cell."], "load_cell.")
    laws = {name: law_of(value, f"load_cell.{name}") for name, value in table.items()}
    if any(name.startswith("ornstein_uhlenbeck") for name in laws):
        laws.setdefault("ornstein_uhlenbeck_time", Law("constant", (OrnsteinUhlenbeck().time,)))
    for share in (0.05, 0.5, 0.95):
        entries = {name: float(law.at(np.full(1, share), np.zeros(1, dtype=np.intp))[0]) for name, law in laws.items()}
        try:
            LoadCell.from_entries(entries)
        except ParameterError as error:
            raise SpecificationError(f"load_cell: {error}") from error
    signed = ("bias_holding", "bias_force", "gain_", "lever_", "correlation_", "drive_angle_o", "drive_angle_b")
    unsigned = {name: law for name, law in laws.items() if not name.startswith(signed)}
    _refuse_negative(unsigned, "load_cell.", or_zero=set(unsigned))
    return laws


def _refuse_no_contour(family: Family, laws: Mapping[str, Law], key: str) -> None:
    """Refuse parameters that no contour has, by what a law may give at its ends; draws of laws without end are
    tried as they come."""
    for name, law in laws.items():
        numbers = law.numbers
        if law.kind in ("normal", "log_normal"):
            numbers = () if law.numbers[1] else law.numbers[:1]
        for number in numbers:
            try:
                family.refuse(name, number)
            except ContourError as error:
                verb = "is" if law.kind == "constant" else "may be"
                raise SpecificationError(f"{key}.{name} {verb} {number:g}: {rule_of(error)}") from error


def _refuse_negative(laws: Mapping[str, Law], prefix: str, or_zero: Container[str] = ()) -> None:
    for name, law in laws.items():
        low = _least(law)
        if low < 0.0 or (low == 0.0 and name not in or_zero):
            what = "negative" if low < 0.0 else "0"
            raise SpecificationError(f"{prefix}{name} may be {what}: choose a law of positive numbers, as log_normal")


def _least(law: Law) -> float:
    """The least number that a law may give; the median of a log_normal one, which is positive throughout."""
    if law.kind == "normal" and law.numbers[1]:
        return -math.inf
    return law.numbers[0] if law.kind in ("normal", "log_normal") else min(law.numbers)


def _bases(value: Any) -> tuple[tuple[Law, Law], ...]:
    if not isinstance(value, list) or not value or not all(isinstance(pair, list) and len(pair) == 2 for pair in value):
        raise SpecificationError(f"scan.bases is {value!r}: give a list of pivots, each [x, y]")
    return tuple((law_of(x, f"scan.bases[{i}][0]"), law_of(y, f"scan.bases[{i}][1]")) for i, (x, y) in enumerate(value))


def _directions(value: Any) -> tuple[str, ...]:
    senses = ("forward", "backward")
    if not isinstance(value, list) or not value or any(v not in senses for v in value) or len(set(value)) < len(value):
        raise SpecificationError(f"scan.directions is {value!r}: give 'forward', 'backward' or both")
    return tuple(value)


def _drive(scan: Mapping[str, Any]) -> Drive:
    samples = _whole(scan.get("samples", _SCAN["samples"]), "scan.samples", 2, 1_000_000)
    names = ("from_degrees", "to_degrees")
    given = [name for name in names if name in scan]
    if not given:
        return Drive(samples, None, None, _number(scan.get("margin", _SCAN["margin"]), "scan.margin", 0.0, 1.0))
    if len(given) == 1:
        missing = names[1 - names.index(given[0])]
        raise SpecificationError(
            f"scan.{missing} is missing: give it beside {given[0]}, or neither, and sweeps go from contact to snap-off"
        )
    if "margin" in scan:
        raise SpecificationError("scan has from_degrees and to_degrees, and a margin: leave the one or the others out")
    begin, end = (_number(scan[name], f"scan.{name}", -360.0, 360.0) for name in names)
    if not begin < end:
        raise SpecificationError(f"scan.from_degrees is {begin:g}, not below to_degrees, {end:g}")
    return Drive(samples, math.radians(begin), math.radians(end), 0.0)


def _table(table: Mapping[str, Any], key: str) -> dict[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, dict):
        raise SpecificationError(f"{key} is {value!r}: write it as a table, [{key}]")
    return value


def _text(table: Mapping[str, Any], key: str) -> str:
    value = table.get(key, _DEFAULTS[key])
    if not isinstance(value, str):
        raise SpecificationError(f"{key} is {value!r}: give a text")
    return value


def _whole(value: Any, key: str, least: int, most: int) -> int:
    if value is None:
        raise SpecificationError(f"{key} is missing: give a whole number")
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        largest = "2^63 - 1" if most == _LARGEST_SEED else most
        raise SpecificationError(f"{key} is {value!r}: give a whole number from {least} to {largest}")
    return value


def _number(value: Any, key: str, least: float, most: float) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not least <= value <= most:
        raise SpecificationError(f"{key} is {value!r}: give a number from {least:g} to {most:g}")
    return float(value)


def _refuse_unknown(table: Mapping[str, Any], known: Iterable[str], prefix: str) -> None:
    known = list(known)
    for key in table:
        if key in known:
            continue
        if elsewhere := [where for where, keys in _TABLES.items() if key in keys]:
            place = f"the table [{elsewhere[0][:-1]}]" if elsewhere[0] else "the top, above the first table"
            hint = f"its place is {place}"
        elif near := get_close_matches(key, known, n=1):
            hint = f"did you mean {near[0]!r}?"
        else:
            more = " and others: `tactile-bayes dataset example` names all" if len(known) > _MOST_NAMED else ""
            hint = f"there are {', '.join(known[:_MOST_NAMED])}{more}"
        raise SpecificationError(f"there is no key {prefix + key!r}: {hint}")

"""The reading of specifications: keys, values, and refusals that name them."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from tactile_bayes.checks import check_choice, check_kind, check_number, check_path, check_whole_number, refused
from tactile_bayes.contours.families import FAMILIES, FLANKS
from tactile_bayes.contours.family import ContourFamily
from tactile_bayes.datasets.deviations import deviations_of_table
from tactile_bayes.datasets.specification import DEFAULTS, SCAN, Drive, Group, Specification, left_out, toml_of
from tactile_bayes.datasets.variations import Variation, quantity_of, variation_of
from tactile_bayes.errors import ContourError, ParameterError, SpecificationError
from tactile_bayes.load_cell import LoadCell, OrnsteinUhlenbeck
from tactile_bayes.mechanics.rods.profile import STEEPEST_TAPER
from tactile_bayes.mechanics.rods.rod import Rod, round_rigidity
from tactile_bayes.record import FRAMES, LOAD_CELL_UNITS, Frame
from tactile_bayes.record.schema import SIGNED
from tactile_bayes.record.spelling import look_alikes, refuse_unknown_keys
from tactile_bayes.rig import Rig
from tactile_bayes.rig.rig_file import ROD_UNITS, calibration_of, entries_of_cell, keys_of, refuse_twice
from tactile_bayes.rig.rig_file import TABLES as OF_RIG
from tactile_bayes.tasks.documents import LARGEST, read_toml

_MOST_SHARDS = 1_000_000
_LARGEST_SEED = 2**63 - 1

# Keys of each table; those of a rig are as in rig.toml.
_TABLES: Mapping[str, Iterable[str]] = {
    "": ("name", "description", "records", "seed", "shard_records", "precision", "each_contour", "contours", "rig"),
    "scan": ("bases", "directions", "translations", "samples", "from_degrees", "to_degrees", "margin"),
    **{name: OF_RIG[name] for name in ("rod", "load_cell", "unknown", "calibration")},
}
_TRACED = ("shape", "rigidity_profile")  # what rig.toml states along a rod, and no data set draws
_OF_ROTATIONS = ("bases", "directions", "from_degrees", "to_degrees", "margin")
_OF_TRANSLATIONS = ("base", "heading", "drive_angle", "turn", "travel", "step")


def read_specification(source: str | os.PathLike[str] | Mapping[str, Any]) -> Specification:
    """Read the specification in a TOML file, or in a mapping of the same form.

    Parameters
    ----------
    source : path-like or mapping
        File, or its content as nested mappings. Its `rig` is the path of a rig.toml, relative to the file, or a `Rig`,
        in place of the tables of that rig.

    Returns
    -------
    Specification

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
    folder, where = Path(), "specification"
    if not isinstance(source, Mapping):
        path = check_path("the specification", source, "give a file, like 'study.toml', or its content as a mapping")
        folder, where = path.parent, str(path)
    try:
        if isinstance(source, Mapping):
            text = toml_of(_with_rig(source, folder))
        else:
            with open(path, encoding="utf-8-sig") as file:
                text = file.read(LARGEST + 1)
        return read_text(text, folder)
    except UnicodeDecodeError as error:
        raise SpecificationError(f"{where}: not a text in UTF-8: {error.reason} at byte {error.start}") from error
    except (ParameterError, SpecificationError) as error:
        raise SpecificationError(f"{where}: {error}") from error


def read_text(text: str, folder: Path = Path()) -> Specification:
    """Read the specification in a TOML text, with the rig that it names; see `read_specification`."""
    try:
        table = read_toml(text)
        if not table:
            raise SpecificationError("it is empty: `tactile-bayes dataset example` prints one to start from")
        if "rig" in table:
            table = _with_rig(table, folder)
            text = toml_of(table)
        return _specification(table, text)
    except ParameterError as error:
        raise SpecificationError(f"{error}{_look_alikes_at(str(error), text)}") from error


def _with_rig(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the tables of a specification with those of the rig that it names in place of its name."""
    own = dict(table)
    rig = own.pop("rig", None)
    if rig is None:
        return own
    refuse_twice(own)
    if not isinstance(rig, Rig):
        check_kind("rig", rig, str, "give the path of a rig.toml")
        rig = Rig.read(folder / rig)
    tables = {"unknown": {}, **rig.tables}
    return {**own, **{name: value for name, value in tables.items() if name != "file" and name not in own}}


def _look_alikes_at(message: str, text: str) -> str:
    """Name the characters that look like others in the line that a message of the parser names."""
    match = re.search(r"at line ([0-9]+)", message)
    return look_alikes(text.split("\n")[int(match[1]) - 1]) if match else ""


def rule_of(error: ContourError) -> str:
    """Return the rule that an error states, without the values, so that errors can be counted by rule."""
    message = str(error).partition("; found ")[0]
    return message.partition(": ")[2] or message


def _specification(table: Mapping[str, Any], text: str) -> Specification:
    refuse_unknown_keys(table, (*_TABLES[""], *list(_TABLES)[1:]), "", _TABLES)
    said = {**DEFAULTS, **table}
    check_kind("each_contour", said["each_contour"], bool, "write true or false")
    for key in ("name", "description"):
        check_kind(key, said[key], str, "give a text")
    scan, said_of_cell, said_of_rod = (_table(table, name) for name in ("scan", "load_cell", "rod"))
    frame = check_choice("load_cell.frame", said_of_cell.get("frame", "fixed"), FRAMES)
    is_si = "length" in said_of_rod
    rod, load_cell = _rod(said_of_rod, is_si), _load_cell(said_of_cell, is_si)
    translations = _translations(scan)
    bases = () if translations else _bases((SCAN | scan)["bases"])
    directions = () if translations else _directions((SCAN | scan)["directions"])
    calibration = calibration_of(_table(table, "calibration")) if "calibration" in table else None
    unknown = table.get("unknown")
    found = Specification(
        text=text,
        name=said["name"],
        description=said["description"],
        records=1,
        shard_records=_whole(said["shard_records"], "shard_records", 1, 100_000),
        seed=_whole(said.get("seed"), "seed", 0, _LARGEST_SEED),
        groups=_groups(said),
        each_group=said["each_contour"],
        rod=rod,
        bases=bases,
        directions=directions,
        translations=translations,
        drive=_drive(scan),
        load_cell=load_cell,
        unknown=deviations_of_table(
            unknown if unknown is None or isinstance(unknown, str) else _table(table, "unknown"),
            is_si,
            pivots=len(translations or bases),
            turns_back=len(directions) > 1,
            load_cell=load_cell,
            calibration=calibration,
        ),
        calibration=calibration,
        frame=cast(Frame, frame),
        single=check_choice("precision", said["precision"], ("double", "single")) == "single",
    )
    if timed := [name for name in (*found.load_cell, *found.unknown) if "lag_seconds" in name]:
        what = f"{timed[0]} is in seconds, and records of a data set have no times: give lag, in readings"
        raise SpecificationError(what)
    turns = found.combinations
    records = table.get("records", turns if found.lists else None)
    records = _whole(records, "records", 1, _MOST_SHARDS * found.shard_records)
    if records % turns:
        raise SpecificationError(
            f"records is {records}, but the lists of 'each' make {turns} combinations: give a multiple of it"
        )
    return replace(found, records=records)


def _groups(said: Mapping[str, Any]) -> tuple[Group, ...]:
    groups = said.get("contours")
    if isinstance(groups, dict):
        raise SpecificationError("contours is one table: write [[contours]], in two pairs of brackets, for each family")
    if not isinstance(groups, list) or not groups or not all(isinstance(group, dict) for group in groups):
        raise SpecificationError("there are no contours: give at least one table [[contours]], with its family")
    return tuple(_group(group, f"contours[{k}]", said["each_contour"]) for k, group in enumerate(groups))


def _group(group: Mapping[str, Any], key: str, each: bool) -> Group:
    name = group.get("family")
    if not isinstance(name, str) or name not in FAMILIES:
        found_is = f"is {name!r}" if "family" in group else "is missing"
        raise SpecificationError(
            f"{key}.family {found_is}{look_alikes(str(name))}: choose from {', '.join(FLANKS)}, shape-free, or two "
            f"flanks ({' or '.join(FLANKS)} on either side, as in 'parabola/circle')"
        )
    family = FAMILIES[name]
    # In the order in which numbers are drawn.
    names = sorted(family.parameters, key=lambda parameter: (parameter == "x_c", parameter.startswith("right_")))
    refuse_unknown_keys(group, ("family", "weight", *names), f"{key}.")
    values = {"weight": 1.0, **left_out(family), **group}
    missing = [parameter for parameter in names if parameter not in values]
    if missing:
        raise SpecificationError(f"{key} is a {name} and has no {missing[0]}: give a number or a distribution")
    weight = _number(values["weight"], f"{key}.weight", 0.0, 1e9)
    if weight == 0.0 or (each and "weight" in group):
        why = "it must be positive" if not each else "with each_contour every family comes as often"
        raise SpecificationError(f"{key}.weight is {weight!r}: {why}")
    distributions = {parameter: variation_of(values[parameter], f"{key}.{parameter}") for parameter in names}
    _refuse_no_contour(family, distributions, key)
    return Group(name, weight, distributions)


def _refuse_no_contour(family: ContourFamily, distributions: Mapping[str, Variation], key: str) -> None:
    """Refuse parameters that are impossible whatever the others; unbounded distributions are tested later."""
    possible = {name: np.full(1, 2.0 if name.endswith("n") else 1.0) for name in family.parameters}
    for name, distribution in distributions.items():
        numbers = distribution.numbers
        if distribution.kind in ("normal", "log_normal"):
            numbers = () if distribution.numbers[1] else distribution.numbers[:1]
        for number in numbers:
            try:
                family.contour(possible | {name: np.full(1, number)})
            except ContourError as error:
                what = f"{key}.{name} {_may_be(distribution)} {number:g}"
                raise SpecificationError(f"{what}: {rule_of(error)}") from error


def _rod(rod: Mapping[str, Any], is_si: bool) -> dict[str, Variation]:
    if not rod:
        return {}
    for name, value in rod.items():
        if name in _TRACED or (isinstance(value, str) and value.lstrip().startswith("{")):
            raise SpecificationError(
                f"rod.{name} states the course of something along the rod, and rods of data sets are straight or arcs, "
                "uniform or tapered: give length, flexural_rigidity, rest_curvature and taper"
            )
    if "youngs_modulus" in rod and ("flexural_rigidity" in rod or "diameter" not in rod):
        raise SpecificationError("rod.youngs_modulus goes with a diameter, and without flexural_rigidity")
    if is_si != ("flexural_rigidity" in rod or "youngs_modulus" in rod):
        raise SpecificationError(
            "rod needs length [m] and flexural_rigidity [N m²] (or youngs_modulus and diameter) together; without them "
            "lengths are in rod lengths"
        )
    given = {"diameter": 0.0, **rod} if is_si else rod
    distributions = {
        name: quantity_of(given[name], f"rod.{name}", unit, is_si) for name, unit in ROD_UNITS.items() if name in given
    }
    for name, of in distributions.items():
        if name != "rest_curvature":
            most = STEEPEST_TAPER if name == "taper" else math.inf
            may_vanish = name in ("taper", "diameter", "stem", "rest_curvature_deviation")
            _refuse_outside(f"rod.{name}", of, most, may_vanish)
    try:
        numbers = _at_share(distributions, 0.5)
        if "youngs_modulus" in numbers:
            numbers["flexural_rigidity"] = round_rigidity(numbers["diameter"], numbers.pop("youngs_modulus"))
        Rod(**numbers)
    except ParameterError as error:
        raise SpecificationError(f"rod: {error}") from error
    return distributions


def _load_cell(table: Mapping[str, Any], is_si: bool) -> dict[str, Variation]:
    distributions = {
        name: quantity_of(value, key, LOAD_CELL_UNITS[name], is_si) for name, key, value in entries_of_cell(table)
    }
    if any(name.startswith("ornstein_uhlenbeck") for name in distributions):
        distributions.setdefault("ornstein_uhlenbeck_time", Variation("constant", (OrnsteinUhlenbeck().time,)))
    for share in (0.05, 0.5, 0.95):
        try:
            LoadCell.from_entries(_at_share(distributions, share))
        except ParameterError as error:
            raise SpecificationError(f"load_cell: {error}") from error
    for name, of in distributions.items():
        if not name.startswith(SIGNED):
            _refuse_outside(f"load_cell.{name}", of)
    return distributions


def _at_share(distributions: Mapping[str, Variation], share: float) -> dict[str, float]:
    """Return the quantiles of distributions at a probability."""
    turn = np.zeros(1, dtype=np.intp)
    return {name: float(distribution.at(np.full(1, share), turn)[0]) for name, distribution in distributions.items()}


def _refuse_outside(key: str, of: Variation, most: float = math.inf, may_vanish: bool = True) -> None:
    """Refuse a distribution with numbers that are negative, above a limit, or zero where they may not vanish."""
    for end in of.ends:
        if not 0.0 <= end <= most or (end == 0.0 and not may_vanish):
            what = "negative" if end < 0.0 else "unbounded" if math.isinf(end) else f"{end:g}"
            wanted = "positive numbers" if math.isinf(most) else f"numbers from 0 to {most:g}"
            raise SpecificationError(f"{key} {_may_be(of)} {what}: give {wanted}, as by uniform or log_normal")


def _may_be(of: Variation) -> str:
    return "is" if of.kind == "constant" else "may be"


def _bases(value: Any) -> tuple[tuple[Variation, Variation], ...]:
    if not isinstance(value, list) or not value or not all(isinstance(pair, list) and len(pair) == 2 for pair in value):
        raise refused("scan.bases", value, "give a list of pivots, each [x, y]")
    return tuple(
        (variation_of(x, f"scan.bases[{i}][0]"), variation_of(y, f"scan.bases[{i}][1]"))
        for i, (x, y) in enumerate(value)
    )


def _directions(value: Any) -> tuple[str, ...]:
    if value not in (["forward"], ["backward"], ["forward", "backward"], ["backward", "forward"]):
        raise refused("scan.directions", value, "give 'forward', 'backward' or both")
    return tuple(value)


def _translations(scan: Mapping[str, Any]) -> tuple[dict[str, Variation], ...]:
    if "translations" not in scan:
        return ()
    if of_rotations := [name for name in _OF_ROTATIONS if name in scan]:
        raise SpecificationError(
            f"scan has translations, and {of_rotations[0]}, which is for rotations: leave the one or the other out"
        )
    value = scan["translations"]
    if not isinstance(value, list) or not value or not all(isinstance(one, dict) for one in value):
        raise refused(
            "scan.translations", value, "write [[scan.translations]], in two pairs of brackets, for each sweep"
        )
    return tuple(_translation(one, f"scan.translations[{k}]") for k, one in enumerate(value))


def _translation(said: Mapping[str, Any], key: str) -> dict[str, Variation]:
    refuse_unknown_keys(said, _OF_TRANSLATIONS, f"{key}.")
    for name in ("base", "heading", "drive_angle"):
        if name not in said:
            raise SpecificationError(
                f"{key}.{name} is missing: give a number or a distribution for each of its numbers"
            )
    if ("travel" in said) == ("step" in said):
        which = "both travel and step" if "travel" in said else "neither travel nor step"
        raise SpecificationError(f"{key} has {which}: give the one or the other, since samples are evenly spaced")
    base = said["base"]
    if not isinstance(base, list) or len(base) != 2:
        raise refused(f"{key}.base", base, "give the place [x, y] where the base begins")
    values = {"base[0]": base[0], "base[1]": base[1]}
    values |= {name: said[name] for name in _OF_TRANSLATIONS[1:] if name in said}
    found = {name: variation_of(value, f"{key}.{name}") for name, value in values.items()}
    for name in ("heading", "drive_angle", "turn"):
        for angle in found[name].ends if name in found else ():
            if math.isfinite(angle) and abs(angle) > 2.0 * math.pi:
                raise SpecificationError(f"{key}.{name} may be {angle:g}: give angles in radians, at most a turn (2π)")
    for name in {"travel", "step"} & set(found):
        _refuse_outside(f"{key}.{name}", found[name], may_vanish=False)
    return found


def _drive(scan: Mapping[str, Any]) -> Drive:
    samples = _whole(scan.get("samples", SCAN["samples"]), "scan.samples", 2, 1_000_000)
    names = ("from_degrees", "to_degrees")
    given = [name for name in names if name in scan]
    if not given:
        return Drive(samples, None, None, _number(scan.get("margin", SCAN["margin"]), "scan.margin", 0.0, 1.0))
    for missing in set(names) - set(given):
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
    """Return one of the inner tables, and refuse unknown keys."""
    value = table.get(key, {})
    check_kind(key, value, dict, f"write it as a table, [{key}]")
    refuse_unknown_keys(value, keys_of(key, value) if key in OF_RIG else _TABLES[key], f"{key}.", _TABLES)
    return dict(value)


def _whole(value: Any, key: str, least: int, most: int) -> int:
    if value is None:
        raise SpecificationError(f"{key} is missing: give a whole number")
    largest = "2^63 - 1" if most == _LARGEST_SEED else most
    return check_whole_number(key, value, least, f"give a whole number from {least} to {largest}", most=most)


def _number(value: Any, key: str, least: float, most: float) -> float:
    return check_number(key, value, f"give a number from {least:g} to {most:g}", least=least, most=most)

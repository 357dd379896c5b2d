"""The file of a rig, rig.toml: tables of rod, load cell, files, unknowns and calibration."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tactile_bayes.checks import as_number, check_array, check_kind, check_number, shown
from tactile_bayes.distributions import distribution_of_table, table_of_distribution
from tactile_bayes.errors import ParameterError, TactileBayesError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.data_sheet import SEVERAL
from tactile_bayes.mechanics.rods.along import text_along
from tactile_bayes.mechanics.rods.rod import Rod, round_rigidity
from tactile_bayes.record.points import read_points
from tactile_bayes.record.quantity import accepted_units, converted, unit_of
from tactile_bayes.record.schema import COLUMNS, LOAD_CELL_UNITS, MEASURED
from tactile_bayes.record.spelling import refuse_unknown_keys
from tactile_bayes.rig.file_format import OPTIONS, FileFormat
from tactile_bayes.rig.parameters import GROUPS, PARAMETERS, members, parameter_named
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.rig.unknown import NOTHING
from tactile_bayes.tasks import check_format
from tactile_bayes.tasks.documents import read_toml, toml_key, toml_value

ROD_UNITS = {
    "length": "m",
    "flexural_rigidity": "N m²",
    "diameter": "m",
    "youngs_modulus": "N/m²",
    "elastic_strain": "1",
    "rest_curvature": "1/m",
    "rest_curvature_deviation": "1/m",
    "taper": "1",
    "stem": "m",
}
TABLES = {
    "rod": (*ROD_UNITS, "rigidity_profile", "rest_shape_modes", "taper_deviation", "shape"),
    "load_cell": tuple(dict.fromkeys(("frame", *LOAD_CELL_UNITS, *SEVERAL))),
    "file": (*MEASURED, *(name for name in COLUMNS if name not in MEASURED), *OPTIONS),
    "unknown": (*GROUPS, *PARAMETERS, "base", "base_x", "base_y"),
    "calibration": ("parameters", "correlation", "error", "source", "stated"),
    "session": tuple(PARAMETERS),
}
_ONE_OF_BOTH = "[rod] states youngs_modulus: give the diameter beside it, and leave out flexural_rigidity"
_OF_SHAPE = ("rest_curvature", "rest_curvature_deviation", "rest_shape_modes", "taper_deviation")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")

_FORMAT = 1
_LARGEST = 1 << 20  # largest number of characters of a file
_HEAD = f"""\
# A rig, for the option --rig of tactile-bayes and for tactile_bayes.Rig.read: what its data sheets state, how its files
# are written, and what is unknown. A number is known, a distribution is unknown; `tactile-bayes rig --parameters` lists
# what may be unknown. Numbers are in SI units, or texts with a unit, like "200 mm", if [rod] states a length and a
# flexural rigidity; else they are in units of the rod: lengths in L, moments in EI/L, forces in EI/L².
format = {_FORMAT}
"""


def read_tables(path: Path) -> dict[str, Any]:
    """Read the tables of a TOML file."""
    with open(path, encoding="utf-8-sig") as file:
        text = file.read(_LARGEST + 1)
    if len(text) > _LARGEST:
        raise ParameterError(f"it has more than {_LARGEST} characters, and is no file of a rig")
    tables = read_toml(text)
    check_format(tables.pop("format", None), _FORMAT, lambda what: ParameterError(f"it {what}"))
    return tables


@contextmanager
def named_in_errors(path: Path) -> Iterator[None]:
    """Begin the message of what is wrong with a file by its path."""
    try:
        yield
    except (TactileBayesError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path}: {error}") from error


def file_of(tables: Mapping[str, Any]) -> str:
    """Return the whole text of the file with tables of a rig."""
    return _HEAD + text_of(tables)


def text_of(tables: Mapping[str, Any]) -> str:
    """Return the text in TOML of tables of a rig."""
    unknown = tables.get("unknown")
    first = f"unknown = {toml_value(unknown)}\n\n" if isinstance(unknown, str) else ""
    return first + "\n".join(
        f"[{name}]\n" + "".join(f"{toml_key(key)} = {toml_value(value)}\n" for key, value in table.items())
        for name, table in tables.items()
        if not isinstance(table, str)
    )


def _table_of_rod(rod: Rod) -> dict[str, Any]:
    usual = {"length": 1.0, "flexural_rigidity": 1.0} if rod.is_dimensionless else {}
    given = {name: getattr(rod, name) for name in TABLES["rod"] if hasattr(rod, name)}
    return {n: text_along(v) for n, v in given.items() if v not in (None, ()) and v != usual.get(n, 0.0)}


def tables_of(
    rod: Rod | None,
    load_cell: LoadCell | None,
    unknown: Mapping[str, Any],
    calibration: RigPrior | None,
    file: FileFormat,
) -> dict[str, Any]:
    """Return the tables that state the arguments of `Rig`; the inverse of `stated_in`."""
    tables: dict[str, Any] = {}
    if rod is not None:
        tables["rod"] = _table_of_rod(rod)
    if load_cell is not None:
        tables["load_cell"] = load_cell.entries()
    if file.table:
        tables["file"] = file.table
    if unknown == dict(NOTHING):
        tables["unknown"] = "nothing"
    elif unknown:
        tables["unknown"] = {n: v if isinstance(v, str) else table_of_distribution(v) for n, v in unknown.items()}
    if calibration is not None:
        tables["calibration"] = {
            "source": calibration.source,
            "error": calibration.error,
            "parameters": {name: table_of_distribution(prior) for name, prior in calibration.priors.items()},
            "correlation": calibration.correlation.tolist(),
            "stated": {n: v.item() if isinstance(v, np.generic) else v for n, v in calibration.stated.items()},
        }
    return tables


def stated_in(tables: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the arguments of `Rig` that tables state; see `Rig.of_tables`."""
    refuse_unknown_keys(tables, ("rig", *TABLES), tables=TABLES)
    said = {name: table for name, table in tables.items() if name != "rig"}
    for name, table in said.items():
        if name != "unknown" or table != "nothing":
            check_kind(name, table, Mapping, f"write it as a table, [{name}]")
            refuse_unknown_keys(table, keys_of(name, table), f"{name}.", TABLES)
    found: dict[str, Any] = {"rod": None, "load_cell": None, "unknown": {}, "calibration": None, "file": {}}
    if "rig" in tables:
        found = _of_other_rig(tables, folder)
    if "rod" in said:
        found["rod"] = _rod(said["rod"], folder)
    is_si = found["rod"] is not None and not found["rod"].is_dimensionless
    if "load_cell" in said:
        found["load_cell"] = _load_cell(said["load_cell"], is_si)
    if "unknown" in said:
        found["unknown"] = _unknown(said["unknown"], is_si)
    if "calibration" in said:
        found["calibration"] = calibration_of(said["calibration"])
    if "session" in said:
        if found["calibration"] is None:
            raise ParameterError('[session] says by how much a calibrated rig differs: name it, rig = "rig/rig.toml"')
        deviations = {
            name: _quantity(value, unit_of_unknown(name), f"session.{name}", is_si)
            for name, value in said["session"].items()
        }
        found["calibration"] = found["calibration"].in_a_session(deviations)
    return found | ({"file": said["file"]} if "file" in said else {})


def _of_other_rig(tables: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the arguments of `Rig` that the file states which tables name."""
    check_kind("rig", tables["rig"], str, "give the path of a rig.toml")
    refuse_twice(tables)
    path = folder / tables["rig"]
    with named_in_errors(path):
        others = read_tables(path)
        if "rig" in others:
            raise ParameterError(f"it names a rig itself, {shown(others['rig'])}: name that one")
        return stated_in(others, path.parent)


def refuse_twice(tables: Mapping[str, Any]) -> None:
    """Refuse tables beside a rig which it states."""
    if twice := [name for name in ("rod", "load_cell", "calibration") if name in tables]:
        raise ParameterError(f"there are a rig and a table [{twice[0]}], which it states: leave one of the two")


def _rod(said: Mapping[str, Any], folder: Path) -> Rod:
    numbers: dict[str, Any] = {
        name: said[name]
        if name == "rest_curvature" and str(said[name]).lstrip().startswith("{")
        else _quantity(said[name], unit, f"rod.{name}", is_si="length" in said or "shape" in said)
        for name, unit in ROD_UNITS.items()
        if name in said
    }
    numbers |= {
        name: said[name] for name in ("rigidity_profile", "rest_shape_modes", "taper_deviation") if name in said
    }
    if "shape" in said:
        return _traced(said, numbers, folder)
    modulus = numbers.pop("youngs_modulus", None)
    if modulus is not None:
        if "flexural_rigidity" in numbers or "diameter" not in numbers:
            raise ParameterError(_ONE_OF_BOTH)
        numbers["flexural_rigidity"] = round_rigidity(numbers["diameter"], modulus)
    if ("length" in numbers) != ("flexural_rigidity" in numbers):
        raise ParameterError(
            "[rod] needs length and flexural_rigidity (or youngs_modulus and diameter) together; without them the rig "
            "is dimensionless, in units of the rod"
        )
    return Rod(**numbers)


def _traced(said: Mapping[str, Any], numbers: dict[str, Any], folder: Path) -> Rod:
    """Return the rod of a shape, with its numbers beside."""
    check_kind("rod.shape", said["shape"], str, "give the path of a CSV file with columns x, y, diameter")
    modulus, rigidity = (numbers.pop(name, None) for name in ("youngs_modulus", "flexural_rigidity"))
    if (modulus is None) == (rigidity is None):
        both = "" if modulus is None else f"; {_ONE_OF_BOTH}"
        raise ParameterError(f"[rod] states a shape: give flexural_rigidity, or youngs_modulus and diameter, too{both}")
    for name in _OF_SHAPE:
        if name in numbers:
            raise ParameterError(f"[rod] states shape and {name}: leave out {name}, which follows from the shape")
    path = folder / said["shape"]
    pieces = read_points(path, beside="diameter").in_unit("m", str(path))
    if len(pieces) > 1:
        raise ParameterError(f"{path} has {len(pieces)} curves: give the rod's shape as one")
    x, y, *diameters = pieces[0].T
    if diameters:
        numbers["diameter"] = diameters[0]
    elif modulus is not None and "diameter" not in numbers:
        raise ParameterError(_ONE_OF_BOTH)
    strain = numbers.pop("elastic_strain", None)
    rod = Rod.from_shape(x, y, 1.0 if rigidity is None else rigidity, **numbers)
    rigidity = rod.flexural_rigidity if modulus is None else round_rigidity(rod.diameter, modulus)
    return replace(rod, elastic_strain=strain, flexural_rigidity=rigidity)


def keys_of(table: str, said: Iterable[str]) -> list[str]:
    """Return the keys that a table may have, with the shifts of pivots that it names."""
    shifts = [key for key in said if parameter_named(key) is not None] if table == "unknown" else []
    return [*TABLES[table], *shifts]


def _load_cell(said: Mapping[str, Any], is_si: bool) -> LoadCell:
    entries: dict[str, Any] = {name: value for name, value in said.items() if name == "frame"}
    for name, where, value in entries_of_cell(said):
        entries[name] = _quantity(value, LOAD_CELL_UNITS[name], where, is_si)
    return LoadCell.from_entries(entries)


def entries_of_cell(said: Mapping[str, Any]) -> Iterator[tuple[str, str, Any]]:
    """Yield the entries that a table of a load cell states, without its frame: name, key for messages, and value."""
    for name, value in said.items():
        if name in SEVERAL and (isinstance(value, list) or name not in LOAD_CELL_UNITS):
            names = SEVERAL[name]
            rows = np.ravel(np.array(value, dtype=object)).tolist() if isinstance(value, list) else []
            if len(rows) != len(names):
                raise ParameterError(
                    f"load_cell.{name} is {shown(value)}: give a list of {len(names)}, {', '.join(names)}"
                )
            yield from ((each, f"load_cell.{name}", row) for each, row in zip(names, rows, strict=True))
        elif name != "frame":
            yield name, f"load_cell.{name}", value


def _unknown(said: Mapping[str, Any] | str, is_si: bool) -> Any:
    if isinstance(said, str):
        return said
    found = {}
    for name, value in said.items():
        number = partial(number_in, unit=unit_of_unknown(name), name=f"unknown.{name}", is_si=is_si)
        found[name] = value if value == "default" else distribution_of_table(value, f"unknown.{name}", number)
    return found


def unit_of_unknown(name: str) -> str:
    """Return the SI unit of a parameter, or of those of a group."""
    row = parameter_named(next(members(name)))
    return "m" if row is None else row.unit


def calibration_of(said: Mapping[str, Any]) -> RigPrior:
    absent = [name for name in TABLES["calibration"] if name not in said]
    if absent:
        raise ParameterError(f"[calibration] has no {', '.join(absent)}: calibrate the rig again")
    for name, kind in (("parameters", Mapping), ("stated", Mapping), ("source", str)):
        check_kind(f"calibration.{name}", said[name], kind, "calibrate the rig again")
    error = check_number("calibration.error", said["error"], "calibrate the rig again", least=0.0)
    refuse_unknown_keys(said["parameters"], PARAMETERS, "calibration.parameters.")
    priors: dict[str, Any] = {}
    for name, value in said["parameters"].items():
        found = distribution_of_table(value, f"calibration.parameters.{name}")
        if isinstance(found, float):
            raise ParameterError(f"calibration.parameters.{name} is the number {found:g}: calibrate the rig again")
        priors[name] = found
    correlation = check_array("calibration.correlation", said["correlation"], "calibrate the rig again")
    if correlation.shape != (len(priors), len(priors)) or not np.isfinite(correlation).all():
        raise ParameterError("calibration.correlation does not fit its parameters: calibrate the rig again")
    if np.linalg.eigvalsh(correlation).min() <= 0.0 or not np.allclose(np.diag(correlation), 1.0):
        raise ParameterError("calibration.correlation is no matrix of correlations: calibrate the rig again")
    return RigPrior(priors, correlation, error, said["source"], dict(said["stated"]))


def _quantity(value: Any, unit: str, name: str, is_si: bool) -> float:
    """Return a number in a unit, from a number, or a text with another unit of the kind."""
    number = number_in(value, unit=unit, name=name, is_si=is_si)
    if number is None:
        raise ParameterError(
            f'{name} is {shown(value)}: give a number [{unit}], or a text with a unit, like "1.5 {unit}"'
        )
    return number


def number_in(value: Any, *, unit: str, name: str, is_si: bool) -> float | None:
    """Return a number in a unit as `_quantity` does, or None for what is neither a number nor a text with a unit."""
    match = _NUMBER.match(value.strip()) if isinstance(value, str) else None
    if match is None:
        return as_number(value)
    said = match.string[match.end() :].strip()
    said = said[1:-1].strip() if said.startswith("[") and said.endswith("]") else said
    stated, wanted = unit_of(said or "1"), unit_of(unit)
    assert wanted is not None
    if stated is None or stated.dimension != wanted.dimension:
        what = f"{name} is {value!r}, which is not in {accepted_units(unit)}"
        raise ParameterError(f"{what}: a lag in seconds is lag_seconds" if name.endswith("lag") else what)
    if not is_si and any(wanted.dimension[:2]):
        raise ParameterError(
            f"{name} is {value!r}, but the rig is dimensionless: give [rod] with length and flexural_rigidity, or a "
            "number in units of the rod (L, EI/L, EI/L²)"
        )
    return float(converted(float(match[0]), stated, wanted))

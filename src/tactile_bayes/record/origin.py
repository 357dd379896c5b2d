"""The origin of a column in a file: its name, unit, factor, sign and zero."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.record.parsing import parsed_column
from tactile_bayes.record.quantity import OTHER_UNITS, accepted_units, converted, same_quantity, unit_of, units_disagree
from tactile_bayes.record.schema import DIRECTIONS, MEASURED, Column, Kind, column_of
from tactile_bayes.record.spelling import look_alikes, nearest, plain
from tactile_bayes.record.storable import storable
from tactile_bayes.record.table import Cells, Source, Table

# Name of the origin of a column as text: an attribute of tables and results, and an encoding of a record, which is not
# written with it.
ORIGIN = "origin_in_file"
# Columns for which a single value can be given, with an example.
CONSTANTS = {"sweep": "0", "direction": "forward", "base_x": "12[mm]", "base_y": "12[mm]", "drive_angle": "90[deg]"}
_NUMBER = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_LEAD = re.compile(rf"(?:(?P<offset>[+-]?{_NUMBER})\s*)?(?P<sign>[+-])\s*+(?P<rest>.+)")
_FACTOR = re.compile(rf"(?P<factor>{_NUMBER})\s*\*\s*+(?P<rest>.+)")
_TRAIL = re.compile(rf"(?P<rest>.*?\S)\s*(?P<sign>[+-])\s*(?P<offset>{_NUMBER})")
_BRACKETS = re.compile(r"(?P<rest>.*\S)\s*\[(?P<unit>[^\[\]]*)\]")
_VALUE = re.compile(rf"(?P<number>[+-]?{_NUMBER})\s*(?:\[(?P<unit>[^\[\]]*)\])?")
_UNIT_IN_NAME = re.compile(
    r"(?P<stem>.*\S)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\)|/\s*+(?P<slash>[^/]*\S))\s*"
)


@dataclass(frozen=True)
class Origin:
    """Origin of a column of a record: offset + sign · factor · (a column of the file), or one value for all samples."""

    column: str  # "" for a value
    unit: str | None = None  # of column (times factor) and offset, if it is given with the column or in its name
    sign: int = 1
    offset: float = 0.0
    value: str | float | None = None
    factor: float = 1.0

    def __str__(self) -> str:
        """Return the origin in the form that `read_record` takes, without the unit."""
        if not self.column:
            return str(self.value)
        sign = "-" if self.sign < 0 else "+" if self.offset else ""
        return f"{f'{self.offset:.15g}' if self.offset else ''}{sign}{self.scaled}"

    @property
    def scaled(self) -> str:
        """Text of the column with its factor."""
        return f"{self.column}" if self.factor == 1.0 else f"{self.factor:.15g}*{self.column}"


def column_entry(column: xr.DataArray, *, sense: int = 1, added: float = 0.0, digits: int = 3) -> str:
    """Return the source that reads a column of a record as sense · (its values) + added, rounded to digits; "" if its
    origin does not have the unit of the record, as after a conversion by the rod.
    """
    name, unit = str(column.name), str(column.attrs.get("units", "1"))
    stored = column.encoding.get(ORIGIN) or column.attrs.get(ORIGIN)
    origin = Origin(**json.loads(stored)) if stored else Origin(name, unit)
    pair = same_quantity(unit, origin.unit or unit)
    if pair is None or not origin.column:
        return ""
    number = float(converted(added, *pair))
    if number:
        number = round(number, digits - 1 - math.floor(math.log10(abs(number))))
    read = replace(origin, sign=sense * origin.sign, offset=sense * origin.offset + number)
    if read.sign > 0 and read.offset:
        return f"{read.scaled}{read.offset:+.12g}"
    return str(replace(read, offset=round(read.offset, 12)))


def with_origin(column: xr.DataArray) -> xr.DataArray:
    """Return a column of a record with its origin in the file as an attribute, which is written with it."""
    stored = column.encoding.get(ORIGIN)
    return column if stored is None else column.assign_attrs({ORIGIN: stored})


def origins_of(columns: Mapping[str, str], names: Iterable[str], source: Source) -> dict[str, Origin]:
    """Find the origins of columns of a record that have other names in a file, also of those like "force_x [mN]"."""
    names = list(names)
    origins = {target: _origin(target, str(text), names, source) for target, text in columns.items()}
    for name in names:
        stem, unit = stem_and_unit(name)
        if stem in MEASURED and unit is not None and stem not in names and stem not in origins:
            origins[stem] = Origin(name, unit)
    used = {origin.column for origin in origins.values()}
    for target in origins:
        if target in names and target not in used:
            what = f"is in the file, but {columns.get(target)!r} is given for it: leave out the one that is wrong"
            raise source.column_error(target, what)
    return origins


def any_meant(columns: Mapping[str, str], names: Iterable[str]) -> bool:
    """Return whether any of these columns belongs to a record, by its own name or by a given origin."""
    names = list(names)
    if any(stem_and_unit(name)[0] in MEASURED for name in names):
        return True
    texts = [plain(str(text)).strip() for text in columns.values()]
    named = [text for text in texts if not (_VALUE.fullmatch(text) or text in DIRECTIONS)]
    return any(found_column(origin.column, names) is not None for text in named for origin in _readings(text))


def meant_kinds(origins: Mapping[str, Origin], names: Iterable[str]) -> dict[str, Kind]:
    """Return the kinds of the columns of a file that belong to a record."""
    kinds = {name: column.kind for name in names if (column := column_of(name)) is not None}
    return kinds | {origin.column: _column(target).kind for target, origin in origins.items() if origin.column}


def renamed(table: Table, columns: Mapping[str, str]) -> Table:
    """Return the table with the names, signs and zeros of a record, and its units as stated."""
    origins = origins_of(columns, table.columns, table.source)
    used = Counter(origin.column for origin in origins.values())
    further = [name for name in table.columns if name not in used]
    forms = Counter(map(storable, further))
    called = {name: storable(name) if forms[storable(name)] == 1 else name for name in further}
    aliases = {other: name for name, other in called.items() if other != name}
    aliases |= {target: origin.column for target, origin in origins.items() if origin.column}
    heads = dict(table.source.heads)
    heads |= {name: heads[alias] for name, alias in aliases.items() if alias in heads}
    given = {target: str(origin) for target, origin in origins.items()}
    source = replace(table.source, heads=heads, aliases=aliases, names=list(table.columns), origins=given)
    cells: dict[str, Cells] = {}
    for name, other in called.items():
        values, attrs = table.columns[name]
        unit = unit_of(str(attrs.get("units", ""))) if name in MEASURED else None
        if unit is not None and unit.scale != 1:  # it is converted
            attrs = {**attrs, ORIGIN: json.dumps(asdict(Origin(name, str(attrs["units"]))))}
        cells[other] = (values, attrs if other == name else {"long_name": name, **attrs})
    for target, origin in origins.items():
        if not origin.column:
            cells[target] = (np.full(table.samples, origin.value), {"units": origin.unit} if origin.unit else {})
        else:
            values, attrs = _cells(target, origin, table.columns[origin.column], used[origin.column] > 1, source)
            cells[target] = values, {**attrs, ORIGIN: _of_file(origin, attrs.get("units"))}
    return Table(cells, table.attrs, source)


def _of_file(origin: Origin, unit: Any) -> str:
    """Return an origin as text for an attribute, with the unit of the file, and as a name that `read_record` takes."""
    is_stated = origin.unit is None or stem_and_unit(origin.column)[1] is not None
    column = origin.column if is_stated else f"{origin.column}[{origin.unit}]"
    return json.dumps(asdict(replace(origin, column=column, unit=unit)))


def _cells(target: str, origin: Origin, found: Cells, is_shared: bool, source: Source) -> Cells:
    """Convert a column of the file to a column of the record."""
    values, attrs = found
    if _column(target).kind != "number":
        return values, {name: value for name, value in attrs.items() if name != "units"}
    values = parsed_column(target, values, source)
    if is_shared:
        values = values.copy()
    if origin.factor != 1.0:
        values *= origin.factor
    if origin.sign < 0:
        np.negative(values, out=values)
    if origin.offset:
        values += origin.offset
    stated = attrs.get("units")
    unit = origin.unit if stated in (None, "unknown") else str(stated)
    if unit is not None and origin.unit is not None and units_disagree(origin.unit, unit):
        what = f"is in [{unit}], but [{origin.unit}] is given for it, or in its name: leave out the one that is wrong"
        if unit_of(origin.unit) is None:
            what += f"; if [{origin.unit}] is no unit, give {f'{origin.column}[{unit}]'!r} for {target!r}"
        raise source.column_error(target, what)
    attrs = {name: value for name, value in attrs.items() if name != "units"}
    return values, attrs if unit is None else {"units": unit, **attrs}


def _origin(target: str, text: str, names: list[str], source: Source) -> Origin:
    column = _column(target)
    text = text.strip()
    readings = list(_readings(text))
    if plain(text) != text:
        readings += _readings(plain(text))
    for origin in readings:
        name = found_column(origin.column, names)
        if name is not None:
            is_whole = _compact(name) == _compact(origin.column)
            return _checked(target, column, replace(origin, column=name), is_whole, text, source)
    value = _value(target, plain(text))
    if value is not None:
        return value
    wanted = readings[-1].column
    near = nearest(wanted, names)
    hint = f"did you mean {near!r}?" if near else "write NAME[UNIT], with a minus before it for the opposite sign"
    if target in names:
        hint = f"the file has a column {target!r} already: leave this entry of [file] out for it"
    elif target in CONSTANTS:
        hint += f" (or one value for all samples, like {CONSTANTS[target]})"
    what = f"there is no column {wanted!r}{look_alikes(wanted)}, which is given for {target!r}"
    raise source.error(f"{what} (columns: {', '.join(names)}): {hint}")


def _readings(text: str) -> Iterator[Origin]:
    """Yield possible meanings of a text, the most literal first: names may contain signs, digits and brackets."""
    starts = [(0.0, 1, text)]
    if match := _LEAD.fullmatch(text):
        starts.append((float(match["offset"] or 0), -1 if match["sign"] == "-" else 1, match["rest"]))
    for lead, sign, rest in starts:
        match = _FACTOR.fullmatch(rest)
        scaled = [(float(match["factor"]), match["rest"])] if match else []
        for factor, named in [(1.0, rest), *scaled]:
            for trail, name in _with_and_without_trail(named):
                yield Origin(name, None, sign, lead + trail, factor=factor)
                if match := _BRACKETS.fullmatch(name):
                    for shift, stem in _with_and_without_trail(match["rest"]):
                        yield Origin(stem, match["unit"].strip(), sign, lead + trail + shift, factor=factor)


def _with_and_without_trail(text: str) -> Iterator[tuple[float, str]]:
    """Yield the text as a name, and a name with a number that is added to it."""
    yield 0.0, text
    if match := _TRAIL.fullmatch(text):
        yield float(match["sign"] + match["offset"]), match["rest"]


def found_column(text: str, names: list[str]) -> str | None:
    """Find the column that a text names, regardless of blanks; a unit in its name may be left out."""
    if text in names:
        return text
    for form in (str, lambda name: stem_and_unit(name)[0]):
        same = [name for name in names if _compact(form(name)) == _compact(text)]
        if len(same) == 1:
            return same[0]
    return None


def _compact(text: str) -> str:
    return re.sub(r"\s", "", plain(text))


def _checked(target: str, column: Column, origin: Origin, is_whole: bool, text: str, source: Source) -> Origin:
    """Complete an origin by the unit in the column's name, or refuse a contradiction."""
    given = f"columns: {text!r} is given for {target!r}"
    if column.kind != "number":
        if origin.unit is not None or origin.sign < 0 or origin.offset or origin.factor != 1.0:
            raise ParameterError(f"{given}, which has no unit, factor, sign or zero: give a name alone")
        return origin
    if not 0.0 < origin.factor < math.inf:
        raise ParameterError(f"{given}: give a factor above zero, like 1e-3*Fx[N]")
    _, in_name = stem_and_unit(origin.column)
    if in_name is None:
        in_name = _ending(origin.column, column)
    if origin.unit is None:
        return replace(origin, unit=in_name)
    if unit_of(origin.unit) is None:
        accepted = accepted_units(column.unit)
        raise ParameterError(f"{given}, but {origin.unit!r} is no unit of it: it takes {accepted}")
    is_of_name = is_whole and in_name is not None and unit_of(in_name) is None  # brackets without a unit
    if in_name is not None and not is_of_name and units_disagree(origin.unit, in_name):
        what = f"column {origin.column!r} is in [{in_name}] by its name, but [{origin.unit}] is given for it"
        raise source.error(f"{what}: leave out the one that is wrong")
    return origin


def _ending(name: str, column: Column) -> str | None:
    """Return a unit of the column's quantity at the end of a name, as in Fx_mN."""
    ending = name.rpartition("_")[2]
    return ending if ending != name and same_quantity(ending, column.unit) else None


def stem_and_unit(name: str) -> tuple[str, str | None]:
    """Split a name into stem and unit; any content of square brackets counts as a unit."""
    match = _UNIT_IN_NAME.fullmatch(name)
    if match is None:
        return name, None
    unit = match["square"] if match["square"] is not None else match["round"] or match["slash"] or ""
    is_unit = match["square"] is not None or unit_of(unit) is not None or unit.strip() in OTHER_UNITS
    return (match["stem"], unit.strip()) if is_unit else (name, None)


def _value(target: str, text: str) -> Origin | None:
    """Parse a value for all samples, if the text is one and the column can have it."""
    match = _VALUE.fullmatch(text)
    if target == "direction":
        return Origin("", value=text) if text in DIRECTIONS else None
    if match is None:
        return None
    if target not in CONSTANTS:
        what = f"columns: {text!r} is given for {target!r}, which is measured"
        raise ParameterError(f"{what}: name a column of the file, or declare a channel missing")
    if target == "sweep":
        return Origin("", value=int(text)) if re.fullmatch(r"[+-]?[0-9]+", text) else None
    return Origin("", unit=match["unit"], value=float(match["number"]))


def _column(name: str) -> Column:
    column = column_of(name)
    assert column is not None
    return column

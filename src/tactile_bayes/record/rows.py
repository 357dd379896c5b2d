"""The rows of a table that belong to a record."""

from __future__ import annotations

import operator
import re
from dataclasses import replace

import numpy as np

from tactile_bayes.arrays import Flags
from tactile_bayes.record.origin import found_column
from tactile_bayes.record.parsing import parsed_column
from tactile_bayes.record.spelling import nearest
from tactile_bayes.record.table import Table

_COMPARISONS = {
    "==": operator.eq,
    "!=": operator.ne,
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
_SIGN = re.compile("|".join(_COMPARISONS))


def rows_where(table: Table, where: str) -> Table:
    """Return the rows of a table that meet each of some conditions, as in `FileFormat`."""
    if not where:
        return table
    table.refuse_empty()
    met = np.ones(table.samples, dtype=bool)
    for condition in re.split(r"\sand\s", where):
        met &= _meets(table, condition)
    if not met.any():
        raise table.source.error(f"no row meets where = {where!r} in [file]: mend it, or leave it out")
    columns = {name: (values[met], attrs) for name, (values, attrs) in table.columns.items()}
    lines = None if table.source.lines is None else np.asarray(table.source.lines)[met]
    return replace(table, columns=columns, source=replace(table.source, lines=lines))


def _meets(table: Table, condition: str) -> Flags:
    names, sign = list(table.columns), _SIGN.search(condition)
    wanted, value = (condition[: sign.start()].strip(), condition[sign.end() :].strip()) if sign else ("", "")
    if not (sign and wanted and value):
        example = f"{names[0]} > 0" if names else "trial == 3"
        raise table.source.error(
            f"where = {condition.strip()!r} in [file] is no condition: write a column, one of "
            f"{', '.join(_COMPARISONS)}, and a value, as in {example!r}; several are joined by 'and'"
        )
    name, text = found_column(wanted, names), value.strip("'\"")
    if name is None:
        near = nearest(wanted, names)
        raise table.source.error(
            f"where = {condition.strip()!r} in [file]: there is no column {wanted!r}: "
            + (f"did you mean {near!r}?" if near else f"the columns are {', '.join(names)}")
        )
    values, compared = table.columns[name][0], _COMPARISONS[sign[0]]
    try:
        number = float(text)
    except ValueError:
        return np.asarray(compared(np.asarray(values).astype(str), text))
    return np.asarray(compared(parsed_column(name, values, table.source), number))

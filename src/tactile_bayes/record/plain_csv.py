"""Plain CSV files: columns of numbers under a line of names, as of points or poses."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.record.cell import number_in


def columns_in(path: Path, names: Sequence[str], what: str) -> list[Floats]:
    """Return columns of numbers of a CSV file, a line for each of what they are, or refuse it."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ParameterError(f"{path}: the {what}s cannot be read ({error})") from error
    columns = []
    for name in names:
        values = [number_in(row.get(name) or "") for row in rows]
        if not values or None in values:
            at = values.index(None) + 1 if values else 0
            raise ParameterError(
                f"{path}: {what} {at} has no number in column {name!r}: write a line '{','.join(names)}', then a "
                f"{what} in each line, with decimal points"
            )
        columns.append(np.array(values, dtype=float))
    return columns

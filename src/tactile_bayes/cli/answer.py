"""The answer of a command: sentences, tables and files for people, or one JSON object for programs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from rich.table import Table


@dataclass(frozen=True)
class Answer:
    """Result of a command: parts for people (sentences, tables, files by content), and the object for programs.

    An interrupt that has cut the work short has a message for stderr, and the exit code of an interrupt.
    """

    parts: Iterable[str | Table | Mapping[str, Path]]
    numbers: Callable[[], Mapping[str, Any]]
    interrupted: str = ""
    in_a_line: bool = False  # true if the object for programs is one line


def print_answer(answer: Answer, as_json: bool) -> None:
    """Print an answer as text, or as one JSON object in which null stands for numbers that are not finite."""
    if as_json:
        print_object(answer.numbers(), in_a_line=answer.in_a_line)
    else:
        for part in answer.parts:
            _print_part(part)
    if answer.interrupted:
        typer.echo(f"tactile-bayes: {answer.interrupted}", err=True)
        raise typer.Exit(130)


def print_object(numbers: Mapping[str, Any], *, in_a_line: bool = False) -> None:
    """Print an object for programs, in ASCII; null stands for numbers that are not finite."""
    import json

    typer.echo(json.dumps(_plain(numbers), indent=None if in_a_line else 2, allow_nan=False))


def _print_part(part: str | Table | Mapping[str, Path]) -> None:
    if isinstance(part, str):
        typer.echo(part)
    elif isinstance(part, Mapping):
        width = max(12, *map(len, part))
        for what, path in part.items():
            typer.echo(f"{what:<{width}} {path}")
    else:
        _print_table(part)


def _print_table(table: Table) -> None:
    """Print a whole table, also if no terminal states its width."""
    from rich.console import Console

    console = Console(markup=False)  # units are in brackets
    if not console.is_terminal:
        console.width = max(console.width, 100)
    console.print(table, highlight=False)


def table_of(
    heads: Iterable[str], rows: Iterable[Iterable[str]], *, left: Iterable[str] = (), may_wrap: bool = False
) -> Table:
    """Return a table without frame; columns are right-aligned unless named in `left`."""
    from rich.table import Table

    table, to_the_left = Table(box=None, pad_edge=False), set(left)
    for head in heads:
        table.add_column(head, justify="left" if head in to_the_left else "right", no_wrap=not may_wrap)
    for row in rows:
        table.add_row(*row)
    return table


def text_of(value: float, form: str = ".1f") -> str:
    """Return a number as text in a form, or a dash for NaN."""
    return "–" if value != value else format(value, form)


def columns_of(dataset: Any, dim: str) -> list[dict[str, Any]]:
    """Return a row for every label of a dimension, with its coordinate and all variables along this dimension alone."""
    columns = {dim: dataset[dim], **dataset.data_vars, **dataset.coords}
    table = {name: values.values for name, values in columns.items() if values.dims == (dim,)}
    return [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]


def _plain(value: Any) -> Any:
    """Return the value in types of JSON: no arrays, no paths, and null for numbers that are not finite."""
    if hasattr(value, "items"):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "values"):  # of xarray
        value = value.values
    if hasattr(value, "tolist"):  # arrays and numbers of NumPy
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value

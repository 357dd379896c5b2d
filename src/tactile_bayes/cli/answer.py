"""The answer of a command: sentences, tables and files for people, or one JSON object for programs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

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

    @classmethod
    def of(cls, words: Sequence[str], files: Mapping[str, Path], *further: str | Table, **numbers: Any) -> Answer:
        """Return the usual answer: words, what follows them after an empty line, and files; numbers for programs."""
        parts = [*words, *([""] if further else []), *further, "", files]
        return cls(parts, lambda: {"words": words, **numbers, "files": files})


def print_answer(answer: Answer, as_json: bool) -> None:
    """Print an answer as text, or as one JSON object in which null stands for numbers that are not finite."""
    if as_json:
        print_object(answer.numbers(), in_a_line=answer.in_a_line)
    else:
        for part in answer.parts:
            if isinstance(part, str):
                typer.echo(part)
            elif isinstance(part, Mapping):
                width = max(12, *map(len, part))
                for what, path in part.items():
                    typer.echo(f"{what:<{width}} {path}")
            else:
                _print_table(part)
    if answer.interrupted:
        typer.echo(f"tactile-bayes: {answer.interrupted}", err=True)
        raise typer.Exit(130)


def print_object(numbers: Mapping[str, Any], *, in_a_line: bool = False) -> None:
    """Print an object for programs, in ASCII; null stands for numbers that are not finite."""
    from tactile_bayes.tasks.documents import json_value

    typer.echo(json.dumps(json_value(numbers), indent=None if in_a_line else 2, allow_nan=False))


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
    """Return a row for every label of a dimension, with its coordinate and all variables along this dimension alone.

    There are none without the dimension.
    """
    if dim not in dataset.dims:
        return []
    columns = {dim: dataset[dim], **dataset.data_vars, **dataset.coords}
    table = {name: values.values for name, values in columns.items() if values.dims == (dim,)}
    return [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]

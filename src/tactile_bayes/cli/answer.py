"""The answer of a command: sentences and files for people, or one JSON object for programs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from rich.table import Table

__all__ = ["Json", "columns_of", "plain", "print_files", "print_json", "print_sentences", "print_table", "table_of"]

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object in place of sentences.")]


def print_json(answer: Mapping[str, Any]) -> None:
    """Print one JSON object; what is no finite number is null."""
    import json

    typer.echo(json.dumps(plain(answer), ensure_ascii=False, indent=2, allow_nan=False))


def plain(value: Any) -> Any:
    """The same in what JSON has: no arrays, no paths, and null for what is no finite number."""
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(name): plain(part) for name, part in value.items()}
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):  # arrays and numbers of NumPy and xarray
        value = value.values.tolist() if hasattr(value, "values") else value.tolist()
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def columns_of(dataset: Any, dim: str) -> list[dict[str, Any]]:
    """A row for every place along a dimension, of the coordinate and of all that lies along this dimension alone."""
    names = [dim, *(str(name) for name, values in dataset.data_vars.items() if values.dims == (dim,))]
    return [{name: dataset[name].values[i] for name in names} for i in range(dataset.sizes[dim])]


def print_sentences(sentences: Iterable[str]) -> None:
    """Print sentences, each on a line of its own, however long."""
    for sentence in sentences:
        typer.echo(sentence)


def print_files(files: Mapping[str, Path], width: int = 12) -> None:
    """Print what is in which file."""
    for what, path in files.items():
        typer.echo(f"{what:<{width}} {path}")


def table_of(heads: Iterable[str], *, left: Iterable[str] = ()) -> Table:
    """An empty table without frame, with numbers to the right."""
    from rich.table import Table

    table, to_the_left = Table(box=None, pad_edge=False), set(left)
    for head in heads:
        table.add_column(head, justify="left" if head in to_the_left else "right", no_wrap=True)
    return table


def print_table(table: Table) -> None:
    """Print a table, whole, also where no terminal says how wide it may be."""
    from rich.console import Console

    console = Console(markup=False)  # units are in brackets
    if not console.is_terminal:
        console.width = max(console.width, 100)
    console.print(table, highlight=False)

"""Options of every command that does many tasks: by how many processes, and where."""

from __future__ import annotations

from typing import Annotated

import typer

__all__ = ["Scheduler", "Workers", "refuse_both"]

Workers = Annotated[int | None, typer.Option(help="Processes on this machine; by default one for each core.", min=1)]
Scheduler = Annotated[
    str | None,
    typer.Option(help="Address of a Dask scheduler in place of --workers, like tcp://10.0.0.1:8786."),
]


def refuse_both(workers: int | None, scheduler: str | None) -> None:
    """Refuse two places for the work."""
    from tactile_bayes.errors import ParameterError

    if workers is not None and scheduler is not None:
        raise ParameterError("--workers and --scheduler exclude each other: give one of them")

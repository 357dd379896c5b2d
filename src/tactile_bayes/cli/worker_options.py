"""Options for the processes of a command with many tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

__all__ = ["WorkerOptions"]


@dataclass(frozen=True)
class WorkerOptions:
    """Local processes or a Dask scheduler; both together are refused."""

    workers: Annotated[
        int | None, typer.Option(help="Number of local processes; by default one for each core.", min=1)
    ] = None
    scheduler: Annotated[
        str | None,
        typer.Option(help="Address of a Dask scheduler in place of --workers, like tcp://10.0.0.1:8786."),
    ] = None

    def __post_init__(self) -> None:
        from tactile_bayes.errors import ParameterError

        if self.workers is not None and self.scheduler is not None:
            raise ParameterError("--workers and --scheduler exclude each other: give one of them")

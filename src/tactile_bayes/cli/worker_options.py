"""Options for the processes of a command with many tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import typer

__all__ = ["WorkerOptions"]


@dataclass(frozen=True)
class WorkerOptions:
    """Local processes, or a Dask scheduler."""

    workers: Annotated[
        str | None,
        typer.Option(
            help="Number of local processes, by default one for each core; or the address of a Dask scheduler, like "
            "tcp://10.0.0.1:8786."
        ),
    ] = None

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of the functions that share their tasks.

        Raises
        ------
        ParameterError
            If it is neither a number nor an address.
        """
        from tactile_bayes.errors import ParameterError

        if self.workers is None:
            return {}
        if "://" in self.workers:
            return {"scheduler": self.workers}
        if not (self.workers.isascii() and self.workers.isdigit() and int(self.workers)):
            raise ParameterError(
                f"--workers is {self.workers!r}: give a number of processes, or the address of a scheduler"
            )
        return {"workers": int(self.workers)}

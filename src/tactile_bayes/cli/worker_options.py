"""Options for the processes of a command with many tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Callable

    from tactile_bayes.tasks import TaskProgress, Workers


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

    def reporting(self, progress: Callable[[TaskProgress], object]) -> Workers:
        """Return the workers, of which a function hears."""
        from tactile_bayes.errors import ParameterError
        from tactile_bayes.tasks import Workers

        if self.workers is None or "://" in self.workers:
            return Workers(self.workers, progress)
        if not (self.workers.isascii() and self.workers.isdigit() and int(self.workers)):
            raise ParameterError(
                f"--workers is {self.workers!r}: give a number of processes, or the address of a scheduler"
            )
        return Workers(int(self.workers), progress)

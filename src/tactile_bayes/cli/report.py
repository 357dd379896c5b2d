"""The command `report`: the results of a run as one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Output, Reads, Writes
from tactile_bayes.cli.task_bar import step_bar

__all__ = ["report"]


def report(
    *,
    run: Annotated[
        Path, typer.Argument(help="Folder of a run of infer."), Reads(("posterior.nc", "trust.nc", "comparison.nc"))
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="File for the page; report.html in that folder if left out.", dir_okay=False),
        Writes(),
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option(help="Folder of a run of compare on the same record; the run's own if left out.", file_okay=False),
        Reads(("comparison.nc",)),
    ] = None,
    output: Output,
) -> Answer:
    """Write a page on a run: its results, how far to trust them, the readings, and how to reproduce it."""
    with step_bar(output.is_silent) as show:
        from tactile_bayes.report import write_report

        path = write_report(run, out, compare=compare, progress=show)
    size = path.stat().st_size
    words = str(path) if output.quiet else f"{path} ({size / 1e3:.0f} kB): open it in a browser; it needs no network."
    return Answer([words], lambda: {"report": path, "bytes": size})

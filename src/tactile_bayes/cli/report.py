"""The command `report`: the results of a run, or of several, as one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Output, Reads, Writes
from tactile_bayes.cli.progress import step_bar


def report(
    *,
    run: Annotated[
        list[Path],
        "Folder of a run of infer; or a folder of several, or several: then side by side.",
        typer.Argument(),
        Reads(("posterior.nc", "trust.nc", "comparison.nc", "runs.nc", "*/posterior.nc")),
    ],
    out: Annotated[
        Path | None,
        "File for the page; report.html in that folder if left out, which only one folder allows.",
        Writes(),
    ] = None,
    compare: Annotated[
        Path | None,
        "Folder of a run of compare on the same record; the run's own if left out.",
        typer.Option(file_okay=False),
        Reads(("comparison.nc",)),
    ] = None,
    overlay: Annotated[
        Path | None,
        "Another run, or a true contour, to lay over it, with the distance in the table: a folder of infer, a CSV file "
        "of x and y with units in their names, like x [mm], or a DXF drawing, in the laboratory frame.",
        Reads(("posterior.nc",)),
    ] = None,
    output: Output,
) -> Answer:
    """Write a page on a run: its results, how far to trust them, the readings, and how to reproduce it.

    Of several runs the page shows the results side by side, and the contours over each other.
    """
    with step_bar(output.is_silent) as show:
        from tactile_bayes.report.writing import report_into

        made = report_into(run, out, compare, overlay, show)
    path, laid, drawn = made.path, made.laid, {} if made.figure is None else {"overlay": made.figure}
    size = path.stat().st_size
    words = [str(path)]
    if not output.quiet:
        words = [f"{path} ({size / 1e3:.0f} kB): open it in a browser; it needs no network."]
        words += [] if overlay is None else laid.words(overlay.resolve().name)
    found = {
        "unit": laid.unit,
        "distances": {name: distance._asdict() for name, distance in laid.distances.items()},
        **({} if made.figure is None else {"figure": made.figure}),
    }
    return Answer(
        [*words, drawn] if drawn else words,
        lambda: {"report": path, "bytes": size, **({} if overlay is None else {"overlay": found})},
    )

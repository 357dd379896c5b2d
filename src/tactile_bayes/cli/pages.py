"""The commands `report` and `figures`: the results of runs as one page, and the figures of Merker et al. 2018."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

import tactile_bayes as tb
from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Out, Output, Reads, Seed, Writes
from tactile_bayes.cli.progress import resumable_bar, step_bar
from tactile_bayes.cli.rigs import NoiseOptions
from tactile_bayes.cli.scan_options import rotation_step
from tactile_bayes.errors import ParameterError
from tactile_bayes.runs.names import FIGURES


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


def figures(
    *,
    out: Annotated[Out, Writes(FIGURES)],
    only: Annotated[list[int] | None, "Number of a figure, from 2 to 11; may be repeated. By default all."] = None,
    format: Annotated[
        list[str] | None,
        "Format of the files, pdf, svg or png; may be repeated; default pdf and png.",
        typer.Option("--format"),
    ] = None,
    distance: Annotated[
        list[float] | None, "Height of the profile above the origin, q [L]; may be repeated; default the figure's own."
    ] = None,
    drive_step: Annotated[float | None, "Step of the drive [degrees], by default 1."] = None,
    rods: Annotated[int, "Number of rods drawn of a sweep in figures 7 to 10.", typer.Option(min=1)] = 15,
    noise: NoiseOptions,
    seed: Seed = 1,
    column: Annotated[bool, "Draw for a column, 3.5 inches wide, instead of a page, 7 inches."] = False,
    style: Annotated[Literal["print", "screen"], "Letters of 8 points for print, or of 10 for the screen."] = "print",
    output: Output,
) -> Answer:
    """Draw Figures 2 to 11 of Merker et al. 2018 (doi 10.1155/2018/1613945) from our own computation.

    Numbers are in units of the rod (L, EI/L, EI/L²). Noise is that of the loads in figure 11, by default none.
    """
    from tactile_bayes.plotting.style import COLUMN_WIDTH, PAGE_WIDTH

    if (not noise.force_noise) != (not noise.moment_noise):
        raise ParameterError("--force-noise and --moment-noise go together, above zero: give both, or neither")
    options: dict[str, Any] = {
        "distances": distance or None,
        "drive_step": rotation_step(drive_step),
        "rods": rods,
        "load_cell": noise.in_place_of(None),
        "rng": seed,
        "width": COLUMN_WIDTH if column else PAGE_WIDTH,
    }
    numbers = list(dict.fromkeys(only or tb.paper_figures.NUMBERS))
    count, then = len(numbers), "the same command draws all of them again"
    with resumable_bar("figure", output.is_silent, out, count, then=then) as note:
        files = tb.paper_figures.draw_all(
            out,
            only=numbers,
            formats=format or ("pdf", "png"),
            style=style,
            progress=lambda done: note(tb.tasks.TaskProgress(done, count, done, 0.0)),
            **options,
        )
    words, rows = list[str](), list[dict[str, Any]]()
    for number, of_formats in files.items():
        text = tb.paper_figures.caption(number, **options)
        words += [f"Figure {number}: {text}", *(f"    {path}" for path in of_formats.values())]
        rows.append({"number": number, "caption": text, "files": of_formats})
    return Answer(words, lambda: {"figures": rows})

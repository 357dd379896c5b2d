"""The command `figures`: those of Merker et al. 2018, computed anew."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Json, print_json
from tactile_bayes.cli.interrupts import going_on
from tactile_bayes.cli.numbers import load_cell_asked
from tactile_bayes.cli.record_options import Out, Quiet, Seed
from tactile_bayes.cli.task_bar import task_bar

__all__ = ["figures"]


def figures(
    out: Out,
    only: Annotated[
        list[int] | None, typer.Option(help="Number of a figure, from 2 to 11; again for another. By default all.")
    ] = None,
    format: Annotated[
        list[str] | None,
        typer.Option("--format", help="Of the files, pdf, svg or png; again for another. By default pdf and png."),
    ] = None,
    distance: Annotated[
        list[float] | None,
        typer.Option(help="Of the profile from the pivot, q [L]; again for another. By default the figure's own."),
    ] = None,
    drive_step: Annotated[float, typer.Option(help="Step of the drive [degrees].")] = 1.0,
    rods: Annotated[int, typer.Option(help="Rods drawn of a sweep in figures 7 to 10.", min=1)] = 15,
    force_noise: Annotated[
        float | None, typer.Option(help="Noise of the forces in figure 11 [EI/L²]; by default none.")
    ] = None,
    moment_noise: Annotated[float | None, typer.Option(help="Likewise of the moment [EI/L].")] = None,
    seed: Seed = 1,
    column: Annotated[
        bool, typer.Option("--column", help="As wide as a column, 3.5 inches, in place of a page, 7 inches.")
    ] = False,
    style: Annotated[
        Literal["print", "screen"], typer.Option(help="Letters of 8 points for print, or of 10 for the screen.")
    ] = "print",
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Draw Figures 2 to 11 of Merker et al. 2018 (doi 10.1155/2018/1613945) from our own computation."""
    import numpy as np

    from tactile_bayes.paper_figures import NUMBERS, caption, draw_all
    from tactile_bayes.plotting.style import COLUMN_WIDTH, PAGE_WIDTH

    options: dict[str, Any] = {
        "distances": distance or None,
        "drive_step": float(np.radians(drive_step)),
        "rods": rods,
        "load_cell": load_cell_asked(force_noise, moment_noise),
        "seed": seed,
        "width": COLUMN_WIDTH if column else PAGE_WIDTH,
    }
    numbers = list(dict.fromkeys(only or NUMBERS))
    finished = 0
    with (
        going_on(
            lambda: f"{finished} of {len(numbers)} figures are drawn", then="the same command draws all anew"
        ) as raise_lost,
        task_bar(len(numbers), "figure", quiet or json) as show,
    ):

        def note(done: int) -> None:
            nonlocal finished
            finished = done
            show(done)
            raise_lost()

        files = draw_all(out, only=numbers, formats=format or ("pdf", "png"), style=style, progress=note, **options)
    captions = {number: caption(number, **options) for number in files}
    if json:
        rows = [{"number": k, "caption": captions[k], "files": of_formats} for k, of_formats in files.items()]
        print_json({"figures": rows})
        return
    for number, of_formats in files.items():
        typer.echo(f"Figure {number}: {captions[number]}")
        for path in of_formats.values():
            typer.echo(f"    {path}")

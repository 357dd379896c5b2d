"""The command `figures`: the figures of Merker et al. 2018, computed anew."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Out, Output, Seed
from tactile_bayes.cli.rig_options import NoiseOptions
from tactile_bayes.cli.task_bar import resumable_bar

__all__ = ["figures"]


@dataclass(frozen=True)
class _NoiseOptions(NoiseOptions):
    """Noise of figure 11."""

    force_noise: Annotated[
        float | None, typer.Option(help="Noise of the forces in figure 11 [EI/L²]; by default none.")
    ] = None
    moment_noise: Annotated[float | None, typer.Option(help="Likewise of the moment [EI/L].")] = None


def figures(
    *,
    out: Out,
    only: Annotated[
        list[int] | None, typer.Option(help="Number of a figure, from 2 to 11; may be repeated. By default all.")
    ] = None,
    format: Annotated[
        list[str] | None,
        typer.Option("--format", help="Format of the files, pdf, svg or png; may be repeated; default pdf and png."),
    ] = None,
    distance: Annotated[
        list[float] | None,
        typer.Option(help="Distance of the profile from the pivot, q [L]; may be repeated; default the figure's own."),
    ] = None,
    drive_step: Annotated[float, typer.Option(help="Step of the drive [degrees].")] = 1.0,
    rods: Annotated[int, typer.Option(help="Number of rods drawn of a sweep in figures 7 to 10.", min=1)] = 15,
    noise: _NoiseOptions,
    seed: Seed = 1,
    column: Annotated[
        bool, typer.Option("--column", help="Draw for a column, 3.5 inches wide, instead of a page, 7 inches.")
    ] = False,
    style: Annotated[
        Literal["print", "screen"], typer.Option(help="Letters of 8 points for print, or of 10 for the screen.")
    ] = "print",
    output: Output,
) -> Answer:
    """Draw Figures 2 to 11 of Merker et al. 2018 (doi 10.1155/2018/1613945) from our own computation."""
    from tactile_bayes.paper_figures import NUMBERS, caption, draw_all
    from tactile_bayes.plotting.style import COLUMN_WIDTH, PAGE_WIDTH

    options: dict[str, Any] = {
        "distances": distance or None,
        "drive_step": math.radians(drive_step),
        "rods": rods,
        "load_cell": noise.load_cell,
        "seed": seed,
        "width": COLUMN_WIDTH if column else PAGE_WIDTH,
    }
    numbers = list(dict.fromkeys(only or NUMBERS))
    with resumable_bar(
        len(numbers),
        "figure",
        output.is_silent,
        lambda done: f"{done or 0} of {len(numbers)} figures are drawn",
        then="the same command draws all anew",
    ) as note:
        files = draw_all(out, only=numbers, formats=format or ("pdf", "png"), style=style, progress=note, **options)
    captions = {number: caption(number, **options) for number in files}
    words = [
        line
        for number, of_formats in files.items()
        for line in (f"Figure {number}: {captions[number]}", *(f"    {path}" for path in of_formats.values()))
    ]
    rows = [{"number": number, "caption": captions[number], "files": files[number]} for number in files]
    return Answer(words, lambda: {"figures": rows})

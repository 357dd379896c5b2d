"""The command `figures`: the figures of Merker et al. 2018, computed anew."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Out, Output, Reads, Seed, Writes
from tactile_bayes.cli.drive_options import DriveOptions
from tactile_bayes.cli.rig_options import NoiseOptions
from tactile_bayes.cli.task_bar import resumable_bar
from tactile_bayes.runs.names import FIGURES

if TYPE_CHECKING:
    from tactile_bayes.load_cell import LoadCell
    from tactile_bayes.sweep import Carried


@dataclass(frozen=True)
class _DriveOptions(DriveOptions):
    """The drive of all figures, by default rotations."""

    carry: Annotated[
        list[str] | None,
        typer.Option(
            help="Carry the base along a line, the rod clamped, instead of turning it: X,Y,HEADING,DRIVE_ANGLE,TRAVEL, "
            "where it begins [L], its direction and the slope of the rod [degrees], and how far it moves [L]; or along "
            "any path: a CSV file with columns x, y [L] and drive_angle [degrees], a line for each pose."
        ),
        Reads(),
    ] = None
    drive_step: Annotated[
        float | None,
        typer.Option(
            help="Step of rotations [degrees], by default 1; of --carry [L], by default 0.01, or the poses if they are "
            "more than 8."
        ),
    ] = None

    @property
    def drive(self) -> Carried | None:
        """The drive that carries the base, if there is one."""
        from tactile_bayes.errors import ParameterError

        carried = self.carried(self.drive_step)
        if len(carried) > 1:
            raise ParameterError(f"figures show one drive, and there are {len(carried)}: give --carry once")
        return carried[0] if carried else None


@dataclass(frozen=True)
class _NoiseOptions(NoiseOptions):
    """Noise of figure 11."""

    force_noise: Annotated[
        float | None, typer.Option(help="Noise of the forces in figure 11 [EI/L²]; by default none.")
    ] = None
    moment_noise: Annotated[float | None, typer.Option(help="Likewise of the moment [EI/L].")] = None

    @property
    def load_cell(self) -> LoadCell | None:
        """The load cell, or None if no option gives one."""
        from tactile_bayes.errors import ParameterError

        if (not self.force_noise) != (not self.moment_noise):
            raise ParameterError("--force-noise and --moment-noise go together, above zero: give both, or neither")
        return self.in_place_of(None)


def figures(
    *,
    out: Annotated[Out, Writes(FIGURES)],
    only: Annotated[
        list[int] | None, typer.Option(help="Number of a figure, from 2 to 11; may be repeated. By default all.")
    ] = None,
    format: Annotated[
        list[str] | None,
        typer.Option("--format", help="Format of the files, pdf, svg or png; may be repeated; default pdf and png."),
    ] = None,
    distance: Annotated[
        list[float] | None,
        typer.Option(help="Height of the profile above the origin, q [L]; may be repeated; default the figure's own."),
    ] = None,
    drive: _DriveOptions,
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
    """Draw Figures 2 to 11 of Merker et al. 2018 (doi 10.1155/2018/1613945) from our own computation.

    The drive turns the rod about the origin, as in the paper, or carries its base (--carry).
    """
    from tactile_bayes.paper_figures import NUMBERS, caption, draw_all
    from tactile_bayes.plotting.style import COLUMN_WIDTH, PAGE_WIDTH

    carried = drive.drive
    options: dict[str, Any] = {
        "distances": distance or None,
        "drive": carried,
        "drive_step": None if carried else drive.rotation_step,
        "rods": rods,
        "load_cell": noise.load_cell,
        "rng": seed,
        "width": COLUMN_WIDTH if column else PAGE_WIDTH,
    }
    numbers = list(dict.fromkeys(only or NUMBERS))
    with resumable_bar(
        len(numbers),
        "figure",
        output.is_silent,
        lambda done: f"{done or 0} of {len(numbers)} figures are drawn",
        then="the same command draws all of them again",
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

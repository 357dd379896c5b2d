"""The command `design`: the best drive for the next record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Out, Output, Reads, Seed, Writes
from tactile_bayes.cli.drive_options import CarryOptions
from tactile_bayes.cli.numbers import numbers_asked
from tactile_bayes.cli.rig_options import RigFile
from tactile_bayes.cli.task_bar import counted, resumable_bar
from tactile_bayes.cli.worker_options import WorkerOptions
from tactile_bayes.runs.names import DESIGN

if TYPE_CHECKING:
    import xarray as xr

    from tactile_bayes.runs.folder import Run

__all__ = ["design"]

Criterion = Literal["band", "gap", "information"]


def design(
    *,
    out: Annotated[Out, Writes((*DESIGN, "nested/*"))],
    run: Annotated[
        Path | None,
        typer.Argument(help="Folder of a run of infer, or its posterior.nc, as present knowledge; else the prior."),
        Reads(("posterior.nc",)),
    ] = None,
    family: Annotated[str, typer.Option(help="Shape of the contours, if only a prior is known.")] = "parabola",
    base: Annotated[
        list[str] | None,
        typer.Option(
            help="A pivot to choose from, X,Y [m, or L]; may be repeated. By default, without --carry, "
            "eleven across at three heights."
        ),
    ] = None,
    drive_step: Annotated[
        list[float] | None, typer.Option(help="A step of the drive to choose from [degrees]; by default 2.")
    ] = None,
    criterion: Annotated[
        Criterion, typer.Option(help="The narrowest band, the smallest gap, or the most information.")
    ] = "band",
    nested: Annotated[
        bool,
        typer.Option(
            "--nested",
            help="Sample each candidate's posteriors as well, which takes longer; the same command resumes a stopped "
            "run.",
        ),
    ] = False,
    draws: Annotated[int, typer.Option(help="Number of objects drawn from posterior or prior.", min=2)] = 24,
    carries: CarryOptions,
    rig: RigFile,
    work: WorkerOptions,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Choose the drive of the next record, so that the contour's band becomes narrowest.

    Candidates are pivots (--base) and drives that carry the base (--carry), each with every --drive-step.
    """
    import numpy as np

    from tactile_bayes.errors import ParameterError
    from tactile_bayes.planning.design import ABOVE, ACROSS
    from tactile_bayes.runs.design import design_into

    pivots = [numbers_asked(pivot, "--base", 2) for pivot in base] if base else None
    drives = carries.carried or None
    options: dict[str, Any] = {}
    known: xr.DataTree | str = family
    if run is not None:
        if rig.rig is not None:
            raise ParameterError("a run has its rig: leave out --rig, or the run")
        known = _posterior(run)
    else:
        options = {"rig": rig.stated}
    steps = drive_step or [2.0]
    usual = 0 if drives else ACROSS.size * ABOVE.size
    count = (len(pivots or ()) + len(drives or ()) or usual) * len(steps)

    def have(done: int | None) -> str:
        if not nested:
            return "nothing was written"
        return f"{done or 0:,} of {counted(count, 'candidate')} are in {out / 'nested'}"

    then = "the same command resumes" if nested else "the same command starts again"
    with resumable_bar(count, "candidate", output.is_silent, have, then=then) as note:
        made = design_into(
            out,
            known,
            rng=seed,
            bases=pivots,
            drives=drives,
            drive_steps=np.radians(steps),
            criterion=criterion,
            nested=nested,
            draws=draws,
            progress=lambda designing: note(designing.done),
            **work.arguments,
            **options,
        )
    words = made.files["words"].read_text(encoding="utf-8").splitlines()
    return Answer([*words, "", made.files], lambda: _numbers(made, words))


def _posterior(run: Path) -> xr.DataTree:
    from tactile_bayes.inference.result import read_result
    from tactile_bayes.runs.folder import posterior_in

    is_the_file = run.is_file() or (run.suffix == ".nc" and not run.exists())
    return read_result(run if is_the_file else posterior_in(run))


def _numbers(made: Run[xr.Dataset], words: list[str]) -> dict[str, Any]:
    found = made.result
    columns = [str(name) for name, values in found.data_vars.items() if values.dims == ("candidate",)]
    return {
        "words": words,
        "best": int(found.best),
        "present_width": float(found.present_width),
        "candidates": [
            {name: found[name].values[k].item() for name in columns} for k in range(found.sizes["candidate"])
        ],
        "files": made.files,
    }

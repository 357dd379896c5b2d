"""The command `design`: the best drive for the next record."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Out, Output, Reads, Seed, Writes
from tactile_bayes.cli.progress import WorkerOptions, resumable_bar
from tactile_bayes.cli.rig_options import RigFile
from tactile_bayes.cli.scan_options import CarryOptions, pivots_in
from tactile_bayes.errors import ParameterError
from tactile_bayes.runs.names import DESIGN

if TYPE_CHECKING:
    import xarray as xr

    from tactile_bayes.runs.folder import Run
    from tactile_bayes.sweep import Carried, Drive


def design(
    *,
    out: Annotated[Out, Writes((*DESIGN, "nested/*"))],
    run: Annotated[
        Path | None,
        "Folder of a run of infer, or its posterior.nc, as present knowledge; else the prior.",
        typer.Argument(),
        Reads(("posterior.nc",)),
    ] = None,
    family: Annotated[str, "Shape of the contours, if only a prior is known."] = "parabola",
    base: Annotated[
        list[str] | None,
        "A pivot to choose from, X,Y [m, or L]; may be repeated. By default, without --carry, eleven across at three "
        "heights.",
    ] = None,
    drive_step: Annotated[list[float] | None, "A step of the drive to choose from [degrees]; by default 2."] = None,
    criterion: Annotated[
        Literal["band", "gap", "information"], "The narrowest band, the smallest gap, or the most information."
    ] = "band",
    nested: Annotated[
        bool, "Sample each candidate's posteriors as well, which takes longer; the same command resumes a stopped run."
    ] = False,
    draws: Annotated[int, "Number of objects drawn from posterior or prior.", typer.Option(min=2)] = 24,
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

    from tactile_bayes.planning.design import usual_drives
    from tactile_bayes.runs.design import design_into
    from tactile_bayes.sweep import Rotation

    options: dict[str, Any] = {}
    known: xr.DataTree | str = family
    if run is not None:
        if rig.rig is not None:
            raise ParameterError("a run has its rig: leave out --rig, or the run")
        known = _posterior(run)
    else:
        options = {"rig": rig.stated}
    steps = np.radians(drive_step or [2.0]).tolist()
    if base or carries.carry:
        drives: list[Drive] = [Rotation(pivot, drive_step=step) for pivot in pivots_in(base) for step in steps if base]
        drives += [_as_often(drive, step) for drive in carries.carried() for step in steps]
    else:
        usual = [usual_drives(known, options.get("rig"), step) for step in steps]
        drives = [drive for each in zip(*usual, strict=True) for drive in each]

    where = out / "nested" if nested else None
    then = f"the same command {'resumes' if nested else 'starts again'}"
    with resumable_bar("candidate", output.is_silent, where, len(drives), then=then) as note:
        made = design_into(
            out,
            known,
            rng=seed,
            drives=drives,
            criterion=criterion,
            nested=nested,
            draws=draws,
            workers=work.reporting(note),
            **options,
        )
    words = made.files["words"].read_text(encoding="utf-8").splitlines()
    return Answer([*words, "", made.files], lambda: _numbers(made, words))


def _as_often(drive: Carried, step: float) -> Carried:
    """Return a drive with as many samples as a rotation of a step [rad]."""
    from tactile_bayes.sweep import blind_angles

    given: Any = drive
    made: Carried = replace(given, drive_step=float(drive.travels[-1]) / (blind_angles(step).size - 1))
    return made


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

"""The command `design`: where to put the whisker, or its next base."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Json, print_json
from tactile_bayes.cli.interrupts import going_on
from tactile_bayes.cli.numbers import load_cell_asked, numbers_asked
from tactile_bayes.cli.record_options import (
    AsStated,
    KnownFriction,
    Nuisances,
    Out,
    Quiet,
    Seed,
    nuisances_asked,
    rod_asked,
)
from tactile_bayes.cli.simulated_rig_options import Diameter, FlexuralRigidity
from tactile_bayes.cli.task_bar import counted, task_bar
from tactile_bayes.cli.worker_options import Scheduler, Workers, refuse_both

if TYPE_CHECKING:
    import xarray as xr

    from tactile_bayes.ledger import TaskProgress

__all__ = ["design"]

Criterion = Literal["band", "gap", "information"]


def design(
    out: Out,
    run: Annotated[
        Path | None,
        typer.Argument(help="Folder of a run of infer, or its posterior.nc: what is known so far. Without, a prior."),
    ] = None,
    family: Annotated[
        str, typer.Option(help="Shape of the contours, where nothing but a prior is known.")
    ] = "parabola",
    base: Annotated[
        list[str] | None,
        typer.Option(
            help="A pivot to choose from, X,Y [m, or L]; again for another. By default eleven across at three heights."
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
            help="Sample each candidate's posteriors as well, which takes longer; the same command goes on where it "
            "was stopped.",
        ),
    ] = False,
    draws: Annotated[int, typer.Option(help="Objects drawn from what is known.", min=2)] = 24,
    force_noise: Annotated[
        float | None, typer.Option(help="Without a run: noise of the forces [N, or EI/L²]; by default 0.05 EI/L².")
    ] = None,
    moment_noise: Annotated[
        float | None, typer.Option(help="Likewise of the moment [N m, or EI/L]; by default 0.02 EI/L.")
    ] = None,
    length: Annotated[float | None, typer.Option(help="Likewise the rod's length [m].")] = None,
    flexural_rigidity: FlexuralRigidity = None,
    diameter: Diameter = 0.0,
    friction: KnownFriction = None,
    nuisance: Nuisances = None,
    as_stated: AsStated = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    seed: Seed = 1,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Choose the next record: from which pivot, and in which steps, it makes the contour's band narrowest."""
    import numpy as np

    from tactile_bayes.planning.design import ABOVE, ACROSS
    from tactile_bayes.runs.design import design_into

    refuse_both(workers, scheduler)
    pivots = [numbers_asked(pivot, "--base", 2) for pivot in base] if base else None
    options: dict[str, Any] = {}
    known: xr.DataTree | str = family
    if run is not None:
        known = _posterior(run)
    else:
        rod = rod_asked(length, flexural_rigidity, diameter)
        options = {
            "load_cell": load_cell_asked(force_noise, moment_noise),
            "rod": rod,
            "friction": friction,
            "nuisances": nuisances_asked(nuisance, as_stated),
        }
    steps = drive_step or [2.0]
    count = (len(pivots) if pivots else ACROSS.size * ABOVE.size) * len(steps)
    done = 0

    def have() -> str:
        return f"{done:,} of {counted(count, 'candidate')} are in {out / 'nested'}" if nested else "nothing was written"

    then = "the same command goes on" if nested else "the same command begins anew"
    with going_on(have, then=then) as raise_lost, task_bar(count, "candidate", quiet or json) as show:

        def note(progress: TaskProgress) -> None:
            nonlocal done
            done = progress.done
            show(done)
            raise_lost()

        made = design_into(
            out,
            known,
            seed=seed,
            bases=pivots,
            drive_steps=np.radians(steps),
            criterion=criterion,
            nested=nested,
            draws=draws,
            workers=workers,
            scheduler=scheduler,
            progress=note,
            **options,
        )
    if json:
        _print_json(made.design, made.files)
        return
    for sentence in made.files["words"].read_text(encoding="utf-8").splitlines():
        typer.echo(sentence)
    typer.echo()
    for what, path in made.files.items():
        typer.echo(f"{what:<12} {path}")


def _posterior(run: Path) -> xr.DataTree:
    from tactile_bayes.inference.result import read_result
    from tactile_bayes.runs.run_folder import posterior_in

    is_the_file = run.is_file() or (run.suffix == ".nc" and not run.exists())
    return read_result(run if is_the_file else posterior_in(run))


def _print_json(found: xr.Dataset, files: Any) -> None:
    from tactile_bayes.runs.design import design_in_words

    columns = [str(name) for name, values in found.data_vars.items() if values.dims == ("candidate",)]
    rows = [{name: float(found[name].values[k]) for name in columns} for k in range(found.sizes["candidate"])]
    answer = {
        "words": list(design_in_words(found)),
        "best": int(found.best),
        "present_width": float(found.present_width),
        "candidates": rows,
        "files": {what: str(path) for what, path in files.items()},
    }
    print_json(answer)

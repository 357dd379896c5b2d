"""The command `calibrate`: whether intervals hold, over records that are simulated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from tactile_bayes.cli.answer import Json, columns_of, print_json, print_sentences, print_table, table_of
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
from tactile_bayes.cli.simulated_rig_options import Bases, Diameter, FlexuralRigidity, ForceNoise, Length, MomentNoise
from tactile_bayes.cli.task_bar import task_bar
from tactile_bayes.cli.worker_options import Scheduler, Workers, refuse_both

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from tactile_bayes.calibration.replicate import Replicate
    from tactile_bayes.calibration.world import World
    from tactile_bayes.ledger import TaskProgress
    from tactile_bayes.runs.calibration import CalibrationRun

__all__ = ["calibrate"]


def calibrate(
    ctx: typer.Context,
    out: Out,
    family: Annotated[str, typer.Option(help="Shape of the contours, as for infer, shape-free too.")] = "parabola",
    replicates: Annotated[int, typer.Option(help="How many records.", min=1)] = 200,
    force_noise: ForceNoise = None,
    moment_noise: MomentNoise = None,
    length: Length = None,
    flexural_rigidity: FlexuralRigidity = None,
    diameter: Diameter = 0.0,
    base: Bases = None,
    drive_step: Annotated[float, typer.Option(help="Step of the drive [degrees].", min=0.05, max=30.0)] = 2.0,
    friction: KnownFriction = None,
    nuisance: Nuisances = None,
    as_stated: AsStated = False,
    world: Annotated[
        list[str] | None,
        typer.Option(
            help="What the world has otherwise than inference assumes: friction=0.3, rigidity_scale=1.05, "
            "drive_angle_offset=0.02, base_shift=0.01,0, bias=0.02,0.05,0.05, drift=0.04,0.1,0.1, "
            "flat_spot=ANGLE,FACTOR; give it again for another."
        ),
    ] = None,
    probability: Annotated[float, typer.Option(help="Of the bands and regions that are judged.")] = 0.9,
    workers: Workers = None,
    scheduler: Scheduler = None,
    seed: Seed = 1,
    replicate: Annotated[
        int | None,
        typer.Option(
            help="Make this replicate alone, once more, and print what comes of it; nothing is written.", min=0
        ),
    ] = None,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show where an error comes from; with --replicate, the one that lost it.")
    ] = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Show whether intervals hold: simulate records, infer from each, and compare with the truth.

    A run that was stopped goes on by the same command; with more replicates it begins with those that are there. An
    error in a replicate does not end the run, but counts against it; --replicate shows which error it was.
    """
    import numpy as np

    from tactile_bayes.runs.calibration import calibrate_into

    refuse_both(workers, scheduler)
    common = ctx.find_root().params
    common["debug"] = common["debug"] or debug
    experiment: dict[str, Any] = {
        "family": family,
        "load_cell": load_cell_asked(force_noise, moment_noise),
        "rod": rod_asked(length, flexural_rigidity, diameter),
        "base": [numbers_asked(pivot, "--base", 2) for pivot in base or ["0,0"]],
        "drive_angles": np.radians(np.arange(-30.0, 210.0 + 0.5 * drive_step, drive_step)),
        "friction": friction,
        "nuisances": nuisances_asked(nuisance, as_stated),
        "world": _world(world or []),
        "probability": probability,
        "seed": seed,
    }
    if replicate is not None:
        from tactile_bayes.calibration.calibrate import calibration_replicate

        _print_replicate(calibration_replicate(replicate, out=out, throw=common["debug"], **experiment), json)
        return
    last: TaskProgress | None = None

    def have() -> str:
        return f"{last.done:,} of {replicates:,} replicates are in {out}" if last else "no further replicate was done"

    with going_on(have) as raise_lost, task_bar(replicates, "replicate", quiet or json) as show:

        def note(calibrating: TaskProgress) -> None:
            nonlocal last
            last = calibrating
            show(calibrating.done)
            raise_lost()

        run = calibrate_into(
            out,
            replicates=replicates,
            workers=workers,
            scheduler=scheduler,
            progress=note,
            **experiment,
        )
    if json:
        found = run.calibration
        names = ("conclusion", "lost", "probability", "power", "noticed_shift", "noticed_narrow", "noticed_wide")
        told = {"words": [found.attrs["verdict"]], **{name: found.attrs[name] for name in names}}
        print_json({**told, "claims": columns_of(found, "claim"), "files": run.files})
        return
    _print_run(run)


def _world(options: Sequence[str]) -> World:
    from tactile_bayes.calibration.world import NUMBERS, World
    from tactile_bayes.errors import ParameterError

    given: dict[str, Any] = {}
    for option in options:
        name, equals, value = (part.strip() for part in option.partition("="))
        if not equals or name not in NUMBERS:
            raise ParameterError(f"--world {option}: write NAME=VALUE, with one of {', '.join(NUMBERS)}")
        numbers = numbers_asked(value, f"--world {name}", NUMBERS[name])
        given[name] = numbers[0] if NUMBERS[name] == 1 else numbers
    return World(**given)


def _print_run(run: CalibrationRun) -> None:
    from rich.console import Console

    console = Console()
    found = run.calibration
    console.print(found.attrs["verdict"], markup=False, highlight=False, soft_wrap=True)
    console.print()
    console.print(_table(found))
    console.print()
    for what, path in run.files.items():
        console.print(f"{what:<12} {path}", highlight=False, soft_wrap=True)


def _print_replicate(made: Replicate, json: bool) -> None:
    outcome = made.outcome
    if json:
        print_json({"number": made.number, "lost": outcome.is_lost, "truth": made.truth, **outcome._asdict()})
        return
    how = f"was lost: {outcome.message}. --debug shows where" if outcome.is_lost else f"is done: {outcome.message}"
    print_sentences([f"Replicate {made.number} {how}.", ""])
    quantities = table_of(["quantity", "truth", "rank"], left=["quantity"])
    for name in dict.fromkeys([*made.truth, *outcome.ranks]):
        truth = f"{made.truth[name]:.6g}" if name in made.truth else ""
        quantities.add_row(name, truth, str(outcome.ranks.get(name, "")))
    numbers = table_of(["number", "value"], left=["number"])
    for name, value in outcome.numbers.items():
        if value == value:  # NaN is what could not be had
            numbers.add_row(name, f"{value:.6g}")
    for table in (quantities, numbers):
        if table.row_count:
            print_table(table)
            print_sentences([""])


def _table(found: xr.Dataset) -> object:
    from rich.table import Table

    from tactile_bayes.calibration.summary import CLAIMS

    table = Table(box=None, pad_edge=False)
    table.add_column(f"stated with {found.attrs['probability']:.0%}", no_wrap=True)
    table.add_column("holds in", justify="right", no_wrap=True)
    table.add_column("of replicates", justify="right", no_wrap=True)
    for name in found.claim.values:
        row = found.sel(claim=name)
        share, error, count = float(row.coverage), float(row.coverage_error), int(row.coverage_replicates)
        if count:
            told = f"{share:.1%}" + (f" ± {error:.1%}" if error == error else "")
            table.add_row(CLAIMS[str(name)], told, f"{count:,}")
    return table

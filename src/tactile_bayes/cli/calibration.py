"""The commands `calibrate` and `calibrate-rig`: coverage over simulated records, and the rig from a known contour."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tactile_bayes as tb
from tactile_bayes.cli.analysis import quantities
from tactile_bayes.cli.answer import Answer, columns_of, table_of
from tactile_bayes.cli.command import Out, Output, Seed, Writes
from tactile_bayes.cli.progress import WorkerOptions, resumable_bar, sampling_bar
from tactile_bayes.cli.rigs import RigFile, RigOptions
from tactile_bayes.cli.scan_options import GaugeOptions, Pivots, pivots_in
from tactile_bayes.runs.names import CALIBRATION, RIG

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from rich.table import Table

    from tactile_bayes.calibration.replicate import Replicate


def calibrate(
    *,
    ctx: typer.Context,
    out: Annotated[Out, Writes((*CALIBRATION, "replicates.json"))],
    family: Annotated[str, "Shape of the contours, as for infer, shape-free too."] = "parabola",
    replicates: Annotated[int, "Number of records.", typer.Option(min=1)] = 200,
    rig: RigFile,
    base: Pivots = None,
    drive_step: Annotated[float, "Step of the drive [degrees].", typer.Option(min=0.05, max=30.0)] = 2.0,
    truth: Annotated[
        Path | None,
        "Another rig.toml, by which the records are simulated: what inference assumes is then wrong.",
        typer.Option(dir_okay=False),
    ] = None,
    work: WorkerOptions,
    seed: Seed = 1,
    replicate: Annotated[
        int | None, "Repeat this replicate alone, and print its result; nothing is written.", typer.Option(min=0)
    ] = None,
    debug: Annotated[bool, "Show the traceback of an error; with --replicate, of the one that lost it."] = False,
    output: Output,
) -> Answer:
    """Measure how often intervals hold: simulate records, infer from each, and compare with the truth.

    The same command resumes a stopped run; with more replicates it begins with those already made. An
    error in a replicate does not end the run, but counts against it; --replicate shows which error it was.
    """
    import numpy as np

    from tactile_bayes.runs.verdicts import calibrate_into

    common = ctx.find_root().params
    common["debug"] = common["debug"] or debug
    angles = np.radians(np.arange(-30.0, 210.0 + 0.5 * drive_step, drive_step))
    experiment: dict[str, Any] = {
        "family": family,
        "rig": rig.stated,
        "drive": [tb.Rotation(pivot, drive_angles=angles) for pivot in pivots_in(base)],
        "truth": None if truth is None else tb.Rig.read(truth),
        "rng": seed,
    }
    if replicate is not None:
        return _of_replicate(
            tb.calibration.calibration_replicate(replicate, out=out, throw=common["debug"], **experiment)
        )

    with resumable_bar("replicate", output.is_silent, out, replicates) as note:
        run = calibrate_into(out, replicates=replicates, workers=work.reporting(note), **experiment)
    found = run.result
    names = ("conclusion", "lost", "probability", "power", "noticed_shift", "noticed_narrow", "noticed_wide")
    numbers = {**{name: found.attrs[name] for name in names}, "claims": columns_of(found, "claim")}
    return Answer.of([found.attrs["verdict"]], run.files, _table(found), **numbers)


def _of_replicate(made: Replicate) -> Answer:
    outcome = made.outcome

    def words() -> Iterator[str | Table]:
        lost = f"was lost: {outcome.message}. --debug shows the traceback"
        yield f"Replicate {made.number} {lost if outcome.is_lost else f'is done: {outcome.message}'}."
        quantities = [
            (name, f"{made.truth[name]:.6g}" if name in made.truth else "", str(outcome.ranks.get(name, "")))
            for name in dict.fromkeys([*made.truth, *outcome.ranks])
        ]
        # NaN stands for a number that could not be computed
        numbers = [(name, f"{value:.6g}") for name, value in outcome.numbers.items() if value == value]
        yield ""
        if quantities:
            yield from (table_of(["quantity", "truth", "rank"], quantities, left=["quantity"]), "")
        if numbers:
            yield from (table_of(["number", "value"], numbers, left=["number"]), "")

    return Answer(
        words(),
        lambda: {"number": made.number, "lost": outcome.is_lost, "truth": made.truth, **outcome._asdict()},
    )


def _table(found: xr.Dataset) -> Table:
    from tactile_bayes.calibration.summary import CLAIMS

    rows = []
    for row in columns_of(found, "claim"):
        error, count = row["coverage_error"], row["coverage_replicates"]
        if count:
            held = f"{row['coverage']:.1%}" + (f" ± {error:.1%}" if error == error else "")
            rows.append((CLAIMS[row["claim"]], held, f"{count:,}"))
    stated = f"stated with {found.attrs['probability']:.0%}"
    return table_of([stated, "holds in", "of replicates"], rows, left=[stated])


def calibrate_rig(
    *,
    record: Annotated[
        list[Path], "Records of the gauge, .csv or .nc, each with its own zeros and its pivots.", typer.Argument()
    ],
    out: Annotated[Out, Writes(RIG)],
    gauge: GaugeOptions,
    rig: RigOptions,
    probability: Annotated[float, "Probability of the intervals.", typer.Option(min=0.0, max=1.0)] = 0.95,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Calibrate the rig on a gauge: infer stiffness, encoder, lever and the like from sweeps along a known contour.

    Its rig.toml is for --rig of the other commands, and of this one, where records of another gauge or place add to it.
    """
    from tactile_bayes.runs.rig import calibrate_rig_into

    contour, read = gauge.contour, [rig.read(path) for path in record]
    with sampling_bar(output.is_silent) as progress:
        run = calibrate_rig_into(
            out,
            [measured for measured, _ in read],
            contour=contour,
            probability=probability,
            rig=read[0][1],
            rng=seed,
            progress=progress,
        )
    attrs = run.result.attrs
    return Answer.of(
        run.messages,
        run.files,
        quantities(run.summary, {}),
        converged=bool(attrs["converged"]),
        **{name: attrs[name] for name in ("message", "gauge")},
        probability=run.summary.attrs["probability"],
        quantities=columns_of(run.summary, "quantity"),
    )

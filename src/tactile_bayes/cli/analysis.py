"""The commands `infer` and `demo`: from a record to a contour."""

from __future__ import annotations

import math
import traceback
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tactile_bayes as tb
from tactile_bayes.cli.answer import Answer, columns_of, table_of
from tactile_bayes.cli.command import Out, Output, Seed, Writes
from tactile_bayes.cli.progress import acknowledge_interrupt, resumable_bar, sampling_bar
from tactile_bayes.cli.rigs import RigOptions
from tactile_bayes.runs.names import CHECKPOINT, INFERENCE, MANY, OF_POSTERIOR, WATCH_PAGE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import xarray as xr
    from rich.table import Table

    from tactile_bayes.runs.contour import ContourRun

# Quantities in the table of several records; the file has all.
_SHOWN = ("a", "b", "r", "n", "w", "q", "x_c", "gap width")
_STOPPING = "stopping; the draws made so far are checked, plotted and written now (Ctrl-C again leaves a part out)"


def infer(
    *,
    ctx: typer.Context,
    record: Annotated[
        list[Path], "Record, .csv or .nc, or a bag of ROS; or several, or a folder of them.", typer.Argument()
    ],
    out: Annotated[Out, Writes((*INFERENCE, *OF_POSTERIOR, WATCH_PAGE, *MANY))],
    family: Annotated[
        str,
        "Shape: parabola, circle, ellipse, power-law, one for each flank: parabola/power-law; shape-free, any "
        "smooth one; or flat-sided, one with a flat side.",
    ] = "parabola",
    rig: RigOptions,
    probability: Annotated[float, "Probability of band and intervals.", typer.Option(min=0.0, max=1.0)] = 0.95,
    max_seconds: Annotated[
        float | None,
        "Time limit for the search for a start and for sampling [s]; the draws made by then are the result. Checks, "
        "files and figures come after it.",
    ] = None,
    checkpoint: Annotated[
        Path | None,
        "Folder in which the state of the run is kept: the same command resumes a stopped run.",
        Writes(CHECKPOINT),
    ] = None,
    no_figures: Annotated[bool, "Draw no figures, which would take two seconds; the report has its own."] = False,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Infer the contour from a measured record: contact points, posterior, band and figures.

    Of several records, or a folder of them, each has a folder in --out, made by a process for each core, and there is
    one table of all; the same command goes on with those that are not done, and records may be added.
    """
    from tactile_bayes.runs.many import records_in

    options: dict[str, Any] = {
        "family": family,
        "probability": probability,
        "rng": seed,
        "settings": tb.SamplerSettings(max_seconds=max_seconds),
        "figures": not no_figures,
    }
    if (paths := records_in(record)) != record[:1]:
        if checkpoint is not None:
            raise typer.BadParameter("--checkpoint is for one record: of several, those that are done are kept")
        return _of_many(paths, rig, out, output, options)
    measured, of_record = rig.read(paths[0])
    options |= {"rig": of_record, "checkpoint": checkpoint, "record_file": paths[0]}
    run = _analysed(ctx, output, measured, out, max_seconds=max_seconds, **options)
    go_on = "with --checkpoint FOLDER the same command can resume an interrupted run"
    if checkpoint is not None:
        go_on = f"the same command resumes from the steps in {checkpoint}"
    return answer_of(ctx, run, run.files, {}, go_on)


def _analysed(
    ctx: typer.Context, output: Output, *arguments: Any, max_seconds: float | None = None, **options: Any
) -> ContourRun:
    """Analyse a record with a bar; an interrupt ends the sampling, and is answered."""
    from tactile_bayes.runs.contour import analyse

    with acknowledge_interrupt(_STOPPING), sampling_bar(output.is_silent, max_seconds=max_seconds) as progress:
        if progress is not None:
            options |= {"progress": progress, "follow": progress.follow}
        return analyse(*arguments, command=ctx.meta["words"], **options)


def _of_many(paths: Sequence[Path], rig: RigOptions, out: Path, output: Output, options: dict[str, Any]) -> Answer:
    """Infer the contours of several records."""

    stated = rig.stated
    of_all = replace(stated, load_cell=rig.in_place_of(stated.load_cell))
    with resumable_bar("record", output.is_silent, out, len(paths)) as note:
        table = tb.infer_contours(paths, of_all, out=out, workers=tb.tasks.Workers(progress=note), **options)
    files = {"table": out / "runs.csv", "table, as NetCDF": out / "runs.nc"}
    return Answer([_rows_of(table), "", files], lambda: {"records": table.to_dict()["data_vars"], "files": files})


def _rows_of(table: xr.Dataset) -> Table:
    """Return a row for each record: parameters of the contour, time, and first verdict, or reason of its failure."""
    import numpy as np

    shown = [name for name in table.quantity.values.tolist() if name in _SHOWN]
    rows = []
    for name in table.record.values.tolist():
        row: Any = table.sel(record=name)
        cells = []
        for quantity in shown:
            one = row.sel(quantity=quantity)
            text = f"{float(one['median']):.{decimals(float(one.upper - one.lower))}f}"
            cells.append("" if np.isnan(one["median"]) else text)
        said = str(row.error.values) or str(row.verdict.values)
        rows.append([name, *cells, f"{float(row.seconds):.0f} s", said])
    return table_of(["record", *shown, "time", "verdict"], rows, left=["record", "verdict"], may_wrap=True)


def demo(
    *,
    ctx: typer.Context,
    out: Annotated[Out, Writes((*INFERENCE, *OF_POSTERIOR, "record.csv", "rig.toml"))] = Path("results/demo"),
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Simulate a steel wire that sweeps along a parabola, and infer the contour with a band from its noisy record."""
    from tactile_bayes.runs.demonstration import CONTOUR, LOAD_CELL, ROD, TRUTH, measure_demo

    path, of_rig = measure_demo(out, rng=seed)
    if not output.is_silent:
        print(
            f"A wire of {ROD.length * 1e3:g} mm and {ROD.diameter * 1e3:g} mm diameter has swept forward and backward "
            f"along a parabola; a load cell\nwith {LOAD_CELL.force_noise * 1e3:g} mN and "
            f"{LOAD_CELL.moment_noise * 1e3:g} mN m of noise has recorded {path}.\nFrom here on only this file is "
            f"used, and {of_rig}, which takes the rig as stated; for your own record:\ntactile-bayes infer RECORD "
            f"--rig rig.toml --out RUN\n",
            flush=True,
        )
    rig = tb.Rig.read(of_rig)
    options: dict[str, Any] = {"family": "parabola", "rig": rig, "rng": seed, "truth": CONTOUR, "record_file": path}
    run = _analysed(ctx, output, tb.read_record(path, rig), out, **options)
    return answer_of(ctx, run, {"record": path, "rig": of_rig, **run.files}, TRUTH, "the same command starts again")


def answer_of(
    ctx: typer.Context, run: ContourRun, files: Mapping[str, Path], truth: Mapping[str, float], go_on: str
) -> Answer:
    """Return the answer; messages name what is left out, and with --debug its traceback goes to stderr."""
    if run.left_out and ctx.find_root().params["debug"]:
        for error in run.left_out.values():
            typer.echo("".join(traceback.format_exception(error)), err=True)
    elif run.left_out:
        names = ", ".join(run.left_out)
        typer.echo(f"tactile-bayes: left out: {names}; tactile-bayes --debug ... shows the traceback", err=True)
    return Answer(
        _words(run, files, truth),
        lambda: _numbers(run, files, truth),
        interrupted=f"interrupted, results are of what was made by then: {go_on}" if run.is_interrupted else "",
    )


def _numbers(run: ContourRun, files: Mapping[str, Path], truth: Mapping[str, float]) -> dict[str, Any]:
    attrs = run.posterior.attrs
    rows = columns_of(run.summary, "quantity")
    if truth:
        rows = [{**row, "truth": truth.get(str(row["quantity"]))} for row in rows]
    contacts = run.contacts
    checks = ("misfit_probability", "axial_score")
    return {
        "words": run.messages,
        "converged": bool(attrs["converged"]),
        **{name: attrs[name] for name in ("message", "family")},
        "probability": run.summary.attrs["probability"],
        "quantities": rows,
        "samples": None if contacts is None else dict(Counter(contacts.status.values.tolist()).most_common()),
        **{name: None if contacts is None else contacts.attrs.get(name) for name in checks},
        "files": files,
        "left_out": {what: str(error) for what, error in run.left_out.items()},
    }


def _words(run: ContourRun, files: Mapping[str, Path], truth: Mapping[str, float]) -> Iterator[Any]:
    yield from run.messages
    yield ""
    yield quantities(run.summary, truth)
    attrs = run.posterior.attrs
    if attrs["converged"]:  # else the messages contain it
        yield attrs["message"]
    if run.contacts is not None:
        fates = Counter(run.contacts.status.values.tolist()).most_common()
        words = "Samples: " + ", ".join(f"{count} {fate}" for fate, count in fates)
        chance = run.contacts.attrs.get("misfit_probability")
        is_known = run.checked is None or run.checked.knows_misfit
        if is_known and chance is not None and chance == chance:
            words += f"; noise of the inferred scale explains their misfit with probability {chance:.2g}"
        yield words
    elif "contacts" not in run.left_out:  # else the messages say so
        yield "No contact points: Step 2 needs all three load channels."
    yield ""
    yield files


def quantities(numbers: xr.Dataset, truth: Mapping[str, float]) -> Table:
    """Return the table of a summary, with the true values of a demonstration."""
    from tactile_bayes.uncertainty.summary import shown_in

    share = f"{numbers.attrs['probability']:.0%}"
    heads = ["quantity", *(["truth"] if truth else []), "estimate", f"{share} from", "to", "unit", "R̂", "eff. draws"]
    rows = []
    for name in numbers.quantity.values:
        if name.startswith("z_"):  # a weight of a random function, which has no meaning by itself
            continue
        row: Any = numbers.sel(quantity=name)
        scale, unit = shown_in(str(row["unit"].values))
        digits = decimals(scale * float(row["upper"] - row["lower"]))
        shown = [f"{scale * float(row[column]):.{digits}f}" for column in ("median", "lower", "upper")]
        true = [f"{scale * truth[name]:.{digits}f}" if name in truth else ""] if truth else []
        ess = min(float(row["ess_bulk"]), float(row["ess_tail"]))
        checks = ["", ""] if ess != ess else [f"{float(row['r_hat']):.3f}", f"{ess:.0f}"]
        rows.append([str(name), *true, *shown, unit, *checks])
    return table_of(heads, rows, left=["quantity", "unit"], may_wrap=True)


def decimals(width: float) -> int:
    """Return the number of decimals that show an interval of this width to two digits."""
    return max(0, min(12, 1 - math.floor(math.log10(width)))) if width > 0.0 else 6

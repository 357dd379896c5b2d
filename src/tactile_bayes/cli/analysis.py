"""The commands `infer` and `demo`: from a record to a contour."""

from __future__ import annotations

from collections import Counter
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from tactile_bayes.inference.ensembles import Progress
    from tactile_bayes.run import Run

__all__ = ["demo", "infer"]

Out = Annotated[Path, typer.Option(help="Folder for results; made if it is not there.", file_okay=False)]
Seed = Annotated[int, typer.Option(help="Same seed, same numbers.", min=0)]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, only the result.")]


def infer(
    record: Annotated[Path, typer.Argument(help="Record, .csv or .nc.")],
    out: Out,
    family: Annotated[
        str,
        typer.Option(help="Shape: parabola, circle, ellipse, power-law, or one for each flank: parabola/power-law."),
    ] = "parabola",
    column: Annotated[
        list[str] | None,
        typer.Option(
            help="What the file has for a column, where it has another name, unit, sign or zero: force_x=Fx[mN], "
            "force_y=-Fy[N], drive_angle=90-Angle[deg], base_x=12[mm]; give it again for another."
        ),
    ] = None,
    split_sweeps: Annotated[
        bool,
        typer.Option("--split-sweeps", help="Find sweeps and directions where the drive turns, if there are none."),
    ] = False,
    length: Annotated[float | None, typer.Option(help="Rod length [m], for SI files that do not state it.")] = None,
    flexural_rigidity: Annotated[float | None, typer.Option(help="EI [N m²], likewise.")] = None,
    diameter: Annotated[float, typer.Option(help="Rod diameter [m], likewise.")] = 0.0,
    force_noise: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the forces [N, or EI/L²]; by default as the record states, else inferred."
        ),
    ] = None,
    moment_noise: Annotated[
        float | None, typer.Option(help="Standard deviation of the moment [N m, or EI/L]; likewise.")
    ] = None,
    missing: Annotated[
        list[str] | None, typer.Option(help="Channel without a column, like force_x; give it again for another.")
    ] = None,
    load_cell_frame: Annotated[
        Literal["fixed", "turning"] | None,
        typer.Option(help="Axes of the forces, if the file does not say: the world's, or turning with the drive."),
    ] = None,
    friction: Annotated[float, typer.Option(help="Coulomb's coefficient, known.", min=0.0, max=0.84)] = 0.0,
    nuisance: Annotated[
        list[str] | None,
        typer.Option(
            help="What is not known of the rig and inferred too, in place of rigidity_scale, drive_angle_offset and "
            "bias: one of these, or drift, gain, friction, suspension_compliance, base (where further pivots "
            "stand); give it again for another."
        ),
    ] = None,
    as_stated: Annotated[
        bool, typer.Option("--as-stated", help="Take everything about the rig as stated: fewer parameters, narrower.")
    ] = False,
    probability: Annotated[float, typer.Option(help="Of band and intervals.", min=0.0, max=1.0)] = 0.95,
    max_steps: Annotated[int, typer.Option(help="Steps of each walker, at most.", min=1)] = 20_000,
    max_seconds: Annotated[
        float | None, typer.Option(help="Time for sampling, at most [s]; what is there by then is the result.")
    ] = None,
    checkpoint: Annotated[
        Path | None,
        typer.Option(
            help="Folder in which every block of steps is kept: the same command goes on where it was stopped.",
            file_okay=False,
        ),
    ] = None,
    seed: Seed = 1,
    quiet: Quiet = False,
) -> None:
    """Infer the contour from a measured record: contact points, posterior, band and figures."""
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.inference.ensembles import SamplerSettings
    from tactile_bayes.inference.nuisances import STANDARD
    from tactile_bayes.load_cell import LoadCell
    from tactile_bayes.record import present_channels, read_record
    from tactile_bayes.rod import Rod
    from tactile_bayes.run import analyse

    if as_stated and nuisance:
        raise ParameterError("--as-stated and --nuisance contradict each other: leave one of them out")
    nuisances = [] if as_stated else list(nuisance or STANDARD)
    if (length is None) != (flexural_rigidity is None):
        raise ParameterError("--length and --flexural-rigidity go together: give both, or neither")
    if diameter and length is None:
        raise ParameterError("--diameter needs --length and --flexural-rigidity beside it: give all three")
    rod = None if length is None or flexural_rigidity is None else Rod(length, flexural_rigidity, diameter)
    measured = read_record(
        record,
        columns=_columns(column or []),
        split_sweeps=split_sweeps,
        rod=rod,
        missing=missing or (),
        load_cell_frame=load_cell_frame,
    )
    cell = None
    if force_noise is not None or moment_noise is not None:
        cell = LoadCell(force_noise=force_noise or 0.0, moment_noise=moment_noise or 0.0)
        bare = [name for name in present_channels(measured) if not cell.standard_deviations[name]]
        if bare:
            option = "--moment-noise" if "holding_moment" in bare else "--force-noise"
            raise ParameterError(
                f"{bare[0]} is measured too: give {option} as well, above zero, or leave both out to have them inferred"
            )
    if measured.attrs.get("units_source") == "assumed":
        typer.echo(
            "The record states no units: its numbers are taken as dimensionless, in units of the rod (L, EI/L, EI/L²). "
            "If they are SI, give --length and --flexural-rigidity.",
            err=True,
        )
    with _progress(quiet) as progress:
        run = analyse(
            measured,
            out,
            family=family,
            load_cell=cell,
            friction=friction,
            nuisances=nuisances,
            checkpoint=checkpoint,
            probability=probability,
            seed=seed,
            settings=SamplerSettings(max_steps=max_steps, max_seconds=max_seconds),
            progress=progress,
        )
    _print_run(run, {})


def demo(
    out: Out = Path("results/demo"),
    seed: Seed = 1,
    quiet: Quiet = False,
) -> None:
    """A steel wire sweeps along a parabola; its noisy record is turned into a contour with a band."""
    from tactile_bayes.demonstration import CONTOUR, LOAD_CELL, ROD, TRUTH, measure_demo
    from tactile_bayes.record import read_record
    from tactile_bayes.run import analyse

    path = measure_demo(out, seed=seed)
    if not quiet:
        print(
            f"A wire of {ROD.length * 1e3:g} mm and {ROD.diameter * 1e3:g} mm diameter has swept forward and backward "
            f"along a parabola; a load cell\nwith {LOAD_CELL.force_noise * 1e3:g} mN and "
            f"{LOAD_CELL.moment_noise * 1e3:g} mN m of noise has recorded {path}.\nFrom here on this file is all there "
            f"is, and the rig is taken as stated; the same job on your own: tactile-bayes infer RECORD --as-stated "
            f"--out RUN\n",
            flush=True,
        )
    with _progress(quiet) as progress:
        run = analyse(
            read_record(path), out, family="parabola", nuisances=[], seed=seed, truth=CONTOUR, progress=progress
        )
    _print_run(run, {"record": path}, TRUTH)


def _columns(options: Sequence[str]) -> dict[str, str]:
    """The values of --column by the columns that they are for."""
    from tactile_bayes.errors import ParameterError

    columns: dict[str, str] = {}
    for option in options:
        name, equals, origin = (part.strip() for part in option.partition("="))
        if not (name and equals and origin):
            raise ParameterError(f"--column {option}: write COLUMN=NAME[UNIT], like force_x=Fx[mN]")
        if name in columns:
            raise ParameterError(f"--column {name}= is given twice: keep one of them")
        columns[name] = origin
    return columns


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[Progress], object] | None]:
    """A bar that fills with the effective sample size; none where nobody sees it move."""
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield None
        return
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Bar(*columns, console=console, transient=True) as bar:
        task = bar.add_task("looking for a start, then sampling", total=1000.0)

        def show(progress: Progress) -> None:
            words = f"step {progress.steps}: R̂ {progress.r_hat:.3f}, effective draws {progress.ess:.0f}"
            bar.update(task, completed=min(progress.ess, 1000.0), description=words)

        yield show


def _print_run(run: Run, files: Mapping[str, Path], truth: Mapping[str, float] | None = None) -> None:
    from rich.console import Console
    from rich.table import Table

    from tactile_bayes.run import summary

    numbers = summary(run.posterior, run.band.attrs["probability"])
    share = f"{run.band.attrs['probability']:.0%}"
    table = Table(box=None, pad_edge=False)
    heads = ["quantity", *(["truth"] if truth else []), "estimate", f"{share} from", "to", "unit", "R̂", "eff. draws"]
    for head in heads:
        table.add_column(head, justify="left" if head in ("quantity", "unit") else "right")
    for name in numbers.quantity.values:
        if name.startswith("z_"):  # a direction of a random function, which says nothing by itself
            continue
        row: Any = numbers.sel(quantity=name)
        digits = _digits(float(row["upper"] - row["lower"]))
        shown = [f"{float(row[column]):.{digits}f}" for column in ("median", "lower", "upper")]
        true = [f"{truth[name]:.{digits}f}" if name in truth else ""] if truth else []
        ess = min(float(row["ess_bulk"]), float(row["ess_tail"]))
        checks = ["", ""] if ess != ess else [f"{float(row['r_hat']):.3f}", f"{ess:.0f}"]
        unit = "" if str(row["unit"].values) == "1" else str(row["unit"].values)
        table.add_row(str(name), *true, *shown, unit, *checks)
    console = Console()
    for verdict in run.verdicts:
        console.print(verdict, markup=False, highlight=False, soft_wrap=True)
    console.print()
    console.print(table)
    attrs = run.posterior.attrs
    if attrs["converged"]:  # else it is among the verdicts
        console.print(attrs["message"], highlight=False, soft_wrap=True)
    if run.contacts is None:
        console.print("No contact points: Step 2 needs all three load channels.")
    else:
        fates = Counter(run.contacts.status.values.tolist()).most_common()
        words = "Samples: " + ", ".join(f"{count} {fate}" for fate, count in fates)
        chance = run.contacts.attrs.get("misfit_probability")
        if chance is not None and chance == chance:
            words += f"; noise explains their misfit with probability {chance:.2g}"
        console.print(words, highlight=False, soft_wrap=True)
    console.print()
    for what, path in {**files, **run.files}.items():
        console.print(f"{what:<12} {path}", highlight=False, soft_wrap=True)
    if "interrupted" in attrs["message"]:
        raise typer.Exit(130)


def _digits(width: float) -> int:
    """Decimals that show an interval of this width to two figures."""
    import math

    return max(0, min(12, 1 - math.floor(math.log10(width)))) if width > 0.0 else 6

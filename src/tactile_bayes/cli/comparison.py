"""The command `compare`: which shape a record is of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from tactile_bayes.cli.answer import Json, columns_of, print_json
from tactile_bayes.cli.record_options import (
    AsStated,
    Columns,
    Diameter,
    FlexuralRigidity,
    ForceNoise,
    KnownFriction,
    Length,
    LoadCellFrame,
    Missing,
    MomentNoise,
    Nuisances,
    Out,
    Quiet,
    Record,
    Seed,
    SplitSweeps,
    read_measurement,
)
from tactile_bayes.cli.sampling_bar import sampling_bar

if TYPE_CHECKING:
    import xarray as xr

    from tactile_bayes.inference.ensembles import Progress
    from tactile_bayes.runs.comparison import ComparisonRun

__all__ = ["compare"]

_POOR_K = 0.7
"""Pareto k̂ above which a leave-one-out density cannot be trusted."""


def compare(
    record: Record,
    out: Out,
    family: Annotated[
        list[str] | None,
        typer.Option(
            help="Shape to be compared, as for infer, or shape-free, any smooth one; give it again for another. By "
            "default parabola, circle, ellipse, power-law, power-law/power-law and shape-free."
        ),
    ] = None,
    column: Columns = None,
    split_sweeps: SplitSweeps = False,
    length: Length = None,
    flexural_rigidity: FlexuralRigidity = None,
    diameter: Diameter = 0.0,
    force_noise: ForceNoise = None,
    moment_noise: MomentNoise = None,
    missing: Missing = None,
    load_cell_frame: LoadCellFrame = None,
    friction: KnownFriction = None,
    nuisance: Nuisances = None,
    as_stated: AsStated = False,
    leave_one_out: Annotated[
        bool,
        typer.Option(
            "--leave-one-out/--no-leave-one-out",
            help="Ask of every family how well it foretells a sample from all the others; takes as long again.",
        ),
    ] = True,
    max_seconds: Annotated[
        float | None,
        typer.Option(help="Time for sampling each family, at most [s]; what is there by then is compared."),
    ] = None,
    seed: Seed = 1,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Compare shapes of contours: which of them a measured record is of, and whether any fits."""
    from tactile_bayes.inference.ensembles import SamplerSettings
    from tactile_bayes.runs.comparison import compare_into
    from tactile_bayes.uncertainty.family_comparison import SHAPES

    measured, cell, nuisances = read_measurement(
        record,
        column=column,
        split_sweeps=split_sweeps,
        length=length,
        flexural_rigidity=flexural_rigidity,
        diameter=diameter,
        force_noise=force_noise,
        moment_noise=moment_noise,
        missing=missing,
        load_cell_frame=load_cell_frame,
        nuisance=nuisance,
        as_stated=as_stated,
    )
    with sampling_bar(quiet or json, max_seconds=max_seconds) as show:

        def note(name: str, progress: Progress) -> None:
            if show is not None:
                show(progress, name)

        run = compare_into(
            measured,
            out,
            families=family or SHAPES,
            load_cell=cell,
            friction=friction,
            nuisances=nuisances,
            leave_one_out=leave_one_out,
            seed=seed,
            settings=SamplerSettings(max_seconds=max_seconds),
            progress=note,
        )
    if json:
        found = run.comparison
        told = {name: found.attrs[name] for name in ("verdict", "prior_width") if name in found.attrs}
        print_json(
            {"words": [found.attrs["verdict"]], **told, "families": columns_of(found, "family"), "files": run.files}
        )
        return
    _print_run(run)


def _print_run(run: ComparisonRun) -> None:
    from rich.console import Console

    console = Console()
    found = run.comparison
    console.print(found.attrs["verdict"], markup=False, highlight=False, soft_wrap=True)
    console.print()
    console.print(_table(found))
    far = found.family.values[~found.sampled.values]
    if far.size:
        console.print(f"Far off, and not sampled: {', '.join(far)}", highlight=False, soft_wrap=True)
    if "largest_k" in found:
        poor = found.family.values[found.largest_k.values > _POOR_K]
        if poor.size:
            console.print(
                f"Leave-one-out densities cannot all be trusted (Pareto k̂ above {_POOR_K}): {', '.join(poor)}",
                highlight=False,
                soft_wrap=True,
            )
    console.print()
    for what, path in run.files.items():
        console.print(f"{what:<12} {path}", highlight=False, soft_wrap=True)


def _table(found: xr.Dataset) -> object:
    """No wider than 80 columns; errors of the evidence are in the files."""
    from rich.table import Table

    left_out = "elpd" in found
    table = Table(box=None, pad_edge=False)
    heads = ["family", "probability", "log evid.", *(["elpd diff.", "weight"] if left_out else []), "check p", "fits"]
    for head in heads:
        table.add_column(head, justify="left" if head in ("family", "fits") else "right", no_wrap=True)
    for name in found.family.values:
        row = {str(column): values.item() for column, values in found.sel(family=name).items() if not values.ndim}
        cells = [_share(row["probability"]), _fixed(row["log_evidence"])]
        if left_out:
            cells += [_with_error(row["elpd_difference"], row["elpd_difference_error"]), _share(row["weight"])]
        table.add_row(str(name), *cells, _share(row["p_value"]), "yes" if row["fits"] else "no")
    return table


def _share(value: float) -> str:
    """A probability to three decimals, which nothing but none and all are rounded to."""
    if value != value:
        return "–"
    if 0.0 < value < 1.0:
        return "<0.001" if value < 0.001 else ">0.999" if value > 0.999 else f"{value:.3f}"
    return f"{value:g}"


def _fixed(value: float) -> str:
    return "–" if value != value else f"{value:.1f}"


def _with_error(value: float, error: float) -> str:
    if value != value:
        return "–"
    return f"{value:.1f} ± {error:.1f}" if value or error else "0"

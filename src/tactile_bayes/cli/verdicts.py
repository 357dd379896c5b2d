"""The commands `compare` and `trust`: families of contours for a record, and whether the band of a run holds for it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tactile_bayes as tb
from tactile_bayes.cli.answer import Answer, columns_of, table_of, text_of
from tactile_bayes.cli.command import Out, Output, Reads, Seed, Writes
from tactile_bayes.cli.progress import WorkerOptions, resumable_bar, sampling_bar
from tactile_bayes.cli.rigs import Record, RigOptions
from tactile_bayes.runs.names import COMPARISON, TRUST

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr
    from rich.table import Table


_POOR_K = 0.7  # Pareto k̂ above which a leave-one-out density cannot be trusted


def compare(
    *,
    record: Record,
    out: Annotated[Out, Writes(COMPARISON)],
    family: Annotated[
        list[str] | None,
        "Shape to be compared, as for infer, or shape-free, any smooth one; may be repeated. By default parabola, "
        "circle, ellipse, power-law, power-law/power-law and shape-free.",
    ] = None,
    rig: RigOptions,
    leave_one_out: Annotated[
        bool, "Compute how well each family predicts a sample from all the others; this doubles the time."
    ] = True,
    max_seconds: Annotated[
        float | None, "Time limit for sampling each family [s]; the draws made by then are compared."
    ] = None,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Compare shapes of contours for a measured record: the probability of each, and whether any fits."""
    from tactile_bayes.comparison.families import SHAPES
    from tactile_bayes.runs.verdicts import compare_into

    measured, of_record = rig.read(record)
    with sampling_bar(output.is_silent, max_seconds=max_seconds) as show:
        run = compare_into(
            measured,
            out,
            families=family or SHAPES,
            rig=of_record,
            leave_one_out=leave_one_out,
            rng=seed,
            settings=tb.SamplerSettings(max_seconds=max_seconds),
            progress=lambda name, progress: show and show(progress, name),
        )
    found = run.result
    attrs = {name: found.attrs[name] for name in ("verdict", "prior_width") if name in found.attrs}
    further: list[Any] = [_table(found), *_reservations(found)]
    return Answer.of([found.attrs["verdict"]], run.files, *further, **attrs, families=columns_of(found, "family"))


def _reservations(found: xr.Dataset) -> Iterator[str]:
    far = found.family.values[~found.sampled.values]
    if far.size:
        yield f"Far off, and not sampled: {', '.join(far)}"
    if "largest_k" in found:
        poor = found.family.values[found.largest_k.values > _POOR_K]
        if poor.size:
            yield f"Leave-one-out densities are unreliable (Pareto k̂ above {_POOR_K}) for {', '.join(poor)}"


def _table(found: xr.Dataset) -> Table:
    """Return a table of at most 80 columns; the files hold the errors of the evidence."""
    from tactile_bayes.report.wording import chance

    left_out = "elpd" in found
    rows = []
    for row in columns_of(found, "family"):
        cells = [chance(row["probability"]), text_of(row["log_evidence"])]
        if left_out:
            cells += [_with_error(row["elpd_difference"], row["elpd_difference_error"]), chance(row["weight"])]
        rows.append([row["family"], *cells, chance(row["p_value"]), "yes" if row["fits"] else "no"])
    heads = ["family", "probability", "log evid.", *(["elpd diff.", "weight"] if left_out else []), "check p", "fits"]
    return table_of(heads, rows, left=["family", "fits"])


def _with_error(value: float, error: float) -> str:
    if value != value:
        return "–"
    return f"{value:.1f} ± {error:.1f}" if value or error else "0"


def trust(
    *,
    run: Annotated[Path, "Folder of a run of infer.", typer.Argument(), Reads(("posterior.nc",))],
    out: Annotated[
        Path | None, "Folder for the results; the run's own if left out, for its report.", Writes((*TRUST, "trust/*"))
    ] = None,
    replicates: Annotated[
        int,
        "Number of truths like this one that are simulated and inferred again; 0 leaves this out.",
        typer.Option(min=0),
    ] = 100,
    assumptions: Annotated[
        bool, "Compute the band again with each unknown of the rig added or fixed, and with each other shape."
    ] = True,
    probability: Annotated[float | None, "Probability of the band; that of the run if left out."] = None,
    work: WorkerOptions,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Judge whether the band of a run holds for its record, and what it rests on: record, prior, sampling."""
    from tactile_bayes.runs.verdicts import REPLICATES_FOLDER, trust_into

    with resumable_bar("posterior", output.is_silent, (out or run) / REPLICATES_FOLDER) as note:
        made = trust_into(
            run,
            out,
            replicates=replicates,
            assumptions=assumptions,
            probability=probability,
            rng=seed,
            workers=work.reporting(note),
        )
    found = made.result
    words = [found.attrs["summary"], *found.attrs["words"].splitlines()]
    names = ("conclusion", "probability", "calibration")
    return Answer(
        [words[0], "", *words[1:], "", _sensitivities(found), "", *_assumptions(found), made.files],
        lambda: {
            "words": words,
            **{name: found.attrs[name] for name in names},
            **{name: float(found[name]) for name in ("split_p_value", "check_p_value")},
            "parts": columns_of(found, "part"),
            "quantities": columns_of(found, "quantity"),
            **{f"{dim}s": columns_of(found, dim) for dim in ("claim", "region", "assumption")},
            "draws_needed": int(found["draws_needed"]),
            "files": made.files,
        },
    )


def _sensitivities(found: xr.Dataset) -> Table:
    """Return the sensitivities of parameters and bands."""
    columns = (found[name].values for name in ("quantity", "sensitivity", "set_by"))
    rows = [(str(name), *(f"{value:.3f}" for value in row), str(by)) for name, row, by in zip(*columns, strict=True)]
    heads = ["sensitivity of", *(f"to {_NAMES[str(name)]}" for name in found["component"].values), "set by"]
    return table_of(heads, rows, left=["sensitivity of", "set by"])


def _assumptions(found: xr.Dataset) -> list[Table | str]:
    """Return how far the median of the band moves under other assumptions."""
    if "assumption" not in found.dims:
        return []
    rows = []
    for row in columns_of(found, "assumption"):
        moved = (text_of(row[name], ".2f") for name in ("moved_in_gap", "moved_beside"))
        rows.append((row["assumption"], *moved, "yes" if row["fits"] else "no"))
    heads = ["assumption instead", "moves in the gap", "beside it [band widths]", "fits"]
    return [table_of(heads, rows, left=["assumption instead", "fits"]), ""]


_NAMES = {"contour": "the contour's prior", "rig": "the rig's prior", "likelihood": "the record"}

"""The command `trust`: whether the band of a run holds for its record, and what it rests on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_bayes.cli.answer import Answer, columns_of, table_of, text_of
from tactile_bayes.cli.command import Output, Reads, Seed, Writes
from tactile_bayes.cli.progress import WorkerOptions, resumable_bar
from tactile_bayes.runs.names import TRUST

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table


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
    from tactile_bayes.runs.trust import REPLICATES_FOLDER, trust_into

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
        [words[0], "", *words[1:], "", _table(found), "", *_assumptions(found), made.files],
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


def _table(found: xr.Dataset) -> Table:
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

"""The command `reconstruct`: contact points from a measured record, sample by sample."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from tactile_bayes.cli.answer import Json, print_files, print_json, print_sentences
from tactile_bayes.cli.record_options import (
    Columns,
    Diameter,
    FlexuralRigidity,
    ForceNoise,
    Friction,
    Length,
    LoadCellFrame,
    Missing,
    MomentNoise,
    Out,
    Quiet,
    Record,
    SplitSweeps,
    read_measurement,
)
from tactile_bayes.cli.task_bar import step_bar

if TYPE_CHECKING:
    from tactile_bayes.runs.reconstruction import ReconstructionRun

__all__ = ["reconstruct"]

_SOURCES = {
    "data sheet": "The noise is what the file states of its load cell.",
    "unloaded samples": "No noise is stated: bias and noise are taken from the unloaded samples.",
    "nothing": "There is no noise, neither stated nor in unloaded samples: no standard deviations.",
    "too few unloaded samples": "No noise is known: neither stated, nor to be found without unloaded samples; every "
    "sample counts as loaded. Give --force-noise and --moment-noise.",
}


def reconstruct(
    record: Record,
    out: Out,
    method: Annotated[
        Literal["raw", "constrained"] | None,
        typer.Option(
            help="raw takes the four numbers of a sample at their word; constrained, the default where there is noise, "
            "finds the most likely contact that a rod can make."
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
    friction: Friction = 0.0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Find contact points (Step 2): from every sample where the rod touched, with standard deviations.

    What noise is not stated is taken from the samples before first contact and after snap-off.
    """
    with step_bar(quiet or json) as show:
        from tactile_bayes.runs.reconstruction import reconstruct_into, reconstruction_in_words

        measured, cell, _ = read_measurement(
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
            nuisance=None,
            as_stated=False,
        )
        show(1, 2)
        run = reconstruct_into(measured, out, method=method, load_cell=cell, friction=friction)
    words = reconstruction_in_words(run.contacts)
    if json:
        _print_json(run, words)
        return
    print_sentences([*words, *([_SOURCES[run.source]] if run.source in _SOURCES else []), ""])
    print_files(run.files)


def _print_json(run: ReconstructionRun, words: tuple[str, ...]) -> None:
    attrs = run.contacts.attrs
    misfit = {name: attrs.get(name) for name in ("misfit_sum", "misfit_samples", "misfit_probability", "axial_score")}
    print_json(
        {
            "words": words,
            "method": attrs["method"],
            "friction": attrs["friction"],
            "units": attrs["units"],
            "samples": dict(Counter(run.contacts.status.values.tolist()).most_common()),
            **misfit,
            "load_cell": run.load_cell.entries() if run.load_cell is not None else None,
            "load_cell_source": run.source,
            "files": run.files,
        }
    )

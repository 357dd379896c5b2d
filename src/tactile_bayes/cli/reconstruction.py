"""The command `reconstruct`: contact points from a measured record, sample by sample."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Out, Output, Writes
from tactile_bayes.cli.progress import step_bar
from tactile_bayes.cli.rig_options import Record, RigOptions
from tactile_bayes.runs.names import RECONSTRUCTION

if TYPE_CHECKING:
    from tactile_bayes.runs.reconstruction import ReconstructionRun

_SOURCES = {
    "data sheet": "The noise is that of the load cell as the file states it.",
    "unloaded samples": "No noise is stated: bias and noise are taken from the unloaded samples.",
    "nothing": "There is no noise, neither stated nor in unloaded samples: no standard deviations.",
    "too few unloaded samples": "No noise is stated, and too few samples are unloaded to estimate it: every "
    "sample counts as loaded. Give --force-noise and --moment-noise.",
}


def reconstruct(
    *,
    record: Record,
    out: Annotated[Out, Writes(RECONSTRUCTION)],
    method: Annotated[
        Literal["raw", "constrained"] | None,
        "raw uses the four numbers of a sample as they are; constrained, the default if there is noise, finds the most "
        "probable contact that a rod can make.",
    ] = None,
    rig: RigOptions,
    output: Output,
) -> Answer:
    """Find contact points with standard deviations (Step 2), from every sample in contact.

    Numbers under [unknown] of rig.toml, like friction = 0.2, are taken into account. Noise that is not stated is
    estimated from the samples before first contact and after snap-off.
    """
    with step_bar(output.is_silent) as show:
        from tactile_bayes.runs.reconstruction import reconstruct_into, reconstruction_messages

        measured, of_record = rig.read(record)
        show(1, 2)
        run = reconstruct_into(measured, out, method=method, rig=of_record)
    words = reconstruction_messages(run.result)
    source = [_SOURCES[run.source]] if run.source in _SOURCES else []
    return Answer([*words, *source, "", run.files], lambda: _numbers(run, words))


def _numbers(run: ReconstructionRun, words: tuple[str, ...]) -> dict[str, Any]:
    attrs = run.result.attrs
    misfit = ("misfit_sum", "misfit_samples", "misfit_probability", "axial_score")
    return {
        "words": words,
        **{name: attrs[name] for name in ("method", "friction", "units")},
        "samples": dict(Counter(run.result.status.values.tolist()).most_common()),
        **{name: attrs.get(name) for name in misfit},
        "load_cell": run.load_cell.entries() if run.load_cell is not None else None,
        "load_cell_source": run.source,
        "files": run.files,
    }

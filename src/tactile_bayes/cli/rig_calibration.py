"""The command `calibrate-rig`: the rig, from records of a gauge whose contour is known."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tactile_bayes.cli.analysis import quantities
from tactile_bayes.cli.answer import Answer, columns_of
from tactile_bayes.cli.command import Out, Output, Seed, Writes
from tactile_bayes.cli.progress import sampling_bar
from tactile_bayes.cli.rig_options import RigOptions
from tactile_bayes.cli.scan_options import GaugeOptions
from tactile_bayes.runs.names import RIG

if TYPE_CHECKING:
    from tactile_bayes.runs.rig import RigRun


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
    return Answer([*run.messages, "", quantities(run.summary, {}), "", run.files], lambda: _numbers(run))


def _numbers(run: RigRun) -> dict[str, Any]:
    assert run.result.calibration is not None
    assert run.result.calibration.posterior is not None
    attrs = run.result.calibration.posterior.attrs
    return {
        "words": run.messages,
        "converged": bool(attrs["converged"]),
        "message": attrs["message"],
        "gauge": attrs["gauge"],
        "probability": run.summary.attrs["probability"],
        "quantities": columns_of(run.summary, "quantity"),
        "files": run.files,
    }

"""The command `measure`: an ideal record as a load cell reads it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Output, Seed
from tactile_bayes.cli.progress import step_bar
from tactile_bayes.cli.rig_options import NoiseOptions, RigFile
from tactile_bayes.cli.scanning import RecordFile, refuse_other_suffix
from tactile_bayes.errors import ParameterError

if TYPE_CHECKING:
    import xarray as xr


def measure(
    *,
    record: Annotated[Path, "Ideal record, .csv or .nc, as scan writes it.", typer.Argument()],
    out: RecordFile,
    rig: RigFile,
    noise: NoiseOptions,
    keep_truth: Annotated[bool, "Keep the columns of the truth, which a laboratory does not have."] = False,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Measure an ideal record with a real load cell: noise, bias, drift, gain, lever, range, resolution and encoder.

    The cell is that of rig.toml, [load_cell], with the errors that are known, [unknown]; the file states the data
    sheets alone, as one from a laboratory does. A record whose header states a load cell is refused, since it would
    have noise twice; a record without one is assumed to be ideal.
    """
    refuse_other_suffix(out)
    from tactile_bayes.load_cell import LoadCell
    from tactile_bayes.record import write_record
    from tactile_bayes.rig import read_record
    from tactile_bayes.rig.parameters import GROUPS
    from tactile_bayes.rig.stated import cell_with

    stated = rig.stated
    cell = noise.in_place_of(stated.load_cell) or LoadCell()
    with step_bar(output.is_silent) as show:
        ideal = read_record(record)
        if LoadCell.from_record(ideal) is not None:
            raise ParameterError(
                f"{record} has been measured already (its header states a load cell), and would have noise twice: "
                "give the ideal record, as scan writes it"
            )
        drifts = [stated.known.get(name, 0.0) for name in GROUPS["drift"]]
        if not cell_with(cell, stated.known).entries() and not any(drifts):
            raise ParameterError(
                "this load cell is ideal, and changes nothing: state a flaw of it under [load_cell] of rig.toml, or "
                "give --force-noise 0.05 --moment-noise 0.02"
            )
        show(1, 2)
        measured = replace(stated, load_cell=cell).measure(ideal, rng=seed)
        if not keep_truth:
            measured = measured.drop_vars([name for name in measured.data_vars if str(name).startswith("truth_")])
        out.parent.mkdir(parents=True, exist_ok=True)
        write_record(measured, out)
    truth = "with the columns of the truth" if keep_truth else "without columns of the truth"
    samples, files = measured.sizes["sample"], {"record": out}
    words = f"{samples} samples, {truth}; the load cell, which the file states:"
    numbers = {"samples": samples, "units": measured.attrs["units"], "seed": seed, "truth": keep_truth, "files": files}
    return Answer(
        [words, *_sheet(cell.entries(), measured), "", files], lambda: {**numbers, "load_cell": cell.entries()}
    )


def _sheet(entries: dict[str, float | str], measured: xr.Dataset) -> list[str]:
    from tactile_bayes.record import LOAD_CELL_UNITS

    lines = []
    for name, value in entries.items():
        unit = LOAD_CELL_UNITS.get(name, "1")
        if measured.attrs["units"] != "SI" and unit != "rad":
            unit = "1"
        shown = value if isinstance(value, str) else f"{value:.6g}"
        lines.append(f"  {name.replace('_', ' '):<40} {shown}{'' if unit == '1' else ' ' + unit}")
    return lines

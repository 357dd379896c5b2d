"""The command `measure`: an ideal record as a load cell reads it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Answer
from tactile_bayes.cli.command import Output, Seed
from tactile_bayes.cli.numbers import numbers_asked
from tactile_bayes.cli.scanning import RecordFile, refuse_other_suffix
from tactile_bayes.cli.task_bar import step_bar

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

__all__ = ["measure"]

_THREE = "of holding moment, force_x and force_y, with commas between them"


@dataclass(frozen=True)
class FlawOptions:
    """Flaws of a load cell, by the names of its data sheet."""

    force_noise: Annotated[
        float, typer.Option(help="Standard deviation of the forces' noise [N, or EI/L²].", min=0.0)
    ] = 0.0
    moment_noise: Annotated[
        float, typer.Option(help="Standard deviation of the moment's noise [N m, or EI/L].", min=0.0)
    ] = 0.0
    relative_noise: Annotated[
        float, typer.Option(help="Standard deviation of noise in proportion to the load, over the load.", min=0.0)
    ] = 0.0
    degrees_of_freedom: Annotated[
        float, typer.Option(help="Degrees of freedom of Student's t noise: 3 to 10 for outliers; inf is normal.")
    ] = math.inf
    correlation: Annotated[
        str | None,
        typer.Option(
            help="Correlations of the noises of moment and force_x, moment and force_y, force_x and force_y, as "
            "0.1,0,0.5."
        ),
    ] = None
    bias: Annotated[str | None, typer.Option(help=f"Reading without load, {_THREE}.")] = None
    bias_uncertainty: Annotated[
        str | None, typer.Option(help=f"Standard deviation of a bias that is drawn for this record, {_THREE}.")
    ] = None
    random_walk: Annotated[
        str | None, typer.Option(help="Random-walk drift: MOMENT,FORCE, standard deviations of a step.")
    ] = None
    ornstein_uhlenbeck: Annotated[
        str | None,
        typer.Option(
            help="Ornstein-Uhlenbeck drift: MOMENT,FORCE,TIME, standard deviations, correlation time [samples]."
        ),
    ] = None
    gain: Annotated[
        list[str] | None,
        typer.Option(
            help="Error of the calibration, force_x=1.01, or cross-talk, READING/LOAD as in force_x/force_y=0.02; "
            "may be repeated."
        ),
    ] = None
    lever: Annotated[
        str | None,
        typer.Option(help="Reference point of the moment, from the pivot, along the axes of the cell: X,Y."),
    ] = None
    moment_curve: Annotated[
        str | None,
        typer.Option(
            help="Curve of the moment, read as M + Q·M² + C·M³ before the gain: Q,C [1/(N m) and 1/(N m)², or in EI/L]."
        ),
    ] = None
    force_range: Annotated[float, typer.Option(help="Largest force that is read [N, or EI/L²].")] = math.inf
    moment_range: Annotated[float, typer.Option(help="Largest moment that is read [N m, or EI/L].")] = math.inf
    force_resolution: Annotated[float, typer.Option(help="Step of the forces [N, or EI/L²].", min=0.0)] = 0.0
    moment_resolution: Annotated[float, typer.Option(help="Step of the moment [N m, or EI/L].", min=0.0)] = 0.0
    drive_angle_offset: Annotated[float, typer.Option(help="Encoder reading at zero [degrees].")] = 0.0
    drive_angle_backlash: Annotated[
        float, typer.Option(help="Encoder reading in forward motion less that in backward motion [degrees].")
    ] = 0.0
    drive_angle_noise: Annotated[float, typer.Option(help="Noise of the encoder [degrees].", min=0.0)] = 0.0
    drive_angle_resolution: Annotated[float, typer.Option(help="Step of the encoder [degrees].", min=0.0)] = 0.0
    load_cell_frame: Annotated[
        Literal["fixed", "turning"] | None,
        typer.Option(
            help="Axes of the cell: fixed in the laboratory, or turning with the drive; default the record's."
        ),
    ] = None

    @property
    def entries(self) -> dict[str, Any]:
        """The data sheet, as `LoadCell.from_entries` takes it."""
        from tactile_bayes.record import CHANNELS

        parts = {
            "bias": CHANNELS,
            "bias_uncertainty": CHANNELS,
            "correlation": [f"{one}_{other}" for i, one in enumerate(CHANNELS) for other in CHANNELS[i + 1 :]],
            "random_walk": ("moment", "force"),
            "ornstein_uhlenbeck": ("moment", "force", "time"),
            "lever": ("x", "y"),
            "moment_curve": ("quadratic", "cubic"),
        }
        entries = {"frame": self.load_cell_frame, **_gains(self.gain or [])}
        for name, value in vars(self).items():
            if name in parts and value is not None:
                numbers = numbers_asked(value, f"--{name.replace('_', '-')}", len(parts[name]))
                entries |= zip((f"{name}_{part}" for part in parts[name]), numbers, strict=True)
            elif isinstance(value, float):
                entries[name] = math.radians(value) if name.startswith("drive_angle_") else value
        return entries


def measure(
    *,
    record: Annotated[Path, typer.Argument(help="Ideal record, .csv or .nc, as scan writes it.")],
    out: RecordFile,
    flaws: FlawOptions,
    keep_truth: Annotated[
        bool, typer.Option("--keep-truth", help="Keep the columns of the truth, which a laboratory does not have.")
    ] = False,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Measure an ideal record with a real load cell: noise, bias, drift, gain, lever, range, resolution and encoder.

    A record whose header states a load cell is refused, since it would have noise twice; a record without one is
    assumed to be ideal.
    """
    refuse_other_suffix(out)
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.load_cell import LoadCell
    from tactile_bayes.record import read_record, write_record

    cell = LoadCell.from_entries(flaws.entries)
    if not cell.entries():
        raise ParameterError(
            "this load cell is ideal, and changes nothing: give at least one flaw, like --force-noise 0.05 "
            "--moment-noise 0.02"
        )
    with step_bar(output.is_silent) as show:
        ideal = read_record(record)
        if LoadCell.from_record(ideal) is not None:
            raise ParameterError(
                f"{record} has been measured already (its header states a load cell), and would have noise twice: "
                "give the ideal record, as scan writes it"
            )
        show(1, 2)
        measured = cell.measure(ideal, seed=seed)
        if not keep_truth:
            measured = measured.drop_vars([name for name in measured.data_vars if str(name).startswith("truth_")])
        out.parent.mkdir(parents=True, exist_ok=True)
        write_record(measured, out)
    truth = "with the columns of the truth" if keep_truth else "without columns of the truth"
    samples, files = measured.sizes["sample"], {"record": out}
    return Answer(
        [
            f"{samples} samples, {truth}; the load cell, which the file states:",
            *_sheet(cell.entries(), measured),
            "",
            files,
        ],
        lambda: {
            "samples": samples,
            "units": measured.attrs["units"],
            "seed": seed,
            "load_cell": cell.entries(),
            "truth": keep_truth,
            "files": files,
        },
    )


def _gains(options: Sequence[str]) -> dict[str, float]:
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.record import CHANNELS

    entries: dict[str, float] = {}
    for option in options:
        name, equals, value = (part.strip() for part in option.partition("="))
        reading, _, load = (part.strip() for part in name.partition("/"))
        if not equals or {reading, load or reading} - set(CHANNELS):
            raise ParameterError(
                f"--gain {option}: write READING=VALUE or READING/LOAD=VALUE, with {', '.join(CHANNELS)}"
            )
        entry = f"gain_{reading}_{load or reading}"
        if entry in entries:
            raise ParameterError(f"--gain {name}= is given twice: keep one of them")
        (entries[entry],) = numbers_asked(value, f"--gain {name}", 1)
    return entries


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

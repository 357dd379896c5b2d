"""The command `measure`: what a load cell makes of an ideal record."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Json, print_files, print_json, print_sentences
from tactile_bayes.cli.numbers import numbers_asked
from tactile_bayes.cli.record_options import Quiet, Seed
from tactile_bayes.cli.scanning import RecordFile, refuse_other_suffix
from tactile_bayes.cli.task_bar import step_bar

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

__all__ = ["measure"]

_THREE = "of holding moment, force_x and force_y, with commas between them"


def measure(
    record: Annotated[Path, typer.Argument(help="Ideal record, .csv or .nc, as scan writes it.")],
    out: RecordFile,
    force_noise: Annotated[
        float, typer.Option(help="Standard deviation of the forces' noise [N, or EI/L²].", min=0.0)
    ] = 0.0,
    moment_noise: Annotated[float, typer.Option(help="Of the moment's noise [N m, or EI/L].", min=0.0)] = 0.0,
    relative_noise: Annotated[float, typer.Option(help="Noise in proportion to the load, over it.", min=0.0)] = 0.0,
    degrees_of_freedom: Annotated[
        float, typer.Option(help="Of Student's t, which the noise follows: 3 to 10 for knocks; inf is normal.")
    ] = math.inf,
    correlation: Annotated[
        str | None,
        typer.Option(
            help="Of the noises of moment and force_x, moment and force_y, force_x and force_y, as 0.1,0,0.5."
        ),
    ] = None,
    bias: Annotated[str | None, typer.Option(help=f"What is read without load, {_THREE}.")] = None,
    bias_uncertainty: Annotated[
        str | None, typer.Option(help=f"Standard deviation of a bias that is drawn for this record, {_THREE}.")
    ] = None,
    random_walk: Annotated[
        str | None, typer.Option(help="Drift that walks away: MOMENT,FORCE, standard deviations of a step.")
    ] = None,
    ornstein_uhlenbeck: Annotated[
        str | None,
        typer.Option(help="Drift that wanders and forgets: MOMENT,FORCE,TIME, of the drift and in samples."),
    ] = None,
    gain: Annotated[
        list[str] | None,
        typer.Option(
            help="Error of the calibration, force_x=1.01, or cross-talk, READING/LOAD as in force_x/force_y=0.02; "
            "give it again for another."
        ),
    ] = None,
    lever: Annotated[
        str | None,
        typer.Option(help="Where the moment is taken, from the pivot, along the axes of the cell: X,Y."),
    ] = None,
    force_range: Annotated[float, typer.Option(help="Largest force that is read [N, or EI/L²].")] = math.inf,
    moment_range: Annotated[float, typer.Option(help="Largest moment that is read [N m, or EI/L].")] = math.inf,
    force_resolution: Annotated[float, typer.Option(help="Step of the forces [N, or EI/L²].", min=0.0)] = 0.0,
    moment_resolution: Annotated[float, typer.Option(help="Step of the moment [N m, or EI/L].", min=0.0)] = 0.0,
    drive_angle_offset: Annotated[float, typer.Option(help="What the encoder reads at zero [degrees].")] = 0.0,
    drive_angle_backlash: Annotated[
        float, typer.Option(help="What it reads more in forward than in backward motion [degrees].")
    ] = 0.0,
    drive_angle_noise: Annotated[float, typer.Option(help="Of the encoder [degrees].", min=0.0)] = 0.0,
    drive_angle_resolution: Annotated[float, typer.Option(help="Step of the encoder [degrees].", min=0.0)] = 0.0,
    load_cell_frame: Annotated[
        Literal["fixed", "turning"] | None,
        typer.Option(help="Axes of the cell: the world's, or turning with the drive; by default the record's."),
    ] = None,
    keep_truth: Annotated[
        bool, typer.Option("--keep-truth", help="Keep the columns of the truth, which no laboratory has.")
    ] = False,
    seed: Seed = 1,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Read an ideal record with a load cell that is not: noise, bias, drift, gain, lever, range, steps and encoder.

    A record whose header states a load cell is refused, as noise would be there twice; one that states none is taken
    to be ideal.
    """
    refuse_other_suffix(out)
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.load_cell import LoadCell
    from tactile_bayes.record import CHANNELS, read_record, write_record

    entries: dict[str, Any] = {
        "force_noise": force_noise,
        "moment_noise": moment_noise,
        "relative_noise": relative_noise,
        "degrees_of_freedom": degrees_of_freedom,
        "force_range": force_range,
        "moment_range": moment_range,
        "force_resolution": force_resolution,
        "moment_resolution": moment_resolution,
        "drive_angle_offset": math.radians(drive_angle_offset),
        "drive_angle_backlash": math.radians(drive_angle_backlash),
        "drive_angle_noise": math.radians(drive_angle_noise),
        "drive_angle_resolution": math.radians(drive_angle_resolution),
    }
    pairs = [f"{one}_{other}" for i, one in enumerate(CHANNELS) for other in CHANNELS[i + 1 :]]
    entries |= _entries("bias", bias, "--bias", CHANNELS)
    entries |= _entries("bias_uncertainty", bias_uncertainty, "--bias-uncertainty", CHANNELS)
    entries |= _entries("correlation", correlation, "--correlation", pairs)
    entries |= _entries("random_walk", random_walk, "--random-walk", ("moment", "force"))
    entries |= _entries("ornstein_uhlenbeck", ornstein_uhlenbeck, "--ornstein-uhlenbeck", ("moment", "force", "time"))
    entries |= _entries("lever", lever, "--lever", ("x", "y"))
    entries |= _gains(gain or [])
    cell = LoadCell.from_entries({"frame": load_cell_frame, **entries})
    if not cell.entries():
        raise ParameterError(
            "this load cell is ideal, and changes nothing: give at least one flaw, like --force-noise 0.05 "
            "--moment-noise 0.02"
        )
    with step_bar(quiet or json) as show:
        ideal = read_record(record)
        if LoadCell.from_record(ideal) is not None:
            raise ParameterError(
                f"{record} has been measured already (its header states a load cell), and noise would be there twice: "
                "give the ideal record, as scan writes it"
            )
        show(1, 2)
        measured = cell.measure(ideal, seed=seed)
        if not keep_truth:
            measured = measured.drop_vars([name for name in measured.data_vars if str(name).startswith("truth_")])
        out.parent.mkdir(parents=True, exist_ok=True)
        write_record(measured, out)
    files = {"record": out}
    if json:
        told = {"samples": measured.sizes["sample"], "units": measured.attrs["units"], "seed": seed}
        print_json({**told, "load_cell": cell.entries(), "truth": keep_truth, "files": files})
        return
    print_sentences([_told(measured, keep_truth), *_sheet(cell.entries(), measured), ""])
    print_files(files)


def _entries(stem: str, text: str | None, option: str, names: Sequence[str]) -> dict[str, float]:
    if text is None:
        return {}
    numbers = numbers_asked(text, option, len(names))
    return {f"{stem}_{name}": number for name, number in zip(names, numbers, strict=True)}


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


def _told(measured: xr.Dataset, keep_truth: bool) -> str:
    truth = "with the columns of the truth" if keep_truth else "as a laboratory has it, without truth"
    return f"{measured.sizes['sample']} samples, {truth}; the load cell, which the file states:"


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

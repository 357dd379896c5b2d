"""Options of every command that reads a record, and what they make of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from tactile_bayes.load_cell import LoadCell
    from tactile_bayes.rod import Rod

__all__ = [
    "AsStated",
    "Columns",
    "Diameter",
    "FlexuralRigidity",
    "ForceNoise",
    "Friction",
    "KnownFriction",
    "Length",
    "LoadCellFrame",
    "Measurement",
    "Missing",
    "MomentNoise",
    "Nuisances",
    "Out",
    "Quiet",
    "Record",
    "Seed",
    "SplitSweeps",
    "nuisances_asked",
    "origins_asked",
    "read_measurement",
    "rod_asked",
]

Record = Annotated[Path, typer.Argument(help="Record, .csv or .nc.")]
Out = Annotated[Path, typer.Option(help="Folder for results; made if it is not there.", file_okay=False)]
Columns = Annotated[
    list[str] | None,
    typer.Option(
        help="What the file has for a column, where it has another name, unit, sign or zero: force_x=Fx[mN], "
        "force_y=-Fy[N], drive_angle=90-Angle[deg], base_x=12[mm]; give it again for another."
    ),
]
SplitSweeps = Annotated[
    bool,
    typer.Option("--split-sweeps", help="Find sweeps and directions where the drive turns, if there are none."),
]
Length = Annotated[float | None, typer.Option(help="Rod length [m], for SI files that do not state it.")]
FlexuralRigidity = Annotated[float | None, typer.Option(help="EI [N m²], likewise.")]
Diameter = Annotated[float, typer.Option(help="Rod diameter [m], likewise.")]
ForceNoise = Annotated[
    float | None,
    typer.Option(
        help="Standard deviation of the forces [N, or EI/L²]; by default as the record states, else inferred."
    ),
]
MomentNoise = Annotated[float | None, typer.Option(help="Standard deviation of the moment [N m, or EI/L]; likewise.")]
Missing = Annotated[
    list[str] | None, typer.Option(help="Channel without a column, like force_x; give it again for another.")
]
LoadCellFrame = Annotated[
    Literal["fixed", "turning"] | None,
    typer.Option(help="Axes of the forces, if the file does not say: the world's, or turning with the drive."),
]
Friction = Annotated[float, typer.Option(help="Coulomb's coefficient, known.", min=0.0, max=0.84)]
KnownFriction = Annotated[
    float | None,
    typer.Option(help="Coulomb's coefficient, where it is known; else it is inferred.", min=0.0, max=0.84),
]
Nuisances = Annotated[
    list[str] | None,
    typer.Option(
        help="What is not known of the rig and inferred too, in place of rigidity_scale, drive_angle_offset, bias, "
        "lever, backlash and friction: one of these, or drift, gain, suspension_compliance, base (where further pivots "
        "stand); give it again for another."
    ),
]
AsStated = Annotated[
    bool, typer.Option("--as-stated", help="Take everything about the rig as stated: fewer parameters, narrower.")
]
Seed = Annotated[int, typer.Option(help="Same seed, same numbers.", min=0)]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, only the result.")]


class Measurement(NamedTuple):
    """A record, and what the options say of the rig that it is from."""

    record: xr.Dataset
    load_cell: LoadCell | None
    """None if the options say nothing of it."""
    nuisances: list[str]


def read_measurement(
    path: Path,
    *,
    column: Sequence[str] | None,
    split_sweeps: bool,
    length: float | None,
    flexural_rigidity: float | None,
    diameter: float,
    force_noise: float | None,
    moment_noise: float | None,
    missing: Sequence[str] | None,
    load_cell_frame: Literal["fixed", "turning"] | None,
    nuisance: Sequence[str] | None,
    as_stated: bool,
) -> Measurement:
    """The record, read as the options say; tells where its units had to be guessed.

    Raises
    ------
    ParameterError
        If options contradict each other, or the record.
    RecordError
        If the file holds no record.
    """
    from tactile_bayes.record import read_record

    nuisances = nuisances_asked(nuisance, as_stated)
    rod = rod_asked(length, flexural_rigidity, diameter)
    record = read_record(
        path,
        columns=origins_asked(column or []),
        split_sweeps=split_sweeps,
        rod=rod,
        missing=missing or (),
        load_cell_frame=load_cell_frame,
    )
    cell = _load_cell(record, force_noise, moment_noise)
    if record.attrs.get("units_source") == "assumed":
        typer.echo(
            "The record states no units: its numbers are taken as dimensionless, in units of the rod (L, EI/L, EI/L²). "
            "If they are SI, give --length and --flexural-rigidity.",
            err=True,
        )
    return Measurement(record, cell, nuisances)


def nuisances_asked(nuisance: Sequence[str] | None, as_stated: bool) -> list[str]:
    """What is to be inferred beside a contour.

    Raises
    ------
    ParameterError
        If the options contradict each other.
    """
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.inference.nuisances import STANDARD

    if as_stated and nuisance:
        raise ParameterError("--as-stated and --nuisance contradict each other: leave one of them out")
    return [] if as_stated else list(nuisance or STANDARD)


def rod_asked(length: float | None, flexural_rigidity: float | None, diameter: float) -> Rod | None:
    """The rod, if one is given.

    Raises
    ------
    ParameterError
        If it is not given whole.
    """
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.rod import Rod

    if (length is None) != (flexural_rigidity is None):
        raise ParameterError("--length and --flexural-rigidity go together: give both, or neither")
    if diameter and length is None:
        raise ParameterError("--diameter needs --length and --flexural-rigidity beside it: give all three")
    return None if length is None or flexural_rigidity is None else Rod(length, flexural_rigidity, diameter)


def origins_asked(options: Sequence[str]) -> dict[str, str]:
    """The values of --column by the columns that they are for."""
    from tactile_bayes.errors import ParameterError

    origins: dict[str, str] = {}
    for option in options:
        name, equals, origin = (part.strip() for part in option.partition("="))
        if not (name and equals and origin):
            raise ParameterError(f"--column {option}: write COLUMN=NAME[UNIT], like force_x=Fx[mN]")
        if name in origins:
            raise ParameterError(f"--column {name}= is given twice: keep one of them")
        origins[name] = origin
    return origins


def _load_cell(record: xr.Dataset, force_noise: float | None, moment_noise: float | None) -> LoadCell | None:
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.load_cell import LoadCell
    from tactile_bayes.record import present_channels

    if force_noise is None and moment_noise is None:
        return None
    cell = LoadCell(force_noise=force_noise or 0.0, moment_noise=moment_noise or 0.0)
    bare = [name for name in present_channels(record) if not cell.standard_deviations[name]]
    if bare:
        option = "--moment-noise" if "holding_moment" in bare else "--force-noise"
        raise ParameterError(
            f"{bare[0]} is measured too: give {option} as well, above zero, or leave both out to have them inferred"
        )
    return cell

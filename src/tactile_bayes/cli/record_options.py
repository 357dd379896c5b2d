"""Options of every command that reads a record."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.numbers import assigned
from tactile_bayes.cli.rig_options import RodOptions

if TYPE_CHECKING:
    import xarray as xr

    from tactile_bayes.load_cell import LoadCell

__all__ = ["Record", "RecordOptions"]

Record = Annotated[Path, typer.Argument(help="Record, .csv or .nc, or a bag of ROS.")]


@dataclass(frozen=True)
class RecordOptions(RodOptions):
    """Options for reading a file, and for parts of the rig that it does not state."""

    column: Annotated[
        list[str] | None,
        typer.Option(
            help="Source of a column with another name, unit, sign or zero in the file: force_x=Fx[mN], "
            "force_y=-Fy[N], drive_angle=90-Angle[deg], base_x=12[mm]; may be repeated."
        ),
    ] = None
    split_sweeps: Annotated[
        bool,
        typer.Option(
            "--split-sweeps", help="Find sweeps and directions by the turns of the drive, if not in the file."
        ),
    ] = False
    force_noise: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the forces [N, or EI/L²]; by default as the record states, else inferred."
        ),
    ] = None
    moment_noise: Annotated[
        float | None, typer.Option(help="Standard deviation of the moment [N m, or EI/L]; likewise.")
    ] = None
    missing: Annotated[
        list[str] | None, typer.Option(help="Channel without a column, like force_x; may be repeated.")
    ] = None
    load_cell_frame: Annotated[
        Literal["fixed", "turning"] | None,
        typer.Option(
            help="Axes of the forces, if not in the file: fixed in the laboratory, or turning with the drive."
        ),
    ] = None

    def read(self, path: Path) -> tuple[xr.Dataset, LoadCell | None]:
        """Read the record, and return it with the load cell that the options state, if any; report assumed units.

        Raises
        ------
        ParameterError
            If options contradict each other, or the record.
        RecordError
            If the file holds no record.
        """
        from tactile_bayes.record import read_record

        record, cell = self.completed(read_record(path, **self.arguments))
        self.report_units(record)
        return record, cell

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of `read_record`.

        Raises
        ------
        ParameterError
            If options contradict each other.
        """
        return {
            "columns": self.origins,
            "split_sweeps": self.split_sweeps,
            "rod": None if self._completes_rod else self.rod,
            "missing": self.missing or (),
            "load_cell_frame": self.load_cell_frame,
        }

    @property
    def _completes_rod(self) -> bool:
        """True for a shape without a length, which belongs to the rod that the file states."""
        return bool(self.shape) and self.length is None and self.rod_shape is None

    def completed(self, record: xr.Dataset) -> tuple[xr.Dataset, LoadCell | None]:
        """Return a record as it was read, with the rod and the load cell that the options state.

        Raises
        ------
        ParameterError
            If options contradict the record.
        """
        from tactile_bayes.record import rod_of, with_rod

        if self._completes_rod:
            record = with_rod(record, replace(rod_of(record), **self.shape))
        return record, self._load_cell(record)

    @staticmethod
    def report_units(record: xr.Dataset) -> None:
        """Report assumed units on stderr."""
        if record.attrs.get("units_source") == "assumed":
            typer.echo(
                "The record states no units: its numbers are taken as dimensionless, in units of the rod (L, EI/L, "
                "EI/L²). If they are SI, give --length and --flexural-rigidity.",
                err=True,
            )

    @property
    def origins(self) -> dict[str, str]:
        """Sources in the file by column of the record."""
        return assigned("--column", self.column, "COLUMN=NAME[UNIT], like force_x=Fx[mN]")

    def _load_cell(self, record: xr.Dataset) -> LoadCell | None:
        from tactile_bayes.errors import ParameterError
        from tactile_bayes.load_cell import LoadCell
        from tactile_bayes.record import present_channels

        if self.force_noise is None and self.moment_noise is None:
            return None
        cell = LoadCell(force_noise=self.force_noise or 0.0, moment_noise=self.moment_noise or 0.0)
        bare = [name for name in present_channels(record) if not cell.standard_deviations[name]]
        if bare:
            option = "--moment-noise" if "holding_moment" in bare else "--force-noise"
            raise ParameterError(
                f"{bare[0]} is measured too: give {option} as well, above zero, or leave both out to have them inferred"
            )
        return cell

"""Options that describe a rig: its file, and single numbers that replace those of the file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import tactile_bayes as tb
from tactile_bayes.cli.command import Reads
from tactile_bayes.errors import ParameterError, TactileBayesError

if TYPE_CHECKING:
    import xarray as xr


Record = Annotated[Path, "Record, .csv or .nc, or a bag of ROS.", typer.Argument()]


class _ReadsRig(Reads):
    """Mark of the file of a rig, which may name others: that of the rod's shape, and that of a calibrated rig."""

    def files(self, path: Path) -> Iterator[Path]:
        """Yield them, if they are there."""
        yield path
        from tactile_bayes.tasks.documents import read_toml

        with suppress(OSError, ValueError, TactileBayesError):  # whoever reads the file reports it
            said = read_toml(path.read_text(encoding="utf-8-sig"))
            rod = said.get("rod", {})
            for name in (said.get("rig"), rod.get("shape") if isinstance(rod, dict) else None):
                if isinstance(name, str):
                    yield path.parent / name


@dataclass(frozen=True)
class RigFile:
    """The file of a rig."""

    rig: Annotated[
        Path | None,
        "rig.toml, the rig: rod, load cell, names and units in its files, and what is unknown of it; calibrate-rig and "
        "inspect write one. By default as the record states, if there is one, with the doubts of a real rig.",
        typer.Option(dir_okay=False),
        _ReadsRig(),
    ] = None

    @property
    def stated(self) -> tb.Rig:
        """The rig as file and options state it, apart from its noise; without a file, one that says nothing."""

        return tb.Rig() if self.rig is None else tb.Rig.read(self.rig)


def report_units(record: xr.Dataset) -> None:
    """Report assumed units on stderr."""
    if record.attrs.get("units_source") == "assumed":
        typer.echo(
            "The record states no units: its numbers are taken as dimensionless, in units of the rod (L, EI/L, "
            "EI/L²). If they are SI, give --length and --flexural-rigidity, or a [rod] in rig.toml.",
            err=True,
        )


@dataclass(frozen=True)
class NoiseOptions:
    """Noise of a load cell."""

    force_noise: Annotated[
        float | None, "Standard deviation of the forces [N, or EI/L²], in place of one that is stated."
    ] = None
    moment_noise: Annotated[float | None, "Standard deviation of the moment [N m, or EI/L]; likewise."] = None

    def in_place_of(self, cell: tb.LoadCell | None) -> tb.LoadCell | None:
        """Return a load cell with the noise that is given."""

        names = ("force_noise", "moment_noise")
        noise = {name: value for name in names if (value := getattr(self, name)) is not None}
        return replace(cell or tb.LoadCell(), **noise) if noise else cell


@dataclass(frozen=True)
class RigOptions(NoiseOptions, RigFile):
    """The file of a rig, and numbers that replace those in it."""

    length: Annotated[float | None, "Rod length [m], if no file states it, or in place of that in rig.toml."] = None
    flexural_rigidity: Annotated[float | None, "EI [N m²]; likewise."] = None
    diameter: Annotated[float | None, "Rod diameter [m], at the base; likewise."] = None

    @property
    def stated(self) -> tb.Rig:
        """The rig as file and options state it, apart from its noise."""

        rig = super().stated
        named = ((name, getattr(self, name)) for name in ("length", "flexural_rigidity", "diameter"))
        given = {name: value for name, value in named if value is not None}
        if not given:
            return rig
        if rig.rod is None or rig.rod.is_dimensionless:
            if (self.length is None) != (self.flexural_rigidity is None):
                raise ParameterError(
                    "--length and --flexural-rigidity go together where no rig.toml states the rod: give both, or "
                    "neither"
                )
            if self.length is None:
                raise ParameterError("--diameter needs --length and --flexural-rigidity beside it: give all three")
        return replace(rig, rod=replace(rig.rod or tb.Rod(), **given))

    def read(self, path: Path) -> tuple[xr.Dataset, tb.Rig]:
        """Read a record, and return it with its rig and the noise that is given; report assumed units."""

        stated = self.stated
        record, rig = tb.read_record(path, stated), stated.without_bare_cell
        report_units(record)
        if self.force_noise is None and self.moment_noise is None:
            return record, rig
        cell = self.in_place_of(rig.load_cell or tb.LoadCell.from_record(record))
        assert cell is not None
        bare = [name for name in tb.record.present_channels(record) if not cell.standard_deviations[name]]
        if bare:
            option = "--moment-noise" if "holding_moment" in bare else "--force-noise"
            raise ParameterError(
                f"{bare[0]} is measured too: give {option} as well, above zero, or leave both out to have them inferred"
            )
        return record, replace(rig, load_cell=cell)

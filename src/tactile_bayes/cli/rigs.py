"""The command `rig`, the file of a rig in words; and options that describe a rig, by its file or single numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tactile_bayes as tb
from tactile_bayes.cli.answer import Answer, table_of
from tactile_bayes.cli.command import Output, Reads
from tactile_bayes.errors import ParameterError, TactileBayesError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

    from tactile_bayes.rig.parameters import Parameter

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


def rig(
    *,
    path: Annotated[
        Path | None, "File of a rig, to be checked.", typer.Argument(metavar="RIG.toml", dir_okay=False)
    ] = None,
    parameters: Annotated[bool, "List what may be unknown of a rig."] = False,
    output: Output,
) -> Answer:
    """Check the file of a rig, and print what it states, what is known of it, and what is unknown.

    Under [unknown] a number makes a parameter known, a distribution unknown, like friction = { half_normal = 0.3 }.
    """
    from tactile_bayes.rig.parameters import PARAMETERS

    if (path is None) != parameters:
        raise ParameterError("give the file of a rig, or --parameters")
    if path is None:
        rows = [_row(parameter) for parameter in PARAMETERS.values()]
        return Answer(_listed(rows), lambda: {"parameters": rows})
    stated = tb.Rig.read(path)
    said = _said(stated)
    return Answer(_words(stated, said), lambda: {"rig": stated.tables, "known": stated.known, "said": said})


# Units of the rod, by those of SI.
_UNITS = {
    "s": "s",
    "m": "L",
    "1/m": "1/L",
    "m/N": "L³/EI",
    "N m": "EI/L",
    "N": "EI/L²",
    "1/N/m": "L/EI",
    "rad/(N m)": "L/EI",
    "1/N²/m²": "(L/EI)²",
}


def _row(parameter: Parameter) -> dict[str, Any]:
    names = ("name", "meaning", "unit", "low", "high", "hidden")
    return {name: getattr(parameter, name) for name in names} | {"default": _default(parameter)}


def _listed(rows: list[dict[str, Any]]) -> Iterator[Any]:
    from tactile_bayes.rig.parameters import GROUPS, STANDARD

    yield (
        f"Unknown of a real rig, unless rig.toml says otherwise: {', '.join(STANDARD)}. All others are as stated, "
        "unless they are named under [unknown]."
    )
    groups = "; ".join(f"{name} for {', '.join(members)}" for name, members in GROUPS.items())
    yield f"Names of several: {groups}; base for the shifts of all pivots but the first, base_2_x, base_2_y and so on."
    yield ""
    cells = [
        [row["name"], row["meaning"], "" if row["unit"] == "1" else row["unit"], row["default"], _bounds(row)]
        for row in rows
    ]
    heads = ["name", "meaning", "unit", "default distribution", "bounds"]
    yield table_of(heads, cells, left=heads, may_wrap=True)
    yield ""
    yield "No record shows, and then they are left out:"
    for row in rows:
        if row["hidden"]:
            yield f"  {row['name']} {row['hidden']}"


def _bounds(row: dict[str, Any]) -> str:
    low, high = row["low"], row["high"]
    if math.isinf(low) and math.isinf(high):
        return ""
    return f"above {low:g}" if math.isinf(high) else f"{low:.3g} to {high:.3g}"


def _default(parameter: Parameter) -> str:
    """Return the default distribution as text; units are those of the rod, lengths L and moments EI/L."""
    kind, centre = parameter.default.replace("_", "-"), parameter.neutral
    if "uniform" in kind:
        kind += " from"
    elif "half" not in kind and centre != 0.0:
        kind += f" around {'the stated one' if centre is None else f'{centre:g}'},"
    else:
        kind += ","
    if parameter.default == "log_normal":  # its width is that of the logarithm
        return f"{kind} {parameter.width:g}"
    if parameter.unit == "rad":
        return f"{kind} {math.degrees(parameter.width):.3g}°"
    return f"{kind} {parameter.width:g} {_UNITS.get(parameter.unit, '')}".strip()


def _said(rig: tb.Rig) -> dict[str, str]:
    """Return what is said of each parameter, as text: a number, a distribution, or that it has its default one."""
    from tactile_bayes.distributions import in_words

    calibrated = {} if rig.calibration is None else rig.calibration.priors
    said = {
        name: f"known, {value:g}"
        if isinstance(value, float)
        else "unknown, by default"
        if isinstance(value, str)
        else f"unknown, {in_words(value)}"
        for name, value in rig.said.items()
        if name not in calibrated
    }
    return said | {name: f"calibrated, {in_words(prior)}" for name, prior in calibrated.items()}


def _words(rig: tb.Rig, said: dict[str, str]) -> Iterator[Any]:
    rod, cell = rig.rod, rig.load_cell
    if rod is None:
        yield "rod         as the record states"
    elif rod.is_dimensionless:
        yield f"rod         {', '.join(['in units of the rod', *rod.shape_in_words('1/L')])}"
    else:
        of_rod = [f"L = {rod.length:g} m", f"EI = {rod.flexural_rigidity:.4g} N m²"]
        of_rod += [f"diameter {rod.diameter:g} m"] if rod.diameter else []
        yield f"rod         {', '.join([*of_rod, *rod.shape_in_words('1/m')])}"
    entries = {} if cell is None else cell.entries()
    yield f"load cell   {_list(entries) or 'as the record states, or its noise is found'}"
    yield f"columns     {_list(rig.format.columns) or 'as in the file'}"
    if rig.format.where:
        yield f"rows        where {rig.format.where}"
    if rig.format.split_sweeps:
        yield f"sweeps      {'each row' if rig.format.split_sweeps == 'rows' else 'found by the turns of the drive'}"
    if rig.format.missing:
        yield f"missing     {', '.join(rig.format.missing)}"
    yield ""
    yield table_of(["parameter", "what is said of it"], said.items(), left=["parameter", "what is said of it"])
    yield ""
    yield "All other parameters are as stated; tactile-bayes rig --parameters lists them."


def _list(entries: Any) -> str:
    texts = {name: f"{value:.6g}" if isinstance(value, float) else str(value) for name, value in entries.items()}
    return ", ".join(f"{name} = {text}" for name, text in texts.items())

"""The commands `inspect` and `reconstruct`: what is in a file and looks wrong, and contact points sample by sample."""

from __future__ import annotations

import shlex
import warnings
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tactile_bayes as tb
from tactile_bayes.cli.answer import Answer, columns_of, table_of, text_of
from tactile_bayes.cli.command import Out, Output, Writes
from tactile_bayes.cli.numbers import assigned
from tactile_bayes.cli.progress import step_bar
from tactile_bayes.cli.rigs import Record, RigOptions
from tactile_bayes.errors import RecordWarning
from tactile_bayes.runs.names import INSPECTION, RECONSTRUCTION

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import xarray as xr
    from rich.table import Table

    from tactile_bayes.runs.readings import ReconstructionRun

_SOURCES = {
    "given": "as rig.toml and options say",
    "data sheet": "as the file states",
    "unloaded samples": "not stated, found in the unloaded samples",
    "nothing": "neither stated nor found",
    "too few unloaded samples": "not stated, and too few unloaded samples to estimate it",
}
_NOISE_SOURCES = {
    "data sheet": "The noise is that of the load cell as the file states it.",
    "unloaded samples": "No noise is stated: bias and noise are taken from the unloaded samples.",
    "nothing": "There is no noise, neither stated nor in unloaded samples: no standard deviations.",
    "too few unloaded samples": "No noise is stated, and too few samples are unloaded to estimate it: every "
    "sample counts as loaded. Give --force-noise and --moment-noise.",
}


@dataclass(frozen=True)
class _FileOptions(RigOptions):
    """The rig, and how its file is written, as long as no rig.toml says it."""

    column: Annotated[
        list[str] | None,
        "Source of a column with another name, unit, sign, factor or zero in the file: force_x=Fx[mN], "
        "force_y=-1e-3*Fy[N], drive_angle=90-Angle[deg], base_x=12[mm]; may be repeated.",
    ] = None
    split_sweeps: Annotated[bool, "Find sweeps and directions by the turns of the drive, if not in the file."] = False
    missing: Annotated[list[str] | None, "Channel without a column, like force_x; may be repeated."] = None
    frame: Annotated[
        Literal["fixed", "turning"] | None,
        "Axes of the forces, if not in the file: fixed in the laboratory, or turning with the drive.",
    ] = None

    @property
    def stated(self) -> tb.Rig:
        """The rig as file and options state it, apart from its noise."""

        rig = super().stated
        columns = assigned("--column", self.column, "COLUMN=NAME[UNIT], like force_x=Fx[mN]")
        file = replace(
            rig.format,
            columns={**rig.format.columns, **columns},
            split_sweeps=self.split_sweeps or rig.format.split_sweeps,
            missing=(*rig.format.missing, *(self.missing or ())),
        )
        cell = rig.load_cell
        if self.frame is not None:
            cell = replace(cell or tb.LoadCell(), frame=self.frame)
        return replace(rig, file=file, load_cell=cell)


def inspect(
    *,
    record: Record,
    out: Annotated[
        Path | None, "Folder for rig.toml, a figure, tables and this text; created if missing.", Writes(INSPECTION)
    ] = None,
    rig: _FileOptions,
    output: Output,
) -> Answer:
    """Inspect a record before anything is inferred: what looks wrong, and the contents of the file.

    Say by options how the file is written: rig.toml then says it to all other commands, with the noise and the zeros of
    the unloaded samples if nobody states them. The last line is the next command.
    """
    with step_bar(output.is_silent) as show:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RecordWarning)  # they are among the contents
            measured, of_record = rig.read(record)
        found = tb.inspect_record(measured, of_record, progress=show)
        beside = _beside(measured)
        texts = (f"{name.replace('_', ' '):<12}{text}" for name, several in beside.items() for text in several)
        contents = [*_contents(found, of_record.format.columns), *texts]
        files: Mapping[str, Path] = {}
        if out is not None:
            from tactile_bayes.runs.readings import write_inspection

            if of_record.load_cell is None:  # the frame is stated without one, too
                of_record = replace(of_record, load_cell=rig.stated.load_cell)
            files = write_inspection(found, out, text=["", *contents], rig=of_record)
    again = _next_command(record, rig, out)
    return Answer(_words(found, contents, again, files), lambda: _numbers(found, again, files) | beside)


def _words(
    found: tb.diagnostics.Inspection, contents: list[str], again: str, files: Mapping[str, Path]
) -> Iterator[Any]:
    yield from (*found.messages, "", *contents, "", _sweeps(found.sweeps), "", _channels(found.channels), "")
    if found.statuses:
        yield "Raw Step 2: " + ", ".join(f"{count} {fate}" for fate, count in found.statuses.items())
    else:
        yield "No Step 2, which needs all three load channels; infer works without."
    if files:
        yield from ("", files)
    yield from ("", f"{'Once that is corrected' if found.is_suspect else 'Next'}: {again}")


def _beside(record: xr.Dataset) -> dict[str, list[str]]:
    """Return what was assumed as the file was read, and what of it has no meaning here."""
    from tactile_bayes.record.attribute_names import unused

    attributes = ", ".join(unused(record.attrs))
    return {
        "reading": list(record.encoding["notes"]),
        "not_used": [text for text in (attributes, *record.encoding["remarks"]) if text],
    }


def _next_command(record: Path, rig: _FileOptions, out: Path | None) -> str:
    """Return the command that goes on: infer, or again inspect where only its options say how the file is written."""
    path = shlex.quote(str(record))
    if out is not None:
        return f"tactile-bayes infer {path} --rig {shlex.quote(str(out / 'rig.toml'))} --out run/"
    if rig.column or rig.split_sweeps or rig.missing or rig.frame:
        return f"tactile-bayes inspect {path}{_as_options(rig)} --out inspection/"
    return f"tactile-bayes infer {path}{_as_options(rig)} --out run/"


def _as_options(rig: _FileOptions) -> str:
    """Return the given options as words of a command."""
    words = ""
    for name, value in vars(rig).items():
        option = f" --{name.replace('_', '-')}"
        for part in value if isinstance(value, list) else [value] if value not in (None, False) else []:
            words += option if part is True else f"{option} {shlex.quote(str(part))}"
    return words


def _contents(found: tb.diagnostics.Inspection, origins: Mapping[str, str]) -> list[str]:
    """Return the contents of the file, except its sweeps and channels; origins are those of the rig's file."""
    from tactile_bayes.diagnostics.findings import quantity

    record, rod = found.record, tb.record.rod_of(found.record)
    sweeps = found.sweeps.sizes["sweep"]
    if record.attrs["units"] == "SI":
        of_rod = [f"L = {quantity(rod.length, 'm')}", f"EI = {rod.flexural_rigidity:.4g} N m²"]
        of_rod += [f"diameter {quantity(rod.diameter, 'm')}"] if rod.diameter else []
        of_rod += rod.shape_in_words("1/m")
        of_rod += [f"EI/L = {quantity(rod.moment_unit, 'N m')}", f"EI/L² = {quantity(rod.force_unit, 'N')}"]
        units = f"SI, rod: {', '.join(of_rod)}"
    else:
        assumed = ", which the file does not state" if record.attrs.get("units_source") == "assumed" else ""
        units = f"dimensionless, in units of the rod{assumed}"
        units = ", ".join([units, *rod.shape_in_words("1/L")])
    axes = (
        "fixed, along x and y"
        if tb.record.frame_of(record) == "fixed"
        else "turning with the drive, along the rod and across"
    )
    taken = [f"{name} = {origins[name]}" if name in origins else name for name in tb.record.MEASURED]
    others = [str(name) for name in record.data_vars if name not in tb.record.MEASURED]
    absent = [name for name in tb.record.MEASURED[-3:] if name not in tb.record.present_channels(record)]
    return [
        f"samples     {record.sizes['sample']} in {sweeps} sweep{'s' * (sweeps != 1)}",
        f"columns     {', '.join(name for name in taken if name not in absent)}",
        *([f"not there   {', '.join(absent)}"] if absent else []),
        *([f"others      {', '.join(others)}"] if others else []),
        f"units       {units}",
        f"load cell   {axes}; noise {_SOURCES[found.load_cell_source]}",
    ]


def _sweeps(sweeps: xr.Dataset) -> Table:
    """Return the table of sweeps; events lie midway between the samples beside them."""
    import numpy as np

    pivots = [f"{x:g},{y:g}" for x, y in zip(sweeps.base_x.values, sweeps.base_y.values, strict=True)]
    with_pivots = set(pivots) != {"0,0"}
    unit = sweeps.base_x.attrs["units"]
    base = "base" if unit == "1" else f"base [{unit}]"
    rows = []
    for i, number in enumerate(sweeps.sweep.values):
        row = sweeps.isel(sweep=i)
        start, end, step = (np.degrees(float(row[f"drive_{name}"])) for name in ("angle_from", "angle_to", "step"))
        ends = [text_of(np.degrees(row[f"{name}_drive_angle"].values).mean()) for name in ("onset", "snap_off")]
        moves = [f"{start:.1f} to {end:.1f}", f"{step:.3g}"]
        if "carried" in row and bool(row.carried):
            along = (_travel(float(row[name]), unit) for name in ("travel", "travel_step"))
            moves = [f"{words} {text}" for words, text in zip(("carried", "by"), along, strict=True)]
            ends = [_travel(float(row[f"{name}_travel"].mean(skipna=False)), unit) for name in ("onset", "snap_off")]
        pivot = [pivots[i]] if with_pivots else []
        ends = ends if bool(row.contact) else ["never", "–"]
        samples, unloaded = str(int(row.samples)), str(int(row.unloaded))
        rows.append([f"{number} {row.direction.values}", *pivot, samples, *moves, *ends, unloaded])
    drive = "drive [°]" if "carried" not in sweeps else "drive [°], or travel"
    heads = ["sweep", *([base] if with_pivots else []), "samples", drive, "step", "touches", "lets go"]
    return table_of([*heads, "unloaded"], rows, left=["sweep"])


def _travel(value: float, unit: str) -> str:
    """Return a travel of the base with its unit."""
    if value != value:
        return "–"
    return f"{value:.4g} L" if unit == "1" else f"{1e3 * value:.4g} mm"


def _channels(channels: xr.Dataset) -> Table:
    """Return the table of channels, each in one unit; the last column is the correlation of unloaded neighbours."""
    from tactile_bayes.diagnostics.findings import prefix_of

    rows = []
    for row in columns_of(channels, "channel"):
        name, unit, like = row["channel"], row["unit"], row["neighbour_correlation"]
        size, prefix = (1.0, "") if unit == "1" else prefix_of(max(abs(row["smallest"]), abs(row["largest"])))
        cells = []
        for column in ("smallest", "largest", "bias", "bias_uncertainty", "noise", "stated_noise", "resolution"):
            value = row[column] / size
            none = value != value or (column == "resolution" and value == 0.0)
            cells.append("–" if none else f"{value:.2g}" if column == "bias_uncertainty" else f"{value:.3g}")
        label = name if unit == "1" else f"{name} [{prefix}{unit}]"
        rows.append([label, *cells, text_of(like, "+.2f")])
    heads = ["channel", "from", "to", "zero", "± s.e.", "noise", "stated", "step", "corr."]
    return table_of(heads, rows, left=["channel"])


def _numbers(found: tb.diagnostics.Inspection, again: str, files: Mapping[str, Path]) -> dict[str, Any]:
    from tactile_bayes.record.attributes import rod_attributes

    record = found.record
    sweeps = columns_of(found.sweeps, "sweep")
    for name, values in found.sweeps.data_vars.items():
        if values.dims == ("sweep", "side"):
            for row, sides in zip(sweeps, values.values, strict=True):
                row[str(name)] = sides
    return {
        "words": found.messages,
        "is_suspect": found.is_suspect,
        "samples": record.sizes["sample"],
        "columns": [str(name) for name in record.data_vars],
        "units": record.attrs["units"],
        "units_assumed": record.attrs.get("units_source") == "assumed",
        "rod": {name.removeprefix("rod_"): value for name, value in rod_attributes(tb.record.rod_of(record)).items()},
        "load_cell_frame": tb.record.frame_of(record),
        "load_cell": found.load_cell.entries() if found.load_cell is not None else None,
        "load_cell_source": found.load_cell_source,
        "sweeps": sweeps,
        "channels": columns_of(found.channels, "channel"),
        "suspicious_samples": _suspicious(found.samples),
        "raw_step_2": found.statuses,
        "next": again,
        "files": files,
    }


def _suspicious(samples: xr.Dataset) -> dict[str, Any]:
    """Return the numbers of suspicious samples by kind, and by channel if a kind has channels."""
    import numpy as np

    numbers: dict[str, Any] = {}
    for kind in ("outlier", "stuck", "cut_off", "repeated", "uneven_step"):
        flags = samples[kind]
        if "channel" in flags.dims:
            numbers[kind] = {str(one): np.flatnonzero(flags.sel(channel=one)) for one in flags.channel.values}
        else:
            numbers[kind] = np.flatnonzero(flags)
    return numbers


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
        from tactile_bayes.runs.readings import reconstruct_into, reconstruction_messages

        measured, of_record = rig.read(record)
        show(1, 2)
        run = reconstruct_into(measured, out, method=method, rig=of_record)
    words = reconstruction_messages(run.result)
    source = [_NOISE_SOURCES[run.source]] if run.source in _NOISE_SOURCES else []
    return Answer([*words, *source, "", run.files], lambda: _contact_numbers(run, words))


def _contact_numbers(run: ReconstructionRun, words: tuple[str, ...]) -> dict[str, Any]:
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

"""The commands `scan` and `measure`: the loads at the base of an ideal rod, and what a load cell reads of them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tactile_bayes as tb
from tactile_bayes.cli.answer import Answer, table_of
from tactile_bayes.cli.command import Output, Seed, Writes
from tactile_bayes.cli.progress import step_bar
from tactile_bayes.cli.rigs import NoiseOptions, RigFile
from tactile_bayes.cli.scan_options import ContourOptions, Directions, DriveOptions, Pivots
from tactile_bayes.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from rich.table import Table

    from tactile_bayes.sweep import Event, Scan

RecordFile = Annotated[Path, "File for the record, .csv or .nc; its folder is created if missing.", Writes()]


def scan(
    *,
    out: RecordFile,
    choice: ContourOptions,
    rig: RigFile,
    base: Pivots = None,
    drive: DriveOptions,
    direction: Annotated[Directions, "Sense of the rotations about each pivot."] = "both",
    figure: Annotated[
        Path | None, "File for a figure of rod and loads along the sweeps, .png, .pdf or .svg; likewise.", Writes()
    ] = None,
    output: Output,
) -> Answer:
    """Sweep an ideal rod along a contour (Step 1), and write the record of its base, without noise, and its events.

    The drive turns the rod about each --base, or carries its base (--carry); with both, the record holds both.
    """
    refuse_other_suffix(out)
    if figure is not None:
        refuse_other_suffix(figure, (".png", ".pdf", ".svg"), "a figure")
    with step_bar(output.is_silent) as show:
        stated = rig.stated
        rod = stated.known_rod
        made = tb.scan(choice.contour(stated.rod or tb.Rod()), stated, drive=drive.drives(base, direction))
        show(1, 3 if figure else 2)
        out.parent.mkdir(parents=True, exist_ok=True)
        tb.write_record(made.record, out)
        files = {"record": out}
        if figure is not None:
            show(2, 3)
            figure.parent.mkdir(parents=True, exist_ok=True)
            _draw(made, figure)
            files["figure"] = figure
    return Answer([_headline(made, rod), "", _table(made, rod), "", files], lambda: _numbers(made, rod, files))


def refuse_other_suffix(path: Path, known: tuple[str, ...] = (".csv", ".nc"), what: str = "a record") -> None:
    """Refuse a file with another suffix, or below another file, before anything is computed."""
    if path.suffix not in known:
        kinds = f"{', '.join(known[:-1])} or {known[-1]}"
        raise ParameterError(f"{path}: {what} is a {kinds} file, so give a name with that ending")
    above = next(folder for folder in path.absolute().parents if folder.exists())
    if not above.is_dir():
        raise ParameterError(f"{above} is a file, and no folder for {path.name}: give {what} another name")


def _headline(made: Scan, rod: tb.Rod) -> str:
    sweeps = len(made.sweeps)
    units = "in units of the rod (L, EI/L, EI/L²)"
    if not rod.is_dimensionless:
        units = f"with EI/L = {rod.moment_unit * 1e3:.4g} mN m and EI/L² = {rod.force_unit * 1e3:.4g} mN"
    return (
        f"{made.contour}: {sweeps} sweep{'s' * (sweeps != 1)}, {made.record.sizes['sample']} samples without noise, "
        f"{units}"
    )


def _table(made: Scan, rod: tb.Rod) -> Table:
    """Return first contact, phase changes and snap-off of every sweep, in this order."""

    scale, units = (1.0, ("", "", "")) if rod.is_dimensionless else (1e3, (" [mm]", " [mN m]", " [mN]"))
    length, moment, force = units
    carried = tb.record.carried_sweeps(made.record)
    rows = []
    for number, sweep in enumerate(made.sweeps):
        named = [(f"{number} {sweep.direction}", f"first contact ({sweep.first_contact.kind})", sweep.first_contact)]
        named += [("", change.kind, change) for change in sweep.transitions]
        for sweeping, name, event in [*named, ("", _ending(sweep.snap_off), sweep.snap_off)]:
            size = math.hypot(event.force_x, event.force_y)
            values = (scale * v for v in (event.contact_x, event.contact_y, event.holding_moment, size))
            travel = [_fixed(scale * event.travel) if number in carried else ""] if carried else []
            rows.append([sweeping, name, *travel, f"{math.degrees(event.drive_angle):.3f}", *map(_fixed, values)])
    travel = [f"travel{length or ' [L]'}"] if carried else []
    heads = ["sweep", "event", *travel, "at [°]", f"x{length}", f"y{length}", f"m0{moment}", f"force{force}"]
    return table_of(heads, rows, left=["sweep", "event"])


def _fixed(value: float) -> str:
    return f"{value:z.4f}" if abs(value) < 1e3 else f"{value:.5g}"


def _ending(event: Event) -> str:
    """Return how contact ends, as text."""
    ways = {"release": "released without a jump", "never": "still in contact at the end"}
    return ways.get(event.kind, f"snap-off ({event.kind})")


def _numbers(made: Scan, rod: tb.Rod, files: Mapping[str, Path]) -> dict[str, Any]:
    from dataclasses import asdict

    carried = tb.record.carried_sweeps(made.record)
    return {
        "contour": str(made.contour),
        "units": made.record.attrs["units"],
        "rod": asdict(rod),
        "samples": made.record.sizes["sample"],
        "sweeps": [
            {"sweep": number, "carried": number in carried, **asdict(sweep)} for number, sweep in enumerate(made.sweeps)
        ],
        "files": files,
    }


def _draw(made: Scan, path: Path) -> None:
    """Draw rods of every sweep from the first pivot and of sweeps in which the base is carried, and the loads below."""
    from tactile_bayes.plotting.style import own_style, save_figure

    carried = tb.record.carried_sweeps(made.record)
    shown = [n for n, sweep in enumerate(made.sweeps) if sweep.base == made.sweeps[0].base or n in carried]
    with own_style(), tb.tasks.write_atomically(path) as temporary:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.0, 5.0 + 3.4 * len(shown)), layout="constrained")
        parts: Any = figure.subfigures(2, 1, height_ratios=(3.4 * len(shown), 5.0))
        for number, ax in zip(shown, parts[0].subplots(len(shown), 1, squeeze=False)[:, 0], strict=True):
            tb.plotting.rods(made, sweep=number, ax=ax)
        tb.plotting.observables(made.record, events=made.events, axes=parts[1].subplots(3, 1, sharex=True))
        save_figure(figure, temporary, path.suffix[1:])


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
    from tactile_bayes.rig.parameters import GROUPS
    from tactile_bayes.rig.stated import cell_with

    stated = rig.stated
    cell = noise.in_place_of(stated.load_cell) or tb.LoadCell()
    with step_bar(output.is_silent) as show:
        ideal = tb.read_record(record)
        if tb.LoadCell.from_record(ideal) is not None:
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
        tb.write_record(measured, out)
    truth = "with the columns of the truth" if keep_truth else "without columns of the truth"
    samples, files = measured.sizes["sample"], {"record": out}
    words = f"{samples} samples, {truth}; the load cell, which the file states:"
    numbers = {"samples": samples, "units": measured.attrs["units"], "seed": seed, "truth": keep_truth, "files": files}
    return Answer(
        [words, *_sheet(cell.entries(), measured), "", files], lambda: {**numbers, "load_cell": cell.entries()}
    )


def _sheet(entries: dict[str, float | str], measured: xr.Dataset) -> list[str]:

    lines = []
    for name, value in entries.items():
        unit = tb.record.LOAD_CELL_UNITS.get(name, "1")
        if measured.attrs["units"] != "SI" and unit != "rad":
            unit = "1"
        shown = value if isinstance(value, str) else f"{value:.6g}"
        lines.append(f"  {name.replace('_', ' '):<40} {shown}{'' if unit == '1' else ' ' + unit}")
    return lines

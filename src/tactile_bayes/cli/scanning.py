"""The command `scan`: what the base of an ideal rod feels along a contour."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Json, print_files, print_json, print_sentences, print_table, table_of
from tactile_bayes.cli.contour_options import Distance, Family, Parameters, Points, Profile, contour_asked
from tactile_bayes.cli.numbers import numbers_asked
from tactile_bayes.cli.record_options import Friction, Quiet, rod_asked
from tactile_bayes.cli.simulated_rig_options import Bases, Diameter, FlexuralRigidity, Length
from tactile_bayes.cli.task_bar import step_bar

if TYPE_CHECKING:
    from tactile_bayes.rod import Rod
    from tactile_bayes.scanning import Scan
    from tactile_bayes.sweep_events import SweepEvents

__all__ = ["RecordFile", "refuse_other_suffix", "scan"]

RecordFile = Annotated[
    Path,
    typer.Option(help="File for the record, .csv or .nc; its folder is made if it is not there.", dir_okay=False),
]


def scan(
    out: RecordFile,
    profile: Profile = None,
    distance: Distance = None,
    family: Family = None,
    parameter: Parameters = None,
    points: Points = None,
    length: Length = None,
    flexural_rigidity: FlexuralRigidity = None,
    diameter: Diameter = 0.0,
    base: Bases = None,
    direction: Annotated[
        Literal["both", "forward", "backward"], typer.Option(help="Sense of the sweeps from each pivot.")
    ] = "both",
    drive_step: Annotated[float, typer.Option(help="Step of the drive [degrees].", min=0.001, max=28.0)] = 1.0,
    friction: Friction = 0.0,
    figure: Annotated[
        Path | None,
        typer.Option(
            help="File for a picture of rod and loads along the sweeps, .png, .pdf or .svg; likewise.", dir_okay=False
        ),
    ] = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Sweep an ideal rod along a contour (Step 1): the record of its base, without noise, and its events."""
    refuse_other_suffix(out)
    if figure is not None:
        refuse_other_suffix(figure, (".png", ".pdf", ".svg"), "a figure")
    with step_bar(quiet or json) as show:
        import numpy as np

        from tactile_bayes.record import write_record
        from tactile_bayes.rod import Rod
        from tactile_bayes.scanning import scan as sweep

        rod = rod_asked(length, flexural_rigidity, diameter) or Rod()
        made = sweep(
            contour_asked(profile, distance, family, parameter, points, rod_length=rod.length),
            direction=direction,
            base=[numbers_asked(pivot, "--base", 2) for pivot in base or ["0,0"]],  # type: ignore[misc]
            drive_step=float(np.radians(drive_step)),
            rod=rod,
            friction=friction,
        )
        show(1, 3 if figure else 2)
        out.parent.mkdir(parents=True, exist_ok=True)
        write_record(made.record, out)
        files = {"record": out}
        if figure is not None:
            show(2, 3)
            figure.parent.mkdir(parents=True, exist_ok=True)
            _draw(made, figure)
            files["figure"] = figure
    if json:
        print_json(_numbers(made, rod, files))
        return
    print_sentences([_headline(made, rod), ""])
    print_table(_table(made, rod))
    print_sentences([""])
    print_files(files)


def refuse_other_suffix(path: Path, known: tuple[str, ...] = (".csv", ".nc"), what: str = "a record") -> None:
    """Refuse a file of another kind, or below another file, before anything is computed.

    Raises
    ------
    ParameterError
        If the name ends otherwise, or there is a file where its folder would be.
    """
    from tactile_bayes.errors import ParameterError

    if path.suffix not in known:
        kinds = f"{', '.join(known[:-1])} or {known[-1]}"
        raise ParameterError(f"{path}: {what} is a {kinds} file, so give a name that ends so")
    above = next(folder for folder in path.absolute().parents if folder.exists())
    if not above.is_dir():
        raise ParameterError(f"{above} is a file, and no folder for {path.name}: give {what} another name")


def _headline(made: Scan, rod: Rod) -> str:
    sweeps = len(made.sweeps)
    units = "in units of the rod (L, EI/L, EI/L²)"
    if not rod.is_dimensionless:
        units = f"with EI/L = {rod.moment_unit * 1e3:.4g} mN m and EI/L² = {rod.force_unit * 1e3:.4g} mN"
    return (
        f"{made.contour}: {sweeps} sweep{'s' * (sweeps != 1)}, {made.record.sizes['sample']} samples without noise, "
        f"{units}"
    )


def _events(sweep: SweepEvents) -> list[tuple[str, Any]]:
    """First contact, changes and snap-off, in the order in which they happen."""
    return [
        ("first contact", sweep.first_contact),
        *(("phase change", change) for change in sweep.transitions),
        ("snap-off", sweep.snap_off),
    ]


def _table(made: Scan, rod: Rod) -> Any:
    si = not rod.is_dimensionless
    scale, units = (1e3, (" [mm]", " [mN m]", " [mN]")) if si else (1.0, ("", "", ""))
    length, moment, force = units
    table = table_of(
        ["sweep", "event", "at [°]", f"x{length}", f"y{length}", f"m0{moment}", f"force{force}"],
        left=["sweep", "event"],
    )
    for number, sweep in enumerate(made.sweeps):
        for what, event in _events(sweep):
            size = (event.force_x**2 + event.force_y**2) ** 0.5
            values = (scale * v for v in (event.contact_x, event.contact_y, event.holding_moment, size))
            numbers = [f"{value:z.4f}" if abs(value) < 1e3 else f"{value:.5g}" for value in values]
            name = event.kind if what == "phase change" else f"{what} ({event.kind})"
            first = f"{number} {sweep.direction}" if what == "first contact" else ""
            table.add_row(first, name, f"{event.drive_angle * 57.29577951308232:.3f}", *numbers)
    return table


def _numbers(made: Scan, rod: Rod, files: dict[str, Path]) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "contour": str(made.contour),
        "units": made.record.attrs["units"],
        "rod": asdict(rod),
        "samples": made.record.sizes["sample"],
        "sweeps": [
            {
                "sweep": number,
                "direction": sweep.direction,
                "base": sweep.base,
                "clear": sweep.clear,
                "largest_strain": sweep.largest_strain,
                "first_contact": asdict(sweep.first_contact),
                "transitions": [asdict(change) for change in sweep.transitions],
                "snap_off": asdict(sweep.snap_off),
            }
            for number, sweep in enumerate(made.sweeps)
        ],
        "files": files,
    }


def _draw(made: Scan, path: Path) -> None:
    """Rods of every sweep from the first pivot, and the loads below."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from tactile_bayes import plotting
    from tactile_bayes.files import write_atomically

    shown = [number for number, sweep in enumerate(made.sweeps) if sweep.base == made.sweeps[0].base]
    figure = Figure(figsize=(7.0, 5.0 + 3.4 * len(shown)), layout="constrained")
    FigureCanvasAgg(figure)
    parts: Any = figure.subfigures(2, 1, height_ratios=(3.4 * len(shown), 5.0))
    for number, ax in zip(shown, parts[0].subplots(len(shown), 1, squeeze=False)[:, 0], strict=True):
        plotting.rods(made, sweep=number, ax=ax)
    one_base = len(shown) == len(made.sweeps)
    plotting.observables(
        made.record, events=made.events if one_base else None, axes=parts[1].subplots(3, 1, sharex=True)
    )
    with write_atomically(path) as temporary:
        figure.savefig(temporary, dpi=200, format=path.suffix[1:])

"""The command `sensitivity`: how good a load cell must be, before anything is measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Json, print_json
from tactile_bayes.cli.interrupts import going_on
from tactile_bayes.cli.numbers import load_cell_asked, numbers_asked
from tactile_bayes.cli.record_options import (
    AsStated,
    KnownFriction,
    Nuisances,
    Out,
    Quiet,
    Seed,
    nuisances_asked,
    rod_asked,
)
from tactile_bayes.cli.simulated_rig_options import Bases, Diameter, FlexuralRigidity, ForceNoise, Length, MomentNoise
from tactile_bayes.cli.task_bar import counted, task_bar
from tactile_bayes.cli.worker_options import Scheduler, Workers, refuse_both

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

    from tactile_bayes.ledger import TaskProgress
    from tactile_bayes.load_cell import LoadCell
    from tactile_bayes.rod import Rod
    from tactile_bayes.runs.sensitivity import Material, SensitivityRun

__all__ = ["sensitivity"]

Profile = Literal["I", "II", "III", "IV"]


def sensitivity(
    out: Out,
    profile: Annotated[
        Profile, typer.Option(help="Profile of Merker et al. 2018; with --length scaled to the rod.")
    ] = "II",
    distance: Annotated[float, typer.Option(help="Of its vertex above the x axis [rod lengths].")] = 0.5,
    force_noise: ForceNoise = None,
    moment_noise: MomentNoise = None,
    drive_angle_noise: Annotated[
        float, typer.Option(help="Standard deviation of the drive angle [degrees].", min=0.0)
    ] = 0.0,
    length: Length = None,
    flexural_rigidity: FlexuralRigidity = None,
    diameter: Diameter = 0.0,
    base: Bases = None,
    drive_step: Annotated[float, typer.Option(help="Step of the drive [degrees].", min=0.05, max=30.0)] = 1.0,
    friction: KnownFriction = None,
    nuisance: Nuisances = None,
    as_stated: AsStated = False,
    band_width: Annotated[
        list[float] | None,
        typer.Option(
            help="Mean width of a band for which the noise is sought [m, or L]; give it again for another. "
            "By default 0.0005 to 0.01 rod lengths."
        ),
    ] = None,
    youngs_modulus: Annotated[
        float | None,
        typer.Option(
            help="With --elastic-strain, of the rod's material [Pa]: which length and diameter does the load cell want?"
        ),
    ] = None,
    elastic_strain: Annotated[
        float | None, typer.Option(help="Bending strain that the material takes: 0.005 spring steel, 0.05 nitinol.")
    ] = None,
    samples: Annotated[int, typer.Option(help="For shares of the variance, a power of two.", min=2)] = 1024,
    study: Annotated[
        bool,
        typer.Option(
            "--study", help="Simulate records as well, over profile, distance and noise, from one pivot below each."
        ),
    ] = False,
    study_profile: Annotated[
        list[str] | None,
        typer.Option(help="A profile of the study; give it again for another. By default that of --profile."),
    ] = None,
    study_distance: Annotated[
        list[float] | None,
        typer.Option(help="Of the vertex above the pivot [rod lengths]; again for another; by default --distance."),
    ] = None,
    noise_factor: Annotated[
        list[float] | None,
        typer.Option(help="On the load cell's noise; again for another. By default 0.1, 0.3, 1 and 3."),
    ] = None,
    replicates: Annotated[
        int | None, typer.Option(help="Records in each cell of the study; by default 20.", min=1)
    ] = None,
    posterior_cells: Annotated[
        int | None, typer.Option(help="Cells in which posteriors are inferred too; by default none.", min=0)
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    seed: Seed = 1,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Say what errors of the sensor do to contact points and to a contour, and how small they have to be.

    A study that was stopped goes on by the same command.
    """
    import numpy as np

    from tactile_bayes.contours import paper_profile
    from tactile_bayes.planning.family_parameters import enlarged
    from tactile_bayes.rod import Rod
    from tactile_bayes.runs.sensitivity import sensitivity_into, steps_of

    refuse_both(workers, scheduler)
    of_study = {
        "--study-profile": study_profile,
        "--study-distance": study_distance,
        "--noise-factor": noise_factor,
        "--replicates": replicates,
        "--posterior-cells": posterior_cells,
        "--workers": workers,
        "--scheduler": scheduler,
    }
    if not study:
        _refuse_without_study(of_study)
    rod = rod_asked(length, flexural_rigidity, diameter)
    for name in study_profile or []:
        paper_profile(name, q=0.5)  # type: ignore[arg-type]  # refuses any other
    pivots = [numbers_asked(pivot, "--base", 2) for pivot in base or ["0,0"]]
    common: dict[str, Any] = {
        "load_cell": _load_cell(rod, force_noise, moment_noise, drive_angle_noise),
        "rod": rod,
        "drive_step": float(np.radians(drive_step)),
        "friction": friction,
        "nuisances": nuisances_asked(nuisance, as_stated),
        "seed": seed,
    }
    material = _material(youngs_modulus, elastic_strain)
    analysis = {
        **common,
        "material": material,
        "contour": enlarged(paper_profile(profile, q=distance), (rod or Rod()).length),
        "base": pivots,
        "band_widths": band_width or None,
        "samples": samples,
    }
    if not study:
        with task_bar(steps_of(material), "step", quiet or json) as show:
            run = sensitivity_into(out, progress=show, **analysis)
        _tell(run, json)
        return
    profiles, distances = study_profile or [profile], study_distance or [distance]
    factors = noise_factor or [0.1, 0.3, 1.0, 3.0]
    count = len(profiles) * len(distances) * len(factors)
    last: TaskProgress | None = None

    def have() -> str:
        if last is None:
            return "no further cell was done"
        return f"{last.done:,} of {counted(count, 'cell')} are in {out / 'study'}"

    with going_on(have) as raise_lost, task_bar(count, "cell", quiet or json) as show:

        def note(studying: TaskProgress) -> None:
            nonlocal last
            last = studying
            show(studying.done)
            raise_lost()

        plan = {
            **common,
            "contours": profiles,
            "distances": distances,
            "noise_factors": factors,
            "base_x": pivots[0][0],
            "replicates": 20 if replicates is None else replicates,
            "posterior_cells": posterior_cells or 0,
            "workers": workers,
            "scheduler": scheduler,
            "progress": note,
        }
        run = sensitivity_into(out, study=plan, **analysis)
    _tell(run, json)


def _refuse_without_study(options: Mapping[str, object]) -> None:
    from tactile_bayes.errors import ParameterError

    for option, value in options.items():
        if value is not None and value != []:
            raise ParameterError(f"{option} is for a study: give --study as well, or leave it out")


def _material(youngs_modulus: float | None, elastic_strain: float | None) -> Material | None:
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.runs.sensitivity import Material

    if youngs_modulus is None and elastic_strain is None:
        return None
    if not youngs_modulus or not elastic_strain or min(youngs_modulus, elastic_strain) < 0.0:
        raise ParameterError("--youngs-modulus and --elastic-strain go together, above zero: give both, or neither")
    return Material(youngs_modulus, elastic_strain)


def _load_cell(
    rod: Rod | None, force_noise: float | None, moment_noise: float | None, drive_angle_noise: float
) -> LoadCell | None:
    import numpy as np

    from tactile_bayes.planning.plan import usual_load_cell
    from tactile_bayes.rod import Rod

    cell = load_cell_asked(force_noise, moment_noise)
    if not drive_angle_noise:
        return cell
    return replace(cell or usual_load_cell(rod or Rod()), drive_angle_noise=float(np.radians(drive_angle_noise)))


def _tell(run: SensitivityRun, as_json: bool) -> None:
    if as_json:
        print_json(_numbers(run))
        return
    from rich.console import Console

    console = Console()
    for line in _words(run):
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    console.print()
    console.print(_table(run.sensitivity))
    console.print()
    for what, path in run.files.items():
        console.print(f"{what:<14} {path}", highlight=False, soft_wrap=True)


def _words(run: SensitivityRun) -> list[str]:
    from tactile_bayes.runs.sensitivity import rod_in_words

    return [*run.sensitivity.attrs["words"].splitlines(), *([] if run.rods is None else [rod_in_words(run.rods)])]


def _table(found: xr.DataTree) -> object:
    from rich.table import Table

    told = found["information"].to_dataset()
    table = Table(box=None, pad_edge=False)
    table.add_column("parameter", no_wrap=True)
    for heading in ("value", "known to ±"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for name in told.parameter.values:
        row = told.sel(parameter=name)
        unit = str(row.unit.item())
        numbers = (f"{float(value):.3g}" for value in (row.value, row.bound_with_priors))
        table.add_row(str(name), *numbers, "" if unit == "1" else unit)
    return table


def _numbers(run: SensitivityRun) -> dict[str, Any]:
    """The main ones, as JSON can hold them."""
    found = run.sensitivity
    told, needed = found["information"].to_dataset(), found["required_noise"].to_dataset()
    answer: dict[str, Any] = {
        "words": _words(run),
        **{name: found.attrs[name] for name in ("contour", "units", "rod_length", "rod_flexural_rigidity")},
        **{name: float(found.attrs[name]) for name in ("force_noise", "moment_noise")},
        "parameters": {
            str(name): {
                "value": float(told.value.sel(parameter=name)),
                "bound": float(told.bound.sel(parameter=name)),
                "bound_with_priors": float(told.bound_with_priors.sel(parameter=name)),
                "unit": str(told.unit.sel(parameter=name).item()),
            }
            for name in told.parameter.values
        },
        "band": {name: float(told[f"{name}_width"]) for name in ("touched", "gap")}
        | {"probability": float(told.attrs["probability"])},
        "required_noise": [
            {name: float(needed[name][i]) for name in ("band_width", "noise_factor", "force_noise", "moment_noise")}
            for i in range(needed.sizes["band_width"])
        ],
        "files": {what: str(path) for what, path in run.files.items()},
    }
    if run.rods is not None:
        answer["rod"] = {name: float(run.rods[f"best_{name}"]) for name in ("length", "diameter", "width")}
    if run.study is not None:
        answer["study"] = _cells(run.study)
    return answer


def _cells(study: xr.Dataset) -> list[dict[str, Any]]:
    """Errors of constrained contacts and widths of bands, by cell."""
    of_method = study.sel(reconstruction="constrained")
    names = ("rms_along", "rms_across", "ok", "expected_touched_width", "expected_gap_width")
    return [
        {
            "contour": str(contour),
            "distance": float(distance),
            "noise_factor": float(factor),
            "message": str(cell.message.item()),
            **{name: float(cell[name]) for name in names},
        }
        for contour in study.contour.values
        for distance in study.distance.values
        for factor in study.noise_factor.values
        for cell in [of_method.sel(contour=contour, distance=distance, noise_factor=factor)]
    ]

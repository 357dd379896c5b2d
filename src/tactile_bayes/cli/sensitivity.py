"""The command `sensitivity`: the load cell that a measurement requires."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.answer import Answer, columns_of, table_of
from tactile_bayes.cli.command import Out, Output, Seed, Writes
from tactile_bayes.cli.rig_options import NoiseOptions, RigOptions, UnknownOptions
from tactile_bayes.cli.task_bar import counted, resumable_bar, task_bar
from tactile_bayes.cli.worker_options import WorkerOptions
from tactile_bayes.runs.names import SENSITIVITY

if TYPE_CHECKING:
    import xarray as xr
    from rich.table import Table

    from tactile_bayes.load_cell import LoadCell
    from tactile_bayes.mechanics.rods.rod import Rod
    from tactile_bayes.runs.sensitivity import Material, SensitivityRun

__all__ = ["sensitivity"]

Profile = Literal["I", "II", "III", "IV"]


@dataclass(frozen=True)
class StudyOptions:
    """A study with simulated records."""

    study: Annotated[
        bool,
        typer.Option(
            "--study", help="Simulate records as well, over profile, distance and noise, from one pivot below each."
        ),
    ] = False
    study_profile: Annotated[
        list[str] | None,
        typer.Option(help="A profile of the study; may be repeated. By default that of --profile."),
    ] = None
    study_distance: Annotated[
        list[float] | None,
        typer.Option(help="Height of the vertex above the pivot [rod lengths]; may be repeated; default --distance."),
    ] = None
    noise_factor: Annotated[
        list[float] | None,
        typer.Option(help="Factor on the load cell's noise; may be repeated. By default 0.1, 0.3, 1 and 3."),
    ] = None
    replicates: Annotated[int | None, typer.Option(help="Records in each cell of the study; by default 20.", min=1)] = (
        None
    )
    posterior_cells: Annotated[
        int | None, typer.Option(help="Cells in which posteriors are inferred too; by default none.", min=0)
    ] = None


def sensitivity(
    *,
    out: Annotated[Out, Writes((*SENSITIVITY, "study/*"))],
    profile: Annotated[
        Profile, typer.Option(help="Profile of Merker et al. 2018; with --length scaled to the rod.")
    ] = "II",
    distance: Annotated[float, typer.Option(help="Height of its vertex above the x axis [rod lengths].")] = 0.5,
    noise: NoiseOptions,
    drive_angle_noise: Annotated[
        float, typer.Option(help="Standard deviation of the drive angle [degrees].", min=0.0)
    ] = 0.0,
    rig: RigOptions,
    drive_step: Annotated[float, typer.Option(help="Step of the drive [degrees].", min=0.05, max=30.0)] = 1.0,
    unknown: UnknownOptions,
    band_width: Annotated[
        list[float] | None,
        typer.Option(
            help="Mean width of a band for which the noise is sought [m, or L]; may be repeated. "
            "By default 0.0005 to 0.01 rod lengths."
        ),
    ] = None,
    youngs_modulus: Annotated[
        float | None,
        typer.Option(
            help="Young's modulus of the rod [Pa], with --elastic-strain: find the rod that suits the load cell."
        ),
    ] = None,
    elastic_strain: Annotated[
        float | None, typer.Option(help="Largest elastic bending strain: 0.005 spring steel, 0.05 nitinol.")
    ] = None,
    samples: Annotated[int, typer.Option(help="Samples for shares of the variance, a power of two.", min=2)] = 1024,
    studying: StudyOptions,
    work: WorkerOptions,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Compute the effect of the sensor's errors on contact points and contour, and the required noise.

    The same command resumes a stopped study.
    """
    from tactile_bayes.contours import paper_profile
    from tactile_bayes.mechanics.rods.rod import Rod
    from tactile_bayes.planning.family_parameters import enlarged
    from tactile_bayes.runs.sensitivity import sensitivity_into, steps_of

    if not studying.study:
        _refuse_without_study(studying, work)
    rod, pivots = rig.rod, rig.pivots
    for name in studying.study_profile or []:
        paper_profile(name, q=0.5)  # type: ignore[arg-type]  # refuses any other
    common: dict[str, Any] = {
        "load_cell": _load_cell(rod, noise.load_cell, drive_angle_noise),
        "rod": rod,
        "drive_step": math.radians(drive_step),
        "friction": unknown.friction,
        "nuisances": unknown.nuisances,
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
    if not studying.study:
        with task_bar(steps_of(material), "step", output.is_silent) as show:
            run = sensitivity_into(out, progress=show, **analysis)
        return _answer(run)
    study = {
        **common,
        "contours": studying.study_profile or [profile],
        "distances": studying.study_distance or [distance],
        "noise_factors": studying.noise_factor or [0.1, 0.3, 1.0, 3.0],
        "base_x": pivots[0][0],
        "replicates": 20 if studying.replicates is None else studying.replicates,
        "posterior_cells": studying.posterior_cells or 0,
        **vars(work),
    }
    count = math.prod(len(study[name]) for name in ("contours", "distances", "noise_factors"))

    def have(done: int | None) -> str:
        if done is None:
            return "no further cell was done"
        return f"{done:,} of {counted(count, 'cell')} are in {out / 'study'}"

    with resumable_bar(count, "cell", output.is_silent, have) as note:
        study["progress"] = lambda studied: note(studied.done)
        run = sensitivity_into(out, study=study, **analysis)
    return _answer(run)


def _refuse_without_study(studying: StudyOptions, work: WorkerOptions) -> None:
    from tactile_bayes.errors import ParameterError

    for name, value in {**vars(studying), **vars(work)}.items():
        if name != "study" and value is not None and value != []:
            option = f"--{name.replace('_', '-')}"
            raise ParameterError(f"{option} is for a study: give --study as well, or leave it out")


def _material(youngs_modulus: float | None, elastic_strain: float | None) -> Material | None:
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.runs.sensitivity import Material

    if youngs_modulus is None and elastic_strain is None:
        return None
    if not youngs_modulus or not elastic_strain or min(youngs_modulus, elastic_strain) < 0.0:
        raise ParameterError("--youngs-modulus and --elastic-strain go together, above zero: give both, or neither")
    return Material(youngs_modulus, elastic_strain)


def _load_cell(rod: Rod | None, cell: LoadCell | None, drive_angle_noise: float) -> LoadCell | None:
    from tactile_bayes.inference.experiment import usual_load_cell
    from tactile_bayes.mechanics.rods.rod import Rod

    if not drive_angle_noise:
        return cell
    return replace(cell or usual_load_cell(rod or Rod()), drive_angle_noise=math.radians(drive_angle_noise))


def _answer(run: SensitivityRun) -> Answer:
    from tactile_bayes.runs.sensitivity import rod_message

    words = run.result.attrs["words"].splitlines()
    if run.rods is not None:
        words.append(rod_message(run.rods))
    table = _table(run.result["information"].to_dataset())
    return Answer([*words, "", table, "", run.files], lambda: _numbers(run, words))


def _table(information: xr.Dataset) -> Table:
    rows = []
    for row in columns_of(information, "parameter"):
        numbers = (f"{row[name]:.3g}" for name in ("value", "bound_with_priors"))
        rows.append((row["parameter"], *numbers, "" if row["unit"] == "1" else row["unit"]))
    return table_of(["parameter", "value", "known to ±", "unit"], rows, left=["parameter", "unit"])


def _numbers(run: SensitivityRun, words: list[str]) -> dict[str, Any]:
    """Return the main results for JSON."""
    found = run.result
    information, needed = found["information"].to_dataset(), found["required_noise"].to_dataset()
    answer: dict[str, Any] = {
        "words": words,
        **{name: found.attrs[name] for name in ("contour", "units", "rod_length", "rod_flexural_rigidity")},
        **{name: float(found.attrs[name]) for name in ("force_noise", "moment_noise")},
        "parameters": {
            row["parameter"]: {name: row[name] for name in ("value", "bound", "bound_with_priors", "unit")}
            for row in columns_of(information, "parameter")
        },
        "band": {
            "touched": information["touched_width"],
            "gap": information["gap_width"],
            "probability": information.attrs["probability"],
        },
        "required_noise": [
            {name: needed[name][i] for name in ("band_width", "noise_factor", "force_noise", "moment_noise")}
            for i in range(needed.sizes["band_width"])
        ],
        "files": run.files,
    }
    if run.rods is not None:
        answer["rod"] = {name: run.rods[f"best_{name}"] for name in ("length", "diameter", "width")}
    if run.study is not None:
        answer["study"] = _cells(run.study)
    return answer


def _cells(study: xr.Dataset) -> list[dict[str, Any]]:
    """Return errors of constrained contacts and widths of bands, by cell."""
    names = ["message", "rms_along", "rms_across", "ok", "expected_touched_width", "expected_gap_width"]
    of_method = study[names].sel(reconstruction="constrained", drop=True)
    table = of_method.to_dataframe(dim_order=["contour", "distance", "noise_factor"])
    return table.reset_index().to_dict("records")

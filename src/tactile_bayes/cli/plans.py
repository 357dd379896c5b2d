"""The commands `design` and `sensitivity`: the best drive for the next record, and the load cell that it requires."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

import tactile_bayes as tb
from tactile_bayes.cli.answer import Answer, columns_of, table_of
from tactile_bayes.cli.command import Out, Output, Reads, Seed, Writes
from tactile_bayes.cli.progress import WorkerOptions, resumable_bar, step_bar
from tactile_bayes.cli.rigs import RigFile
from tactile_bayes.cli.scan_options import CarryOptions, Pivots, pivots_in
from tactile_bayes.errors import ParameterError
from tactile_bayes.runs.names import DESIGN, SENSITIVITY

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from rich.table import Table

    from tactile_bayes.runs.plans import Material, SensitivityRun
    from tactile_bayes.sweep import Carried, Drive


def design(
    *,
    out: Annotated[Out, Writes((*DESIGN, "nested/*"))],
    run: Annotated[
        Path | None,
        "Folder of a run of infer, or its posterior.nc, as present knowledge; else the prior.",
        typer.Argument(),
        Reads(("posterior.nc",)),
    ] = None,
    family: Annotated[str, "Shape of the contours, if only a prior is known."] = "parabola",
    base: Annotated[
        list[str] | None,
        "A pivot to choose from, X,Y [m, or L]; may be repeated. By default, without --carry, eleven across at three "
        "heights.",
    ] = None,
    drive_step: Annotated[list[float] | None, "A step of the drive to choose from [degrees]; by default 2."] = None,
    criterion: Annotated[
        Literal["band", "gap", "information"], "The narrowest band, the smallest gap, or the most information."
    ] = "band",
    nested: Annotated[
        bool, "Sample each candidate's posteriors as well, which takes longer; the same command resumes a stopped run."
    ] = False,
    draws: Annotated[int, "Number of objects drawn from posterior or prior.", typer.Option(min=2)] = 24,
    carries: CarryOptions,
    rig: RigFile,
    work: WorkerOptions,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Choose the drive of the next record, so that the contour's band becomes narrowest.

    Candidates are pivots (--base) and drives that carry the base (--carry), each with every --drive-step.
    """
    import numpy as np

    from tactile_bayes.runs.plans import design_into

    options: dict[str, Any] = {}
    known: xr.DataTree | str = family
    if run is not None:
        if rig.rig is not None:
            raise ParameterError("a run has its rig: leave out --rig, or the run")
        known = _posterior(run)
    else:
        options = {"rig": rig.stated}
    steps = np.radians(drive_step or [2.0]).tolist()
    if base or carries.carry:
        drives: list[Drive] = [
            tb.Rotation(pivot, drive_step=step) for pivot in pivots_in(base) for step in steps if base
        ]
        drives += [_as_often(drive, step) for drive in carries.carried() for step in steps]
    else:
        usual = [tb.planning.usual_drives(known, options.get("rig"), step) for step in steps]
        drives = [drive for each in zip(*usual, strict=True) for drive in each]

    where = out / "nested" if nested else None
    then = f"the same command {'resumes' if nested else 'starts again'}"
    with resumable_bar("candidate", output.is_silent, where, len(drives), then=then) as note:
        made = design_into(
            out,
            known,
            rng=seed,
            drives=drives,
            criterion=criterion,
            nested=nested,
            draws=draws,
            workers=work.reporting(note),
            **options,
        )
    words = made.files["words"].read_text(encoding="utf-8").splitlines()
    found = made.result
    columns = [str(name) for name, values in found.data_vars.items() if values.dims == ("candidate",)]
    return Answer.of(
        words,
        made.files,
        best=int(found.best),
        present_width=float(found.present_width),
        candidates=found[columns].to_dataframe()[columns].to_dict("records"),
    )


def _as_often(drive: Carried, step: float) -> Carried:
    """Return a drive with as many samples as a rotation of a step [rad]."""
    from tactile_bayes.sweep import blind_angles

    given: Any = drive
    made: Carried = replace(given, drive_step=float(drive.travels[-1]) / (blind_angles(step).size - 1))
    return made


def _posterior(run: Path) -> xr.DataTree:
    from tactile_bayes.runs.folder import posterior_in

    is_the_file = run.is_file() or (run.suffix == ".nc" and not run.exists())
    return tb.read_result(run if is_the_file else posterior_in(run))


def sensitivity(
    *,
    out: Annotated[Out, Writes((*SENSITIVITY, "study/*"))],
    profile: Annotated[
        list[str] | None,
        "Profile of Merker et al. 2018, I, II, III or IV, by default II, scaled to the rod; further ones are for the "
        "study.",
    ] = None,
    distance: Annotated[
        list[float] | None, "Height of its vertex above the x axis [rod lengths], by default 0.5; likewise."
    ] = None,
    rig: RigFile,
    base: Pivots = None,
    drive_step: Annotated[float, "Step of the drive [degrees].", typer.Option(min=0.05, max=30.0)] = 1.0,
    band_width: Annotated[
        list[float] | None,
        "Mean width of a band for which the noise is sought [m, or L]; may be repeated. By default 0.0005 to 0.01 rod "
        "lengths.",
    ] = None,
    best_rod: Annotated[
        bool,
        "Find the rod of the same material that suits the load cell: rig.toml states diameter, elastic_strain (0.005 "
        "spring steel, 0.05 nitinol) and noise.",
    ] = False,
    replicates: Annotated[
        int,
        "Simulate records as well, so many for each profile, distance and noise, from one pivot below each; 0 leaves "
        "this study out.",
        typer.Option(min=0),
    ] = 0,
    noise_factor: Annotated[
        list[float] | None, "Factor on the load cell's noise in the study; may be repeated. By default 0.1, 0.3, 1, 3."
    ] = None,
    work: WorkerOptions,
    seed: Seed = 1,
    output: Output,
) -> Answer:
    """Compute the effect of the sensor's errors on contact points and contour, and the required noise.

    The same command resumes a stopped study.
    """
    from tactile_bayes.planning.plan import enlarged
    from tactile_bayes.runs.plans import sensitivity_into, steps_of

    profiles, distances = profile or ["II"], distance or [0.5]
    if not replicates:
        _refuse_without_study(profiles, distances, noise_factor, work)
    stated = rig.stated
    for name in profiles:
        tb.contours.paper_profile(name, q=0.5)  # type: ignore[arg-type]  # refuses any other
    common: dict[str, Any] = {"rig": stated, "rng": seed}
    drives = [tb.Rotation(pivot, drive_step=math.radians(drive_step)) for pivot in pivots_in(base)]
    material = _material(stated) if best_rod else None
    first: Any = profiles[0]
    analysis = {
        **common,
        "material": material,
        "contour": enlarged(tb.contours.paper_profile(first, q=distances[0]), (stated.rod or tb.Rod()).length),
        "drive": drives,
        "band_widths": band_width or None,
    }
    if not replicates:
        steps = steps_of(material)
        with step_bar(output.is_silent) as show:
            run = sensitivity_into(out, progress=lambda done: show(done, steps), **analysis)
        return _answer(run)
    over = {"distance": distances, "noise_factor": noise_factor or [0.1, 0.3, 1.0, 3.0]}
    study = {
        **common,
        "contours": profiles,
        "over": over,
        "drive": replace(drives[0], base=(drives[0].base[0], 0.0)),
        "replicates": replicates,
    }
    count = len(profiles) * math.prod(map(len, over.values()))
    with resumable_bar("cell", output.is_silent, out / "study", count) as note:
        study["workers"] = work.reporting(note)
        run = sensitivity_into(out, study=study, **analysis)
    return _answer(run)


def _refuse_without_study(
    profiles: Sequence[str], distances: Sequence[float], factors: Sequence[float] | None, work: WorkerOptions
) -> None:
    given = {
        "more than one --profile": len(profiles) > 1,
        "more than one --distance": len(distances) > 1,
        "--noise-factor": bool(factors),
        "--workers": work.workers is not None,
    }
    for option, is_given in given.items():
        if is_given:
            raise ParameterError(f"{option} is for a study: give --replicates as well, like --replicates 20")


def _material(rig: tb.Rig) -> Material:
    """Return the material of a rig's rod, of Young's modulus EI / (π d⁴ / 64)."""
    from tactile_bayes.mechanics.rods.rod import round_rigidity
    from tactile_bayes.runs.plans import Material

    rod = rig.rod
    if rod is None or rod.is_dimensionless or not rod.diameter or rod.elastic_strain is None:
        raise ParameterError(
            "--best-rod is for a rod of a known material: state length, flexural_rigidity, diameter and elastic_strain "
            "under [rod] of rig.toml"
        )
    if rig.load_cell is None or not rig.load_cell.has_variances:
        raise ParameterError("--best-rod is for a known load cell: state its noise under [load_cell] of rig.toml")
    return Material(rod.flexural_rigidity / round_rigidity(rod.diameter, 1.0), rod.elastic_strain)


def _answer(run: SensitivityRun) -> Answer:
    from tactile_bayes.runs.plans import rod_message

    words = run.result.attrs["words"].splitlines()
    if run.rods is not None:
        words.append(rod_message(run.rods))
    return Answer.of(words, run.files, _bounds(run.result["information"].to_dataset()), **_numbers(run))


def _bounds(information: xr.Dataset) -> Table:
    from tactile_bayes.uncertainty.summary import shown_in

    rows = []
    for row in columns_of(information, "parameter"):
        scale, unit = shown_in(row["unit"])
        numbers = (f"{scale * row[name]:.3g}" for name in ("value", "bound_with_priors"))
        rows.append((row["parameter"], *numbers, unit))
    return table_of(["parameter", "value", "known to ±", "unit"], rows, left=["parameter", "unit"])


def _numbers(run: SensitivityRun) -> dict[str, Any]:
    """Return the main results for JSON."""
    found = run.result
    information, needed = found["information"].to_dataset(), found["required_noise"].to_dataset()
    answer: dict[str, Any] = {
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

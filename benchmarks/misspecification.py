"""Prints what becomes of bands where the world is not as inference assumes, whether it is noticed, and what cures it.

Every row is a calibration: parabolas are drawn, swept, measured and inferred, and bands compared with the truth. Below
each world stands what is to be inferred, or told, to cure it. What is done is kept in results/misspecification, so that
a run that was stopped goes on.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import stats

import tactile_bayes as tb

OUT = Path("results/misspecification")
PRIORS = {"a": stats.lognorm(s=0.4, scale=0.6), "q": stats.uniform(0.3, 0.4), "x_c": stats.norm(0.0, 0.1)}
CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
CHANNELS = ("moment", "force_x", "force_y")
STANDARD = ("rigidity_scale", "drive_angle_offset", "bias")
AS_STATED = {
    "noise_scale": stats.lognorm(s=1e-3),
    "rigidity_scale": stats.lognorm(s=1e-4),
    "drive_angle_offset": stats.norm(0.0, 1e-5),
    "friction": stats.halfnorm(scale=1e-4),
    **{f"{channel}_{what}": stats.norm(0.0, 1e-4) for channel in CHANNELS for what in ("bias", "drift")},
    **{name: stats.norm(0.0, 1e-5) for name in ("base_2_x", "base_2_y")},
}
"""Rig and noise are what is stated but for what a world names, though inference does not rely on that."""

TWO_BASES = [(0.0, 0.0), (0.3, 0.0)]
SETTINGS = tb.SamplerSettings(ensembles=2, walkers=26, block_steps=25, max_r_hat=1.05, min_ess=200.0, max_steps=400)
"""Posteriors that agree with no model may have many modes; those that take longer say that they have not converged."""
COSTLY = {"shape-free": 4, "friction": 2}
"""Of these cures so many times fewer replicates are made."""

CHANCE, SCORE = 1e-3, 4.0
"""Probability of the misfit, and size of the axial score, that are an alarm."""


class Case(NamedTuple):
    """A world, and what is otherwise than by default in what is inferred."""

    world: dict[str, Any]
    asked: dict[str, Any]
    cure: dict[str, Any] | None = None
    """What is asked for in place of that."""
    cured_by: str = ""


def _without(name: str) -> dict[str, Any]:
    return {"nuisances": tuple(n for n in STANDARD if n != name)}


CASES: Mapping[str, Case] = {
    "as assumed": Case({}, {}),
    **{
        f"friction {mu}": Case({"friction": mu}, {}, {"nuisances": (*STANDARD, "friction")}, "friction")
        for mu in (0.1, 0.3, 0.5)
    },
    "base off by 1 % L, across": Case({"base_shift": (0.01, 0.0)}, {}),
    "base off by 1 % L, along": Case({"base_shift": (0.0, 0.01)}, {}),
    "second base off by 1 % L": Case(
        {"further_base_shift": (0.01, 0.0)},
        {"base": TWO_BASES},
        {"base": TWO_BASES, "nuisances": (*STANDARD, "base")},
        "base",
    ),
    "EI off by 5 %": Case({"rigidity_scale": 1.05}, _without("rigidity_scale"), {}, "rigidity_scale"),
    "encoder off by 1°": Case({"drive_angle_offset": np.radians(1.0)}, _without("drive_angle_offset"), {}, "offset"),
    "bias of one noise": Case({"bias": (0.02, 0.05, 0.05)}, _without("bias"), {}, "bias"),
    "drift of two noises": Case({"drift": (0.04, 0.1, 0.1)}, {}, {"nuisances": (*STANDARD, "drift")}, "drift"),
    "outliers (t, 2.5)": Case(
        {"load_cell": replace(CELL, degrees_of_freedom=2.5)},
        {},
        {"load_cell": replace(CELL, degrees_of_freedom=2.5)},
        "told",
    ),
    "flat spot in the gap": Case({"flat_spot": (0.0, 2.0)}, {}, {"family": "shape-free"}, "shape-free"),
    "flat spot beside it": Case({"flat_spot": (0.4, 2.0)}, {}, {"family": "shape-free"}, "shape-free"),
}


def main(replicates: int = 40, *names: str) -> None:
    print(
        f"{replicates} replicates; noise 0.05 EI/L² and 0.02 EI/L, steps of 2°; bands of 90 %; noticed by the check of"
    )
    print(
        "the record, by the misfit of single samples, by the axial score, by any of them; not converged, or lost: of a"
    )
    print("replicate that ended with an error nothing holds, and nothing is noticed\n")
    heads = ("in the gap", "beside it", "bias [L]", "width [L]", "check", "misfit", "axial", "any", "not conv.")
    print(f"{'':<38}" + "".join(f"{head:>11}" for head in heads), flush=True)
    for name in names or CASES:
        case = CASES[name]
        print(row(name, calibrated(name, case.world, case.asked, replicates)), flush=True)
        if case.cure is not None:
            few = max(1, replicates // COSTLY.get(case.cured_by, 1))
            told = "told of them" if case.cured_by == "told" else f"{case.cured_by} inferred"
            found = calibrated(f"{name}, cured", case.world, case.cure, few)
            print(row(f"  {told}" + (f" ({few})" if few < replicates else ""), found, cured=True), flush=True)


def calibrated(name: str, world: dict[str, Any], asked: dict[str, Any], replicates: int) -> xr.Dataset:
    folder = OUT / "".join(c if c.isalnum() or c in ".-" else "-" for c in name)
    options = {"nuisances": STANDARD, "load_cell": CELL, "priors": PRIORS, **asked}
    groups = {what: {f"{channel}_{what}" for channel in CHANNELS} for what in ("bias", "drift")}
    groups["base"] = {"base_2_x", "base_2_y"}
    known = {"noise_scale"}.union(*(groups.get(name, {name}) for name in options["nuisances"]))
    in_world = tb.World(**world, priors={name: law for name, law in AS_STATED.items() if name in known})
    if options.get("family") == "shape-free":  # which takes parabolas for any smooth contour, and knows where they lie
        in_world = replace(in_world, family="parabola", priors={**in_world.priors, **PRIORS})
        options["priors"] = {name: PRIORS[name] for name in ("q", "x_c")}
    else:
        options["settings"] = SETTINGS
    return tb.calibrate(seed=2029, replicates=replicates, world=in_world, out=folder, **options)


def row(name: str, found: xr.Dataset, *, cured: bool = False) -> str:
    """Single samples are judged by what is stated, so that a cure changes nothing of that."""
    if found.attrs["lost"] == found.sizes["replicate"]:
        return f"{name:<38} {found.attrs['verdict']}"
    check = found.check_passed.values == 0.0
    misfit = found.misfit_probability.values < CHANCE
    axial = np.abs(found.axial_score.values) > SCORE
    numbers = [float(found.pointwise_in_gap.mean()), float(found.pointwise_beside.mean())]
    lengths = [float(np.abs(found.bias_in_gap).mean()), float(found.width_in_gap.mean())]
    cells = [f"{v:.2f}" for v in numbers] + [f"{v:.4f}" for v in lengths]
    cells += [f"{check.mean():.0%}"]
    cells += ["", "", ""] if cured else [f"{alarm.mean():.0%}" for alarm in (misfit, axial, check | misfit | axial)]
    cells += [f"{np.mean(found.converged.values != 1.0):.0%}"]
    return f"{name:<38}" + "".join(f"{cell:>11}" for cell in cells)


if __name__ == "__main__":
    counts, chosen = [a for a in sys.argv[1:] if a.isdigit()], [a for a in sys.argv[1:] if not a.isdigit()]
    main(*map(int, counts or ["40"]), *chosen)

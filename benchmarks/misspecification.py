"""Prints the coverage of bands if the rig differs from what inference assumes, its detection, and its correction.

Every row is a calibration: parabolas are drawn from the default prior, swept, measured and inferred as `infer` does by
default, and their bands are compared with the truth. Noise is as stated; other unknowns of the rig are drawn
from their default priors. An indented row repeats the case above it with other arguments of inference. If the default
infers the property that is wrong, everything is taken as stated instead (--as-stated); otherwise the row names the
property that is inferred, or stated, in correction. Replicates are kept in results/misspecification, from which a
stopped run resumes.

With --discrepancy, the rows are those of the rigs without correction, each without and with a discrepancy, which is
inferred beside all else.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from tactile_bayes.inference.parameters.nuisances import STANDARD

OUT = Path("results/misspecification")
CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
TWO_BASES = [(0.0, 0.0), (0.3, 0.0)]
SETTINGS = tb.SamplerSettings(ensembles=2, walkers=34, block_steps=25, max_r_hat=1.05, min_ess=200.0, max_steps=500)
"""Posteriors of a wrong model may have many modes; those that take longer are reported as unconverged."""
FEWER = 4
"""Factor by which replicates of shape-free contours are fewer, as they cost more."""

CHANCE, SCORE = 1e-3, 4.0
"""Probability of the misfit, and size of the axial score, that raise an alarm."""


class Run(NamedTuple):
    """A misspecified rig, and arguments of inference other than the defaults."""

    world: dict[str, Any]
    asked: Mapping[str, Any] = MappingProxyType({})


def _known_to_vary(exactly: dict[str, float], beside: dict[str, Any]) -> dict[str, Run]:
    """Return runs with one value of properties that are inferred by default, and with everything taken as stated."""
    priors = {name: stats.norm(value, 1e-9) for name, value in exactly.items()}
    return {"": Run({"priors": priors}), "--as-stated": Run(beside, {"nuisances": ()})}


def _untold(world: dict[str, Any], asked: dict[str, Any], **others: dict[str, Any]) -> dict[str, Run]:
    """Return runs with properties that are not inferred by default, and with these inferred or stated."""
    return {"": Run(world, asked)} | {
        other.replace("_", " "): Run(world, asked | more) for other, more in others.items()
    }


OF_UNKNOWN_SHAPE = {
    "nuisances": (*STANDARD, "rest_curvature"),
    "priors": {"rest_curvature": stats.norm(0.0, 0.5)},
}
OF_UNKNOWN_TAPER = {"nuisances": (*STANDARD, "taper"), "priors": {"taper": stats.uniform(0.0, 0.9)}}
BIASES = (0.02, 0.05, 0.05)
OUTLIERS = {"load_cell": replace(CELL, degrees_of_freedom=2.5)}
CASES: Mapping[str, Mapping[str, Run]] = {
    "as assumed": _known_to_vary({}, {}),
    **{f"friction {mu}": _known_to_vary({"friction": mu}, {"friction": mu}) for mu in (0.1, 0.3, 0.5)},
    "base off by 1 % L, across": _untold({"base_shift": (0.01, 0.0)}, {}),
    "base off by 1 % L, along": _untold({"base_shift": (0.0, 0.01)}, {}),
    "second base off by 1 % L": _untold(
        {"further_base_shift": (0.01, 0.0)}, {"base": TWO_BASES}, base_inferred={"nuisances": (*STANDARD, "base")}
    ),
    "EI off by 5 %": _known_to_vary({"rigidity_scale": 1.05}, {"rigidity_scale": 1.05}),
    "encoder off by 1°": _known_to_vary(
        {"drive_angle_offset": np.radians(1.0)}, {"drive_angle_offset": np.radians(1.0)}
    ),
    "backlash of 0.5°": _known_to_vary(
        {"backlash": np.radians(0.5)}, {"load_cell": replace(CELL, drive_angle_backlash=np.radians(0.5))}
    ),
    "load cell off by 1 % L": _known_to_vary(
        {"lever_x": 0.01, "lever_y": 0.01}, {"load_cell": replace(CELL, lever=(0.01, 0.01))}
    ),
    "biases of one noise": _known_to_vary(
        dict(zip(("moment_bias", "force_x_bias", "force_y_bias"), BIASES, strict=True)), {"bias": BIASES}
    ),
    "curved by 0.05/L": _untold(
        {"rest_curvature": 0.05}, {}, rest_curvature_inferred={"nuisances": (*STANDARD, "rest_curvature")}
    ),
    "curved by 0.4/L": _untold({"rest_curvature": 0.4}, {}, rest_curvature_inferred=OF_UNKNOWN_SHAPE),
    "tapered by 10 %": _untold({"taper": 0.1}, {}, taper_inferred={"nuisances": (*STANDARD, "taper")}),
    "tapered by 50 %": _untold({"taper": 0.5}, {}, taper_inferred=OF_UNKNOWN_TAPER),
    "drift of two noises": _untold({"drift": (0.04, 0.1, 0.1)}, {}, drift_inferred={"nuisances": (*STANDARD, "drift")}),
    "outliers (t, 2.5)": _untold(OUTLIERS, {}, told_of_them=OUTLIERS),
    **{
        name: _untold({"flat_spot": (at, 2.0)}, {}, shape_free={"family": "shape-free"})
        for name, at in (("flat spot in the gap", 0.0), ("flat spot beside it", 0.4))
    },
}


def main(replicates: int = 40, *names: str, discrepancy: bool = False) -> None:
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
        runs = beside_discrepancy(CASES[name]) if discrepancy else CASES[name]
        for k, (other, run) in enumerate(runs.items()):
            few = max(1, replicates // (FEWER if run.asked.get("family") else 1))
            count = f" ({few})" if few < replicates else ""
            title = f"  {other}{count}" if k else f"{name} {other}".strip()
            print(row(title, calibrated(f"{name} {other}", run, few)), flush=True)


def beside_discrepancy(runs: Mapping[str, Run]) -> dict[str, Run]:
    """Return the run without correction, and the same with a discrepancy, of which the simulated rig has none."""
    which = "--as-stated" if "--as-stated" in runs else ""
    run = runs[which]
    nothing = {"discrepancy_scale": stats.lognorm(s=1e-9, scale=1e-12)}
    world = {**run.world, "priors": {**run.world.get("priors", {}), **nothing}}
    asked = {**run.asked, "nuisances": (*run.asked.get("nuisances", STANDARD), "discrepancy")}
    return {which: run, f"{which} with discrepancy".strip(): Run(world, asked)}


def calibrated(name: str, run: Run, replicates: int) -> xr.Dataset:
    folder = OUT / "".join(c if c.isalnum() or c in ".-" else "-" for c in name.strip())
    options = {"load_cell": CELL, **run.asked}
    as_stated = {"noise_scale": stats.lognorm(s=1e-9)}
    world = tb.Misspecification(**{**run.world, "priors": as_stated | run.world.get("priors", {})})
    if options.get("family") == "shape-free":  # which takes parabolas for any smooth contour
        world = replace(world, family="parabola")
    else:
        options["settings"] = SETTINGS
    return tb.calibrate(seed=2029, replicates=replicates, world=world, out=folder, **options)


def row(name: str, found: xr.Dataset) -> str:
    if found.attrs["lost"] == found.sizes["replicate"]:
        return f"{name:<38} {found.attrs['verdict']}"
    check = found.check_passed.values == 0.0
    misfit = found.misfit_probability.values < CHANCE
    axial = np.abs(found.axial_score.values) > SCORE
    held = [_mean(found, f"pointwise_{region}") for region in ("in_gap", "beside")]
    lengths = [_mean(found, f"{what}_in_gap") for what in ("bias", "width")]
    cells = [f"{v:.2f}" for v in held] + [f"{v:.4f}" for v in lengths]
    cells += [f"{check.mean():.0%}"]
    cells += [f"{alarm.mean():.0%}" for alarm in (misfit, axial, check | misfit | axial)]
    cells += [f"{np.mean(found.converged.values != 1.0):.0%}"]
    return f"{name:<38}" + "".join(f"{cell:>11}" for cell in cells)


def _mean(found: xr.Dataset, name: str) -> float:
    """Return the mean size; NaN if no sweeps leave a gap."""
    return float(abs(found[name]).mean()) if name in found else np.nan


if __name__ == "__main__":
    given = [argument for argument in sys.argv[1:] if argument != "--discrepancy"]
    counts, chosen = [a for a in given if a.isdigit()], [a for a in given if not a.isdigit()]
    main(*map(int, counts or ["40"]), *chosen, discrepancy="--discrepancy" in sys.argv)

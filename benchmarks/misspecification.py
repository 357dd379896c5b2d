"""Prints the coverage of bands if the rig differs from what inference assumes, its detection, and its correction.

Every row is a calibration with the defaults of `infer`, except that noise is as stated. An indented row repeats the
case above it with other arguments of inference: if the default infers the property that is wrong, everything is taken
as stated; otherwise the row names what is inferred, or stated, in correction. Replicates are kept in
results/misspecification, from which a stopped run resumes.

With --discrepancy, the rows are those of the rigs without correction, each without and with a discrepancy.
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
from benchmarks.table import counts_and_names, folder_name, line
from tactile_bayes.rig import NOTHING

OUT = Path("results/misspecification")
CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
TWO_BASES = [tb.Rotation((0.0, 0.0)), tb.Rotation((0.3, 0.0))]
# Posteriors of a wrong model may have many modes; those that take longer are reported as unconverged.
SETTINGS = tb.SamplerSettings(ensembles=2, walkers=34, block_steps=25, max_r_hat=1.05, min_ess=200.0, max_steps=500)
FEWER = 4  # factor by which replicates of shape-free contours are fewer, as they cost more
CHANCE, SCORE = 1e-3, 4.0  # probability of the misfit, and size of the axial score, that raise an alarm


Truth = tb.Rig | tb.calibration.Misspecification

INFERRED = tb.Rig(load_cell=CELL)
AS_STATED = tb.Rig(load_cell=CELL, unknown="nothing")


class Run(NamedTuple):
    """The truth that is simulated, the rig that inference assumes, and other options of `calibrate`."""

    truth: Truth
    rig: tb.Rig = INFERRED
    options: Mapping[str, Any] = MappingProxyType({})


def _real(load_cell: tb.LoadCell = CELL, **known: float) -> tb.Rig:
    """Return a rig with noise as its load cell states it."""
    return tb.Rig(load_cell=load_cell, unknown={"noise_scale": 1.0, **known})


def _known_to_vary(**known: float) -> dict[str, Run]:
    """Return runs with values of properties that are inferred by default, and with everything taken as stated."""
    return {"": Run(_real(**known)), "as stated": Run(_real(**{**NOTHING, **known}), AS_STATED)}


def _untold(truth: Truth, *, options: Mapping[str, Any] = MappingProxyType({}), **rigs: tb.Rig) -> dict[str, Run]:
    """Return runs with properties that are not inferred by default, and with these inferred or stated."""
    corrected = {other.replace("_", " "): Run(truth, rig, options) for other, rig in rigs.items()}
    return {"": Run(truth, options=options), **corrected}


def _spotted(at: float) -> dict[str, Run]:
    """Return runs with a flat spot; a shape-free family takes parabolas for any smooth contour."""
    spotted = tb.calibration.Misspecification(_real(), flat_spot=(at, 2.0))
    free = Run(replace(spotted, family="parabola"), options={"family": "shape-free"})
    return {"": Run(spotted), "shape free": free}


BIASES = {"moment_bias": 0.02, "force_x_bias": 0.05, "force_y_bias": 0.05}
DRIFTS = {"moment_drift": 0.04, "force_x_drift": 0.1, "force_y_drift": 0.1}
OUTLIERS = replace(CELL, degrees_of_freedom=2.5)
CASES: Mapping[str, Mapping[str, Run]] = {
    "as assumed": _known_to_vary(),
    **{f"friction {mu}": _known_to_vary(friction=mu) for mu in (0.1, 0.3, 0.5)},
    **{
        f"base off by 1 % L, {way}": _untold(tb.calibration.Misspecification(_real(), base_shift=shift))
        for way, shift in (("across", (0.01, 0.0)), ("along", (0.0, 0.01)))
    },
    "second base off by 1 % L": _untold(
        _real(base_2_x=0.01), options={"drive": TWO_BASES}, base_inferred=INFERRED.with_unknown(base="default")
    ),
    "EI off by 5 %": _known_to_vary(rigidity_scale=1.05),
    "encoder off by 1°": _known_to_vary(drive_angle_offset=float(np.radians(1.0))),
    "backlash of 0.5°": _known_to_vary(backlash=float(np.radians(0.5))),
    "load cell off by 1 % L": _known_to_vary(lever_x=0.01, lever_y=0.01),
    "biases of one noise": _known_to_vary(**BIASES),
    "curved by 0.05/L": _untold(
        _real(rest_curvature=0.05), rest_curvature_inferred=INFERRED.with_unknown(rest_curvature="default")
    ),
    "curved by 0.4/L": _untold(
        _real(rest_curvature=0.4), rest_curvature_inferred=INFERRED.with_unknown(rest_curvature=stats.norm(0.0, 0.5))
    ),
    "tapered by 10 %": _untold(_real(taper=0.1), taper_inferred=INFERRED.with_unknown(taper="default")),
    "tapered by 50 %": _untold(_real(taper=0.5), taper_inferred=INFERRED.with_unknown(taper=stats.uniform(0.0, 0.9))),
    "drift of two noises": _untold(_real(**DRIFTS), drift_inferred=INFERRED.with_unknown(drift="default")),
    "outliers (t, 2.5)": _untold(_real(OUTLIERS), told_of_them=tb.Rig(load_cell=OUTLIERS)),
    "flat spot in the gap": _spotted(0.0),
    "flat spot beside it": _spotted(0.4),
}


_HEAD = """noise 0.05 EI/L² and 0.02 EI/L, steps of 2°; bands of 90 %; noticed by the check of
the record, by the misfit of single samples, by the axial score, by any of them; not converged, or lost: of a
replicate that ended with an error nothing holds, and nothing is noticed"""


def main(replicates: int = 40, *names: str, discrepancy: bool = False) -> None:
    print(f"{replicates} replicates; {_HEAD}\n")
    heads = ("in the gap", "beside it", "bias [L]", "width [L]", "check", "misfit", "axial", "any", "not conv.")
    print(line("", heads, 38), flush=True)
    for name in names or CASES:
        runs = beside_discrepancy(CASES[name]) if discrepancy else CASES[name]
        for k, (other, run) in enumerate(runs.items()):
            few = max(1, replicates // (FEWER if run.options.get("family") else 1))
            count = f" ({few})" if few < replicates else ""
            title = f"  {other}{count}" if k else f"{name} {other}".strip()
            print(row(title, calibrated(f"{name} {other}", run, few)), flush=True)


def beside_discrepancy(runs: Mapping[str, Run]) -> dict[str, Run]:
    """Return the run without correction, and the same with a discrepancy, of which the simulated rig has none."""
    which = "as stated" if "as stated" in runs else ""
    run = runs[which]
    beside = run._replace(rig=run.rig.with_unknown(discrepancy="default"))
    return {which: run, f"{which} with discrepancy".strip(): beside}


def calibrated(name: str, run: Run, replicates: int) -> xr.Dataset:
    settings = None if run.options.get("family") == "shape-free" else SETTINGS
    options = {"rig": run.rig, "truth": run.truth, "settings": settings, **run.options}
    return tb.calibrate(rng=2029, replicates=replicates, out=OUT / folder_name(name), **options)


def row(name: str, found: xr.Dataset) -> str:
    if found.attrs["lost"] == found.sizes["replicate"]:
        return f"{name:<38} {found.attrs['verdict']}"
    check = found.check_passed.values == 0.0
    misfit = found.misfit_probability.values < CHANCE
    axial = np.abs(found.axial_score.values) > SCORE
    cells = [f"{_mean(found, f'pointwise_{region}'):.2f}" for region in ("in_gap", "beside")]
    cells += [f"{_mean(found, f'{what}_in_gap'):.4f}" for what in ("bias", "width")]
    shares = (check, misfit, axial, check | misfit | axial, found.converged.values != 1.0)
    return line(name, [*cells, *(f"{share.mean():.0%}" for share in shares)], 38)


def _mean(found: xr.Dataset, name: str) -> float:
    """Return the mean size; NaN if no sweeps leave a gap."""
    return float(abs(found[name]).mean()) if name in found else np.nan


if __name__ == "__main__":
    counts, chosen = counts_and_names(sys.argv[1:])
    main(*(counts or [40]), *chosen, discrepancy="--discrepancy" in sys.argv)

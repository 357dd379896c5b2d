"""Prints the calibration at the defaults of `infer`: coverage, ranks of the truth, and lost replicates.

Truths are drawn from the default priors of a family and of the unknowns of the rig, at the usual noise, a tenth of
it and three times as much; see `tactile_bayes.calibrate`. Results are kept in results/calibration, so that a run that
was stopped goes on. With the argument "published", the tables are those of the replicates in data/calibration.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

import tactile_bayes as tb
from tactile_bayes.calibration.calibrate import experiment_of
from tactile_bayes.calibration.store import REPLICATES
from tactile_bayes.calibration.summary import CLAIMS, summary

OUT, PUBLISHED = Path("results/calibration"), Path(__file__).parents[1] / "data" / "calibration"
SEED = 2026


class Family(NamedTuple):
    title: str
    replicates: int
    """Number at the usual noise; half as many at others."""


class Noise(NamedTuple):
    title: str
    force: float
    """Standard deviation [EI/L²]."""
    moment: float
    """Standard deviation [EI/L]."""


FAMILIES = {
    "parabola": Family("parabolas", 1000),
    "circle": Family("circles", 500),
    "ellipse": Family("ellipses", 500),
    "power-law": Family("power laws", 500),
    "parabola/power-law": Family("parabola/power-law", 200),
    "shape-free": Family("shape-free", 100),
}
NOISES = {
    "usual": Noise("at the usual noise", 0.05, 0.02),
    "tenth": Noise("at a tenth of the noise", 0.005, 0.002),
    "threefold": Noise("at three times the noise", 0.15, 0.06),
}


def folder_of(family: str, noise: str) -> str:
    return f"{family.replace('/', '-')}-{noise}"


def load_cell(noise: str) -> tb.LoadCell:
    return tb.LoadCell(force_noise=NOISES[noise].force, moment_noise=NOISES[noise].moment)


def published(noise: str) -> dict[str, xr.Dataset]:
    """Return the calibrations whose replicates are published, by family."""
    found = {}
    for family in FAMILIES:
        path = PUBLISHED / folder_of(family, noise) / "replicates.json"
        if path.exists():
            rows = json.loads(path.read_text(encoding="utf-8"))["replicates"]
            outcomes = {row["number"]: REPLICATES.decode(row) for row in rows}
            found[family] = summary(experiment_of(family, tb.Rig(load_cell=load_cell(noise)), rng=SEED), outcomes)
    return found


def table(noise: str, calibrations: dict[str, xr.Dataset]) -> str:
    """Return a table in Markdown with a column for each family."""
    found = list(calibrations.values())

    def row(name: str, cells: Iterable[str]) -> str:
        return f"| {name} | {' | '.join(cells)} |"

    def held(name: str) -> str:
        return row(CLAIMS[name], (_share(one.sel(claim=name)) for one in found))

    smallest = [f"{float(np.nanmin(one.rank_p_value)):.2g} of {one.sizes['quantity']}" for one in found]
    return "\n".join(
        [
            row(
                NOISES[noise].title,
                (f"{one.sizes['replicate']} {FAMILIES[family].title}" for family, one in calibrations.items()),
            ),
            "|" + "---|" * (len(found) + 1),
            *(held(name) for name in CLAIMS),
            row("smallest p-value of the ranks", smallest),
            row("verdict", (one.attrs["conclusion"] for one in found)),
            row("ended in an error", (str(one.attrs["lost"]) for one in found)),
            row("did not converge, and said so", (str(one.attrs["not_converged"]) for one in found)),
            row("false alarms of the check of the record", (str(int((one.check_passed == 0).sum())) for one in found)),
        ]
    )


def _share(claim: xr.Dataset) -> str:
    return f"{100 * float(claim.coverage):.1f} ± {100 * float(claim.coverage_error):.1f} %"


def calibrated(family: str, noise: str) -> xr.Dataset:
    replicates = FAMILIES[family].replicates // (1 if noise == "usual" else 2)
    rig, out = tb.Rig(load_cell=load_cell(noise)), OUT / folder_of(family, noise)
    found = tb.calibrate(family, rig, replicates=replicates, rng=SEED, out=out)
    print(f"{family}, {noise} noise: {found.attrs['verdict']}", flush=True)
    return found


def main(*chosen: str) -> None:
    families = [name for name in FAMILIES if name in chosen] or FAMILIES
    for noise in [name for name in NOISES if name in chosen] or NOISES:
        made = published(noise) if "published" in chosen else {name: calibrated(name, noise) for name in families}
        print(f"\n{table(noise, made)}\n", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])

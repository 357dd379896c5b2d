"""Prints whether posteriors of contours are calibrated: ranks of the truth, and coverage of bands, in the gap and out.

Truths are drawn from the prior, of the contour and of everything that is not known of the rig by default; see
`tactile_bayes.calibrate`. What is done is kept in results/calibration, so that a run that was stopped goes on.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import xarray as xr
from scipy import stats

import tactile_bayes as tb

OUT = Path("results/calibration")
SIZE = stats.lognorm(s=0.4, scale=0.7)
PRIORS: dict[str, dict[str, Any]] = {
    "parabola": {"a": stats.lognorm(s=0.4, scale=0.6)},
    "circle": {"r": SIZE},
    "ellipse": {"a": SIZE, "b": SIZE},
}
VERTEX = {"q": stats.uniform(0.3, 0.4), "x_c": stats.norm(0.0, 0.1)}


def main(replicates: int = 200, *families: str) -> None:
    for family in families or PRIORS:
        found = tb.calibrate(
            family=family, replicates=replicates, priors=PRIORS[family] | VERTEX, seed=2026, out=OUT / family
        )
        print_one(family, found)


def print_one(family: str, found: xr.Dataset) -> None:
    seconds = found.seconds
    print(f"{family}: {found.attrs['verdict']}")  # which names replicates that were lost; below they hold nowhere
    print(f"  seconds a replicate: {float(seconds.mean()):.1f}, the longest {float(seconds.max()):.1f}")
    for name in found.claim.values:
        row = found.sel(claim=name)
        print(f"  {name:<22}{float(row.coverage):>8.3f} ± {float(row.coverage_error):.3f}")
    p_values = zip(found.quantity.values, found.rank_p_value.values, strict=True)
    print("  p: " + ", ".join(f"{name} {p:.3f}" for name, p in p_values) + "\n", flush=True)


if __name__ == "__main__":
    counts, chosen = [a for a in sys.argv[1:] if a.isdigit()], [a for a in sys.argv[1:] if not a.isdigit()]
    main(*map(int, counts or ["200"]), *chosen)

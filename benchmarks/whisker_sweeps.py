"""Prints what a real whisker tells of real cylinders, from the runs of the commands in `docs/howto/gauge.md`.

    python -m benchmarks.whisker_sweeps RUN [RUN ...]

Runs are folders of `tactile-bayes infer`, in which their figures are left as cylinder.png. The data are those of
`../shared/data/whisker-sweeps`, or of the folder that TACTILE_BAYES_MEASURED names.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import tactile_bayes as tb

ROOT = Path(__file__).resolve().parents[1]
MEASURED = Path(os.environ.get("TACTILE_BAYES_MEASURED", ROOT.parent / "shared" / "data")) / "whisker-sweeps"


def prepare(folder: Path) -> None:
    """Write the files of the rig into a folder, with the trace of the whisker."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in (ROOT / "benchmarks" / "whisker").iterdir():
        (folder / file.name).write_text(file.read_text(encoding="utf-8"), encoding="utf-8")
    traced = np.genfromtxt(MEASURED / "shape_y.csv", delimiter=",", skip_header=1, usecols=(1, 2))
    np.savetxt(folder / "shape.csv", traced, delimiter=",", header="x [mm],y [mm]", comments="")


def picture(posterior: xr.DataTree) -> Figure:
    """Draw a sweep, and what it tells of the cylinder."""
    draws = posterior["posterior"]
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    readings, plane, pairs = figure.subplots(1, 3)
    x, y = (posterior["constant_data"][name].values for name in ("base_x", "base_y"))
    way, predicted = 1e3 * np.hypot(x - x[0], y - y[0]), posterior["posterior_predictive"].holding_moment
    low, high = predicted.quantile([0.025, 0.975], ("chain", "draw")).values
    readings.fill_between(way, low, high, color="#0072B2", alpha=0.4, linewidth=0, label="predicted, 95 %")
    readings.plot(way, posterior["observed_data"].holding_moment, color="black", linewidth=1.0, label="read")
    readings.set(xlabel="way of the stage / mm", ylabel="reading / counts", ylim=(-100, None))
    readings.legend(frameon=False, loc="lower right")

    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    r, x_c, q, friction = (draws[name].values.ravel() for name in ("r", "x_c", "q", "friction"))
    some = slice(None, None, r.size // 40)
    for size, middle, lowest in zip(r[some], x_c[some], q[some], strict=True):
        circle = 1e3 * (middle + size * np.cos(turn)), 1e3 * (lowest + size + size * np.sin(turn))
        plane.plot(*circle, color="#0072B2", linewidth=0.6, alpha=0.4)
    touched = tb.uncertainty.implied_contacts(posterior, draws=20)["posterior"]
    at = (1e3 * touched[name].values.ravel() for name in ("contact_x", "contact_y"))
    plane.plot(*at, ".", markersize=1.5, color="#D55E00", rasterized=True)
    plane.set(xlabel="$x$ / mm", ylabel="$y$ / mm", aspect="equal")

    pairs.plot(1e3 * r[:: r.size // 1500], friction[:: r.size // 1500], ".", markersize=1.5, color="#0072B2")
    pairs.axvline(15.12, color="0.4", linewidth=1.0)
    pairs.set(xlabel="radius / mm", ylabel="coefficient of friction", ylim=(0.0, None))
    return figure


def main() -> None:
    for run in map(Path, sys.argv[1:]):
        found = tb.read_result(run / "posterior.nc")
        r, friction = 1e3 * found["posterior"].r, found["posterior"].friction
        low, high = r.quantile([0.025, 0.975]).values
        off = found["observed_data"].holding_moment
        off = off - found["posterior_predictive"].holding_moment.mean(("chain", "draw"))
        seconds = found["sample_stats"].attrs["seconds"]
        print(f"{run.name}: radius {float(r.mean()):.2f} mm ({low:.2f} to {high:.2f}),", end=" ")
        print(f"friction {float(friction.mean()):.2f} ± {float(friction.std()):.2f},", end=" ")
        print(f"residuals {float(np.sqrt((off**2).mean())):.1f} counts, {float(seconds):.0f} s of sampling")
        picture(found).savefig(run / "cylinder.png", dpi=110, bbox_inches="tight")


if __name__ == "__main__":
    main()

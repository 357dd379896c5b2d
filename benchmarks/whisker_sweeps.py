"""Prints what a real whisker tells of real cylinders: calibrated on points, then swept past them.

The data are those of `../shared/data/whisker-sweeps`, or of the folder that TACTILE_BAYES_MEASURED names; the README
there describes them. A thin probe touches a bent nitinol whisker at known points, and a stage moves cylinders past it.
A Hall sensor under the clamp counts, with a gain that differs by 2 % from session to session, and hysteresis of 1 % of
the peak, over some 6 mm. Taken from that README are the direction of the whisker, the transformation of the stage's
coordinates, and 4.1 mm between the hinge of the sensor and the first traced point. From that point the rod is 51 mm
long: there it lets go of the smaller cylinder. Its rigidity is that of a wire of 0.24 mm, and scales the gain.

    python -m benchmarks.whisker_sweeps FOLDER [SWEEP ...]

keeps the rig, every posterior and its figure in FOLDER, and goes on from there. SWEEP is like cylinder_may25/trial0, or
cylinder_may25, the sweeps of a session in one record, which have one hysteresis if they repeat each other. Where a
table shows that the rod lets go, after its record has ended, that is compared with what the posterior predicts.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy import stats

import tactile_bayes as tb
from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.parameters.unknowns import Unknowns
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood, events_of
from tactile_bayes.inference.result import known_of
from tactile_bayes.rig import NOTHING

ROOT = Path(__file__).resolve().parents[1]
MEASURED = Path(os.environ.get("TACTILE_BAYES_MEASURED", ROOT.parent / "shared" / "data")) / "whisker-sweeps"
NAMES = ("index", "x", "y", "z", "sensor_x", "sensor_y", "sensor_z")
ORIGIN = np.array([64.3045, 98.0687])  # place of the sensor in the coordinates of the stage [mm]
# Direction of the whisker at the clamp. The object rests and the sensor moves, in a frame that is turned by half.
DRIVE_ANGLE = np.radians(180.0 - 115.3)
HINGE, LENGTH, DIAMETER, RIGIDITY = 4.1, 51.0, 0.24e-3, 1e-5
ON_SWEEPS = 0.01  # hysteresis over the peak
COUNTS = 5e6  # roughly, counts to N m; the calibration finds them
SENSOR = tb.LoadCell(moment_noise=3.0, gain=((COUNTS, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))

# Distances of the probe from the clamp: closer points do not fit any rod, and the outermost is at the tip.
RINGS = range(3, 9)
UNTOUCHED = 15  # number of readings before contact
BEFORE = np.radians(-108.0)  # bearing from which the probe arrives, on the other side of the whisker
SWEEPS = tuple(f"cylinder_may25/trial{k}" for k in range(5)) + tuple(f"cylinder_may03/trial{k}" for k in range(1, 5))
ENOUGH = tb.SamplerSettings(ensembles=2, walkers=40, min_ess=400, max_r_hat=1.03, max_seconds=600)


def whisker() -> tb.Rod:
    """Return the rod, from the hinge to the tip, whose first piece is straight."""
    traced = _table("shape_y.csv")
    x, y = traced["x"], traced["y"]
    before = np.array([x[0] - x[3], y[0] - y[3]])
    before *= HINGE / np.hypot(*before)
    x, y = np.append(x[0] + before[0] * np.array([1.0, 0.5]), x), np.append(y[0] + before[1] * np.array([1.0, 0.5]), y)
    return tb.Rod.from_shape(1e-3 * x, 1e-3 * y, RIGIDITY, length=1e-3 * (HINGE + LENGTH), diameter=DIAMETER)


def points(rod: tb.Rod) -> xr.Dataset:
    """Return the record of the probe, along five rays away from the clamp: each a sweep that begins beside the whisker.

    Readings there and back are averaged, and places moved onto the ray, by up to 4 µm.
    """
    found = np.genfromtxt(MEASURED / "calibration_in_plane.csv", delimiter=",", names=True)
    rows = []
    for ray in range(5):
        twice = found[np.isin(found["series"], (4 - ray, 5 + ray))]
        rings = [twice[twice["position"] == ring] for ring in RINGS]
        places = np.array([[each[name].mean() for name in ("x_mm", "y_mm", "sy_counts")] for each in rings])
        middle = places[:, :2].mean(axis=0)
        along = np.linalg.svd(places[:, :2] - middle)[2][0]
        places[:, :2] = middle + ((places[:, :2] - middle) @ along)[:, None] * along
        near = 0.4 * np.hypot(*places[0][:2])
        rows += [[ray, near * np.cos(BEFORE), near * np.sin(BEFORE), 0.0], *([ray, *place] for place in places)]
    sweep, x, y, counts = np.array(rows).T
    return _record(rod, sweep.astype(int), x, y, counts)


def record_of(name: str, rod: tb.Rod, whole: bool = False) -> xr.Dataset:
    """Return the record of a cylinder, of one sweep or of all of a session, whole or without what follows the release.

    Then a sweep ends where its reading has fallen to 60 % of its peak, and those that repeat each other where the first
    does. In the record of a session the zero of each is that of its first readings.
    """
    tables = [_table(f"{one}.csv") for one in SWEEPS if one == name or one.startswith(f"{name}/")]
    counts = [table["sensor_y"] for table in tables]
    if len(tables) > 1:
        counts = [each - each[:UNTOUCHED].mean() for each in counts]
    distances = [float(table["y"][-1]) for table in tables]
    ends: dict[float, int] = {}
    for at, each in zip(distances, counts, strict=True):
        ends[at] = min(ends.get(at, each.size), each.size if whole else _end(each))
    rows = []
    for k, (table, each, at) in enumerate(zip(tables, counts, distances, strict=True)):
        end = ends[at]
        x, y = table["x"] - ORIGIN[0], table["y"] - table["y"][0]
        rows.append(np.stack([np.full(end, k), x[:end], y[:end], each[:end]]))
    sweep, x, y, counted = np.concatenate(rows, axis=1)
    return _record(rod, sweep.astype(int), x, y, counted)


def _end(counts: Floats) -> int:
    """Return the number of readings before they have fallen to 60 % of their peak."""
    released = (np.arange(counts.size) > counts.argmax()) & (counts < 0.6 * counts.max())
    return int(np.argmax(released)) if released.any() else counts.size


def hysteresis(rod: tb.Rod) -> dict[str, Any]:
    """Return the priors of a sweep's discrepancy, whose length is 6 mm.

    Other parameters follow a smooth deviation, so that residuals do not tell its size: it is given.
    """
    length = stats.lognorm(s=0.3, scale=6e-3 / rod.length)
    return {"discrepancy_scale": stats.lognorm(s=0.01, scale=ON_SWEEPS), "discrepancy_length": length}


def _record(rod: tb.Rod, sweep: Floats, x: Floats, y: Floats, counts: Floats) -> xr.Dataset:
    columns = {"sweep": sweep, "direction": "forward", "base_x": 1e-3 * x, "base_y": 1e-3 * y}
    columns |= {"drive_angle": np.full(len(x), DRIVE_ANGLE), "holding_moment": counts}
    return tb.make_record(columns, tb.Rig(rod=rod, file={"missing": ("force_x", "force_y")}))


def _table(name: str) -> Floats:
    return np.genfromtxt(MEASURED / name, delimiter=",", names=NAMES, skip_header=1)


def calibrated(folder: Path, rod: tb.Rod) -> tuple[tb.Rig, xr.DataTree]:
    """Return the rig and its posterior, from the probe, whose place is uncertain by some millimetres."""
    file, path = folder / "rig.toml", folder / "rig.nc"
    if not path.exists():
        unit = rod.moment_unit
        unknown = {
            **NOTHING,
            **dict.fromkeys(("drive_angle_offset", "friction", "rest_shape"), "default"),
            "moment_gain": stats.lognorm(s=0.5),
            "moment_curve_quadratic": stats.norm(0.0, 0.2 / unit),
            "moment_curve_cubic": stats.norm(0.0, 0.1 / unit**2),
            "suspension_compliance": stats.halfnorm(scale=0.3 / unit),
            **dict.fromkeys(("gauge_x", "gauge_y"), stats.norm(0.0, 3e-3)),
        }
        probe = tb.contours.Circle(r=1e-5, q=-1e-5)
        rig = tb.Rig(load_cell=SENSOR, unknown=unknown)
        rig = tb.calibrate_rig(points(rod), contour=probe, rig=rig, rng=1)
        assert rig.calibration is not None
        assert rig.calibration.posterior is not None
        rig.write(file)
        tb.write_result(rig.calibration.posterior, path)
    return tb.Rig.read(file), tb.read_result(path)


def measured(folder: Path, name: str, rod: tb.Rod, rig: tb.Rig) -> xr.DataTree:
    """Return the posterior of the cylinder of a sweep, or of all sweeps of a session."""
    path = folder / f"{name.replace('/', '-')}.nc"
    if not path.exists():
        unknown: dict[str, Any] = dict.fromkeys(("moment_bias", "friction", "noise_scale"), "default")
        unknown |= {"rigidity_scale": stats.lognorm(s=0.02), **hysteresis(rod)}
        record, rig = record_of(name, rod), rig.with_unknown(**unknown)
        found = tb.infer_contour(record, family="circle", rig=rig, rng=1, settings=ENOUGH)
        tb.write_result(found, path)
    return tb.read_result(path)


def radius(found: xr.DataTree) -> str:
    """Return the radius with its interval of 95 %."""
    r = 1e3 * found["posterior"].r
    low, high = r.quantile([0.025, 0.975]).values
    return f"radius {float(r.mean()):.2f} mm ({low:.2f} to {high:.2f})"


def releases(found: xr.DataTree, name: str, rod: tb.Rod) -> list[str]:
    """Return the ways of the stage at which the rod lets go, as read and as a posterior predicts them (95 %)."""
    draws = found["posterior"].dataset.stack(every=("chain", "draw"))
    draws = draws.isel(every=slice(None, None, max(1, draws.sizes["every"] // 200)))
    inferred = [one for one in json.loads(found.attrs["nuisances"]) if not one.startswith("discrepancy")]
    unknowns = Unknowns(tuple(inferred), {}, rod, known_of(found.attrs))
    rig = unknowns.rig({one: draws[one].values for one in inferred})
    record = record_of(name, rod, whole=True)
    contours = contours_of(draws, found.attrs["family"])
    words = []
    for number in np.unique(record.sweep):
        own = record.isel(sample=record.sweep.values == number)
        predicted = 1e3 * events_of(RecordLikelihood(own, SENSOR), contours, rig)["snap_off_travel"]
        counts = own.holding_moment.values - own.holding_moment.values[:UNTOUCHED].mean()
        loaded = np.flatnonzero(counts > 0.1 * counts.max())[-1]
        if loaded + 1 < counts.size:
            way = 1e3 * np.append(0.0, np.cumsum(np.hypot(np.diff(own.base_x), np.diff(own.base_y))))
            low, high = np.nanquantile(predicted, [0.025, 0.975])
            words.append(f"{way[loaded]:.1f} to {way[loaded + 1]:.1f} mm (predicted {low:.1f} to {high:.1f})")
    return words


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
    folder, names = Path(sys.argv[1]), sys.argv[2:] or SWEEPS
    folder.mkdir(parents=True, exist_ok=True)
    rod, began = whisker(), perf_counter()
    rig, of_rig = calibrated(folder, rod)
    print(f"rig: {of_rig.attrs['message']} ({perf_counter() - began:.0f} s)")
    for name, draws in of_rig["posterior"].mean().items():
        print(f"  {name:24s} {float(draws):12.5g} ± {float(of_rig['posterior'][name].std()):.2g}")
    for name in names:
        began = perf_counter()
        found = measured(folder, name, rod, rig)
        friction = found["posterior"].friction.values.ravel()
        off = found["observed_data"].holding_moment
        off = off - found["posterior_predictive"].holding_moment.mean(("chain", "draw"))
        print(
            f"{name}: {radius(found)}, friction {friction.mean():.2f} ± "
            f"{friction.std():.2f}, residuals {float(np.sqrt((off**2).mean())):.1f} counts, "
            f"{perf_counter() - began:.0f} s; {found.attrs['message']}",
            flush=True,
        )
        picture(found).savefig(folder / f"{name.replace('/', '-')}.png", dpi=110, bbox_inches="tight")
        for words in releases(found, name, rod):
            print(f"  lets go at {words}")


if __name__ == "__main__":
    main()

"""Prints how far the posterior of a growing record can be trusted, how late it is, and what a stopping rule saves.

`tb.Stream` takes records as those of `benchmarks.calibration` in blocks. At a quarter, half, three quarters and all of
it the truth has a rank among draws, and the band of 95 % is compared with it at nine positions within 0.1 L of the
vertex at once. The last update is compared with `infer_contour` of the whole record. A rule asks for a band that is
nowhere wider than a tolerance. Records are kept in results/stream, from which a stopped run resumes.

    python -m benchmarks.stream [--wrong] [RECORDS]

With --wrong, records are of rigs or shapes that the model does not have, and their e-values are printed.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import tactile_bayes as tb
from benchmarks.table import counts_and_names, folder_name, line, stored
from tactile_bayes.calibration.calibrate import calibration_replicate, experiment_of
from tactile_bayes.calibration.ranks import uniformity_p_value
from tactile_bayes.calibration.simulation import simulate
from tactile_bayes.errors import TactileBayesError
from tactile_bayes.inference.streams.particles import LOST_ONCE

OUT = Path("results/stream")
CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
SEED, BLOCKS, PARTICLES, DRAWS = 2033, 12, 1000, 99
QUARTERS = ("a quarter", "half", "three quarters", "all")
AROUND = np.linspace(-0.1, 0.1, 9)  # positions, relative to the vertex as the whole record shows it [L]
TOLERANCES = (0.02, 0.01, 0.005)  # largest widths of the band [L] at which a rule stops
ALARMS = (0.2, 0.05, 0.01, 0.001)  # rates of false alarms that an e-value may have at most
SMOOTH = tb.Rig(load_cell=CELL, unknown={"friction": 0.0, "backlash": 0.0})
# What the model does not have: it takes all for parabolas without friction and backlash.
WRONG: Mapping[str, dict[str, Any]] = {
    "none": {},
    "friction of 0.1, not inferred": {"truth": SMOOTH.with_unknown(friction=0.1)},
    "friction of 0.3, not inferred": {"truth": SMOOTH.with_unknown(friction=0.3)},
    "rod tapered by 30 %": {"truth": SMOOTH.with_unknown(taper=0.3)},
    "rod curved by 0.2/L": {"truth": SMOOTH.with_unknown(rest_curvature=0.2)},
    "circle": {"truth": tb.calibration.Misspecification(family="circle")},
    "flat spot in the gap": {"truth": tb.calibration.Misspecification(flat_spot=(0.0, 2.0))},
    "outliers (t, 2.5)": {"truth": replace(SMOOTH, load_cell=replace(CELL, degrees_of_freedom=2.5))},
}
Row = Mapping[str, Any]


def main(records: int = 100) -> None:
    identity = {"particles": str(PARTICLES), "blocks": str(BLOCKS), "seed": str(SEED)}
    every = stored(OUT, identity, one, (), records)
    report([row for row in every if "error" not in row], [row["error"] for row in every if "error" in row])


def one(task: tuple[tuple[()], int]) -> Row:
    """Return ranks, bands and times of one record."""
    _, number = task
    try:
        replicate = calibration_replicate(number, rig=tb.Rig(load_cell=CELL), rng=SEED)
        assert replicate.measured is not None
        assert replicate.posterior is not None
        return compared(replicate.measured, replicate.truth, replicate.posterior, number)
    except TactileBayesError as error:
        return {"error": f"{number}: {error}"}


def wrong(records: int = 20) -> None:
    print(f"e-values of {records} records each; a right model exceeds 1,000 in at most 0.1 % of them\n")
    print(line("what the model does not have", ("told (1,000)", "after", "told (20)", "no particle left"), 32, 18))
    for name in WRONG:
        identity = {"without": name, "seed": str(SEED)}
        rows = stored(OUT / folder_name(f"without-{name}"), identity, wrong_one, name, records)
        every = [row["e_values"] for row in rows if row.get("e_values")]
        values = np.array([row + [row[-1]] * (BLOCKS - len(row)) for row in every])
        told = values > 1000.0
        early = told.any(axis=1)
        after = f"{np.median(told[early].argmax(axis=1) + 1) / BLOCKS:.0%}" if early.any() else ""
        some = (values[:, -1] > 20.0).mean()
        ended = sum("error" in row or row["ended"] for row in rows)
        print(line(name, (f"{early.mean():.0%}", after, f"{some:.0%}", ended), 32, 18), flush=True)


def wrong_one(task: tuple[str, int]) -> Row:
    """Return the e-values of one record, and whether no particle explained it."""
    name, number = task
    experiment = experiment_of(rig=SMOOTH, rng=SEED, **WRONG[name])
    random = np.random.default_rng(np.random.SeedSequence(SEED, spawn_key=(number,)))
    try:
        measured = simulate(experiment, random).measured
    except TactileBayesError as error:
        return {"error": f"{number}: {error}"}
    stream = tb.Stream(rig=SMOOTH, rng=number, particles=PARTICLES)
    row: dict[str, Any] = {"e_values": [], "ended": False}
    for block in np.array_split(np.arange(measured.sizes["sample"]), BLOCKS):
        try:
            row["e_values"].append(float(stream.update(measured.isel(sample=block)).e_value))
        except TactileBayesError:
            row["ended"] = True
            break
    return row


def compared(measured: xr.Dataset, truth: Mapping[str, float], posterior: xr.DataTree, number: int) -> Row:
    x = float(posterior["posterior"]["x_c"].median()) + AROUND
    stream = tb.Stream(rig=tb.Rig(load_cell=CELL), rng=number, particles=PARTICLES, x=x)
    height = tb.contours.Parabola(truth["a"], truth["q"], truth["x_c"]).height(x)
    row: dict[str, Any] = {"ranks": [], "held": [], "width": [], "seconds": [], "stages": []}
    for k, block in enumerate(np.array_split(np.arange(measured.sizes["sample"]), BLOCKS), start=1):
        now = stream.update(measured.isel(sample=block))
        row["seconds"].append(float(now.seconds))
        row["stages"].append(int(now.stages))
        low, high = now.height.sel(level=0.025).values, now.height.sel(level=0.975).values
        row["width"].append(float(np.max(high - low)))
        row["held"].append(bool(np.all((low <= height) & (height <= high))))
        if k * len(QUARTERS) % BLOCKS == 0:
            row["ranks"].append(ranks(stream.posterior(), truth, number))
    draws = np.stack([posterior["posterior"][name].values.ravel() for name in now.parameter.values])
    expected, deviation = np.quantile(draws, now.level.values, axis=1), draws.std(axis=1)
    off = (now.parameters.values - expected) / deviation
    row["off"] = dict(zip(map(str, now.parameter.values), np.abs(off).max(axis=0).tolist(), strict=True))
    row["off_median"] = float(np.abs(off[now.level.values == 0.5]).max())
    band = tb.contour_band(posterior, x)
    row["wider"] = float(np.mean((high - low) / (band["upper"] - band["lower"]).values))
    row["held_by_infer"] = bool(np.all((band["lower"] <= height) & (height <= band["upper"])))
    row["told"] = not bool(stream.posterior().attrs["converged"])
    row["shift"], row["e_value"] = float(now.log_density_shift), float(now.e_value)
    row["converged"] = bool(posterior.attrs["converged"])
    return row


def ranks(posterior: xr.DataTree, truth: Mapping[str, float], number: int) -> dict[str, int]:
    """Return ranks of the truth among as many draws, without replacement."""
    drawn = posterior["posterior"].isel(chain=0)
    picked = np.random.default_rng(number).choice(drawn.sizes["draw"], DRAWS, replace=False)
    return {name: int(np.sum(drawn[name].values[picked] < truth[name])) for name in truth if name in drawn}


def report(rows: list[Row], errors: list[str]) -> None:
    print(f"{len(rows)} records; {len(errors)} ended with an error {'; '.join(errors)}")
    seconds = np.array([row["seconds"] for row in rows])
    print(f"an update takes {np.median(seconds):.2f} s (median), 5 to 95 %: {_range(seconds)}, the longest of a record")
    print(f"{np.median(seconds.max(axis=1)):.2f} s (median); without its first two, {_range(seconds[:, 2:])}")
    moves = seconds / np.maximum([row["stages"] for row in rows], 1)
    print(f"a stage takes {np.median(moves):.2f} s (median), 5 to 95 %: {_range(moves)}\n")
    print(line("of the record", ("smallest p", "band holds", "width [L]"), 18, 12))
    for k, (name, at) in enumerate(zip(QUARTERS, range(BLOCKS // 4 - 1, BLOCKS, BLOCKS // 4), strict=True)):
        names = sorted({one for row in rows for one in row["ranks"][k]})
        of = [[row["ranks"][k][one] for row in rows if one in row["ranks"][k]] for one in names]
        values = [uniformity_p_value(each, DRAWS) for each in of]
        held, width = (np.array([row[what][at] for row in rows]) for what in ("held", "width"))
        smallest = f"{min(values):.2g} of {len(values)}"
        print(line(name, (smallest, _share(held), f"{np.median(width):.4f}"), 18, 12))
    print(line("infer_contour", ("", _share([row["held_by_infer"] for row in rows])), 18, 12))
    largest = np.array([row["e_value"] for row in rows])
    limits = ", ".join(f"{1.0 / rate:g} in {np.mean(largest > 1.0 / rate):.1%}" for rate in ALARMS)
    print(f"\nthe largest e-value of a record, whose model is right, exceeds {limits} of records")
    told = [round(row["off_median"], 2) for row in rows if row["told"]]
    found_again = sum(row["shift"] > LOST_ONCE and not row["told"] for row in rows)
    print(f"\n{len(told)} results have not converged; medians are off by {told or 'nothing'}")
    print(f"{found_again} had lost the posterior, and found it again; without the first:")
    sure = [row for row in rows if row["converged"] and not row["told"]]
    off = np.array([max(row["off"].values()) for row in sure])
    median = np.array([row["off_median"] for row in sure])
    print(f"against infer_contour, {len(sure)} records on which it converged, in its standard deviations: largest")
    print(f"difference of a quantile {np.median(off):.2f} (median of records), {off.max():.2f} (largest), of a median")
    wider = _range([row["wider"] for row in sure])
    print(f"{np.median(median):.2f}, {median.max():.2f}; width of the band over its width, 5 to 95 %: {wider}\n")
    print(line("band at most", ("stops before", "samples saved", "band holds then", "at the end"), 18, 16))
    held = np.array([row["held"] for row in rows])
    for tolerance in TOLERANCES:
        enough = np.array([row["width"] for row in rows]) <= tolerance
        first = np.where(enough.any(axis=1), enough.argmax(axis=1), BLOCKS - 1)
        saved, before = 1.0 - (first + 1) / BLOCKS, first < BLOCKS - 1
        then = [f"{held[before, at].mean():.0%}" if before.any() else "" for at in (first[before], -1)]
        print(line(f"{tolerance}", (f"{before.mean():.0%}", f"{saved.mean():.0%}", *then), 18, 16))


def _range(values: Any) -> str:
    low, high = np.quantile(values, [0.05, 0.95])
    return f"{low:.2f} to {high:.2f}"


def _share(held: Any) -> str:
    return f"{np.mean(held):.0%} ± {np.sqrt(np.mean(held) * (1.0 - np.mean(held)) / len(held)):.0%}"


if __name__ == "__main__":
    counts, _ = counts_and_names(sys.argv[1:])
    wrong(*counts) if "--wrong" in sys.argv else main(*counts)

"""Prints the coverage of shape-free bands in the gap and beside it, and their width over that of a known family.

The truths are not drawn from the prior: parabola, circle, ellipse, x⁴, profile IV of Merker et al. 2018, whose radius
of curvature jumps, a rounded corner whose radius varies a hundredfold, and a contour through points that scatter.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import xarray as xr

import tactile_bayes as tb
from benchmarks.table import counts_and_names, line, results
from tactile_bayes.arrays import Floats
from tactile_bayes.contours import Circle, Contour, Ellipse, Parabola, PowerLaw, Smooth, from_points, paper_profile
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.sweep import Scan

# Noise of forces [EI/L²] and of the moment [EI/L].
NOISES = {"quiet": (0.02, 0.008), "middling": (0.05, 0.02), "strong": (0.15, 0.06)}
ANGLES = np.radians(np.arange(0.0, 200.0, 1.0))
PROBABILITY, PLACES = 0.9, 9
SETTINGS = SamplerSettings(max_steps=700)


def _corner(q: float, x_c: float) -> Contour:
    """Sides of radius 2, a corner of 0.02 between slopes of ±0.6, and a fifth of a radian for each change."""
    slopes = Smooth.nodes(64)
    blunt = 0.5 * (1.0 + np.tanh((np.abs(slopes) - 0.6) / 0.1))
    return Smooth(np.log(0.02) + np.log(100.0) * blunt, q=q, x_c=x_c)


def _measured(q: float, x_c: float) -> Contour:
    """Points of an oval that is not one of the families, with a scatter of 0.002."""
    x = np.linspace(-1.0, 1.0, 80)
    y = 0.45 * x**2 + 0.12 * x**3 + 0.15 * x**4 + 0.002 * np.random.default_rng(7).normal(size=x.size)
    return from_points(x + x_c, y + q)


class Truth(NamedTuple):
    """A contour, and its family, if any."""

    build: Callable[[float, float], Contour]
    family: str | None


TRUTHS = {
    "parabola": Truth(lambda q, x_c: Parabola(0.5, q, x_c), "parabola"),
    "circle": Truth(lambda q, x_c: Circle(0.8, q, x_c), "circle"),
    "ellipse": Truth(lambda q, x_c: Ellipse(0.9, 0.5, q, x_c), "ellipse"),
    "x⁴": Truth(lambda q, x_c: PowerLaw(1.0, 4.0, q, x_c), "power-law"),
    "points": Truth(_measured, None),
    "corner": Truth(_corner, None),
    "profile IV": Truth(lambda q, _: paper_profile("IV", q=q), "parabola/power-law"),
}


class Outcome(NamedTuple):
    """Outcome for one record."""

    in_gap: float  # share of the grid points in the gap at which the band holds the truth
    out_of_gap: float
    width: float  # mean width of the band in the gap
    error: float  # largest distance of the truth from the band's median there
    known_width: float  # mean width of the band of the contour's own family; NaN without one
    seconds: float
    converged: bool
    passed: bool  # true if the record passes its check


def main(replicates: int = 4, workers: int = 2, *names: str) -> None:
    tasks = [(name, noise, k) for name in names or TRUTHS for noise in NOISES for k in range(replicates)]
    outcomes: dict[tuple[str, str], list[Outcome]] = {(name, noise): [] for name, noise, _ in tasks}
    for (name, noise, _), outcome in results(record, tasks, workers):
        outcomes[name, noise].append(outcome)
    heads = ("in the gap", "out of it", "width [L]", "off [L]", "over known", "time", "longest", "converged", "check")
    print(line(f"{'truth':<12}noise", heads, 22, 12))
    for (name, noise), of_kind in outcomes.items():
        table = np.array(of_kind, dtype=float)
        in_gap, out_of_gap, width, off, known, seconds, converged, passed = np.mean(table, axis=0)
        cells = [f"{in_gap:.2f}", f"{out_of_gap:.2f}", f"{width:.5f}", f"{off:.5f}", f"{width / known:.2f}"]
        cells += [f"{seconds:.1f} s", f"{table[:, 5].max():.1f} s", f"{converged:.0%}", f"passes {passed:.0%}"]
        print(line(f"{name:<12}{noise}", cells, 22, 12))


def record(task: tuple[str, str, int]) -> Outcome:
    """Simulate a record, infer, and compare."""
    name, noise, number = task
    rng = np.random.default_rng([2027, list(TRUTHS).index(name), number])
    truth = TRUTHS[name]
    contour = truth.build(float(rng.uniform(0.45, 0.6)), float(rng.normal(0.0, 0.05)))
    cell = tb.LoadCell(force_noise=NOISES[noise][0], moment_noise=NOISES[noise][1])
    scan = tb.scan(contour, drive_angles=ANGLES + rng.uniform(0.0, np.radians(1.0)))
    measured = cell.measure(scan.record, rng=rng)
    began = time.perf_counter()
    rig = tb.Rig(load_cell=cell)
    result = tb.infer_contour(measured, family="shape-free", rig=rig, rng=number, settings=SETTINGS)
    seconds = time.perf_counter() - began
    gap, touched = gap_and_touched(scan)
    in_gap, width, off = compared(result, contour, gap)
    out_of_gap, _, _ = compared(result, contour, touched)
    known_width = np.nan
    if truth.family is not None:
        known = tb.infer_contour(measured, family=truth.family, rig=rig, rng=number, settings=SETTINGS)
        _, known_width, _ = compared(known, contour, gap)
    passed = bool(tb.check(result).predictive.passed)
    return Outcome(in_gap, out_of_gap, width, off, known_width, seconds, bool(result.attrs["converged"]), passed)


def gap_and_touched(scan: Scan) -> tuple[Floats, Floats]:
    """Return grid points in the gap, and beside it as far as first contact."""
    forward, backward = scan.events["forward"], scan.events["backward"]
    left, right = sorted([backward.snap_off.contact_x, forward.snap_off.contact_x])
    sides = [
        np.linspace(event.snap_off.contact_x, event.first_contact.contact_x, PLACES + 1)[1:]
        for event in (forward, backward)
    ]
    return np.linspace(left, right, PLACES + 2)[1:-1], np.concatenate(sides)


def compared(result: xr.DataTree, contour: Contour, x: Floats) -> tuple[float, float, float]:
    """Return the share of grid points at which a band holds, its mean width, and its median's largest error."""
    band = tb.contour_band(result, x, PROBABILITY)
    height = contour.height(x)
    inside = (band.lower.values <= height) & (height <= band.upper.values)
    width, off = (band.upper - band.lower).mean(), np.abs(band["median"] - height).max()
    return float(np.mean(inside)), float(width), float(off)


if __name__ == "__main__":
    counts, names = counts_and_names(sys.argv[1:])
    main(*[*counts, *(4, 2)[len(counts) :]], *names)

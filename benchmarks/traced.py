"""Prints how often the rest curvature of a drawn rod lies in the interval of 90 % that points along it imply.

Rods of nine kinds, from straight to sharply bent, are traced with 8 to 80 points, whose scatter is a 10,000th to a
200th of the length, and estimated or given. Columns: at eleven places, at both ends, in the mean; root mean square of
the errors over the standard deviations.

With the argument "records" it prints how often intervals of 90 % hold in posteriors of records, each swept with a rod
of its own, of which 25 points were traced with a scatter of a thousandth of the length; a number stands for that of
records. Results are kept in results/traced; "publish" also writes what the table needs to benchmarks/replicates.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.integrate import cumulative_simpson

import tactile_bayes as tb
from benchmarks.calibration import TRACED, load_cell, pooled, publish, table
from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.rods.traced import traced_rod

PLACES, FINE = np.linspace(0.0, 1.0, 11), np.linspace(0.0, 1.0, 2001)
POINTS, SCATTERS = (8, 12, 30, 80), (1e-4, 1e-3, 5e-3)
QUANTILE = 1.645
OUT, NOISE = Path("results/traced"), "usual"
SWEPT = ("linear", "quadratic", "smooth over 0.5", "smooth over 1.0")

Curvature = Callable[[Floats], Floats]


def waves(rng: np.random.Generator, length: float) -> Curvature:
    """Draw a random function with a correlation length."""
    rates, phases = rng.normal(0.0, 1.0 / length, 40), rng.uniform(0.0, 2.0 * np.pi, 40)
    size = rng.uniform(0.3, 2.0) * np.sqrt(2.0 / 40.0)
    return lambda s: np.asarray(size * np.cos(np.multiply.outer(s, rates) + phases).sum(axis=-1))


def polynomial(rng: np.random.Generator, *sizes: float) -> Curvature:
    powers = rng.normal(0.0, sizes)
    return lambda s: np.asarray(np.polynomial.polynomial.polyval(s - 0.5, powers))


def bend(rng: np.random.Generator) -> Curvature:
    where, size = rng.uniform(0.5, 0.8), rng.uniform(1.0, 3.0)
    return lambda s: 0.5 * size * (1.0 + np.tanh((s - where) / 0.1))


def wavy(rng: np.random.Generator) -> Curvature:
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return lambda s: 2.0 * np.cos(5.0 * s + phase)


KINDS: dict[str, Callable[[np.random.Generator], Curvature]] = {
    "straight": lambda rng: polynomial(rng, 0.0),
    "arc": lambda rng: polynomial(rng, 1.0),
    "linear": lambda rng: polynomial(rng, 1.0, 2.0),
    "quadratic": lambda rng: polynomial(rng, 1.0, 2.0, 4.0),
    "wavy": wavy,
    "bent within a fifth": bend,
    **{f"smooth over {length}": lambda rng, length=length: waves(rng, length) for length in (0.2, 0.5, 1.0)},
}


def points(curvature: Curvature, count: int, scatter: float, rng: np.random.Generator) -> tuple[Floats, Floats, float]:
    """Trace a rod, and return its turn from base to tip, too."""
    turn = cumulative_simpson(curvature(FINE), x=FINE, initial=0.0)
    x, y = (cumulative_simpson(way, x=FINE, initial=0.0) for way in (np.cos(turn), np.sin(turn)))
    x, y = (np.interp(np.linspace(0.0, 1.0, count), FINE, v) + rng.normal(0.0, scatter, count) for v in (x, y))
    return x, y, float(turn[-1])


def main(rods: int = 12) -> None:
    print(f"{len(POINTS) * len(SCATTERS) * rods} rods of each kind; scatter estimated, and given\n")
    every: dict[bool, list[Floats]] = {False: [], True: []}
    for number, (name, draw) in enumerate(KINDS.items()):
        for is_given in every:
            errors, refused = [], 0
            for count, scatter, k in product(POINTS, SCATTERS, range(rods)):
                rng = np.random.default_rng([number, count, round(1e6 * scatter), k])
                curvature = draw(rng)
                x, y, turn = points(curvature, count, scatter, rng)
                try:
                    rod = traced_rod(x, y, scatter=scatter if is_given else None)
                except ParameterError:
                    refused += 1
                    continue
                off = cumulative_simpson(rod.rest_curvature(FINE), x=FINE)[-1] - turn
                at_places = (rod.rest_curvature(PLACES) - curvature(PLACES)) / rod.deviation(PLACES)
                errors.append(np.append(at_places, off / rod.deviation_of_mean))
            every[is_given] += errors
            print(row(name if not is_given else "", errors) + (f"  {refused} refused" if refused else ""), flush=True)
    for errors in every.values():
        print(row("all", errors))


def row(name: str, errors: list[Floats]) -> str:
    z = np.array(errors)
    shares = [np.mean(np.abs(part) < QUANTILE) for part in (z[:, :-1], z[:, [0, -2]], z[:, -1])]
    return f"{name:<22}" + "".join(f"{share:>8.0%}" for share in shares) + f"{np.sqrt(np.mean(z**2)):>8.2f}"


def swept_rods(number: int) -> tuple[tb.Rod, tb.Rod]:
    """Draw a rod that leads away from its base all along, and trace it."""
    rng = np.random.default_rng([2026, number])
    while True:
        curvature = KINDS[SWEPT[number % len(SWEPT)]](rng)
        try:
            rod = tb.Rod(rest_curvature=curvature)
        except ParameterError:
            continue
        return rod, tb.Rod.from_shape(*points(curvature, 25, 1e-3, rng)[:2])


def records(count: int) -> xr.Dataset:
    return pooled("traced", NOISE, (record(number, *swept_rods(number)) for number in range(count)))


def record(number: int, true: tb.Rod, traced: tb.Rod) -> xr.Dataset:
    """Calibrate by one replicate, or read it."""
    cell, out = load_cell(NOISE), OUT / str(number)
    rig, truth = tb.Rig(traced, cell), tb.Rig(true, cell)
    one = tb.calibrate("parabola", rig, truth=truth, replicates=1, rng=number, out=out)
    print(f"record {number}: {str(one.message.values[0]).partition(':')[0]}", flush=True)
    return one


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    if "records" in sys.argv:
        calibration = records(*(numbers or [TRACED["traced"].replicates]))
        print(f"{table(NOISE, {'traced': calibration})}\n\n{calibration.attrs['verdict']}")
        if "publish" in sys.argv:
            publish("traced", NOISE, calibration)
    else:
        main(*numbers)

"""Prints whether posteriors of contours are calibrated: ranks of the truth, and coverage of bands, in the gap and out.

Truths are drawn from the prior, of the contour and of everything that is not known of the rig by default, records are
simulated of them and posteriors inferred. If the posterior is right, ranks of the truth among its draws are uniform
(Talts et al. 2018, arXiv:1804.06788), and bands of 90 % hold the true contour in nine of ten places.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy import stats

import tactile_bayes as tb
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.family_names import family_named
from tactile_bayes.inference.noise import noise_of
from tactile_bayes.inference.nuisances import STANDARD, nuisances_of
from tactile_bayes.record import CHANNELS
from tactile_bayes.scanning import Scan
from tactile_bayes.tasks import run_tasks

Floats = NDArray[np.float64]

CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
ANGLES = np.radians(np.arange(0.0, 200.0, 2.0))
SIZE = stats.lognorm(s=0.4, scale=0.7)
PRIORS: dict[str, dict[str, Any]] = {
    "parabola": {"a": stats.lognorm(s=0.4, scale=0.6)},
    "circle": {"r": SIZE},
    "ellipse": {"a": SIZE, "b": SIZE},
}
VERTEX = {"q": stats.uniform(0.3, 0.4), "x_c": stats.norm(0.0, 0.1)}
SETTINGS = SamplerSettings(min_ess=400.0, max_r_hat=1.02, max_seconds=60.0)
DRAWS, BINS, PROBABILITY, PLACES = 99, 10, 0.9, 9


class Outcome(NamedTuple):
    """Of one replicate."""

    ranks: Mapping[str, int]
    in_gap: float
    """Share of the places in the gap at which the band holds the true contour."""
    out_of_gap: float
    converged: bool
    seconds: float


def main(replicates: int = 200, workers: int = 2) -> None:
    tasks = [(list(PRIORS)[k % len(PRIORS)], k) for k in range(replicates)]
    outcomes: dict[str, list[Outcome]] = {family: [] for family in PRIORS}
    for (family, _), outcome in run_tasks(replicate, tasks, workers=workers):
        outcomes[family].append(outcome)
        if sys.stderr.isatty():
            print(f"\r{sum(map(len, outcomes.values()))} of {replicates}", end="", file=sys.stderr)
    print(f"{'':<12}{'replicates':>11}{'converged':>11}{'mean time':>11}{'longest':>10}", end="")
    print(f"{'band, in the gap':>22}{'out of the gap':>22}")
    for family, of_family in outcomes.items():
        print(f"{family:<12}{len(of_family):>11}{np.mean([o.converged for o in of_family]):>11.0%}", end="")
        seconds = [o.seconds for o in of_family]
        print(f"{np.mean(seconds):>9.1f} s{max(seconds):>8.1f} s", end="")
        for shares in ([o.in_gap for o in of_family], [o.out_of_gap for o in of_family]):
            print(f"{np.nanmean(shares):>14.3f} ± {np.nanstd(shares) / np.sqrt(len(shares)):.3f}", end="")
        print()
    print(
        f"\nRanks of the truth in {BINS} classes, expected {replicates / BINS:.0f} in each, and p-value of chi-square:"
    )
    every = [outcome for of_family in outcomes.values() for outcome in of_family]
    for name in dict.fromkeys(name for outcome in every for name in outcome.ranks):
        ranks = [outcome.ranks[name] for outcome in every if name in outcome.ranks]
        counts = np.bincount(np.array(ranks) * BINS // (DRAWS + 1), minlength=BINS)
        print(f"{name:<20}" + "".join(f"{count:>4}" for count in counts) + f"   {stats.chisquare(counts).pvalue:.3f}")


def replicate(task: tuple[str, int]) -> Outcome:
    """Draw a truth, simulate its record, infer, and compare."""
    name, number = task
    rng = np.random.default_rng([2026, number])
    family, priors = family_named(name), PRIORS[name] | VERTEX
    model = model_of(name, priors)
    point, _ = model.draw_prior(rng, 1)
    truth = dict(zip(model.names, point[0].tolist(), strict=True))
    contour = family.build(*(truth[parameter] for parameter in family.parameters))
    scan = tb.scan(contour, drive_angles=ANGLES - truth["drive_angle_offset"])
    measured = sensed(truth).measure(as_read(scan.record, truth), seed=rng)
    began = time.perf_counter()
    result = tb.infer_contour(
        measured, family=name, load_cell=CELL, priors=priors, seed=int(rng.integers(2**32)), settings=SETTINGS
    )
    seconds = time.perf_counter() - began
    draws = result["posterior"].to_dataset()
    picked = rng.choice(draws.sizes["chain"] * draws.sizes["draw"], DRAWS, replace=False)
    ranks = {
        parameter: int(np.sum(draws[parameter].values.ravel()[picked] < value)) for parameter, value in truth.items()
    }
    gap, touched = gap_and_touched(scan)
    in_gap, out_of_gap = (held(result, contour, x) for x in (gap, touched))
    return Outcome(ranks, in_gap, out_of_gap, bool(result.attrs["converged"]), seconds)


def model_of(name: str, priors: Mapping[str, Any]) -> ContourModel:
    """What is inferred, of any record: its prior alone is used."""
    record = tb.scan(tb.contours.Parabola(0.5, 0.5), drive_angles=ANGLES).record
    noise = noise_of(record, CELL)
    rig = nuisances_of(record, STANDARD, {}, CELL, 0.0)
    return ContourModel(record, family_named(name), rig, noise, {**rig.priors, **noise.priors, **priors})


def as_read(record: xr.Dataset, truth: Mapping[str, float]) -> xr.Dataset:
    """Loads of a rod of another stiffness, and drive angles as the encoder reads them."""
    read: dict[str, Any] = {channel: truth["rigidity_scale"] * record[channel] for channel in CHANNELS}
    return record.assign(**read, drive_angle=record.drive_angle + truth["drive_angle_offset"])


def sensed(truth: Mapping[str, float]) -> tb.LoadCell:
    """The load cell as it is."""
    scale = truth["noise_scale"]
    bias = truth["moment_bias"], truth["force_x_bias"], truth["force_y_bias"]
    return tb.LoadCell(force_noise=scale * CELL.force_noise, moment_noise=scale * CELL.moment_noise, bias=bias)


def gap_and_touched(scan: Scan) -> tuple[Floats, Floats]:
    """Places in the gap, and beside it as far as first contact."""
    forward, backward = scan.events["forward"], scan.events["backward"]
    left, right = sorted([backward.snap_off.contact_x, forward.snap_off.contact_x])
    sides = [
        np.linspace(event.snap_off.contact_x, event.first_contact.contact_x, PLACES + 1)[1:]
        for event in (forward, backward)
    ]
    return np.linspace(left, right, PLACES + 2)[1:-1], np.concatenate(sides)


def held(result: xr.DataTree, contour: tb.contours.Contour, x: Floats) -> float:
    band = tb.contour_band(result, x, PROBABILITY)
    height = contour.height(x)
    return float(np.mean((band.lower.values <= height) & (height <= band.upper.values)))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

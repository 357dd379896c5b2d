"""Prints the confusion of shapes, and the calibration of probabilities, over objects of known shape.

Objects are drawn from the priors by which families are compared, as many of each family, records of them simulated and
all families compared. If the probabilities are right, of the families that are given a probability of 30 %, three of
ten are the true one.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy import stats

import tactile_bayes as tb
from benchmarks.table import line, results
from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.contours import Circle, Contour, Joined
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.parameters.priors import matched_priors
from tactile_bayes.rig import NOTHING

FAMILIES = ("parabola", "circle", "ellipse", "power-law", "power-law/power-law", "shape-free")
NONE = "edge"  # two arcs that meet at an angle
KINDS = (*FAMILIES, NONE)
NOISES = {"quiet": (0.02, 0.008), "strong": (0.15, 0.06)}  # noise of forces [EI/L²] and of the moment [EI/L]
ANGLES = np.radians(np.arange(0.0, 200.0, 2.0))
VERTEX = {"q": stats.uniform(0.3, 0.4), "x_c": stats.norm(0.0, 0.1)}
UNKNOWN = {**NOTHING, "bias": "default"}
SETTINGS = SamplerSettings(ensembles=2, min_ess=300.0, max_r_hat=1.03, max_steps=300)
BINS = np.array([0.0, 0.02, 0.1, 0.3, 0.7, 0.9, 0.98, 1.0])


class Outcome(NamedTuple):
    """Outcome for one object."""

    probability: Floats  # probability by family; NaN if unknown
    fits: Flags
    seconds: float


def main(objects: int = 200, workers: int = 2) -> None:
    tasks = [(KINDS[k // 2 % len(KINDS)], list(NOISES)[k % 2], k) for k in range(objects)]
    outcomes: dict[tuple[str, str], list[Outcome]] = {(kind, noise): [] for noise in NOISES for kind in KINDS}
    for (kind, noise, _), outcome in results(recognised, tasks, workers):
        outcomes[kind, noise].append(outcome)
    for noise in NOISES:
        print(
            f"\n{noise}: rows what it was, columns the most probable, or that none fits; then mean of its probability"
        )
        print(line("", (*FAMILIES, "none fits", "no answer", "mean time"), 22, 21))
        for kind in KINDS:
            print(line(kind, _row(kind, outcomes[kind, noise]), 22, 21))
    print_calibration({kind: outcomes[kind, "quiet"] + outcomes[kind, "strong"] for kind in FAMILIES})


def print_calibration(outcomes: Mapping[str, list[Outcome]]) -> None:
    print("\nProbability stated, how often, and how often it was this family:")
    known = [(k, o.probability) for k, of in outcomes.items() for o in of if np.isfinite(o.probability).all()]
    values = np.concatenate([probability for _, probability in known])
    is_true = np.concatenate([np.array(FAMILIES) == kind for kind, _ in known])
    for low, high in itertools.pairwise(BINS):
        inside = (values >= low) & ((values < high) | (high == 1.0))
        if inside.any():
            said, was, count = values[inside].mean(), is_true[inside].mean(), int(inside.sum())
            error = np.sqrt(said * (1.0 - said) / count)
            print(f"{low:>5.2f} to {high:.2f}{count:>6}   stated {said:.3f}   true {was:.3f} ± {error:.3f}")
    score = np.log(np.maximum(values[is_true], 1e-300))
    print(f"mean log-probability of the truth {score.mean():.3f} (of guesses {-np.log(len(FAMILIES)):.3f})")


def _row(kind: str, of_kind: list[Outcome]) -> list[str]:
    counts = np.zeros(len(FAMILIES) + 2, dtype=int)
    for outcome in of_kind:
        if not outcome.fits.any():
            counts[-2] += 1
        elif np.isnan(outcome.probability).any():
            counts[-1] += 1
        else:
            counts[int(np.argmax(outcome.probability))] += 1
    cells = [str(count) if count else "·" for count in counts]
    if kind in FAMILIES and of_kind:
        own = FAMILIES.index(kind)
        cells[own] += f" ({np.nanmean([outcome.probability[own] for outcome in of_kind]):.2f})"
    return [*cells, f"{np.mean([o.seconds for o in of_kind]) if of_kind else 0.0:.1f} s"]


def recognised(task: tuple[str, str, int]) -> Outcome:
    """Draw an object, simulate its record, and compare families."""
    kind, noise, number = task
    rng = np.random.default_rng([2028, number])
    cell = tb.LoadCell(force_noise=NOISES[noise][0], moment_noise=NOISES[noise][1])
    contour = _neither(rng) if kind == NONE else _drawn(kind, cell, rng)
    measured = cell.measure(tb.scan(contour, drive_angles=ANGLES).record, rng=rng)
    began = time.perf_counter()
    result = tb.compare_families(
        measured,
        [tb.Family(family, **VERTEX) for family in FAMILIES],
        tb.Rig(load_cell=cell, unknown=UNKNOWN),
        rng=int(rng.integers(2**32)),
        leave_one_out=False,
        settings=SETTINGS,
    )
    return Outcome(result.probability.values, result.fits.values, time.perf_counter() - began)


def _drawn(family: str, cell: tb.LoadCell, rng: np.random.Generator) -> Contour:
    """Draw from the prior, within reach."""
    record = tb.scan(tb.contours.Parabola(0.5, 0.5), drive_angles=ANGLES).record
    priors = {**matched_priors(family, 1.0), **VERTEX}
    model = Experiment(record, tb.Rig(load_cell=cell, unknown=UNKNOWN), tb.Family(family, **priors)).model
    points, _ = model.draw_prior(rng, 1)
    return model.contours(points).take(0)


def _neither(rng: np.random.Generator) -> Contour:
    """Two circular arcs with a corner between them, whose slope jumps from one side to the other."""
    q, tilts, radii = rng.uniform(0.4, 0.6), rng.uniform(0.2, 0.45, 2), rng.uniform(0.6, 1.5, 2)
    left, right = (
        Circle(r, q - r * (1.0 - np.cos(tilt)), sign * r * np.sin(tilt))
        for sign, tilt, r in zip((1.0, -1.0), tilts, radii, strict=True)
    )
    return Joined(left, right, x=0.0)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

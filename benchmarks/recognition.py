"""Prints the confusion of shapes, and the calibration of probabilities, over objects of known shape.

Objects are drawn from the priors by which families are compared, as many of each family, records of them simulated and
all families compared. If the probabilities are right, of the families that are given a probability of 30 %, three of
ten are the true one.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

import tactile_bayes as tb
from tactile_bayes.arrays import Flags, Floats
from tactile_bayes.contours import Circle, Contour, Joined
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.parameters.priors import matched_priors
from tactile_bayes.rig import NOTHING
from tactile_bayes.tasks import run_tasks

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
    outcomes = []
    for (kind, noise, _), outcome in run_tasks(recognised, tasks(objects), workers=workers):
        outcomes.append((kind, noise, outcome))
        if sys.stderr.isatty():
            print(f"\r{len(outcomes)} of {objects}", end="", file=sys.stderr)
    report(outcomes)


def tasks(objects: int) -> list[tuple[str, str, int]]:
    """Return tasks, kinds and noises in turn."""
    return [(KINDS[k // 2 % len(KINDS)], list(NOISES)[k % 2], k) for k in range(objects)]


def report(found: Sequence[tuple[str, str, Outcome]]) -> None:
    outcomes: dict[tuple[str, str], list[Outcome]] = {(kind, noise): [] for noise in NOISES for kind in KINDS}
    for kind, noise, outcome in found:
        outcomes[kind, noise].append(outcome)
    for noise in NOISES:
        print(
            f"\n{noise}: rows what it was, columns the most probable, or that none fits; then mean of its probability"
        )
        print(f"{'':<22}" + "".join(f"{head:>21}" for head in (*FAMILIES, "none fits", "no answer", "mean time")))
        for kind in KINDS:
            print(f"{kind:<22}" + "".join(f"{cell:>21}" for cell in _row(kind, outcomes[kind, noise])))
    print("\nProbability stated, how often, and how often it was this family:")
    stated, true = [], []
    for (kind, _), of_kind in outcomes.items():
        if kind == NONE:
            continue
        for outcome in of_kind:
            if np.isfinite(outcome.probability).all():
                stated.append(outcome.probability)
                true.append(np.arange(len(FAMILIES)) == FAMILIES.index(kind))
    values, is_true = np.concatenate(stated), np.concatenate(true)
    for low, high in itertools.pairwise(BINS):
        inside = (values >= low) & ((values < high) | (high == 1.0))
        if inside.any():
            said, was, count = values[inside].mean(), is_true[inside].mean(), int(inside.sum())
            print(
                f"{low:>5.2f} to {high:.2f}{count:>6}   stated {said:.3f}   true {was:.3f} ± {_error(said, count):.3f}"
            )
    score = np.log(np.maximum(values[is_true], 1e-300))
    print(f"mean log-probability of the truth {score.mean():.3f} (of guesses {-np.log(len(FAMILIES)):.3f})")


def _row(kind: str, of_kind: list[Outcome]) -> list[str]:
    counts, means = np.zeros(len(FAMILIES) + 2, dtype=int), []
    for outcome in of_kind:
        if not outcome.fits.any():
            counts[-2] += 1
        elif np.isnan(outcome.probability).any():
            counts[-1] += 1
        else:
            counts[int(np.argmax(outcome.probability))] += 1
        if kind in FAMILIES:
            means.append(outcome.probability[FAMILIES.index(kind)])
    mean = f" ({np.nanmean(means):.2f})" if means else ""
    cells = [str(count) if count else "·" for count in counts]
    if kind in FAMILIES:
        cells[FAMILIES.index(kind)] += mean
    return [*cells, f"{np.mean([o.seconds for o in of_kind]) if of_kind else 0.0:.1f} s"]


def _error(share: float, count: int) -> float:
    return float(np.sqrt(share * (1.0 - share) / count))


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

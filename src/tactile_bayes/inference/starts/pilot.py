"""Short pilot runs, which make nearly standard normal coordinates of a posterior more so."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.coordinates.base import in_coordinates
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import LogProbability
from tactile_bayes.inference.ensembles.moves import moves_in
from tactile_bayes.inference.ensembles.run_state import Block, make_block
from tactile_bayes.inference.ensembles.walkers import first_random_state
from tactile_bayes.inference.shape_free_posterior.whitening import Whitening

_STEPS = (40, 80, 160, 320)  # of each pilot run
# Gain of mean log-density by a further change of these coordinates, and share of the steps that move a walker, below
# and above which no further run is made.
_GOOD_GAIN, _GOOD_MOVING = 0.3, 0.55
_MIN_VARIANCE = 1e-3  # of these coordinates that is believed


def standardise(
    log_probability: LogProbability,
    base: Whitening,
    start: Floats,
    columns: slice,
    rng: np.random.Generator,
    deadline: Deadline = NEVER,
) -> tuple[Whitening, Floats]:
    """Return coordinates nearer to standard normal, by pilot runs, and the start, (ensembles, walkers, d), in them."""
    random = first_random_state(np.random.SeedSequence(int(rng.integers(2**63))))
    best, start, points = base, start.copy(), start[0]
    for steps in _STEPS:
        if deadline.has_passed:
            break
        density = in_coordinates(log_probability, best)
        first = Block(points[None, None], density(points)[None, None], (random,))
        block = make_block(density, moves_in(best), first, steps, deadline)
        if not block.whole:
            raise KeyboardInterrupt
        (random,), points = block.random_states, block.samples[0, -1].copy()
        late = np.swapaxes(block.samples[0, block.steps // 2 :], 0, 1)
        normal, gain = _cross_validated(late[..., columns])
        best = best.standardised(normal.mean, normal.root)
        for each in (start, points):
            each[..., columns] = normal.standard(each[..., columns])
        moving = np.mean(np.any(np.diff(late, axis=1) != 0.0, axis=-1))
        if moving > _GOOD_MOVING and gain < _GOOD_GAIN:
            break
    return best, start


class _Normal(NamedTuple):
    """Normal distribution of coordinates that should be nearly standard normal."""

    mean: Floats
    root: Floats

    @classmethod
    def fitted(cls, draws: Floats, independent: float) -> _Normal:
        """Return the distribution fitted to draws, (n, k), as many of which as said are independent.

        Only principal axes count whose variances differ from one by more than that number explains (Marchenko & Pastur
        1967, doi 10.1070/SM1967v001n04ABEH001994), less their bias (Baik & Silverstein 2006, doi
        10.1016/j.jmva.2005.08.003).
        """
        variances, axes = np.linalg.eigh(np.cov(draws.T))
        variances = np.maximum(variances, _MIN_VARIANCE)  # if few walkers have moved
        ratio = variances.size / independent
        unlike = np.abs(np.sqrt(variances) - 1.0) > np.sqrt(ratio)
        variances, axes = variances[unlike], axes[:, unlike]
        twice = variances + 1.0 - ratio
        true = 0.5 * (twice + np.sign(variances - 1.0) * np.sqrt(np.maximum(twice**2 - 4.0 * variances, 0.0)))
        root = np.sqrt(np.maximum(true, _MIN_VARIANCE))
        return cls(draws.mean(axis=0), np.eye(draws.shape[1]) + axes * (root - 1.0) @ axes.T)

    def gain(self, draws: Floats) -> float:
        """Return by how much the mean log-density of draws, (n, k), exceeds that of the standard normal one."""
        squares = np.mean(np.sum(draws**2 - self.standard(draws) ** 2, axis=1))
        return float(0.5 * squares - np.linalg.slogdet(self.root).logabsdet)

    def standard(self, points: Floats) -> Floats:
        """Return points, (…, k), standardised by this distribution."""
        return np.asarray(np.linalg.solve(self.root, (points - self.mean)[..., None])[..., 0])


def _cross_validated(draws: Floats) -> tuple[_Normal, float]:
    """Return a normal distribution fitted to draws (walkers, steps, k), and its gain for draws of other walkers.

    How many draws are independent is the number with which a fit to each half of the walkers suits the other best.
    """
    halves = [half.reshape(-1, draws.shape[-1]) for half in np.array_split(draws, 2)]
    gains = {}
    for number in len(draws) * 2.0 ** np.arange(-1, 8):
        fits = [_Normal.fitted(half, 0.5 * number) for half in halves]
        gains[number] = float(np.mean([fit.gain(other) for fit, other in zip(fits, halves[::-1], strict=True)]))
    best = max(gains, key=gains.__getitem__)
    return _Normal.fitted(np.concatenate(halves), best), gains[best]

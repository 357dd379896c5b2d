"""The proposals by which walkers move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import emcee
import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.coordinates import Coordinates
from tactile_bayes.inference.densities import LogProbability, Mixture, Proposal

Moves = Sequence[tuple[Any, float]]  # moves of an ensemble, with their shares. They keep nothing from step to step.
_MIN_NEW_SHARE, _WHOLLY_NEW = 0.2, 0.5  # least share of the new draw in a step, and the probability that it is all
_SHORT_SCALE = 0.25  # scale of short differences over the usual scale, for targets along bent ridges or between bounds
_MAX_FIXED_SHARE, _EFFICIENT = 0.8, 0.5  # share of a fixed proposal at most, and its efficiency from which that applies


def step_ensembles(
    target: LogProbability, moves: Moves, randoms: Sequence[np.random.RandomState], points: Floats, values: Floats
) -> tuple[Floats, Floats]:
    """Return points, (chain, walker, parameter), and their log-density, (chain, walker), after a step of all ensembles.
    Each moves by halves with its own random numbers, as if alone, while the target is evaluated for all at once."""
    points, values = points.copy(), values.copy()
    shares = np.array([share for _, share in moves])
    chosen, halves = [], []
    for random, ensemble in zip(randoms, points, strict=True):
        chosen.append(random.choice([move for move, _ in moves], p=shares / shares.sum()))
        chosen[-1].setup(ensemble)
        halves.append(np.arange(len(ensemble)) % 2)
        random.shuffle(halves[-1])
    for half in range(2):
        moving = [each == half for each in halves]
        proposed = [
            move.get_proposal(ensemble[some], [ensemble[~some]], random)
            for move, ensemble, some, random in zip(chosen, points, moving, randoms, strict=True)
        ]
        densities = np.split(target(np.concatenate([there for there, _ in proposed])), len(points))
        for k, ((there, factors), some, density) in enumerate(zip(proposed, moving, densities, strict=True)):
            with np.errstate(invalid="ignore"):  # from an impossible point, where rounding may put one, to another
                accepted = factors + density - values[k, some] > np.log(randoms[k].rand(len(density)))
            movers = np.flatnonzero(some)[accepted]
            points[k, movers], values[k, movers] = there[accepted], density[accepted]
    return points, values


class FittedMove(emcee.moves.RedBlueMove):
    """Proposals from a distribution, Student's t by default, fitted to the half of the ensemble that does not move.
    They leave the target invariant however bad the fit is (compare Boehl 2022, doi 10.2139/ssrn.4250395)."""

    def __init__(
        self, columns: slice = slice(None), fit: Callable[[Floats], Proposal | Mixture] = Proposal.fitted
    ) -> None:
        """Move the parameters in `columns` alone, by what `fit` returns for points, shape (n, parameters)."""
        super().__init__()
        self._columns = columns
        self._fit = fit

    def get_proposal(
        self, sample: Floats, complement: Sequence[Floats], random: np.random.RandomState
    ) -> tuple[Floats, Floats]:
        """Return proposals, (n, parameters), and the log of the backward over the forward proposal density, (n,)."""
        moving, others = sample[:, self._columns], np.concatenate(complement)[:, self._columns]
        proposed = sample.copy()
        try:
            proposal = self._fit(others)
        except np.linalg.LinAlgError:
            return proposed, np.full(len(moving), -np.inf)
        proposed[:, self._columns], density = proposal.draw(random, len(moving))
        return proposed, proposal.log_density(moving) - density


class NormalMove(emcee.moves.RedBlueMove):
    """Steps that leave a standard normal distribution invariant: a random share of the position and a new normal draw.
    See Cotter, Roberts, Stuart & White 2013, doi 10.1214/13-STS421; half of the steps are new draws."""

    def __init__(self, columns: slice) -> None:
        """Move the parameters in `columns` alone."""
        super().__init__()
        self._columns = columns

    def get_proposal(
        self, sample: Floats, complement: Sequence[Floats], random: np.random.RandomState
    ) -> tuple[Floats, Floats]:
        """Return proposals, (n, parameters), and the log of the backward over the forward proposal density, (n,)."""
        moving = sample[:, self._columns]
        new = random.uniform(_MIN_NEW_SHARE, 1.0, len(moving))
        new = np.where(random.rand(len(moving)) < _WHOLLY_NEW, 1.0, new)[:, None]
        there = np.sqrt(1.0 - new**2) * moving + new * random.standard_normal(moving.shape)
        proposed = sample.copy()
        proposed[:, self._columns] = there
        return proposed, 0.5 * np.sum(there**2 - moving**2, axis=1)


def moves_in(coordinates: Coordinates) -> Moves:
    """Return the moves of an ensemble in coordinates, with their shares."""
    return standard_moves(coordinates.proposal) if coordinates.bent is None else whitened_moves(coordinates.bent)


def standard_moves(proposal: Mixture | None = None) -> Moves:
    """Return the moves of an ensemble, with their shares: of a proposal the more, the more efficient it is."""
    if proposal is None:
        return [(FittedMove(), 0.7), (emcee.moves.DEMove(), 0.27), (emcee.moves.DEMove(gamma0=1.0), 0.03)]
    fixed = _MAX_FIXED_SHARE * np.sqrt(min(1.0, proposal.efficiency / _EFFICIENT))
    usual = 2.38 / np.sqrt(2.0 * proposal.size)
    moves = [
        (FittedMove(fit=lambda _: proposal), fixed),
        (FittedMove(), 0.2 * (1.0 - fixed)),
        (emcee.moves.DEMove(gamma0=usual), 0.4 * (1.0 - fixed)),
        (emcee.moves.DEMove(gamma0=_SHORT_SCALE * usual), 0.37 * (1.0 - fixed)),
        (emcee.moves.DEMove(gamma0=1.0), 0.03 * (1.0 - fixed)),
    ]
    return [move for move in moves if move[1]]


def whitened_moves(bent: int) -> Moves:
    """Return the moves for coordinates that are nearly independent and standard normal, except the first `bent`."""
    first, rest = slice(0, bent), slice(bent, None)
    return [
        (FittedMove(first), 0.3),
        (NormalMove(rest), 0.6),
        (emcee.moves.DEMove(), 0.08),
        (emcee.moves.DEMove(gamma0=1.0), 0.02),
    ]

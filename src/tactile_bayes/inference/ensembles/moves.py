"""The proposals by which walkers move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import emcee
import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.ensembles.proposal import Mixture, Proposal

__all__ = ["Abreast", "FittedMove", "FixedMove", "Moves", "NormalMove", "standard_moves", "whitened_moves"]

Moves = Callable[[], list[tuple[Any, float]]]
"""Makes the moves of one ensemble, with their shares."""

_LEAST_NEW = 0.2
"""Share that is new in the shortest step of `NormalMove`."""

_SMALL = 0.25
"""Of the usual scale of differences, where what is likely lies along bent ridges or between walls."""

_MOST_FIXED, _EFFICIENT = 0.8, 0.5
"""Share of proposals from a distribution of that efficiency or a better one."""


class Abreast(emcee.moves.Move):
    """Moves of several ensembles, whose walkers come one ensemble after the other.

    Each moves by halves, as emcee's moves do (Foreman-Mackey et al. 2013, doi 10.1086/670067), with moves and random
    numbers of its own, and so as if it were alone; but the target, which likes many points, is asked for all at once.
    """

    def __init__(self, moves: Sequence[Sequence[tuple[Any, float]]], randoms: Sequence[np.random.RandomState]) -> None:
        """`moves`: of each ensemble, with their shares."""
        self._moves = [[move for move, _ in each] for each in moves]
        shares = [np.array([share for _, share in each]) for each in moves]
        self._shares = [each / each.sum() for each in shares]
        self.randoms = randoms

    def propose(self, model: Any, state: emcee.State) -> tuple[emcee.State, NDArray[np.bool_]]:
        """The state after a step of every ensemble, and which walkers moved."""
        count, size = len(self.randoms), state.coords.shape[1]
        points, values = state.coords.reshape(count, -1, size), state.log_prob.reshape(count, -1)
        accepted = np.zeros(values.shape, dtype=bool)
        chosen, halves = [], []
        for moves, shares, random, place in zip(self._moves, self._shares, self.randoms, points, strict=True):
            chosen.append(random.choice(moves, p=shares))
            chosen[-1].setup(place)
            halves.append(np.arange(len(place)) % 2)
            random.shuffle(halves[-1])
        for half in range(2):
            moving = [each == half for each in halves]
            proposed = [
                move.get_proposal(place[some], [place[~some]], random)
                for move, place, some, random in zip(chosen, points, moving, self.randoms, strict=True)
            ]
            there, _ = model.compute_log_prob_fn(np.concatenate([place for place, _ in proposed]))
            for k, ((place, factors), some, value) in enumerate(
                zip(proposed, moving, np.split(there, count), strict=True)
            ):
                taken = factors + value - values[k, some] > np.log(self.randoms[k].rand(len(value)))
                movers = np.flatnonzero(some)[taken]
                points[k, movers], values[k, movers], accepted[k, movers] = place[taken], value[taken], True
        state.coords, state.log_prob = points.reshape(-1, size), values.ravel()
        return state, accepted.ravel()


class FixedMove(emcee.moves.RedBlueMove):
    """Proposals from one and the same distribution, whatever the walkers do.

    The nearer it is to the target the more of them are accepted, and a walker has forgotten where it was.
    """

    def __init__(self, proposal: Mixture) -> None:
        super().__init__()
        self._proposal = proposal

    def get_proposal(
        self, sample: Floats, complement: Sequence[Floats], random: np.random.RandomState
    ) -> tuple[Floats, Floats]:
        """Places proposed to walkers, (n, parameters), and log of the density back over that of going there, (n,)."""
        there, density = self._proposal.draw(random, len(sample))
        return there, self._proposal.log_density(sample) - density


class FittedMove(emcee.moves.RedBlueMove):
    """Proposals from Student's t distribution, fitted to the half of the ensemble that does not move meanwhile.

    Where a posterior is nearly normal, a walker forgets where it was in a few steps. The proposal depends on nothing
    that the moving half does, so that the target stays invariant however badly the fit is. Where the other half lies in
    a plane, nothing can be fitted, and nothing moves.

    Proposals of this kind beside those of differential evolution are from Boehl (2022), doi 10.2139/ssrn.4250395, who
    adapts them to the whole run instead.
    """

    def __init__(self, columns: slice = slice(None)) -> None:
        """Of the parameters in `columns`, the others staying as they are."""
        super().__init__()
        self._columns = columns

    def get_proposal(
        self, sample: Floats, complement: Sequence[Floats], random: np.random.RandomState
    ) -> tuple[Floats, Floats]:
        """Places proposed to walkers, (n, parameters), and log of the density back over that of going there, (n,)."""
        moving, others = sample[:, self._columns], np.concatenate(complement)[:, self._columns]
        proposed = sample.copy()
        try:
            proposal = Proposal.fitted(others)
        except np.linalg.LinAlgError:
            return proposed, np.full(len(moving), -np.inf)
        proposed[:, self._columns], density = proposal.draw(random, len(moving))
        return proposed, proposal.log_density(moving) - density


class NormalMove(emcee.moves.RedBlueMove):
    """Steps that leave a standard normal distribution invariant, of coordinates that the target makes nearly that.

    A step of random length keeps a share of where the walker is and draws the rest anew (Neal 1999; Cotter, Roberts,
    Stuart & White 2013, doi 10.1214/13-STS421); what the target adds to a standard normal one decides alone.
    """

    def __init__(self, columns: slice) -> None:
        """Of the parameters in `columns`, the others staying as they are."""
        super().__init__()
        self._columns = columns

    def get_proposal(
        self, sample: Floats, complement: Sequence[Floats], random: np.random.RandomState
    ) -> tuple[Floats, Floats]:
        """Places proposed to walkers, (n, parameters), and log of the density back over that of going there, (n,)."""
        moving = sample[:, self._columns]
        new = random.uniform(_LEAST_NEW, 1.0, len(moving))[:, None]
        there = np.sqrt(1.0 - new**2) * moving + new * random.standard_normal(moving.shape)
        proposed = sample.copy()
        proposed[:, self._columns] = there
        return proposed, 0.5 * np.sum(there**2 - moving**2, axis=1)


def standard_moves(proposal: Mixture | None = None) -> list[tuple[Any, float]]:
    """Moves of one ensemble and their shares, new ones for each ensemble, since a move keeps its scale between calls.

    Proposals fitted to the walkers where the posterior is nearly normal; differences of two other walkers, scaled and
    now and then unscaled, where it is not. Where there is a proposal that comes near the posterior anyway, it is used
    most, the more efficient it is; what it misses, one fitted to walkers would miss as well, and differences of other
    walkers, scaled far down, do not. All cut the ensemble in two halves, as `Abreast` does.
    """
    if proposal is None:
        return [(FittedMove(), 0.7), (emcee.moves.DEMove(), 0.27), (emcee.moves.DEMove(gamma0=1.0), 0.03)]
    fixed = _MOST_FIXED * np.sqrt(min(1.0, proposal.efficiency / _EFFICIENT))
    usual = 2.38 / np.sqrt(2.0 * proposal.size)
    moves = [
        (FixedMove(proposal), fixed),
        (FittedMove(), 0.2 * (1.0 - fixed)),
        (emcee.moves.DEMove(gamma0=usual), 0.4 * (1.0 - fixed)),
        (emcee.moves.DEMove(gamma0=_SMALL * usual), 0.37 * (1.0 - fixed)),
        (emcee.moves.DEMove(gamma0=1.0), 0.03 * (1.0 - fixed)),
    ]
    return [move for move in moves if move[1]]


def whitened_moves(bent: int) -> list[tuple[Any, float]]:
    """Those of an ensemble in coordinates that are nearly standard normal and independent, but for the first ones."""
    first, rest = slice(0, bent), slice(bent, None)
    return [
        (FittedMove(first), 0.35),
        (NormalMove(rest), 0.5),
        (emcee.moves.DEMove(), 0.12),
        (emcee.moves.DEMove(gamma0=1.0), 0.03),
    ]

"""The moves of particles, which adapt to how many of them are accepted."""

from __future__ import annotations

from functools import partial
from typing import Any

import emcee
import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.contour_model import ContourModel
from tactile_bayes.inference.densities import LogProbability, Mixture, Proposal
from tactile_bayes.inference.ensembles.moves import FittedMove, step_ensembles

__all__ = ["Mover"]

# Number of parts of the mixture by which particles along a bent ridge move: 0.28 of its proposals for the first 28
# samples of a double sweep were accepted, 0.20 of those of 4 parts, 0.29 of 12, and 0.05 of a single distribution.
_PARTS = 8
# Shares of accepted proposals below which a mixture takes the place of a single distribution, and above which a single
# one is tried again.
_POOR, _GOOD = 0.3, 0.45
# Shares of steps by differences of particles, and where hardly any proposal of a fitted distribution is accepted.
_DIFFERENCES, _MOSTLY_DIFFERENCES = 0.1, 0.5
_HARDLY = 0.1  # share of accepted proposals below which that is so
# Increase of the mean log-density in a step, over the standard error of that mean, of particles that are on their way
# to where the density is larger.
_RISING = 3.0


class Mover:
    """Moves particles by distributions fitted to half of them, now and then by differences.

    `rises` says whether the mean log-density rose in the last step of a fitted distribution by more than chance
    explains.
    """

    def __init__(self, model: ContourModel, random: np.random.RandomState) -> None:
        ends = model.walked_ends
        self.rises = False
        self._random = random
        self._single = FittedMove(fit=partial(Proposal.fitted, ends=ends))
        self._mixture = FittedMove(fit=partial(Mixture.fitted, bent=model.of_path, parts=_PARTS, ends=ends))
        self._fitted, self._accepted = self._single, 1.0

    def step(self, target: LogProbability, ensemble: Floats, density: Floats) -> tuple[Floats, Floats]:
        """Return the ensemble, shape (1, particles, coordinates), and its log-density after a step."""
        move = self._next()
        there, now = step_ensembles(target, [(move, 1.0)], [self._random], ensemble, density)
        if move is self._fitted:
            self._accepted = float(np.mean(np.any(there != ensemble, axis=-1)))
            self.rises = bool(now.mean() - density.mean() > _RISING * now.std() / np.sqrt(now.size))
        return there, now

    def _next(self) -> Any:
        """Return the next move, by what share of the proposals of the last fitted distribution was accepted."""
        by_differences = _DIFFERENCES if self._accepted > _HARDLY else _MOSTLY_DIFFERENCES
        if self._random.rand() < by_differences:
            return emcee.moves.DEMove()
        if self._fitted is self._single and self._accepted < _POOR:
            self._fitted = self._mixture
        elif self._fitted is self._mixture and self._accepted > _GOOD:
            self._fitted = self._single
        return self._fitted

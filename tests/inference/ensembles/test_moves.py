"""The moves against targets whose moments are known exactly."""

from dataclasses import replace
from functools import partial

import emcee
import numpy as np
import pytest

from tactile_bayes.inference.densities import Mixture, Proposal
from tactile_bayes.inference.ensembles.moves import FittedMove, NormalMove, standard_moves, whitened_moves
from tactile_bayes.inference.ensembles.run_state import Block, make_block
from tactile_bayes.inference.ensembles.walkers import first_random_state

WALKERS = 40  # of an ensemble; 5 for each of 8 parameters, and the default has 6


class Careless(FittedMove):
    """Takes its proposals for symmetric."""

    def get_proposal(self, sample, complement, random):
        proposed, factors = super().get_proposal(sample, complement, random)
        return proposed, np.zeros_like(factors)


MOVES = {
    "scaled": lambda: [(emcee.moves.DEMove(), 1.0)],
    "unscaled": lambda: [(emcee.moves.DEMove(gamma0=1.0), 1.0)],
    "fitted": lambda: [(FittedMove(), 1.0)],
    "pieces": lambda: [(FittedMove(fit=partial(Mixture.fitted, bent=[0, 1], parts=2)), 1.0)],
    "mixed": standard_moves,
    "careless": lambda: [(Careless(), 1.0)],
}


class Gaussian:
    """A correlated normal distribution, the first coordinate cut off at its mode if there is a wall."""

    def __init__(self, parameters: int, scale: float, *, wall: bool) -> None:
        rng = np.random.default_rng(parameters)
        root = scale * np.linalg.cholesky(0.4 * np.eye(parameters) + 0.6)  # correlations of 0.6
        self.root = root * np.exp(rng.normal(size=(parameters, 1)))
        self.wall = wall
        self.precision = np.linalg.inv(self.root @ self.root.T)
        # The first coordinate is root[0, 0] times the first of independent normal numbers; with a wall, times a
        # half-normal number, whose mean is √(2/π) and whose variance is 1 − 2/π.
        mean, variance = (np.sqrt(2.0 / np.pi), 1.0 - 2.0 / np.pi) if wall else (0.0, 1.0)
        self.mean = self.root[:, 0] * mean
        self.deviation = np.sqrt((self.root[:, 1:] ** 2).sum(axis=1) + self.root[:, 0] ** 2 * variance)

    def draw(self, rng, count):
        numbers = rng.normal(size=(count, len(self.root)))
        if self.wall:
            numbers[:, 0] = np.abs(numbers[:, 0])
        return numbers @ self.root.T

    def log_probability(self, x):
        value = -0.5 * ((x @ self.precision) * x).sum(axis=1)
        return np.where(x[:, 0] > 0.0, value, -np.inf) if self.wall else value


def moments(target: Gaussian, moves, *, ensembles: int, steps: int, watched: int = 0):
    """Mean less the true mean, and mean square about it less 1, in true sd; their standard errors: (2, parameters). The
    walkers start from the target itself, exactly, and a move that leaves it invariant keeps them there: every step
    counts, none is burnt. The error is that between ensembles, which are independent."""
    totals, moved = [], 0.0
    for own in np.random.SeedSequence(1).spawn(ensembles):
        first, second = own.spawn(2)
        start = target.draw(np.random.default_rng(first), WALKERS)
        values, random = target.log_probability(start), first_random_state(second)
        first = Block(start[None, None], values[None, None], (random,))
        samples = make_block(target.log_probability, moves(), first, steps).samples[0]
        moved += float(np.mean(samples[1:, :, watched] != samples[:-1, :, watched])) / ensembles
        centred = (samples - target.mean) / target.deviation
        totals.append([centred.mean(axis=(0, 1)), (centred**2).mean(axis=(0, 1)) - 1.0])
    assert moved > 0.05  # else nothing would be shown
    values = np.array(totals)
    return values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(ensembles)


def test_ensembles_abreast_walk_as_each_does_alone():
    """Bit by bit as emcee makes them go, one after the other."""
    target, rng = Gaussian(3, 1.0, wall=False), np.random.default_rng(5)
    starts = np.array([target.draw(rng, WALKERS) for _ in range(3)])
    randoms = tuple(first_random_state(own) for own in np.random.SeedSequence(6).spawn(3))
    values = np.array([target.log_probability(start) for start in starts])
    blocks = [Block(starts[:, None], values[:, None], randoms)]
    for steps in (20, 10):
        blocks.append(make_block(target.log_probability, standard_moves(), blocks[-1], steps))
    for k, (start, random) in enumerate(zip(starts, randoms, strict=True)):
        alone = emcee.EnsembleSampler(WALKERS, 3, target.log_probability, moves=standard_moves(), vectorize=True)
        state = alone.run_mcmc(emcee.State(start, random_state=random), 30)
        assert np.array_equal(np.concatenate([block.samples[k] for block in blocks[1:]]), alone.get_chain())
        assert np.array_equal(np.concatenate([block.log_probability[k] for block in blocks[1:]]), alone.get_log_prob())
        assert blocks[-1].random_states[k][2] == state.random_state[2]


@pytest.mark.slow
@pytest.mark.parametrize("moves", ["scaled", "unscaled", "fitted", "pieces", "mixed"])
@pytest.mark.parametrize(("parameters", "scale"), [(2, 1.0), (2, 1e-6), (8, 1.0), (8, 1e-6)])
@pytest.mark.parametrize("wall", [False, True])
def test_each_move_leaves_a_target_invariant(moves, parameters, scale, wall):
    """Within 4 standard errors of 64 ensembles: false alarm 2e-4 a number; 200 numbers, as scales give the same."""
    error, standard = moments(Gaussian(parameters, scale, wall=wall), MOVES[moves], ensembles=64, steps=60)
    assert np.all(standard < 0.05)
    assert np.all(np.abs(error) < 4.0 * standard)


@pytest.mark.slow
@pytest.mark.parametrize(("parameters", "wall"), [(2, False), (2, True), (8, False), (8, True)])
def test_proposals_from_elsewhere_leave_a_target_invariant(parameters, wall):
    """However badly they fit: off by half a deviation, and as wide in one direction as in every other."""
    target = Gaussian(parameters, 1.0, wall=wall)
    proposal = Proposal(target.mean + 0.5 * target.deviation, np.diag(1.2 * target.deviation))
    error, standard = moments(target, lambda: [(FittedMove(fit=lambda _: proposal), 1.0)], ensembles=64, steps=60)
    assert np.all(np.abs(error) < 4.0 * standard)
    moves = standard_moves(Mixture((replace(proposal, efficiency=0.2),)))
    assert sum(share for _, share in moves) == pytest.approx(1.0)
    error, standard = moments(target, lambda: moves, ensembles=64, steps=60)
    assert np.all(np.abs(error) < 4.0 * standard)


@pytest.mark.slow
@pytest.mark.parametrize("wall", [False, True])
@pytest.mark.parametrize(
    ("parameters", "moves"),
    [(2, lambda: [(NormalMove(slice(1, None)), 1.0)]), (8, lambda: whitened_moves(2))],
    ids=["normal", "whitened"],
)
def test_moves_of_some_coordinates_leave_a_target_invariant(parameters, moves, wall):
    """Within 4 standard errors of 32 ensembles, 40 numbers; a coordinate that is not moved stays as it was drawn."""
    error, standard = moments(Gaussian(parameters, 1.0, wall=wall), moves, ensembles=32, steps=50, watched=1)
    assert np.all(np.abs(error) < 4.0 * standard)


@pytest.mark.slow
def test_a_move_that_does_not_is_noticed():
    """One that forgets how probable its proposals are draws walkers together."""
    error, standard = moments(Gaussian(8, 1.0, wall=False), MOVES["careless"], ensembles=32, steps=50)
    assert np.all(error[1] < -4.0 * standard[1])

"""Straightened coordinates against a ridge that is bent by a known parabola."""

import numpy as np
import pytest

from helpers.interrupts import interrupted_at
from tactile_bayes.inference.coordinates.base import Logarithms, in_coordinates
from tactile_bayes.inference.coordinates.straightened import Straightened
from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.densities import Mixture, Proposal
from tactile_bayes.inference.importance import approximate
from tactile_bayes.inference.starts.pilot import learn_coordinates

SIZE = 6
POSITIVE = np.arange(SIZE) == 0
SCALE = np.ones(SIZE)
PLAIN = Logarithms(np.zeros(SIZE, dtype=bool))


def bent(points):
    """Logarithm of the density of a ridge: the first two coordinates are wide, the others lie along parabolas of them,
    and are ten times narrower."""
    inside = points[:, 0] > 0.0
    first, second = np.log(np.where(inside, points[:, 0], 1.0)), points[:, 1]
    parabola = 0.1 * first**2 - 0.07 * first * second + 0.05 * second**2
    rest = (points[:, 2:] - np.arange(1, SIZE - 1) * parabola[:, None]) / 0.1
    values = -0.5 * (first**2 + second**2 + np.sum(rest**2, axis=1)) - first
    return np.where(inside, values, -np.inf)


def drawn(count):
    """Exact draws of the bent ridge."""
    steps = np.random.default_rng(3).normal(size=(count, SIZE))
    parabola = 0.1 * steps[:, 0] ** 2 - 0.07 * steps[:, 0] * steps[:, 1] + 0.05 * steps[:, 1] ** 2
    rest = 0.1 * steps[:, 2:] + np.arange(1, SIZE - 1) * parabola[:, None]
    return np.column_stack([np.exp(steps[:, 0]), steps[:, 1], rest])


def acceptance(log_probability, coordinates, exact):
    """Share of proposals that walkers accept who are where the target is."""
    target, proposal = in_coordinates(log_probability, coordinates), coordinates.proposal
    points, density = proposal.draw(np.random.default_rng(2), len(exact))
    places = coordinates.of(exact)
    here, there = target(places) - proposal.log_density(places), target(points) - density
    return float(np.mean(np.exp(np.minimum(0.0, there - here))))


def scouts(width):
    """Where walkers begin, in parameters."""
    places = width * np.random.default_rng(5).normal(size=(36, SIZE)) * np.array([1.0, 1.0, *[0.1] * (SIZE - 2)])
    return Logarithms(POSITIVE).parameters(places)[0]


@pytest.fixture(scope="module")
def found():
    base, rng = Logarithms(POSITIVE), np.random.default_rng(4)
    target = in_coordinates(bent, base)
    straight = approximate(target, np.zeros(SIZE), np.diag([1.0, 1.0, *[0.1] * (SIZE - 2)]) ** 2, rng)
    return straight, learn_coordinates(bent, base.with_proposal(Mixture((straight,))), scouts(2.0), SCALE, rng)


def test_a_bent_ridge_is_made_normal(found):
    """Of proposals from a normal approximation of the ridge few are accepted, of the straightened one many."""
    straight, coordinates = found
    exact = drawn(5000)
    assert acceptance(bent, coordinates.base.with_proposal(Mixture((straight,))), exact) < 0.15
    assert acceptance(bent, coordinates, exact) > 0.3


def test_directions_that_turn_about_one_another_are_followed():
    """Along the first coordinate, which is wide, the narrowest one shears a third."""
    narrow = np.array([1.0, *[0.1] * (SIZE - 2), 0.01])

    def sheared(points):
        steps = points / narrow
        steps[:, -1] -= 3.0 * steps[:, 0] * steps[:, 2]
        return -0.5 * np.sum(steps**2, axis=1)

    start = narrow * np.random.default_rng(5).normal(size=(36, SIZE))
    coordinates = learn_coordinates(sheared, PLAIN, start, SCALE, np.random.default_rng(4))
    exact = np.random.default_rng(3).normal(size=(5000, SIZE))
    exact[:, -1] += 3.0 * exact[:, 0] * exact[:, 2]
    assert acceptance(sheared, coordinates, narrow * exact) > 0.4


def test_coordinates_and_parameters_are_there_and_back(found):
    _, coordinates = found
    points = np.exp(0.3 * np.random.default_rng(3).normal(size=(4, 5, SIZE)))
    np.testing.assert_allclose(
        coordinates.parameters(coordinates.of(points).reshape(-1, SIZE))[0], points.reshape(-1, SIZE)
    )


def test_what_is_far_off_has_coordinates_that_are_numbers(found):
    """Parabolas of parabolas of parabolas."""
    _, coordinates = found
    far = coordinates.of(np.full((1, SIZE), 1e60))
    assert np.isfinite(far).all()
    assert np.isfinite(coordinates.proposal.log_density(far)).all()


def test_volumes_grow_as_is_said(found):
    """The Jacobian by differences, but for a constant."""
    _, coordinates = found
    places = np.random.default_rng(4).normal(size=(3, SIZE))
    said = coordinates.parameters(places)[1]
    step = 1e-5
    logs = []
    for place in places:
        more, less = (coordinates.parameters(place + sign * step * np.eye(SIZE))[0] for sign in (1.0, -1.0))
        logs.append(np.linalg.slogdet((more - less) / (2.0 * step))[1])
    np.testing.assert_allclose(np.diff(logs), np.diff(said), atol=1e-6)


def normal(points):
    return -0.5 * np.sum(points**2, axis=1)


def learned_of_a_normal(width, efficiency, deadline=NEVER):
    """What is made of a proposal so many times as wide as a standard normal posterior."""
    base = PLAIN.with_proposal(Mixture((Proposal(np.zeros(SIZE), width * np.eye(SIZE), efficiency),)))
    start = 2.0 * np.random.default_rng(5).normal(size=(36, SIZE))
    return learn_coordinates(normal, base, start, SCALE, np.random.default_rng(1), deadline)


def test_what_is_normal_already_is_left_alone():
    assert isinstance(learned_of_a_normal(1.1, 0.2), Logarithms)


def test_a_narrow_proposal_is_not_believed():
    """Its own draws hardly ever meet what it misses, so that they take it for nearly perfect."""
    coordinates = learned_of_a_normal(0.4, 0.99)
    assert isinstance(coordinates, Straightened)
    assert acceptance(normal, coordinates, np.random.default_rng(3).normal(size=(5000, SIZE))) > 0.5


def test_past_the_deadline_one_step_is_made():
    coordinates = learned_of_a_normal(0.4, 0.99, Deadline.after(0.0))
    assert isinstance(coordinates, Logarithms)
    assert coordinates.proposal.efficiency < 0.5


def test_an_interrupt_is_passed_on():
    start = np.random.default_rng(5).normal(size=(36, SIZE))
    with pytest.raises(KeyboardInterrupt):
        learn_coordinates(interrupted_at(11, normal), PLAIN, start, SCALE, np.random.default_rng(1))


def test_draws_of_which_the_nearest_lie_in_a_plane_are_refused():
    points = np.random.default_rng(6).normal(size=(2000, SIZE))
    flat = points.copy()
    flat[:1500, -1] = flat[:1500, 0]
    flat[1500:] *= 5.0
    with pytest.raises(np.linalg.LinAlgError):
        Straightened.fitted(PLAIN, flat, SCALE, len(flat))

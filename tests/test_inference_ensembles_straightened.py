"""Straightened coordinates against a ridge that is bent by a known parabola."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_bayes.inference.ensembles import Logarithms, in_coordinates, straightened
from tactile_bayes.inference.ensembles.proposal import Proposal, approximate
from tactile_bayes.inference.ensembles.straightened import Straightened

SIZE = 6
POSITIVE = np.arange(SIZE) == 0
SCALE = np.ones(SIZE)


def bent(points):
    """Logarithm of the density of a ridge: the first two coordinates are wide, the others lie along parabolas of them,
    and are ten times narrower."""
    inside = points[:, 0] > 0.0
    first, second = np.log(np.where(inside, points[:, 0], 1.0)), points[:, 1]
    parabola = 0.1 * first**2 - 0.07 * first * second + 0.05 * second**2
    rest = (points[:, 2:] - np.arange(1, SIZE - 1) * parabola[:, None]) / 0.1
    values = -0.5 * (first**2 + second**2 + np.sum(rest**2, axis=1)) - first
    return np.where(inside, values, -np.inf)


def true_efficiency(proposal, target):
    """By 20,000 draws; of fewer, one that misses a part of the target looks better than it is."""
    points, density = proposal.draw(np.random.default_rng(2), 20_000)
    surplus = target(points) - density
    weights = np.exp(surplus - surplus.max())
    return weights.sum() ** 2 / np.sum(weights**2) / len(points)


@pytest.fixture(scope="module")
def found():
    base, rng = Logarithms(POSITIVE), np.random.default_rng(4)
    target = in_coordinates(bent, base)
    straight = approximate(target, np.zeros(SIZE), np.diag([1.0, 1.0, *[0.1] * (SIZE - 2)]) ** 2, rng)
    return straight, straightened(bent, base, straight, SCALE, rng)


def test_a_bent_ridge_is_made_normal(found):
    """Of draws from a normal approximation of the ridge hardly any count, of the straightened one half do."""
    straight, coordinates = found
    assert true_efficiency(straight, in_coordinates(bent, coordinates.base.base)) < 0.02
    assert true_efficiency(coordinates.proposal, in_coordinates(bent, coordinates)) > 0.4


def test_coordinates_and_parameters_are_there_and_back(found):
    _, coordinates = found
    points = np.exp(0.3 * np.random.default_rng(3).normal(size=(4, 5, SIZE)))
    np.testing.assert_allclose(
        coordinates.parameters(coordinates.of(points).reshape(-1, SIZE))[0], points.reshape(-1, SIZE)
    )


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


def test_what_tells_coordinates_apart_is_what_they_follow_from(found):
    _, one = found
    other = Straightened(one.base, one.mean, one.root, one.bends + 1e-9, one.wide, one.proposal)
    assert one.digest != other.digest
    assert one.digest == Straightened(one.base, one.mean, one.root, one.bends, one.wide, one.proposal).digest


def test_what_is_normal_already_is_left_alone():
    def normal(points):
        return -0.5 * np.sum(points**2, axis=1)

    exact = Proposal(np.zeros(SIZE), np.eye(SIZE), 0.99)
    base = Logarithms(np.zeros(SIZE, dtype=bool))
    assert straightened(normal, base, exact, SCALE, np.random.default_rng(1)) is None

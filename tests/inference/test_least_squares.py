"""Robust least squares, for problems whose answer is known, and searches that end when their time is up."""

import time

import numpy as np
import pytest

from tactile_bayes.inference.deadline import NEVER, Deadline
from tactile_bayes.inference.least_squares import optima

PASSED = Deadline.after(0.0)
DESIGN = np.random.default_rng(1).normal(size=(50, 2))
TRUE = np.array([3.0, -0.02])
SPREAD = np.array([10.0, 0.1])
DATA = DESIGN @ (TRUE / SPREAD)
COVARIANCE = np.linalg.inv(DESIGN.T @ DESIGN + np.eye(2)) * np.outer(SPREAD, SPREAD)
ORIGIN = np.zeros((1, 2))


def best_optimum(residuals, candidates, middle=TRUE, spread=SPREAD, *bounds, **options):
    found = optima(residuals, np.asarray(candidates), middle, spread, *bounds, **options)
    return min(found, key=lambda each: each.cost)


def linear(data, scale=1.0):
    return lambda points: scale * (data - points / SPREAD @ DESIGN.T)


def test_optimum_of_a_linear_problem():
    data = DATA + 0.1 * np.random.default_rng(2).normal(size=50)
    found = best_optimum(linear(data), ORIGIN)
    # Residuals far below _HUBER_THRESHOLD: robust and plain least squares agree to their square over 4 · 2².
    expected = np.linalg.lstsq(DESIGN, data, rcond=None)[0] * SPREAD
    np.testing.assert_allclose(found.point, expected, rtol=0.02)
    np.testing.assert_allclose(found.covariance, COVARIANCE, rtol=0.02)
    np.testing.assert_allclose(found.residuals, linear(data)(found.point[None])[0])


def test_a_jump_at_the_optimum_is_no_slope():
    """A sample that lets go of the object right there does not say how sure the rest is."""

    def jumping(points):
        lost = np.where(points[:, :1] > TRUE[0] + 2e-5 * SPREAD[0], 20.0, 0.0)
        return np.hstack([linear(DATA)(points), lost])

    found = best_optimum(jumping, ORIGIN)
    assert abs(found.point[0] - TRUE[0]) < 5e-5 * SPREAD[0]
    np.testing.assert_allclose(found.covariance, COVARIANCE, rtol=0.02)


def test_an_outlier_pulls_little():
    found = best_optimum(linear(DATA + 1000.0 * (np.arange(50) == 7)), ORIGIN)
    # By least squares it would pull by 1000 · |design| / 50, some 20 spreads; so by about 2 · |design| / 50.
    assert np.all(np.abs(found.point - TRUE) < 0.2 * SPREAD)


def test_a_tight_prior_is_heeded():
    """Data say 3.0 with a deviation of about 10/√50; a prior that is a million times tighter wins."""
    found = best_optimum(linear(DATA), TRUE[None], np.array([2.0, -0.02]), np.array([1e-6, 0.1]))
    assert found.point[0] == pytest.approx(2.0, abs=1e-5)
    assert found.covariance[0, 0] == pytest.approx(1e-12, rel=0.5)


def test_the_better_of_two_valleys_is_taken():
    def residuals(points):
        return np.where(points > 0.0, points - 1.0, 0.25 * (points + 1.0) ** 2 + 2.0) + np.zeros((1, 3))

    for order in ([[-1.5], [0.7]], [[0.7], [-1.5]]):
        assert best_optimum(residuals, order, np.ones(1), np.ones(1)).point == pytest.approx(1.0)


def test_a_search_from_far_off_is_as_good_as_one_from_near():
    """Residuals of thousands pull by their squares at first, else forty steps would not lead here."""
    found = best_optimum(linear(DATA, scale=1e4), [100.0 * SPREAD])
    np.testing.assert_allclose(found.point, TRUE, rtol=1e-6)
    assert found.fits


def test_to_be_far_from_the_prior_costs_its_square():
    """One datum of ten deviations against a prior as sharp: both give way alike, though data alone may be outliers."""
    found = best_optimum(lambda p: 10.0 - p / SPREAD[:1], [np.zeros(1)], np.zeros(1), SPREAD[:1])
    robust = found.residuals[0] / np.sqrt(1.0 + (found.residuals[0] / 2.0) ** 2)
    assert found.point[0] / SPREAD[0] == pytest.approx(robust, rel=1e-4)


def test_a_search_that_ends_beyond_what_is_possible_goes_on_inside():
    """Of two parameters that are told apart by the data the one at its end stays there, the other moves freely."""
    free = best_optimum(linear(DATA), ORIGIN)
    low, high = free.point - np.array([10.0, 0.5]) * SPREAD, free.point + np.array([10.0, -0.1]) * SPREAD
    found = best_optimum(linear(DATA), ORIGIN, TRUE, SPREAD, low, high)
    np.testing.assert_allclose(found.beyond, free.point)
    assert found.point[1] == pytest.approx(high[1], abs=1e-3 * SPREAD[1])
    assert np.all((found.point > low) & (found.point < high))
    assert found.excess == pytest.approx(found.cost - free.cost)
    assert found.excess > 0.0


def test_past_the_deadline_one_candidate_has_to_do():
    """With the covariance that belongs to it, and no word of what lies beyond what is possible."""
    first = TRUE + 5.0 * SPREAD
    found = best_optimum(linear(DATA), [first, TRUE], deadline=PASSED)
    np.testing.assert_allclose(found.point, first, rtol=1e-14)
    np.testing.assert_allclose(found.residuals, linear(DATA)(first[None])[0])
    assert np.all(np.linalg.eigvalsh(found.covariance) > 0.0)
    low = first + SPREAD
    inside = best_optimum(linear(DATA), [first], TRUE, SPREAD, low, deadline=PASSED)
    assert inside.beyond is None
    assert np.all(inside.point > low)


class Valley:
    """Rosenbrock's, as residuals; it may be that so many calls take all the time there is."""

    def __init__(self, calls: int | None = None) -> None:
        self.left, self.deadline, self.seen = calls, NEVER, []

    def __call__(self, x):
        if self.left is not None:
            self.left -= 1
            if self.left == 0:
                object.__setattr__(self.deadline, "moment", time.monotonic())
        self.seen.append(x.copy())
        return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])

    @staticmethod
    def jacobian(x):
        return np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])


START = np.array([-1.2, 1.0])


def cost(x):
    return 0.5 * np.sum(Valley()(x) ** 2)


def test_without_a_deadline_the_search_is_scipys():
    found = NEVER.least_squares(Valley(), START, Valley.jacobian)
    np.testing.assert_allclose(found.x, 1.0, rtol=1e-8)
    assert NEVER.seconds_left is None
    assert not NEVER.has_passed


def test_past_the_deadline_nothing_is_sought_but_all_is_told_of_the_start():
    valley = Valley()
    found = PASSED.least_squares(valley, START, Valley.jacobian)
    np.testing.assert_array_equal(found.x, START)
    np.testing.assert_array_equal(found.jac, Valley.jacobian(START))
    assert found.cost == pytest.approx(cost(START), rel=1e-14)
    assert len(valley.seen) == 1
    assert PASSED.seconds_left == 1e-9
    assert PASSED.has_passed
    assert 3590.0 < Deadline.after(3600.0).seconds_left <= 3600.0


def test_a_search_that_is_cut_short_ends_at_its_best_point():
    whole = Valley()
    NEVER.least_squares(whole, START, Valley.jacobian)
    for calls in (2, 5, 10):
        valley = Valley(calls)
        valley.deadline = Deadline.after(3600.0)
        found = valley.deadline.least_squares(valley, START, Valley.jacobian)
        seen = min(cost(x) for x in whole.seen[: calls - 1])
        assert found.cost <= seen * (1.0 + 1e-12)
        assert len(valley.seen) <= calls + 1

"""Searches that end when their time is up, with the best that they have found."""

import time

import numpy as np
import pytest

from tactile_bayes.inference.deadline import NEVER, Deadline

PASSED = Deadline.after(0.0)


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

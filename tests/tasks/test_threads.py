"""Parts of a computation on threads."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import tactile_bayes as tb
from tactile_bayes.sweep import scan_many
from tactile_bayes.tasks import in_parts, one_thread


@pytest.fixture(autouse=True)
def three_threads(monkeypatch):
    monkeypatch.setattr("numba.core.config.NUMBA_NUM_THREADS", 3)


def seen(count, fewest):
    """Number of times that each item is worked on, the number of parts, and whether any is on another thread."""
    times, threads = np.zeros(count, dtype=int), []

    def work(part):
        threads.append(threading.current_thread())
        times[part] += 1

    in_parts(work, count, fewest)
    return times, len(threads), any(thread is not threading.current_thread() for thread in threads)


@pytest.mark.parametrize("count", [0, 1, 19, 20, 21, 100])
def test_parts_are_all_items_once_and_few_items_are_one_part_on_this_thread(count):
    times, parts, elsewhere = seen(count, 10)
    np.testing.assert_array_equal(times, 1)
    assert (parts > 1, elsewhere) == (count >= 20, count >= 20)
    assert parts >= 1


def test_one_thread_is_of_its_context_and_of_its_thread():
    with one_thread():
        with one_thread():
            pass
        assert seen(100, 1)[1:] == (1, False)
        others = []
        thread = threading.Thread(target=lambda: others.append(seen(100, 1)[1]))
        thread.start()
        thread.join()
    assert others[0] > 1
    assert seen(100, 1)[1] > 1


def test_parts_have_no_parts_of_their_own():
    inner = []
    in_parts(lambda part: inner.append(seen(100, 1)[1]), 100, 1)
    assert set(inner) == {1}


def test_an_error_of_a_part_is_raised():
    def work(part):
        if part.stop == 100:
            raise ValueError("the last")

    with pytest.raises(ValueError, match="the last"):
        in_parts(work, 100, 1)


def test_sweeps_do_not_depend_on_threads():
    rng = np.random.default_rng(1)
    contours = tb.contours.Parabola(rng.uniform(0.3, 2.0, 60), rng.uniform(0.3, 0.8, 60), rng.uniform(-0.3, 0.3, 60))
    many = scan_many(contours, [0.2, 0.5, 0.9])
    with one_thread():
        assert many.identical(scan_many(contours, [0.2, 0.5, 0.9]))

"""Streams of random numbers of many records."""

import numpy as np

from tactile_bayes.datasets.streams import NOISE, Together, streams

RECORDS = np.array([0, 1, 499, 2**31, 2**32])


def test_together_they_draw_what_each_draws_alone():
    together = Together(streams(7, RECORDS, NOISE))
    normal, chi = together.standard_normal((RECORDS.size, 4, 3)), together.chisquare(3.0, (RECORDS.size, 2))
    for i, record in enumerate(RECORDS.tolist()):
        alone = np.random.default_rng(np.random.SeedSequence(7, spawn_key=(record, NOISE)))
        np.testing.assert_array_equal(normal[i], alone.standard_normal((4, 3)))
        np.testing.assert_array_equal(chi[i], alone.chisquare(3.0, 2))

"""Streams of random numbers: NumPy's own of each record, whatever records are beside it."""

import numpy as np
import pytest

from tactile_bayes.datasets.streams import CONTOUR, NOISE, Together, streams

RECORDS = np.array([0, 1, 499, 2**31, 2**32 - 1])


def own(seed, record, purpose):
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(record, purpose)))


@pytest.mark.parametrize("purpose", [CONTOUR, NOISE])
@pytest.mark.parametrize("seed", [0, 7, 2**32, 2**63 - 1, 2**128 - 1])
@pytest.mark.parametrize("records", [RECORDS, RECORDS + 2**32], ids=["one word", "two words"])
def test_they_are_those_of_numpys_seed_sequences(seed, records, purpose):
    for stream, record in zip(streams(seed, records, purpose), records.tolist(), strict=True):
        assert stream.bit_generator.state == own(seed, record, purpose).bit_generator.state


def test_together_they_draw_what_each_draws_alone():
    together = Together(streams(7, RECORDS, NOISE))
    normal, chi = together.standard_normal((RECORDS.size, 4, 3)), together.chisquare(3.0, (RECORDS.size, 2))
    for i, record in enumerate(RECORDS.tolist()):
        alone = own(7, record, NOISE)
        np.testing.assert_array_equal(normal[i], alone.standard_normal((4, 3)))
        np.testing.assert_array_equal(chi[i], alone.chisquare(3.0, 2))

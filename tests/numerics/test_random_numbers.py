"""Tests of `rng`: a seed gives the same numbers in every call, a generator goes on."""

from dataclasses import replace

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.contour_posteriors import BRIEF, CELL, measured
from tactile_bayes.errors import ParameterError
from tactile_bayes.numerics.random_numbers import child, generator, seed_sequence, seed_words, spawn, words

FEW = replace(BRIEF, max_steps=2, block_steps=2)
STATED = tb.Rig(load_cell=CELL, unknown="nothing")


def of_measure(rng):
    return CELL.measure(tb.scan(tb.contours.Parabola(0.5, 0.5), drive_step=0.2).record, rng=rng).force_x.values


def of_contour(rng):
    return tb.infer_contour(measured(), rig=STATED, rng=rng, settings=FEW)["posterior"]["a"].values


def of_contacts(rng):
    record = measured().isel(sample=slice(60, 62))
    return tb.infer_contacts(record, STATED, rng=rng, draws=4)["posterior"]["contact_x"].values


@pytest.mark.parametrize("draw", [of_measure, of_contour, of_contacts])
def test_a_seed_gives_the_same_numbers_and_a_generator_goes_on(draw):
    once, going_on = np.random.SeedSequence(3), np.random.default_rng(3)
    first = draw(3)
    for again in (draw(once), draw(once), draw(np.int64(3))):
        np.testing.assert_array_equal(again, first)
    assert once.n_children_spawned == 0
    one, other = draw(going_on), draw(going_on)
    assert not np.array_equal(one, other)
    np.testing.assert_array_equal(draw(np.random.default_rng(3)), one)


@pytest.mark.parametrize("rng", [-1, True, 1.5, None, "1", np.random.RandomState(1)])
def test_what_is_no_seed_and_no_generator_is_refused(rng):
    for take in (seed_sequence, generator, of_measure, of_contour, of_contacts):
        with pytest.raises(ParameterError, match="rng"):
            take(rng)


def test_children_are_those_of_numpy():
    parent = np.random.SeedSequence(7, spawn_key=(2,))
    for number, spawned in enumerate(spawn(parent, 3)):
        assert child(parent, number).generate_state(4).tolist() == spawned.generate_state(4).tolist()
    assert words(parent) == [7, 2]
    assert words(np.random.SeedSequence([5, 6])) == [5, 6]
    assert [seed_words(seed) for seed in (7, parent)] == ["7", "7, spawn key (2,)"]

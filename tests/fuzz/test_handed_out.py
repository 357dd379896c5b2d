"""Scans of drawn rods, contours, drives and frictions: every state is an equilibrium that nothing contradicts."""

from __future__ import annotations

import warnings

import numpy as np

import tactile_bayes as tb
from helpers import drawn_sweeps
from helpers.handed_out import violations
from tactile_bayes.errors import ContourError, TactileBayesWarning

SCANS = 8


def test_no_state_is_wrong(fuzz_seed):
    rng, made = np.random.default_rng([fuzz_seed, 4]), 0
    while made < SCANS:
        contour, rod = drawn_sweeps.contour(rng), drawn_sweeps.rod(rng)
        friction = float(rng.choice([0.0, rng.uniform(0.0, 0.8)]))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", TactileBayesWarning)
            try:
                scan = tb.scan(contour, rod=rod, friction=friction, **drawn_sweeps.way(rng))
            except ContourError:
                continue
        made += 1
        assert violations(scan, rod, friction) == {}, (contour, rod, friction, scan.sweeps)

"""The accuracy of likelihoods of rods of every kind, rotated and carried, past objects near and far."""

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.rods_drawn import drawn_rod
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.rig import Rig

CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
SCENES = 6


def drawn_scene(rng):
    """Record, friction, and the contour as a family of one."""
    rod, friction = drawn_rod(rng), float(rng.choice([0.0, rng.uniform(0.0, 0.5)]))
    side, q = float(rng.choice([-1.0, 1.0])), np.exp(rng.uniform(np.log(0.021), np.log(0.8)))
    numbers = np.exp(rng.uniform(-2.0, 1.5)), q, rng.uniform(-0.4, 0.4)
    drive = tb.Motion(
        side * np.array([-1.2, 1.2]), rng.uniform(-0.5, -0.1, 2), 0.5 * np.pi + side * rng.uniform(-1.3, 1.3, 2)
    )
    drive = [tb.Rotation(drive_step=np.radians(3.0)), drive][rng.integers(2)]
    record = tb.scan(
        tb.contours.Parabola(*numbers), drive=drive, rig=Rig(rod=rod, unknown={"friction": friction})
    ).record
    return record, friction, tb.contours.Parabola(*(np.array([number]) for number in numbers))


@pytest.mark.filterwarnings("ignore::tactile_bayes.errors.ClearanceWarning")
@pytest.mark.filterwarnings("ignore::tactile_bayes.errors.StrainWarning")
def test_interpolation_is_not_felt_at_the_truth(fuzz_seed):
    """Log-likelihoods are within 0.05 of the exact ones."""
    rng, off = np.random.default_rng([3, fuzz_seed]), []
    while len(off) < SCENES:
        try:
            record, friction, contour = drawn_scene(rng)
        except (tb.errors.ReachError, tb.errors.ContourError):
            continue
        measured = CELL.measure(record, rng=rng)
        likelihoods = [RecordLikelihood(measured, CELL, friction, exact) for exact in (True, False)]
        values = [float(one.log_likelihood(contour)[0]) for one in likelihoods]
        if np.isfinite(values[0]):
            off.append(abs(values[1] - values[0]))
    assert max(off) < 0.05


@pytest.mark.parametrize("q", [0.022, 0.05])
def test_loads_of_thousands_do_not_change_that(q):
    """A rod that grows stiffer toward its tip, past an object at its pivot."""
    rod = tb.Rod(rigidity_profile=lambda s: 1.0 + 1.4 * s)
    record = tb.scan(
        tb.contours.Parabola(0.16, q, 0.17), rig=Rig(rod=rod, unknown={"friction": 0.29}), drive_step=np.radians(3.0)
    ).record
    measured = CELL.measure(record, rng=1)
    contour = tb.contours.Parabola(*np.array([[0.16], [q], [0.17]]))
    exact, found = (
        float(RecordLikelihood(measured, CELL, 0.29, exact).log_likelihood(contour)[0]) for exact in (True, False)
    )
    assert abs(found - exact) < 0.05

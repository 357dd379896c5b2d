"""Agreement of the force along the rod with the moment, of straight rods and of such that vary along their length."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.load_cells import CELL
from tactile_bayes import LoadCell, Rig, Rod, reconstruct, scan
from tactile_bayes.contours import Parabola

CONTOUR = Parabola(0.5, 0.5)
TAPERED = Rod(diameter=0.02, taper=0.5)


def swept(rod, step=4.0, friction=0.0):
    return scan(CONTOUR, rig=Rig(rod=rod, unknown={"friction": friction}), drive_step=np.radians(step)).record


def score(record, seed, cell=CELL, rod=None, friction=0.0):
    measured = cell.measure(record, rng=seed)
    rig = Rig(rod=rod, load_cell=cell, unknown={"friction": friction})
    return reconstruct(measured, rig, method="constrained").attrs["axial_score"]


@pytest.mark.parametrize("curvature", [0.0, 0.4])
@pytest.mark.parametrize("share", [1.0, 0.1])
def test_that_of_an_arc_is_the_same_by_its_first_integral_and_by_step_2(curvature, share):
    """They differ by terms of second order in the noise, some hundredths of a standard error."""
    cell = LoadCell(force_noise=0.05 * share, moment_noise=0.02 * share)
    record = swept(Rod(rest_curvature=curvature))
    for seed in range(3):
        arc, varied = (
            score(record, seed, cell, rod=Rod(rest_curvature=curvature, taper=taper)) for taper in (0.0, 1e-9)
        )
        assert varied == pytest.approx(arc, abs=0.1 * share)


NOISY = {
    "tapered, few": (TAPERED, 40, CELL, 0.0),
    "tapered": (TAPERED, 200, CELL, 0.0),
    "tapered, friction": (TAPERED, 200, CELL, 0.3),
    "tapered, much noise": (TAPERED, 200, LoadCell(force_noise=0.15, moment_noise=0.06), 0.0),
    "tapered, turning": (TAPERED, 200, replace(CELL, frame="turning", drive_angle_noise=0.01), 0.0),
    "straight, few": (Rod(), 30, CELL, 0.0),
    "straight, encoder": (Rod(), 30, replace(CELL, drive_angle_noise=0.01), 0.0),
    "straight, turning": (Rod(), 30, replace(CELL, frame="turning", drive_angle_noise=0.01), 0.0),
}


@pytest.mark.parametrize("kind", [pytest.param(k, marks=[] if "few" in k else [pytest.mark.slow]) for k in NOISY])
def test_it_is_standard_normal(kind):
    """Mean within 4.5 standard errors, and spread within 4, of which normal numbers have 1e-4 together."""
    rod, count, cell, friction = NOISY[kind]
    record = swept(rod, 8.0, friction)
    scores = [score(record, seed, cell, friction=friction) for seed in range(count)]
    assert abs(np.mean(scores)) < 4.5 / np.sqrt(count)
    assert abs(np.std(scores) - 1.0) < 4.0 / np.sqrt(2.0 * count)


@pytest.mark.parametrize(("rod", "friction"), [(TAPERED, 0.3), (Rod(), 0.1)])
def test_unstated_friction_makes_it_negative(rod, friction):
    record = swept(rod, friction=friction)
    assert score(record, 1) < -20.0
    assert abs(score(record, 1, friction=friction)) < 4.0


def test_a_straight_rod_taken_for_a_tapered_one_makes_it_large():
    record = swept(Rod(diameter=0.02))
    assert abs(score(record, 1)) < 4.0
    assert abs(score(record, 1, rod=TAPERED)) > 20.0

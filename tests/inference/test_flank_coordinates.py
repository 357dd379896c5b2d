"""Coordinates of a flank: a bijection, of what the contour is at a place, that keeps volumes in view."""

from __future__ import annotations

import numpy as np
import pytest

from tactile_bayes.calibration.calibrate import calibration_replicate
from tactile_bayes.contours import PowerLaw
from tactile_bayes.inference.ensembles import Logarithms
from tactile_bayes.inference.ensembles.proposal import Mixture, Proposal
from tactile_bayes.inference.flank_coordinates import FlankCoordinates

PLACE = 0.1
BASE = Logarithms(np.array([True, False, False, False, True]))
SIDES = pytest.mark.parametrize("side", [-1.0, 1.0])


def points_of(side, count=50):
    """w, n, q, x_c and a size of the rig, the vertex on one side of the place."""
    rng = np.random.default_rng(3)
    w, distance, size = np.exp(rng.normal(-0.5, 0.7, (3, count)))
    return np.stack([w, 1.1 + 3.0 * rng.random(count), rng.normal(size=count), PLACE - side * distance, size], axis=1)


@SIDES
def test_coordinates_of_points_lead_back_to_them(side):
    points = points_of(side)
    there, _ = FlankCoordinates(BASE, PLACE, side).parameters(FlankCoordinates(BASE, PLACE, side).of(points))
    np.testing.assert_allclose(there, points, rtol=1e-9, atol=1e-11)


@SIDES
def test_they_are_slope_exponent_height_and_bend_at_the_place(side):
    """The contour's own slope and curvature, from its class, at the place."""
    points = points_of(side)
    found = FlankCoordinates(BASE, PLACE, side).of(points)
    for point, row in zip(points, found, strict=True):
        contour = PowerLaw.of_width(*point[:4])
        height, slope_angle = contour.height(PLACE), contour.locate(contour.parameter_of_x(PLACE)).slope_angle
        slope = np.tan(slope_angle)
        assert np.sign(slope) == side
        bend = (1.0 + slope**2) ** 1.5 / contour.radius_of_curvature(slope_angle)
        np.testing.assert_allclose(
            row,
            [np.log(abs(slope)), np.log(point[1] - 1.0), height, np.log(abs(slope) / bend), np.log(point[4])],
            rtol=1e-9,
        )


@SIDES
def test_volumes_grow_as_the_determinant_of_the_jacobian_says(side):
    """By differences of third order, whose errors are a millionth."""
    coordinates = FlankCoordinates(BASE, PLACE, side)
    for place in coordinates.of(points_of(side, 10)):
        steps = 1e-4 * np.eye(5)
        ends = [coordinates.parameters(place + k * steps)[0] for k in (-2, -1, 1, 2)]
        jacobian = (ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / 12e-4
        growth = coordinates.parameters(place[None])[1]
        np.testing.assert_allclose(np.linalg.slogdet(jacobian)[1], growth, atol=1e-6)


@SIDES
def test_vertices_on_the_other_side_have_none(side):
    found = FlankCoordinates(BASE, PLACE, side).of(points_of(-side))
    assert np.isnan(found[:, [0, 3]]).all()


def test_a_checkpoint_tells_them_apart():
    proposal = Mixture((Proposal(np.zeros(5), np.eye(5)),))
    several = [FlankCoordinates(BASE, *where) for where in ((0.1, 1.0), (0.1, -1.0), (0.2, 1.0))]
    several.append(several[0].with_proposal(proposal))
    assert len({one.digest for one in several} | {BASE.digest}) == 5


@pytest.mark.slow
@pytest.mark.parametrize("number", [15, 25, 43, 65])
def test_a_flank_that_is_told_to_a_hundred_thousandth_is_found_and_walked(number):
    """Pivots next to the object, loads of up to 65,000 times their noise: replicates of the published calibration."""
    replicate = calibration_replicate(number, family="power-law", seed=2026)
    assert replicate.outcome.ranks, replicate.outcome.message
    assert replicate.outcome.numbers["converged"] == 1.0

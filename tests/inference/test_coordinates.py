"""Coordinates of parameters: bijections, with the determinant of their Jacobian."""

import numpy as np
import pytest

from helpers.contour_posteriors import CELL, swept
from tactile_bayes import Family, Rig
from tactile_bayes.calibration.calibrate import calibration_replicate, experiment_of
from tactile_bayes.calibration.simulation import simulate
from tactile_bayes.contours import Circle
from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.inference.coordinates import FlankCoordinates, Logarithms
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.starts.modes import flank_at_contacts

PLACE = 0.1
# The parameters that are sizes, of those of the family and one of the rig.
POSITIVE = {
    "parabola": [True, False, False, True],
    "circle": [True, False, False, True],
    "power-law": [True, False, False, False, True],
    "ellipse": [True, True, False, False, True],
}
FLANKS = pytest.mark.parametrize(("family", "side"), [(name, side) for name in POSITIVE for side in (-1.0, 1.0)])


def flank(family, side, x=PLACE):
    positive = np.array(POSITIVE[family])
    return FlankCoordinates(family, Logarithms(positive), x, side, tuple(range(positive.size - 1)))


def points_of(family, side, count=50):
    """Sizes, q, x_c and a size of the rig, the vertex on one side of the place."""
    rng = np.random.default_rng(3)
    first, distance, size = np.exp(rng.normal(-0.5, 0.7, (3, count)))
    second = 1.1 + 3.0 * rng.random(count)
    if family in ("circle", "ellipse"):  # which ends at its half-axis
        first = distance / (0.05 + 0.9 * rng.random(count))
    sizes = [first] if len(POSITIVE[family]) == 4 else [first, second]
    return np.stack([*sizes, rng.normal(size=count), PLACE - side * distance, size], axis=1)


def test_logarithms_lead_back():
    coordinates = Logarithms(np.array([True, False, True]))
    points = np.exp(np.random.default_rng(2).normal(size=(5, 3)))
    there, growth = coordinates.parameters(coordinates.of(points))
    np.testing.assert_allclose(there, points, rtol=1e-14)
    np.testing.assert_allclose(growth, np.log(points[:, 0] * points[:, 2]), rtol=1e-12)


@FLANKS
def test_they_are_slope_shape_height_and_slope_ratio_at_the_place(family, side):
    """The contour's own slope and curvature, from its class, at the place."""
    points = points_of(family, side)
    found = flank(family, side).of(points)
    for point, row in zip(points, found, strict=True):
        contour = FAMILIES[family].build(*point[:-1])
        height, slope_angle = contour.height(PLACE), contour.locate(contour.parameter_of_x(PLACE)).slope_angle
        slope = np.tan(slope_angle)
        assert np.sign(slope) == side
        bend = (1.0 + slope**2) ** 1.5 / contour.radius_of_curvature(slope_angle)
        # Of an ellipse, with the circle of which it is a shadow.
        shadow = np.tan(np.arcsin(abs(PLACE - point[-2]) / point[0])) if family == "ellipse" else None
        shape = {"power-law": [point[1] - 1.0], "ellipse": [shadow]}.get(family, [])
        expected = [*np.log([abs(slope), *shape]), height, np.log(abs(slope) / bend), np.log(point[-1])]
        np.testing.assert_allclose(row, expected, rtol=1e-9, atol=1e-12)


@FLANKS
def test_they_lead_back_and_volumes_grow_as_the_determinant_of_the_jacobian_says(family, side):
    """By differences of third order, whose errors are a millionth."""
    coordinates, points = flank(family, side), points_of(family, side)
    there = coordinates.of(points)
    np.testing.assert_allclose(coordinates.parameters(there)[0], points, rtol=1e-9, atol=1e-11)
    for place in there[:10]:
        steps = 1e-4 * np.eye(place.size)
        ends = [coordinates.parameters(place + k * steps)[0] for k in (-2, -1, 1, 2)]
        jacobian = (ends[0] - 8.0 * ends[1] + 8.0 * ends[2] - ends[3]) / 12e-4
        growth = coordinates.parameters(place[None])[1]
        np.testing.assert_allclose(np.linalg.slogdet(jacobian)[1], growth, atol=1e-6)


@FLANKS
def test_vertices_on_the_other_side_have_none(family, side):
    found = flank(family, side).of(points_of(family, -side))
    assert np.isnan(found[:, [0, -2]]).any(axis=1).all()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_flank_of_joined_contours_is_that_of_its_own_parameters(side):
    """Beside parameters of the other flank, which stay as they are."""
    points = points_of("ellipse", side)
    other = np.linspace(0.5, 2.0, len(points))
    alone = flank("ellipse", side)
    columns = (1, 2, 3, 4) if side > 0.0 else (0, 1, 3, 4)
    base = Logarithms(np.array([True, True, True, False, False, True]))
    joined = FlankCoordinates("ellipse", base, PLACE, side, columns)
    at = 0 if side > 0.0 else 2
    both = np.insert(points, at, other, axis=1)
    np.testing.assert_allclose(joined.of(both), np.insert(alone.of(points), at, np.log(other), axis=1))
    there, growth = joined.parameters(joined.of(both))
    np.testing.assert_allclose(there, both, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(growth, alone.parameters(alone.of(points))[1] + np.log(other))


@pytest.mark.parametrize(
    ("contour", "flank", "own"),
    [("parabola/power-law", "power-law", ["right_w", "right_n"]), ("ellipse/parabola", "parabola", ["right_a"])],
)
def test_of_joined_contours_the_flank_that_was_touched_counts(contour, flank, own):
    """A record of the right flank alone."""
    replicate = experiment_of(family=contour, rng=2026)
    measured = simulate(replicate, np.random.default_rng(1)).measured
    model = replicate.problem_of(measured).model
    point = np.concatenate([[0.7, 1.3, 1.6][: len(model.family.parameters) - 2], [0.3, -0.9]])
    found = flank_at_contacts(model, np.append(point, model.prior_medians(model.names[point.size :])))
    assert (found.flank, found.side) == (flank, 1.0)
    assert [model.names[k] for k in found.columns] == [*own, "q", "x_c"]


@pytest.mark.parametrize("known", [{"x_c": 0.0}, {"q": 0.5}, {"r": 0.3}, {}])
def test_a_size_or_vertex_that_is_known_leaves_no_ridge_nor_does_a_record_of_both_flanks(known):
    for direction in ("forward", "both"):
        record = CELL.measure(swept(Circle(0.3, 0.5), step=0.1, direction=direction), rng=1)
        model = Experiment(record, Rig(load_cell=CELL), Family("circle", **known)).model
        point = [{"r": 0.3, "q": 0.5, "x_c": -0.01}.get(name, 0.0) for name in model.names]
        assert (flank_at_contacts(model, np.array(point)) is None) == (bool(known) or direction == "both")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("family", "number"),
    [
        *(("power-law", number) for number in (15, 25, 43, 65, 373, 420)),
        *(("ellipse", number) for number in (39, 51, 53)),
        ("parabola/power-law", 54),
    ],
)
def test_a_flank_known_to_a_hundred_thousandth_is_found_and_sampled(family, number):
    """Pivots next to the object, loads of up to 65,000 times their noise: replicates of the published calibration."""
    replicate = calibration_replicate(number, family=family, rng=2026)
    assert replicate.outcome.ranks, replicate.outcome.message
    assert replicate.outcome.numbers["converged"] == 1.0

"""Regions of contacts: do they hold fresh points as often as they say, whatever their shape?"""

import functools

import numpy as np
import pytest
import xarray as xr

from helpers.refusals import refused
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.uncertainty.contact_region import contact_region

PROBABILITIES = (0.5, 0.9, 0.95)


def normal(rng, n):
    return rng.normal(size=(n, 2)) * [1.0, 0.01] @ [[0.8, 0.6], [-0.6, 0.8]]


def banana(rng, n, width=0.3):
    x = rng.normal(size=n)
    return np.stack([x, x**2 + width * rng.normal(size=n)], axis=-1)


thin_banana = functools.partial(banana, width=0.02)


def blocks(rng, n):
    return rng.random((n, 2)) + np.where(rng.random(n) < 0.3, 5.0, 0.0)[:, None]


def half_normal(rng, n):
    return np.stack([np.abs(rng.normal(size=n)), 0.2 * rng.normal(size=n)], axis=-1)


SHAPES = {"normal": normal, "banana": banana, "thin banana": thin_banana, "blocks": blocks, "half normal": half_normal}


def posterior(points, sample=3):
    """Draws of one contact, and none of another."""
    values = np.full((4, len(points) // 4, 2, 2), np.nan)
    values[:, :, 1] = points.reshape(4, -1, 2)
    dims = ("chain", "draw", "sample")
    columns = {"contact_x": (dims, values[..., 0]), "contact_y": (dims, values[..., 1])}
    return xr.Dataset(columns, coords={"sample": [sample - 2, sample]})


# The level is a quantile of what the draws say of one another: short by about 1/draws, and 0.002 is allowed for it.
# Four standard errors: false alarm 6e-5 a number.
@pytest.mark.parametrize(
    ("regions", "fresh"), [pytest.param(8, 300, id="few"), pytest.param(200, 2000, id="many", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("probability", PROBABILITIES)
@pytest.mark.parametrize("name", SHAPES)
def test_a_region_holds_fresh_points_as_often_as_it_says(name, probability, regions, fresh):
    rng, shares = np.random.default_rng(1), []
    for _ in range(regions):
        region = contact_region(posterior(SHAPES[name](rng, 1000)), 3, probability)
        shares.append(region.contains(*SHAPES[name](rng, fresh).T).mean())
    error = np.std(shares, ddof=1) / np.sqrt(regions)  # from the scatter of regions
    if regions < 10:
        error = max(error, np.sqrt(probability * (1 - probability) / (regions * fresh)))
    assert abs(np.mean(shares) - probability) < 4.0 * error + 0.002


@pytest.mark.parametrize("name", SHAPES)
def test_the_draws_in_it_are_the_share_that_it_says(name):
    """A draw counts itself in the density, which moves a draw or two over the boundary."""
    points = SHAPES[name](np.random.default_rng(2), 1000)
    for probability in PROBABILITIES:
        region = contact_region(posterior(points), 3, probability)
        kernels = region.density(*points.T) * 1000
        others = (kernels - 1.0) / 999
        assert np.count_nonzero(others >= region.level) == pytest.approx(1000 * probability, abs=1)


def test_of_a_normal_distribution_it_is_the_ellipse():
    """Area over that of the ellipse: the kernel widens by 1 + h², h² = n^(-1/3) = 0.1, and less noise: within 5 %."""
    rng = np.random.default_rng(3)
    region = contact_region(posterior(rng.normal(size=(1000, 2))), 3, 0.9)
    x, y, density = region.grid(70)
    area = np.count_nonzero(density >= region.level) * (x[1] - x[0]) * (y[1] - y[0])
    assert area == pytest.approx(2.0 * np.pi * np.log(10.0), rel=0.15)


def test_two_blocks_are_two_regions():
    region = contact_region(posterior(blocks(np.random.default_rng(4), 2000)), 3, 0.9)
    assert region.contains([0.5, 5.5], [0.5, 5.5]).all()
    assert not region.contains([3.0, 0.5, 5.5], [3.0, 5.5, 0.5]).any()


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_units_and_axes_do_not_matter(size, angle):
    rng = np.random.default_rng(5)
    points, places = thin_banana(rng, 800), thin_banana(rng, 3000)
    turn = size * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    shift = size * np.array([3.0, -2.0])
    expected = contact_region(posterior(points), 3, 0.9)
    found = contact_region(posterior(points @ turn + shift), 3, 0.9)
    np.testing.assert_allclose(found.level, expected.level, rtol=1e-6)
    density = expected.density(*places.T)
    np.testing.assert_allclose(found.density(*(places @ turn + shift).T), density, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("name", SHAPES)
def test_the_grid_holds_the_region(name):
    region = contact_region(posterior(SHAPES[name](np.random.default_rng(8), 600)), 3, 0.99)
    _, _, density = region.grid(60)
    assert density.shape == (60, 60)
    rim = np.concatenate([density[0], density[-1], density[:, 0], density[:, -1]])
    assert rim.max() < region.level


def test_shapes_of_places_are_kept_and_nan_is_nowhere():
    region = contact_region(posterior(normal(np.random.default_rng(9), 400)), 3)
    assert region.probability == 0.9
    assert region.density(np.zeros((2, 1)), np.zeros(3)).shape == (2, 3)
    assert not region.contains(np.nan, 0.0)
    assert region.contains(0.0, 0.0).shape == ()


def test_the_least_probability_is_that_of_the_region_on_whose_boundary_a_place_is():
    rng = np.random.default_rng(10)
    points, places = banana(rng, 1000), banana(rng, 500)
    least = contact_region(posterior(points), 3).least_probability(*places.T)
    for probability in PROBABILITIES:
        inside = contact_region(posterior(points), 3, probability).contains(*places.T)
        clear = np.abs(least - probability) > 2e-3
        np.testing.assert_array_equal(inside[clear], (least <= probability)[clear])
    assert np.isnan(contact_region(posterior(points), 3).least_probability(np.nan, 0.0))


DRAWS = posterior(np.zeros((400, 2)))


@pytest.mark.parametrize(
    ("draws", "sample", "probability", "error", "named"),
    [
        (DRAWS, 3, 1.0, ParameterError, ["probability", 1.0]),
        (DRAWS, 2, 0.9, ParameterError, ["sample 2", "1 to 3"]),
        (DRAWS, 1, 0.9, InferenceError, ["sample 1"]),
        (xr.DataTree.from_dict({"prior": DRAWS}), 3, 0.9, InferenceError, ["'posterior'"]),
    ],
)
def test_what_has_no_region_is_refused(draws, sample, probability, error, named):
    with refused(error, *named):
        contact_region(draws, sample, probability)

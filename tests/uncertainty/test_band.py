"""Bands of contours, against quantiles of heights."""

import numpy as np
import pytest

from helpers.contour_posteriors import tree
from tactile_bayes.contours import Parabola
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.uncertainty.band import contour_band, contour_heights, contours_drawn
from tactile_bayes.uncertainty.quantiles import quantile_band

X = np.linspace(-0.8, 0.8, 41)


def made(size=3000):
    """Draws with a wide spread, in two chains."""
    rng = np.random.default_rng(1)
    a, q, x_c = rng.normal([[[0.5]], [[0.4]], [[0.0]]], [[[0.05]], [[0.01]], [[0.03]]], size=(3, 2, size // 2))
    return tree("parabola", a=a, q=q, x_c=x_c)


@pytest.mark.parametrize("probability", [0.5, 0.95])
def test_a_pointwise_band_is_made_of_quantiles(probability):
    posterior = made()
    draws = posterior["posterior"].to_dataset()
    heights = draws.a.values.ravel()[:, None] * (X - draws.x_c.values.ravel()[:, None]) ** 2
    heights += draws.q.values.ravel()[:, None]
    band = contour_band(posterior, X, probability)
    expected = np.quantile(heights, [0.5 - 0.5 * probability, 0.5, 0.5 + 0.5 * probability], axis=0)
    np.testing.assert_allclose([band[name] for name in ("lower", "median", "upper")], expected, rtol=1e-12)
    np.testing.assert_array_equal(band.share_reaching, 1.0)
    assert band.attrs == {"probability": probability, "simultaneous": 0}


def test_a_simultaneous_band_holds_whole_contours():
    """Its share of whole contours is the stated one, up to one contour; pointwise bands hold fewer."""
    posterior = made()
    heights = contour_heights(posterior, X)

    def share(band):
        slack = 1e-12
        inside = (heights >= band.lower.values - slack) & (heights <= band.upper.values + slack)
        return inside.all(axis=1).mean()

    pointwise = contour_band(posterior, X, 0.9)
    whole = contour_band(posterior, X, 0.9, simultaneous=True)
    np.testing.assert_array_equal(whole["median"], pointwise["median"])
    assert np.all(whole.lower < pointwise.lower)
    assert np.all(whole.upper > pointwise.upper)
    assert share(whole) == pytest.approx(0.9, abs=2.0 / len(heights))
    assert share(pointwise) < 0.9


def test_where_all_contours_meet_a_simultaneous_band_is_not_widened_by_rounding():
    """The widening factor is that of the other places, and no more."""
    rng = np.random.default_rng(1)
    values = rng.normal(size=(400, 1)) * [1.0, 2.0, 3.0] + rng.normal(size=(400, 3))
    lower, _, upper = quantile_band(values, 0.9, True)
    rounding = np.where(rng.uniform(size=(400, 1)) < 0.04, 1e-16, 0.0)
    with_point = quantile_band(np.concatenate([values, rounding], axis=1), 0.9, True)
    np.testing.assert_array_equal(with_point[:, :3][[0, 2]], [lower, upper])


def test_a_single_contour_is_its_own_band():
    for simultaneous in (False, True):
        band = contour_band(tree("parabola", a=[0.5] * 5, q=[0.3] * 5, x_c=[0.1] * 5), X, simultaneous=simultaneous)
        for name in ("lower", "median", "upper"):
            np.testing.assert_allclose(band[name], Parabola(0.5, 0.3, 0.1).height(X), rtol=1e-12)


def test_beyond_the_end_of_some_circles_the_band_is_not_known():
    r = np.array([0.5, 0.5, 0.6, 0.7])
    at = [0.0, 0.45, 0.55, 0.65, 0.8]
    for simultaneous in (False, True):
        band = contour_band(tree("circle", r=r, q=0.0 * r + 0.3, x_c=0.0 * r), at, simultaneous=simultaneous)
        np.testing.assert_array_equal(band.share_reaching, [1.0, 1.0, 0.5, 0.25, 0.0])
        for name in ("lower", "median", "upper"):
            assert np.isfinite(band[name]).values.tolist() == [True, True, False, False, False]
        reasons = ["ok"] * 2 + ["some contours end before"] * 2 + ["all contours end before"]
        assert band.status.values.tolist() == reasons


def test_units():
    assert contour_band(made(100), X).lower.attrs["units"] == "1"
    in_si = tree("parabola", units="SI", a=[2.5], q=[0.1], x_c=[0.0])
    assert contour_band(in_si, X).lower.attrs["units"] == "m"


def test_many_draws_are_thinned_evenly():
    drawn = made()
    every = contours_of(drawn["posterior"].to_dataset(), "parabola")
    picked = every.take(np.linspace(0, every.shape[0] - 1, 10).astype(int))
    assert contours_drawn(drawn, 10) == picked
    np.testing.assert_array_equal(contour_heights(drawn, X, most=10), picked.take(np.arange(10)[:, None]).height(X))

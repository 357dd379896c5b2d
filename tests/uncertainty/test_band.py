"""Bands of contours, against quantiles of heights, circles about one centre, and geometry."""

import json

import numpy as np
import pytest
import scipy.optimize
import xarray as xr

from helpers.contour_posteriors import tree
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Parabola, PowerLaw
from tactile_bayes.contours.families import FAMILIES, FLANKS
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.uncertainty.band import averaged_heights, contour_band, contour_heights, normal_band, quantile_band
from tactile_bayes.uncertainty.offsets import Feet, aligned, normal_offsets

X, NEAR = np.linspace(-0.8, 0.8, 41), np.linspace(-0.4, 0.4, 33)


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


def spread(family, size=200, share=0.02):
    """Draws with standard deviations of a share of their values."""
    rng = np.random.default_rng(1)
    typical = {"a": 0.6, "b": 0.7, "r": 0.6, "w": 1.0, "n": 3.0, "q": 0.3, "x_c": 0.0}
    names = {name: typical[name.rsplit("_")[-1] if name != "x_c" else name] for name in FAMILIES[family].parameters}
    return tree(family, **{k: v + share * (v or 0.5) * rng.normal(size=(2, size // 2)) for k, v in names.items()})


def concentric(r, centre=1.0):
    return tree("circle", r=r, q=centre - r, x_c=np.zeros_like(r))


def test_circles_about_one_centre_are_apart_by_their_radii():
    r = np.array([0.5, 0.6, 0.7, 0.8])
    x = np.array([-0.5, -0.45, 0.0, 0.3, 0.49])
    reference = Circle(0.5, q=0.5)
    band = normal_band(concentric(r), x, 0.5, reference=reference)
    expected = np.quantile(0.5 - r, [0.25, 0.5, 0.75])
    found = np.array([band[name] for name in ("lower", "median", "upper")])
    np.testing.assert_allclose(found, np.broadcast_to(expected[:, None], (3, 5)), atol=1e-14)
    for edge, r_edge in (("lower", 0.5 - expected[0]), ("upper", 0.5 - expected[2])):
        np.testing.assert_allclose(np.hypot(band[f"{edge}_x"], band[f"{edge}_y"] - 1.0), r_edge, rtol=1e-14)
    np.testing.assert_allclose(band.y, reference.height(x), rtol=1e-14)
    assert band.status.values.tolist() == ["ok"] * 5


@pytest.mark.parametrize("family", [*FLANKS, "parabola/power-law", "circle/power-law"])
def test_the_points_found_are_on_the_contours_and_on_the_normals(family):
    contours = FAMILIES[family].build(
        *(spread(family)["posterior"][name].values.ravel() for name in FAMILIES[family].parameters)
    )
    reference = contours.take(np.asarray(3))
    locus = reference.locate(reference.parameter_of_x(NEAR))
    offsets = normal_offsets(contours, locus)
    assert np.isfinite(offsets).all()
    np.testing.assert_allclose(offsets[3], 0.0, atol=1e-13)
    x = locus.x - offsets * np.sin(locus.slope_angle)
    y = locus.y + offsets * np.cos(locus.slope_angle)
    np.testing.assert_allclose(contours.take(np.arange(200)[:, None]).height(x), y, rtol=0, atol=1e-11)


def test_the_normal_enters_the_object_where_it_meets_the_contour():
    """On a steep flank the line goes on to the other flank, which is not meant."""
    steep, wide = Parabola(20.0, q=0.0), Parabola(np.array([19.0]), q=0.0)
    locus = steep.locate(steep.parameter_of_x(np.array([-0.3, 0.3])))
    offsets = normal_offsets(wide, locus)
    assert np.all((offsets < 0.0) & (offsets > -0.02))


def test_an_endless_contour_is_met_far_away():
    flat, high = Parabola(0.5, q=0.0), PowerLaw(np.array([1.0, 1.0]), 1.5, q=np.array([1000.0, -1000.0]))
    locus = flat.locate(np.array([0.0]))
    np.testing.assert_allclose(normal_offsets(high, locus), [[1000.0], [-1000.0]])


def test_where_contours_end_the_band_is_not_known():
    r = np.array([0.5, 0.6, 0.7])
    posterior = tree("circle", r=r, q=np.full(3, 0.3), x_c=np.zeros(3))
    flat = Parabola(1e-3, q=0.3)
    band = normal_band(posterior, [0.0, 0.55, 0.65, 0.8], reference=flat)
    np.testing.assert_allclose(band.share_reaching, [1.0, 2.0 / 3.0, 1.0 / 3.0, 0.0])
    assert [status.split()[0] for status in band.status.values] == ["ok", "some", "some", "all"]
    assert np.isfinite(band.upper).values.tolist() == [True, False, False, False]
    band = normal_band(posterior, [0.0, 0.65], reference=Circle(0.6, q=0.3))
    assert ["reference" in status for status in band.status.values] == [False, True]
    assert np.isnan(band.upper_x).values.tolist() == [False, True]


def test_a_normal_may_pass_below_a_contour():
    """It leads to the left, and climbs more slowly than the contour."""
    far = Parabola(np.array([1.0]), q=10.0)
    assert np.isnan(normal_offsets(far, Feet(np.array([-1.0]), np.array([0.0]), np.array([1.5])))).all()


def test_the_reference_is_the_most_central_draw():
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.9])
    band = normal_band(tree("parabola", a=np.full(5, 0.5), q=q, x_c=np.zeros(5)), [0.0, 0.5])
    np.testing.assert_allclose(band.y, [0.3, 0.425], rtol=1e-14)
    r = np.array([0.5, 0.5, 0.5, 0.8])
    band = normal_band(tree("circle", r=r, q=1.0 - r, x_c=0.0 * r), [0.0, 0.6])
    assert band.y[0] == pytest.approx(0.2)  # it alone reaches both places


def distances(place, foot, direction, a, q, x_c):
    """Squares of the distances along normals, of a parabola that is turned, scaled and shifted; by a quadratic."""
    (shift_x, shift_y, turn, growth), (centre_x, centre_y) = place, (foot[0].mean(), foot[1].mean())
    cos, sin = np.cos(turn), np.sin(turn)
    away_x, away_y = foot[0] - centre_x - shift_x, foot[1] - centre_y - shift_y
    x = (cos * away_x + sin * away_y) / (1.0 + growth) + centre_x - x_c
    y = (-sin * away_x + cos * away_y) / (1.0 + growth) + centre_y - q
    along_x, along_y = -np.sin(direction - turn), np.cos(direction - turn)
    # y + t along_y = a (x + t along_x)²
    square, linear, rest = a * along_x**2, 2.0 * a * x * along_x - along_y, a * x**2 - y
    t = 2.0 * rest / (-linear + np.sqrt(linear**2 - 4.0 * square * rest))
    return ((1.0 + growth) * t) ** 2


@pytest.mark.parametrize(("align", "count"), [("translation", 2), ("rigid", 3), ("similarity", 4)])
def test_contours_are_moved_to_where_another_search_finds_them_nearest(align, count):
    draws = np.array([[0.505, 0.496, 0.5], [0.303, 0.298, 0.3], [0.002, -0.003, 0.005]])
    reference = Parabola(0.5, q=0.3)
    locus = reference.locate(reference.parameter_of_x(np.linspace(-0.1, 0.6, 15)))
    foot = np.stack([locus.x, locus.y])
    contours = Parabola(*draws)
    moves = aligned(contours, locus, align)
    offsets = normal_offsets(contours, locus, moves)
    for k, values in enumerate(draws.T):

        def total(free, values=values):
            return distances(np.r_[free, np.zeros(4 - count)], foot, locus.slope_angle, *values).sum()

        shift, factor = moves.shift[k], moves.factor[k]
        place = np.array([shift.real, shift.imag, np.angle(factor), np.abs(factor) - 1.0])
        np.testing.assert_allclose(offsets[k] ** 2, distances(place, foot, locus.slope_angle, *values), atol=1e-13)
        best = scipy.optimize.minimize(total, np.zeros(count), method="BFGS", options={"gtol": 1e-12})
        assert np.sum(offsets[k] ** 2) <= 1.01 * best.fun + 1e-9


def test_a_shift_alone_leaves_no_band_of_the_shape():
    rng = np.random.default_rng(2)
    shifts = rng.normal(0.0, 0.01, (2, 60))
    posterior = tree("ellipse", a=np.full(60, 0.7), b=np.full(60, 0.5), q=0.3 + shifts[0], x_c=shifts[1])
    for band_of in (normal_band, contour_band):
        wide, narrow = (band_of(posterior, NEAR, align=align) for align in (None, "translation"))
        assert float((wide.upper - wide.lower).min()) > 0.02
        np.testing.assert_allclose(narrow.upper - narrow.lower, 0.0, atol=1e-7)


def test_units_and_attributes():
    assert contour_band(made(100), NEAR).lower.attrs["units"] == "1"
    in_si = tree("parabola", units="SI", a=[2.5], q=[0.1], x_c=[0.0])
    assert contour_band(in_si, NEAR).lower.attrs["units"] == "m"
    band = normal_band(in_si, NEAR, 0.9, True)
    assert {band[name].attrs["units"] for name in ("x", "y", "lower", "upper_x")} == {"m"}
    assert band.slope_angle.attrs["units"] == "rad"
    assert band.attrs == {"probability": 0.9, "simultaneous": 1}


def test_wrong_arguments_are_refused():
    posterior = spread("parabola")
    for band_of in (normal_band, contour_band):
        with refused(ParameterError, probability=1.0):
            band_of(posterior, NEAR, 1.0)
        with refused(ParameterError, "x"):
            band_of(posterior, [np.nan])
        with refused(ParameterError, align="turn"):
            band_of(posterior, NEAR, align="turn")
    for reference in (Parabola([0.5, 0.6], q=0.3), "truth"):
        with refused(ParameterError, "one contour"):
            normal_band(posterior, NEAR, reference=reference)


def comparison(probability, weight=None, none_fits=0):
    """A parabola at the height 0.3, and a circle at 0.5, each known exactly."""
    draws = np.full((2, 10, 4), np.nan)
    draws[0, :, :3], draws[1, :, :3] = (0.5, 0.3, 0.0), (0.8, 0.5, 0.0)
    variables = {"contour_draws": (("family", "contour_draw", "contour_parameter"), draws)}
    for name, values in {"probability": probability, "weight": weight}.items():
        variables |= {} if values is None else {name: ("family", np.array(values, dtype=float))}
    attrs = {"none_fits": none_fits, "units": "dimensionless"}
    return xr.Dataset(variables, coords={"family": ["parabola", "circle"]}, attrs=attrs)


def test_each_family_has_its_share_of_the_contours():
    heights = averaged_heights(comparison([0.75, 0.25]), np.zeros(1), 4000)[:, 0]
    assert np.count_nonzero(heights == 0.3) == 3000
    assert np.count_nonzero(heights == 0.5) == 1000


def test_the_band_spans_the_families_that_count():
    both = contour_band(comparison([0.75, 0.25]), [0.0], 0.9)
    assert [float(both[name][0]) for name in ("lower", "median", "upper")] == pytest.approx([0.3, 0.3, 0.5])
    assert both.attrs["averaged_by"] == "evidence"
    assert json.loads(both.attrs["weights"]) == {"parabola": 0.75, "circle": 0.25}
    one = contour_band(comparison([1.0, 0.0]), [0.0, 1.0], 0.9)
    assert one["upper"].values == pytest.approx([0.3, 0.8])  # though the circle ends before x = 1


def test_stacking_weights_replace_evidence_that_is_missing():
    band = contour_band(comparison([np.nan, np.nan], weight=[0.2, 0.8]), [0.0])
    assert band.attrs["averaged_by"] == "stacking"
    assert float(band["median"][0]) == pytest.approx(0.5)


def test_what_cannot_be_averaged_is_refused():
    for made, named in (
        (comparison([0.5, 0.5], none_fits=1), "fits"),
        (comparison([np.nan, 0.5]), "evidence"),
        (comparison([0.5, 0.5]).drop_vars("contour_draws"), "draws"),
    ):
        with refused(InferenceError, named):
            contour_band(made, [0.0])

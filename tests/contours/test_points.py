"""Contours from measured points: accuracy, strict convexity, refusals with their stretch, false alarms and power."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom, chi2

from helpers.refusals import refused
from tactile_bayes import scan
from tactile_bayes.contours import Circle, Ellipse, Parabola, PowerLaw
from tactile_bayes.contours.points import _FLOOR, FALSE_ALARM, Bends, from_points, refuse_two_bands
from tactile_bayes.errors import ContourError

ARCS = {
    "parabola": (Parabola(0.5, 0.3), -1.0, 0.8),
    "circle": (Circle(1.0, 0.3), -0.8, 0.7),
    "ellipse": (Ellipse(1.0, 0.5, 0.3, 0.2), -0.6, 0.8),
    "quartic": (PowerLaw(1.0, 4, 0.3), -1.0, 1.0),
}
each = pytest.mark.parametrize(("truth", "left", "right"), ARCS.values(), ids=ARCS)


def measured(truth, left, right, count=60, scatter=0.0, seed=0):
    """Unequally spaced points; their heights scatter."""
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(left, right, count)) if scatter else np.linspace(left, right, count)
    return x, truth.height(x) + scatter * rng.standard_normal(count)


def dented(depth, scatter, seed=0, count=100, at=0.3, half_width=0.15):
    """Points of 0.5 x² whose arc around `at` is replaced by its chord, and by `depth` more in the middle."""
    rng = np.random.default_rng(seed)
    x = np.linspace(-0.8, 0.8, count)
    t = (x - at) / half_width
    chord = 0.5 * (at**2 + half_width**2) + at * (x - at)
    y = np.where(np.abs(t) < 1, chord + depth * np.cos(0.5 * np.pi * t) ** 2, 0.5 * x**2)
    return x, y + scatter * rng.standard_normal(count)


@pytest.mark.parametrize(
    ("name", "height", "radius"), [("parabola", 1e-14, 1e-11), ("circle", 1e-6, 1e-3), ("quartic", 2e-5, 0.03)]
)
def test_exact_points_are_followed(name, height, radius):
    """Within few times what was found: heights 2e-15, 1e-7 and 6e-6, radii of curvature 2e-13, 3e-4 and 0.008. Those of
    the quartic where it is not about to vanish, |x| > 0.2: no B-spline of x² has positive coefficients."""
    truth, left, right = ARCS[name]
    contour = from_points(*measured(truth, left, right))
    x = np.linspace(left, right, 1001)
    assert np.abs(contour.height(x) - truth.height(x)).max() < height
    inner = x[100:-100] if name != "quartic" else x[100:-100][np.abs(x[100:-100]) > 0.2]
    true_radius = truth.radius_of_curvature(truth.locate(truth.parameter_of_x(inner)).slope_angle)
    _, slope, bend = contour.derivatives(inner)
    assert np.abs((1 + slope**2) ** 1.5 / bend / true_radius - 1).max() < radius


@each
@pytest.mark.parametrize("given_scatter", [True, False])
def test_the_heights_are_better_than_the_scatter(truth, left, right, given_scatter):
    """100 points and some ten degrees of freedom: errors of a third of the scatter. Mean of ten sets below half."""
    scatter, error = 0.003, []
    for seed in range(10):
        x, y = measured(truth, left, right, 100, scatter, seed)
        contour = from_points(x, y, scatter=scatter if given_scatter else None)
        error.append(np.mean((contour.height(x) - truth.height(x)) ** 2))
    assert np.sqrt(np.mean(error)) < 0.5 * scatter


@each
def test_the_scatter_is_estimated(truth, left, right):
    """Its square has at least 80 degrees of freedom in each of 20 sets: bounds at 1e-6 either way, and 3 % for bias."""
    ratio = [from_points(*measured(truth, left, right, 100, 0.003, seed)).scatter / 0.003 for seed in range(20)]
    lo, hi = np.sqrt(chi2.isf([1 - 1e-6, 1e-6], 20 * 80) / (20 * 80))
    assert 0.97 * lo < np.sqrt(np.mean(np.square(ratio))) < 1.03 * hi


def test_scatter_of_each_point_weighs():
    """Left half ten times better than the right half: so is the contour there, by a factor of four at least."""
    truth, error = Circle(1.0, 0.3), []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        x = np.linspace(-0.8, 0.8, 100)
        scatter = np.where(x < 0, 0.0005, 0.005)
        contour = from_points(x, truth.height(x) + scatter * rng.standard_normal(x.size), scatter=scatter)
        error.append((contour.height(x) - truth.height(x)) ** 2)
        np.testing.assert_array_equal(contour.scatter, scatter)
    assert np.mean(np.array(error)[:, x > 0]) > 4**2 * np.mean(np.array(error)[:, x < 0])


def test_repeated_and_unsorted_points():
    truth = Circle(1.0, 0.3)
    rng = np.random.default_rng(3)
    x = np.repeat(np.linspace(-0.8, 0.8, 20), 5)
    y = truth.height(x) + 0.002 * rng.standard_normal(x.size)
    contour = from_points(x, y)
    order = rng.permutation(x.size)
    shuffled = from_points(x[order], y[order])
    grid = np.linspace(-0.8, 0.8, 101)
    assert np.abs(contour.height(grid) - truth.height(grid)).max() < 0.003
    np.testing.assert_allclose(shuffled.height(grid), contour.height(grid), atol=1e-3 * 0.002)
    np.testing.assert_array_equal(shuffled.x, x[order])


def test_six_points_are_enough():
    x = np.array([-0.5, -0.2, 0.0, 0.1, 0.4, 0.5])
    np.testing.assert_allclose(from_points(x, 0.3 + x**2).height(x), 0.3 + x**2, atol=1e-12)


@st.composite
def convex_points(draw):
    """Points of a sum of a parabola, a power and a catenary, anywhere and in any unit, and their scatter."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    u = rng.uniform(-1, 1, draw(st.integers(20, 120)))
    power, centre, rate = draw(st.floats(1.3, 6)), draw(st.floats(-1, 1)), draw(st.floats(0.5, 4))
    parts = np.array([u**2, np.abs(u - centre) ** power, np.cosh(rate * u) / np.cosh(rate)])
    y = draw(st.lists(st.floats(0.1, 1), min_size=3, max_size=3)) @ parts + draw(st.floats(-2, 2)) * u
    scatter = draw(st.sampled_from([0.0, 1e-6, 1e-3, 0.01]))
    unit, away = 10.0 ** draw(st.integers(-4, 4)), draw(st.floats(-3, 3))
    return unit * (u + away), unit * (y + scatter * rng.standard_normal(u.size) - away), unit * scatter


@settings(max_examples=60, deadline=None, derandomize=True)  # a false alarm is rare, but not impossible
@given(convex_points(), st.booleans())
def test_every_contour_is_strictly_convex_and_smooth(points, tell):
    x, y, scatter = points
    contour = from_points(x, y, scatter=scatter if tell and scatter else None)
    lo, hi = contour.domain
    assert (lo, hi) == (x.min(), x.max())
    breaks = contour.graph.x
    grid = (breaks[:-1] + np.diff(breaks) * np.linspace(0, 1, 9)[:, None]).T.ravel()
    bend = contour.derivatives(grid)[2]
    mean = 2 * np.polynomial.Polynomial.fit(x, y, 2).convert().coef[2]
    assert bend.min() >= 0.999 * _FLOOR * mean
    chord = np.diff(contour.height(breaks)) / np.diff(breaks)
    ends = contour.derivatives(breaks)[1]
    assert np.all((ends[:-1] < chord) & (chord < ends[1:]))
    for order in range(4):  # no jump at a break
        before, here = (contour.graph(at, order) for at in (np.nextafter(breaks[1:-1], lo), breaks[1:-1]))
        size = np.abs(contour.graph(grid, order)).max() + np.abs(y).max() * (order == 0)
        np.testing.assert_allclose(before, here, rtol=0, atol=1e-9 * size)


def test_the_ends():
    x, y = measured(Parabola(0.5, 0.3), -1.0, 0.8)
    contour = from_points(x, y)
    np.testing.assert_array_equal(np.isnan(contour.height([-1.001, -1.0, 0.8, 0.801])), [True, False, False, True])
    assert ["first" in contour.end_name("left"), "last" in contour.end_name("right")] == [True, True]
    assert contour.point(0.1)[0] == pytest.approx(np.tan(0.1))


@pytest.mark.parametrize("unit", [1e-3, 0.25, 1000.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("scatter", [None, 0.003])
def test_any_unit_of_length_and_mirror_images(unit, side, scatter):
    """The weight is found to some 1e-6, which moves heights by a like share of the scatter."""
    x, y = measured(Circle(1.0, 0.3), -0.8, 0.7, scatter=0.003)
    contour = from_points(x, y, scatter=scatter)
    scaled = from_points(side * unit * x, unit * y, scatter=None if scatter is None else unit * scatter)
    grid = np.linspace(x[0], x[-1], 51)[1:-1]
    np.testing.assert_allclose(scaled.height(side * unit * grid) / unit, contour.height(grid), atol=1e-3 * 0.003)
    assert scaled.scatter == pytest.approx(unit * contour.scatter, rel=1e-5)
    assert scaled.residual_rms == pytest.approx(unit * contour.residual_rms, rel=1e-4)


def test_the_points_are_kept_as_they_were_and_the_text_is_short():
    x, y = (values.tolist() for values in measured(Parabola(0.5, 0.3), -1.0, 0.8, scatter=0.002))
    contour = from_points(x, y, scatter=0.002)
    np.testing.assert_array_equal(contour.x, x)
    np.testing.assert_array_equal(contour.y, y)
    assert contour.scatter == 0.002
    assert contour.residual_rms == pytest.approx(np.sqrt(np.mean((np.array(y) - contour.height(x)) ** 2)))
    assert len(repr(contour)) < 120
    with pytest.raises(ValueError, match="read-only"):
        contour.x[0] = 1.0


def stretch(error):
    found = re.search(r"x = (\S+) to (\S+): .* (\S+) standard errors", str(error.value))
    assert found, str(error.value)
    return float(found[1]), float(found[2]), float(found[3])


@pytest.mark.parametrize(
    ("depth", "scatter", "given", "least"), [(0.016, 0.002, 0.002, 0), (0.016, 0.002, None, 0), (1e-4, 0.0, 1e-7, 100)]
)
@pytest.mark.parametrize("seed", range(5))
def test_a_dent_of_several_scatters_is_named(depth, scatter, given, least, seed):
    """Eight scatters beyond the chord, some 19 points wide: caught 20 times out of 20; and one of exact points."""
    with refused(ContourError, "Leave this stretch out") as error:
        from_points(*dented(depth, scatter, seed), scatter=given)
    left, right, errors = stretch(error)
    assert errors > least
    overlap = min(right, 0.45) - max(left, 0.15)
    assert overlap > 0.7 * (right - left)


def test_the_message_tells_of_a_scatter_given_too_small():
    x, y = measured(Parabola(0.5, 0.3), -1.0, 0.8, 200, scatter=0.01)
    with pytest.raises(ContourError, match=r"suggest (9|1[01])\S* times the scatter given"):
        from_points(x, y, scatter=0.001)
    assert from_points(x, y, scatter=0.01).residual_rms == pytest.approx(0.01, rel=0.2)


def most(alarms_of, rate):
    """Alarms that come more often with a probability of 1e-4 only, where each has the rate promised."""
    return int(binom.isf(1e-4, alarms_of, rate))


@pytest.mark.slow
def test_bends_are_standard_normal_on_a_line_and_never_negative_on_a_convex_arc():
    rng, count, draws = np.random.default_rng(12), 30, 2000
    u, noise = np.sort(rng.uniform(-1, 1, count)), rng.uniform(0.5, 2.0, count)
    errors = np.array([Bends.of(u, 3 - u + noise * rng.standard_normal(count), noise).errors for _ in range(draws)])
    # Variances of `draws` draws have the relative standard deviation √(2/draws); five of them for some 130 stretches.
    assert np.abs(errors.var(axis=0) - 1).max() < 5 * np.sqrt(2 / draws)
    assert np.abs(errors.mean(axis=0)).max() < 5 / np.sqrt(draws)
    for arc in (u**2, np.abs(u - 0.2), np.maximum(0.0, u) ** 3):
        assert Bends.of(u, arc, noise).errors.min() > -1e-12


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "draws", "arc", "given"),
    [(count, 5000, lambda x: 0.0 * x, None) for count in (6, 8, 15, 40, 120)]
    + [(count, 2000, lambda x: 0.0 * x, 0.01) for count in (10, 40)]
    + [(count, 150, lambda x: np.maximum(0.0, x) ** 3, None) for count in (8, 40)],
)
def test_false_alarms(count, draws, arc, given):
    """About a line, where they are most likely, and half a line; with the scatter estimated or given."""
    rng, alarms = np.random.default_rng(14), 0
    for _ in range(draws):
        x = np.sort(rng.uniform(-1, 1, count))
        try:
            from_points(x, arc(x) + 0.01 * rng.standard_normal(count), scatter=given)
        except ContourError as error:
            alarms += "from a straight line" not in str(error)
    assert alarms <= most(draws, FALSE_ALARM)


X = np.linspace(-1.0, 1.0, 20)


@pytest.mark.parametrize(
    ("x", "y", "scatter", "named"),
    [
        (X[:5], X[:5] ** 2, None, ["5 different x", 6]),
        (np.repeat(X[:5], 4), np.repeat(X[:5] ** 2, 4), None, ["5 different x"]),
        ([], [], None, ["0 different x"]),
        (X, X[:-1] ** 2, None, ["x", 20, "y", 19]),
        (X, X**2, np.ones(19), ["x", 20, "scatter", 19]),
        (X.reshape(4, 5), X.reshape(4, 5), None, ["x", "(4, 5)"]),
        (0.0, 1.0, None, ["x", "()"]),
        (np.where(np.arange(20) == 3, np.nan, X), X**2, None, ["x[3]", "nan"]),
        (X, np.where(np.arange(20) == 7, np.inf, X**2), None, ["y[7]", "inf"]),
        (X, X**2, 0.0, ["scatter", 0.0]),
        (X, X**2, -0.1, ["scatter", -0.1]),
        (X, X**2, np.nan, ["scatter", "nan"]),
        (X, X**2, np.where(np.arange(20) == 2, 0.0, 0.1), ["scatter[2]", 0.0]),
        (X, 0.0 * X, None, ["straight line"]),
        (X, 0.1 + 0.3 * X, None, ["straight line"]),
        (X, 0.1 + 0.3 * X, 0.01, ["straight line"]),
        (X, 0.01 * X**2, 0.1, ["straight line"]),
        (X, -(X**2), None, ["upside down", "mirror y"]),
        (X, -np.cosh(X), 0.01, ["upside down"]),
    ],
)
def test_refusals(x, y, scatter, named):
    with refused(ContourError, *named):
        from_points(x, y, scatter=scatter)


@pytest.mark.parametrize("count", [30, 50, 101, 400])
@pytest.mark.parametrize("scatter", [0.0, 0.03])
@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_a_closed_outline_is_told_from_a_straight_line(count, scatter, tilt):
    t, rng = np.linspace(0.0, 2.0 * np.pi, count), np.random.default_rng(count)
    x = np.cos(t) + scatter * rng.standard_normal(count)
    y = 1.3 + np.sin(t) + tilt * x + scatter * rng.standard_normal(count)
    with refused(ContourError, "near x =", "at y =", "lower boundary"):
        from_points(x, y)


def test_scatter_and_repeated_points_are_no_outline():
    """Found is none in 1000 sets of points about a parabola; about a line, which is refused anyway, 1 of 5000."""
    rng, alarms = np.random.default_rng(15), 0
    for _ in range(1000):
        count, bend = rng.integers(6, 60), rng.choice([0.0, 1.0])
        x = np.round(rng.uniform(-1, 1, count), rng.integers(0, 4))
        y = bend * x**2 + rng.choice([0.1, 0.001]) * rng.standard_normal(count)
        try:
            refuse_two_bands(x, y)
        except ContourError:
            alarms += 1
    assert alarms <= most(1000, FALSE_ALARM)


def test_the_record_of_the_fit_is_that_of_the_contour():
    """80 exact points: the record within 2e-5 (3e-6 found), the snap-off within 1e-7 rad (3e-9 found)."""
    truth = Circle(1.0, 0.3)
    ours, theirs = (scan(contour) for contour in (from_points(*measured(truth, -0.9, 0.9, 80)), truth))
    for direction in ("forward", "backward"):
        mine, other = (s.events[direction].snap_off for s in (ours, theirs))
        assert mine.kind == other.kind
        assert mine.drive_angle == pytest.approx(other.drive_angle, abs=1e-7)
    for name in ("holding_moment", "force_x", "force_y"):
        np.testing.assert_allclose(ours.record[name], theirs.record[name], atol=2e-5)

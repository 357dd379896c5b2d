"""Contours: properties of every family drawn, the paper's formulas, ends and edges, and refusals."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays, broadcastable_shapes
from scipy.integrate import tanhsinh

from helpers.contours_drawn import FAMILIES, all_power_laws, circles, ellipses, functions, mirrored, parabolas
from helpers.refusals import refused
from tactile_bayes.contours import (
    Circle,
    Ellipse,
    Graph,
    Joined,
    MeasuredContour,
    Parabola,
    PowerLaw,
    ShapeFree,
    Smooth,
    from_function,
    paper_profile,
)
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.errors import ContourError

EPS = np.finfo(float).eps
STEEPEST = 1.5  # endless contours are tried up to here: there the tangent is 14, and heights have lost a digit
# Of x, y and the slope angle.
RATES = (
    lambda at: at.arclength_rate * np.cos(at.slope_angle),
    lambda at: at.arclength_rate * np.sin(at.slope_angle),
    lambda at: at.slope_rate,
)
FEW = settings(
    max_examples=settings.default.max_examples // 3,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)


def every(test):
    """Contours of each family."""
    return pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)(FEW(given(data=st.data())(test)))


def drawn(data, family):
    """A contour, and at least three slope angles that it has: those at its knots among them."""
    contour = data.draw(family, "contour")
    (lo, hi), shares = steepest(contour), st.lists(st.floats(0.0, 1.0), min_size=3, max_size=8, unique=True)
    alpha = lo + (hi - lo) * np.array(data.draw(shares, "shares"))
    knots = [float(contour.locate(knot).slope_angle) for knot in contour.knots]
    return contour, np.unique([*np.clip(alpha, lo, hi), *(knot for knot in knots if lo <= knot <= hi)])


def steepest(contour):
    """The slope angles between which a contour is tried, pulled in: rounded, that of an end may be beyond it."""
    lo, hi = (contour.locate(e).slope_angle if np.isfinite(e) else np.sign(e) * STEEPEST for e in contour.domain)
    return np.array([lo + 1e-9 if lo > -STEEPEST else -STEEPEST, hi - 1e-9 if hi < STEEPEST else STEEPEST])


def size_of(contour):
    """How far a contour reaches from the origin, as far as it is tried: one rounding of that is the unit of errors.
    Polynomials round all of them, height and slope, where they are steepest, tried or not."""
    ends = np.array(contour.derivatives(np.array(contour.domain))[:2]) if isinstance(contour, Graph) else 0.0
    return np.abs(contour.point(steepest(contour))).sum() + np.abs(ends).sum()


def smooth_stretches(contour, parameters):
    """Where to stop between parameters, so that the contour is smooth between stops."""
    pieces = contour.graph.x if isinstance(contour, MeasuredContour) else ()
    stops = np.unique([*parameters, *contour.knots, *pieces])
    return apart(stops[(stops >= min(parameters)) & (stops <= max(parameters))])


def apart(stops):
    """Stops of which none is the next one but for rounding."""
    return stops[np.diff(stops, append=np.inf) > 16.0 * EPS * (1.0 + np.abs(stops))]


def integrals(function, stops):
    """Integrals of a function between neighbouring stops, and what they may be off. By double-exponential quadrature,
    which does not mind powers at the stops. From level 6: two coarse levels in a row agree by chance now and then."""
    found = tanhsinh(function, stops[:-1], stops[1:], atol=1e-14, rtol=1e-14, minlevel=6)
    return found.integral, 2.0 * found.error + 1e-14


@every
def test_the_rates_add_up_to_the_locus(family, data):
    """The own parameter is continuous, over knots and edges too, and its rates are derivatives: to 64 roundings."""
    contour, alpha = drawn(data, family)
    stops = smooth_stretches(contour, contour.parameter_of_slope(alpha))
    here = contour.locate(stops)
    assert np.all(here.arclength_rate >= 0.0)
    assert np.all(here.slope_rate >= 0.0)
    for rate, value in zip(RATES, here[:3], strict=True):
        integral, off = integrals(lambda p, rate=rate: rate(contour.locate(p)), stops)
        slack = 64 * EPS * (size_of(contour) + np.pi + here.arclength_rate.max())
        assert np.all(np.abs(integral - np.diff(value)) <= off + slack)


@every
def test_a_chord_is_steeper_than_its_beginning_and_less_steep_than_its_end(family, data):
    """Strict convexity. Chords between points that rounding can tell apart, which may be few about a sharp vertex."""
    contour, alpha = drawn(data, family)
    x, y, alpha, *_ = contour.locate(contour.parameter_of_slope(alpha))
    run, rise, slope = np.diff(x), np.diff(y), np.tan(alpha)
    rounding = 8 * EPS * (size_of(contour) + run * (1.0 + slope[1:] ** 2 + slope[:-1] ** 2))
    assert np.all(run >= -rounding)
    rounding *= 1.0 + np.abs(slope[1:]) + np.abs(slope[:-1])
    above, below = rise - slope[:-1] * run, slope[1:] * run - rise
    assert np.all(np.minimum(above, below) >= -rounding)
    # Knots are ends of chords. Between them chord and tangents differ by some share of this, found to be 1/60 at least.
    told = run * np.diff(slope) > 1000 * rounding
    assert np.all(np.minimum(above, below)[told] > 0.0)


@every
def test_point_height_and_parameters_tell_of_one_contour(family, data):
    """Each within 32 roundings, but at the ends: an x there, rounded, may be beyond them."""
    contour, alpha = drawn(data, family)
    lo, hi = steepest(contour)
    alpha = alpha[(alpha > lo + 1e-6) & (alpha < hi - 1e-6)]
    x, y = contour.point(alpha)
    rounding = 32 * EPS * size_of(contour)
    assert np.all(np.abs(contour.height(x) - y) <= rounding * (1.0 + np.abs(np.tan(alpha))))
    assert np.all(np.abs(contour.locate(contour.parameter_of_x(x)).x - x) <= rounding)
    parameter = contour.parameter_of_slope(alpha)
    here = contour.locate(parameter)
    assert np.all(np.hypot(here.x - x, here.y - y) <= rounding * (1.0 + np.abs(np.tan(alpha))))
    per_rounding = 32 * EPS * (np.pi + here.slope_rate * np.abs(parameter))
    lost = 4.0 if family in (FAMILIES["function"], FAMILIES["measured"]) else 1.0  # sums of many terms
    assert np.all(np.abs(here.slope_angle - alpha) <= lost * per_rounding)
    with np.errstate(divide="ignore"):
        np.testing.assert_array_equal(contour.radius_of_curvature(alpha), here.arclength_rate / here.slope_rate)


@pytest.mark.parametrize("family", [FAMILIES[name] for name in FAMILIES if name not in ("function", "measured")])
@FEW
@given(data=st.data())
def test_mirror_images(family, data):
    """x → −x, α → −α. Families with formulas agree to the last digit, the others to 64 roundings."""
    contour, alpha = drawn(data, family)
    other = mirrored(contour)
    (lo, hi), (left, right) = steepest(contour), steepest(other)
    np.testing.assert_allclose([left, right], [-hi, -lo], rtol=0, atol=4 * EPS)
    knots = np.array([contour.locate(knot).slope_angle for knot in contour.knots]).reshape(-1, 1)
    alpha = alpha[(alpha > lo + 1e-6) & (alpha < hi - 1e-6)]
    (x, y), (u, v) = contour.point(alpha), other.point(-alpha)
    rounding = 0.0 if family in (parabolas, circles, ellipses, all_power_laws) else 64 * EPS * size_of(contour)
    lost = rounding + (64 * EPS * contour.radius_of_curvature(alpha) if rounding else 0.0)  # because α is rounded
    assert np.all(np.abs(u + x) <= lost)
    assert np.all(np.abs(v - y) <= lost)
    assert np.all(np.abs(other.height(-x) - contour.height(x)) <= rounding * (1.0 + np.abs(np.tan(alpha))))
    alpha = alpha[np.all(np.abs(knots - alpha) > 1e-6, axis=0)]  # there a radius has two values
    radius = contour.radius_of_curvature(alpha)
    np.testing.assert_allclose(other.radius_of_curvature(-alpha), radius, rtol=1e-12 if rounding else 0.0)


@FEW
@given(functions())
def test_mirror_images_of_functions(contour):
    """Interpolants are other ones, but as near to the function: 1e-14 of their largest coefficient, times √degree."""
    x, other = np.linspace(*contour.domain, 21), mirrored(contour)
    np.testing.assert_array_equal(other.domain, [-contour.right, -contour.left])
    size = np.abs(contour.height(x)).max()
    np.testing.assert_allclose(other.height(-x), contour.height(x), rtol=0, atol=1e-12 * size)


@every
def test_nothing_beyond_the_ends_and_of_what_is_no_number(family, data):
    contour = data.draw(family, "contour")
    lo, hi = steepest(contour)
    beyond = [end for end, outside in ((lo - 2e-9, lo > -STEEPEST), (hi + 2e-9, hi < STEEPEST)) if outside]
    for nowhere in (*beyond, 0.5 * np.pi + 1e-9, 2.0, -2.0, np.nan):
        assert np.isnan(contour.point(nowhere)).all()
        assert np.isnan(contour.radius_of_curvature(nowhere))
    assert np.isnan(contour.height(np.nan))
    assert np.isnan(contour.parameter_of_x(np.nan))
    for end, outward in zip(contour.domain, (-1.0, 1.0), strict=True):
        if np.isfinite(end) and np.abs(contour.locate(end).x) < 1e9:  # a parabola's slope angle ends at infinity
            outside = contour.locate(end).x + outward * 1e-9 * size_of(contour)
            assert np.isnan(contour.height(outside))
            assert np.isnan(contour.parameter_of_x(outside))


def test_a_circle_has_a_height_up_to_its_ends():
    circle = Circle(0.5, 0.3, 0.1)
    np.testing.assert_allclose(circle.height([-0.41, -0.4, 0.6, 0.61]), [np.nan, 0.8, 0.8, np.nan], rtol=4 * EPS)
    assert [float(end) for end in circle.domain] == [-np.pi / 2, np.pi / 2]


def test_the_papers_formulas():
    x = np.linspace(-0.9, 0.9, 19)
    iv = np.where(x < 0, 0.5 * x**2, x**4)
    for name, above in {"I": 0.7 * x**2, "II": 0.5 * x**2, "III": 1.0 - np.sqrt(1 - x**2), "IV": iv}.items():
        np.testing.assert_allclose(paper_profile(name, 0.3).height(x), above + 0.3, rtol=8 * EPS)


def test_the_radius_jumps_at_the_vertex_of_profile_four():
    iv = paper_profile("IV", 0.3)
    assert float(iv.radius_of_curvature(-1e-12)) == pytest.approx(1.0, abs=1e-11)
    assert np.isinf(iv.radius_of_curvature(0.0))
    assert {float(k) for k in iv.knots} == {0.0}
    np.testing.assert_allclose(iv.point([-1e-300, 0.0, 1e-300]), [[0, 0, 0], [0.3] * 3], atol=1e-90)


KNOTS = np.linspace(-1.3, 1.3, 5)


def shape_free(a, b, n, q, x_c):
    return ShapeFree(KNOTS, np.multiply.outer(np.log(a), KNOTS) + np.multiply.outer(b, KNOTS**2), x_c, q, at=0.2)


MAKERS = {
    "parabola": lambda a, b, n, q, x_c: Parabola(a, q, x_c),
    "circle": lambda a, b, n, q, x_c: Circle(a, q, x_c),
    "ellipse": lambda a, b, n, q, x_c: Ellipse(a, b, q, x_c),
    "power-law": lambda a, b, n, q, x_c: PowerLaw(a, n, q, x_c),
    "shape-free": shape_free,
    "flat-sided": lambda a, b, n, q, x_c: Smooth(np.multiply.outer(np.log(a), np.ones(4)), q, x_c, b, 0.5),
    "vertex": lambda a, b, n, q, x_c: Joined(Ellipse(a, b, q, x_c), PowerLaw(b, n, q, x_c)),
    "edge": lambda a, b, n, q, x_c: Joined(Parabola(a, q, x_c + 0.3), Parabola(a, q, x_c - 0.3), x=x_c),
}


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
@FEW
@given(data=st.data())
def test_arrays_of_parameters_are_many_contours(make, data):
    """Each equals the single contour of its own parameters, whichever way it is picked, but for rounding. Some
    processors raise arrays to powers otherwise than numbers."""
    shape = data.draw(broadcastable_shapes((), max_dims=2, max_side=3), "shape")
    ranges = (0.3, 2.0), (0.3, 2.0), (1.1, 6.0), (0.1, 0.9), (-0.5, 0.5)
    a, b, n, q, x_c = (data.draw(arrays(float, shape, elements=st.floats(*ends), fill=st.nothing())) for ends in ranges)
    q, x_c = q[..., :1] if q.ndim else q, x_c[:1] if x_c.ndim == 2 else x_c  # which broadcast
    alpha = data.draw(st.floats(-1.25, 1.25), "slope angle")

    many = make(a, b, n, q, x_c)
    full = many.broadcast_to(shape)
    flat = many.broadcast_to(shape).take(tuple(axis.ravel() for axis in np.indices(shape))) if shape else full
    assert many.shape == full.shape == shape
    x = data.draw(st.floats(-0.3, 0.3), "x")
    for number, index in enumerate(np.ndindex(shape)):
        one = make(*(float(np.broadcast_to(v, shape)[index]) for v in (a, b, n, q, x_c)))
        assert one.shape == ()
        for ask in (
            lambda c: c.point(alpha)[0],
            lambda c: c.point(alpha)[1],
            lambda c: c.radius_of_curvature(alpha),
            lambda c: c.height(x),
            lambda c: c.locate(c.parameter_of_x(x)).slope_angle,
            lambda c: c.locate(c.parameter_of_slope(alpha)).slope_rate,
        ):
            single = ask(one)
            assert np.shape(single) == ()
            for found in (ask(many)[index], ask(full)[index], *([ask(flat)[number]] if shape else [])):
                np.testing.assert_allclose(found, single, rtol=1e-12, atol=1e-14)
    if shape:
        index = np.arange(flat.shape[0])[:, None]
        table = flat.take(index).point(np.array([-0.3, 0.0, alpha]))
        assert np.shape(table) == (2, flat.shape[0], 3)
        np.testing.assert_array_equal(table[0][:, 2], flat.point(alpha)[0])


@pytest.mark.parametrize(
    ("build", "named"),
    [
        (lambda: paper_profile("V", 0.3), ["'V'", "'IV'"]),
        (lambda: Parabola(0.0, 0.3), ["Parabola", "a = 0.0"]),
        (lambda: Parabola([0.5, -0.2], 0.3), ["Parabola", "a = -0.2"]),
        (lambda: Parabola(np.inf, 0.3), ["Parabola", "a = inf"]),
        (lambda: Parabola(0.5, 0.3, [0.0, np.inf]), ["Parabola", "q = 0.3, x_c = inf"]),
        (lambda: Circle(np.inf, 0.3), ["Circle", "r = inf"]),
        (lambda: PowerLaw(1.0, 1.0, 0.3), ["PowerLaw", 1.1, "edge", "n = 1.0"]),
        (lambda: PowerLaw(1.0, 1000, 0.3), ["PowerLaw", "n", 50, "straight"]),
        (lambda: Ellipse(1.0, [1.0, -2.0], 0.3), ["Ellipse", "b = -2.0"]),
        (lambda: PowerLaw(1.0, np.nan, 0.3), ["PowerLaw", "n = nan"]),
        (lambda: Joined(Parabola(0.5, 0.3), Parabola(0.5, 0.31)), ["Joined", "left y = 0.3", "right y = 0.31"]),
        (lambda: Joined(Parabola(0.5, 0.3, 0.1), PowerLaw(1.0, 4, 0.3)), ["Joined", "vertex"]),
        (lambda: Joined(Parabola(0.5, 0.3), Circle(1.0, 0.3, 3.0), x=0.1), ["Circle", "x = 0.1"]),
        (lambda: Joined(Parabola(0.2, 0.3, -1.0), Parabola(0.2, 0.3, 1.0), x=0.0), ["slope", "dent"]),
        (lambda: ShapeFree([0.0, 0.1, 0.1, 0.2], np.zeros(4), 0, 0.3), ["ShapeFree", "increasing angles"]),
        (lambda: ShapeFree(KNOTS, np.zeros(4), 0, 0.3), ["ShapeFree", "log_radius", "(4,)", 5]),
        (lambda: ShapeFree(KNOTS, [0, 0, np.nan, 0, 0], 0, 0.3), ["ShapeFree", "log_radius", "finite"]),
        (lambda: ShapeFree([-1, 0, 1e-6, 1], [0, 0, 1, 0], 0, 0.3), ["log_radius", "knots"]),
        (lambda: ShapeFree(KNOTS, np.zeros(5), 0, np.inf), ["ShapeFree", "x", "y"]),
        (lambda: ShapeFree(KNOTS, np.zeros(5), 0, 0.3, at=1.4), ["at = 1.4", "-1.3 to 1.3"]),
        (lambda: from_function(np.sqrt, (-1, 1)), ["sqrt", "nan", "domain"]),
        (lambda: from_function(np.square, (1, -1)), ["domain", "(1.0, -1.0)"]),
        (lambda: from_function(np.square, (-1, 1), slope=np.abs), ["slope", "curvature"]),
        (lambda: from_function(lambda x: 1.0, (-1, 1)), ["<lambda>", "()"]),
        (lambda: Parabola([0.5, 0.6], [0.1, 0.2, 0.3]), ["Parabola", "a", "(2,)", "q", "(3,)"]),
        (lambda: Joined(Parabola([1, 2], 0.3), Parabola([1, 2, 3], 0.3)), ["Joined", "left", "(2,)", "right", "(3,)"]),
        (lambda: ShapeFree(KNOTS, np.zeros(5), [0, 1], [0.1, 0.2, 0.3]), ["ShapeFree", "x", "(2,)", "y", "(3,)"]),
        (lambda: Parabola("wide", 0.3), ["Parabola", "a", "'wide'"]),
        (lambda: Ellipse(1.0, None, 0.3), ["Ellipse", "b", None]),
        (lambda: Circle([[1.0], [1.0, 2.0]], 0.3), ["Circle", "r", [[1.0], [1.0, 2.0]]]),
        (lambda: Joined(Parabola(0.5, 0.3), 0.3), ["Joined", "right", 0.3]),
    ],
)
def test_refusals_say_what_was_wrong(build, named):
    with refused(ContourError, *named):
        build()


def test_joined_admits_rounding_of_the_vertex():
    third = 0.1 + 0.2
    assert third != 0.3
    joined = Joined(Parabola(0.5, third), PowerLaw(1.0, 4, 0.3))
    assert float(joined.height(0.0)) == pytest.approx(0.3, abs=EPS)


def test_an_edge_turns_on_the_spot():
    """Between the slopes of its halves an edge is an arc of radius zero; beyond them it is the halves."""
    left, right = Parabola(0.2, 0.3, 1.0), Ellipse(2.0, 0.8, 0.3, -1.0)
    x = 0.07
    right = Ellipse(2.0, 0.8, 0.3 + float(left.height(x) - right.height(x)), -1.0)
    edge = Joined(left, right, x=x)
    first, last = (float(half.locate(half.parameter_of_x(x)).slope_angle) for half in (left, right))
    assert first < -0.3 < 0.1 < last
    inside = np.linspace(first + 1e-9, last - 1e-9, 7)
    np.testing.assert_allclose(edge.point(inside), [[x] * 7, [float(left.height(x))] * 7], rtol=0, atol=4 * EPS)
    np.testing.assert_array_equal(edge.radius_of_curvature(inside), 0.0)
    for half, beyond in ((left, first - np.array([0.3, 1e-9])), (right, last + np.array([1e-9, 0.3]))):
        np.testing.assert_allclose(edge.point(beyond), half.point(beyond), rtol=0, atol=1e-14)
        np.testing.assert_allclose(edge.radius_of_curvature(beyond), half.radius_of_curvature(beyond), rtol=1e-12)
    across = np.array([-0.6, x, 0.4])
    np.testing.assert_array_equal(edge.height(across), [left.height(-0.6), right.height(x), right.height(0.4)])
    assert [edge.end_name(side) for side in ("left", "right")] == ["where it ends", "where it is vertical"]


@pytest.mark.parametrize(
    ("contour", "x"), [(from_function(np.square, (-1, 2)), 0.5), (ShapeFree(KNOTS, KNOTS, 0.2, 0.3), 0.5)]
)
def test_a_contour_may_be_half_of_a_joined_one(contour, x):
    y, slope = float(contour.height(x)), np.tan(contour.locate(contour.parameter_of_x(x)).slope_angle)
    tail = Parabola(2.0, y - slope**2 / 8.0, x - slope / 4.0)
    joined = Joined(contour, tail, x=x)
    assert joined.knots[-1] == 0.0  # no edge
    np.testing.assert_allclose(joined.height([0.3, 0.9]), [contour.height(0.3), tail.height(0.9)], rtol=1e-14)
    x, _ = joined.point(np.array([-0.1, 0.4, 1.4]))
    assert np.all(np.diff(x) > 0)


def test_the_function_with_and_without_its_derivatives():
    plain = from_function(lambda x: np.exp(x) - x, (-2, 1.5))
    given = from_function(lambda x: np.exp(x) - x, (-2, 1.5), slope=lambda x: np.exp(x) - 1, curvature=np.exp)
    alpha = np.linspace(-0.7, 1.2, 30)
    np.testing.assert_allclose(plain.point(alpha), given.point(alpha), rtol=0, atol=1e-12)
    np.testing.assert_allclose(plain.radius_of_curvature(alpha), given.radius_of_curvature(alpha), rtol=1e-10)
    assert np.isnan(plain.height([-2.01, 1.51])).all()
    assert np.isnan(plain.point([-0.9, 1.3])).all()  # slopes that it does not have
    assert repr(from_function(np.exp, (-1, 1))) == "from_function(exp, domain=(-1, 1))"


def test_shape_free_finds_the_circle_and_the_parabola():
    alpha = np.linspace(-1.2, 1.2, 40)
    circle = ShapeFree(KNOTS, np.full(5, np.log(0.7)), *Circle(0.7, 0.3, 0.2).point(0.4), at=0.4)
    np.testing.assert_allclose(circle.point(alpha), Circle(0.7, 0.3, 0.2).point(alpha), rtol=0, atol=2e-15)
    parabola, errors = Parabola(0.6, 0.3, 0.2), []
    for count in (21, 41, 81):  # the error of a cubic spline is of fourth order
        knots = np.linspace(-1.3, 1.3, count)
        free = ShapeFree(knots, np.log(parabola.radius_of_curvature(knots)), 0.2, 0.3)
        errors.append(np.abs(np.subtract(free.point(0.5 * alpha), parabola.point(0.5 * alpha))).max())
    assert errors[-1] < 1e-7
    assert errors[0] > 12 * errors[1] > 100 * errors[2]


@pytest.mark.parametrize("mirror", [pytest.param(False, marks=pytest.mark.slow), True])
@every
def test_in_the_sweep_frame(family, mirror, data):
    """Relative to the pivot, in rod lengths, mirrored: the same points, and rates that are derivatives still."""
    contour, alpha = drawn(data, family)
    length, standoff, base, side = 0.25, 0.02, (0.1, -0.2), -1.0 if mirror else 1.0
    bases = np.full((2, 3), np.array(base)[:, None])
    sweep_frame = SweepFrame(contour.broadcast_to((3,)), *bases, length, standoff, np.full(3, mirror))
    stops = side * smooth_stretches(contour, contour.parameter_of_slope(alpha))[:: int(side)]
    here = contour.locate(side * stops)
    locus = sweep_frame.locate(np.ones(stops.size, dtype=np.intp), stops)
    rounding = 64 * EPS * (1.0 + size_of(contour)) / length
    u, v = here.x + standoff * np.sin(here.slope_angle), here.y - standoff * np.cos(here.slope_angle)
    assert np.all(np.abs(locus.x - side * (u - base[0]) / length) <= rounding)
    assert np.all(np.abs(locus.y - (v - base[1]) / length) <= rounding)
    np.testing.assert_allclose(locus.slope_angle, side * here.slope_angle, rtol=4 * EPS)
    for rate, value in zip(RATES, locus[:3], strict=True):
        integral, off = integrals(
            lambda p, rate=rate: rate(sweep_frame.locate(np.zeros(p.shape, dtype=np.intp), p)), stops
        )
        assert np.all(np.abs(integral - np.diff(value)) <= off + rounding + 64 * EPS * locus.arclength_rate.max())
    lo, hi = sweep_frame.domain()
    assert np.all(lo < hi)


def test_an_open_end_is_brought_in_to_beyond_the_rods_reach():
    contour = PowerLaw(np.array([0.5, 2.0]), 4.0, 0.3, np.array([0.0, 3.0])).broadcast_to((2,))
    sweep_frame = SweepFrame(contour, np.zeros(2), np.zeros(2), 1.0, 0.0, np.array([False, True]))
    lo, hi = sweep_frame.domain()
    index = np.arange(2)
    assert np.all(sweep_frame.locate(index, lo).x < -1)
    assert np.all(sweep_frame.locate(index, hi).x > 1)
    assert np.all(np.isfinite([lo, hi]))

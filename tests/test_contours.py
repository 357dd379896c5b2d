"""Contours: geometry against differences, exact heights, symmetry, arrays of parameters, and refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from tactile_bayes.contours import (
    Circle,
    Ellipse,
    Joined,
    Parabola,
    PowerLaw,
    ShapeFree,
    from_function,
    paper_profile,
)
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.errors import ContourError

EPS = np.finfo(float).eps
ALPHAS = np.linspace(-1.2, 1.2, 25)  # 0 among them

CONTOURS = {
    "parabola": Parabola(0.4, 0.3, 0.2),
    "circle": Circle(0.7, -0.1, -0.3),
    "quadratic-power": PowerLaw(0.4, 2, 0.3, 0.2),
    "quartic": PowerLaw(1.3, 4, 0.3, 0.1),
    "odd-power": PowerLaw(0.8, 2.5, 0.4),
    "sharp-power": PowerLaw(0.8, 1.5, 0.4, -0.1),
    "flat-ellipse": Ellipse(1.4, 0.3, 0.3, 0.2),
    "tall-ellipse": Ellipse(0.3, 1.1, 0.3, -0.2),
    "catenary": from_function(lambda x: np.cosh(x - 0.1) - 0.7, (-2.5, 2.5)),
    "tangent": from_function(
        lambda x: 0.3 - np.log(np.cos(x)), (-1.4, 1.4), slope=np.tan, curvature=lambda x: 1 / np.cos(x) ** 2
    ),
    "shape-free": ShapeFree(np.linspace(-1.4, 1.4, 8), [0.3, -0.4, 0.1, 0.6, -0.2, -0.5, 0.2, 0.0], 0.1, 0.3),
    "joined": Joined(Parabola(0.5, 0.3, 0.2), Circle(0.6, 0.3, 0.2)),
    **{name: paper_profile(name, 0.3) for name in ("I", "II", "III", "IV")},
}
each = pytest.mark.parametrize("contour", CONTOURS.values(), ids=CONTOURS)


@each
def test_the_point_moves_along_the_slope_at_the_rate_of_the_radius(contour):
    """ξ' = ρ cos α and η' = ρ sin α: differences of order h⁴ with h = 1e-3 leave 1e-9 of the fifth derivative."""
    alpha = ALPHAS[np.abs(ALPHAS) > 0.01]
    h = 1e-3
    x, y = contour.point(alpha + h * np.array([-2, -1, 1, 2])[:, None])
    stencil = np.array([1, -8, 8, -1])[:, None] / (12 * h)
    radius = contour.radius_of_curvature(alpha)
    assert np.all(radius > 0)
    np.testing.assert_allclose((stencil * x).sum(0), radius * np.cos(alpha), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose((stencil * y).sum(0), radius * np.sin(alpha), rtol=1e-7, atol=1e-9)


@each
@pytest.mark.parametrize(("a", "b"), [(0.2, 1.1), (-1.0, -0.1)])
def test_the_radius_integrates_to_the_point(contour, a, b):
    (x0, y0), (x1, y1) = contour.point(a), contour.point(b)
    for trig, change in ((np.cos, x1 - x0), (np.sin, y1 - y0)):
        integral, error = quad(lambda t, trig=trig: float(contour.radius_of_curvature(t)) * trig(t), a, b, epsabs=1e-12)
        assert abs(integral - change) <= 1e-11 + 2 * error


@each
def test_strictly_convex_and_the_height_is_that_of_the_point(contour):
    x, y = contour.point(ALPHAS)
    assert np.all(np.diff(x) > 0)
    chord = np.diff(y) / np.diff(x)
    assert np.all(np.diff(chord) > 0)
    assert np.all(np.tan(ALPHAS[:-1]) < chord)
    assert np.all(chord < np.tan(ALPHAS[1:]))
    # The height of x, which is rounded, and its slope's worth.
    tolerance = 256 * EPS * (1 + np.abs(y) + np.abs(np.tan(ALPHAS)) * (1 + np.abs(x)))
    assert np.all(np.abs(contour.height(x) - y) <= tolerance)


@each
def test_the_own_parameter_is_continuous_and_its_rates_are_derivatives(contour):
    lo, hi = contour.parameter_of_slope(-1.1), contour.parameter_of_slope(1.1)
    p = np.linspace(lo, hi, 40)
    p = p[np.abs(p - contour.parameter_of_slope(0.0)) > 1e-2]
    here = contour.locate(p)
    back = contour.parameter_of_slope(here.slope_angle)
    assert np.all(np.abs(back - p) <= 64 * EPS * (1 + np.abs(p)))
    h = 1e-4
    x, y, slope, _, _ = contour.locate(p + h * np.array([-2, -1, 1, 2])[:, None])
    stencil = np.array([1, -8, 8, -1])[:, None] / (12 * h)
    dx, dy, dslope = ((stencil * v).sum(0) for v in (x, y, slope))
    np.testing.assert_allclose(np.hypot(dx, dy), here.arclength_rate, rtol=1e-8)
    np.testing.assert_allclose(np.arctan2(dy, dx), here.slope_angle, rtol=0, atol=1e-8)
    np.testing.assert_allclose(dslope, here.slope_rate, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize(
    ("make", "rest"),
    [
        (Parabola, (0.7,)),
        (Circle, (0.7,)),
        (Ellipse, (0.7, 0.4)),
        (PowerLaw, (1.2, 4)),
        (PowerLaw, (1.2, 2.5)),
        (PowerLaw, (1.2, 1.3)),
    ],
)
def test_mirror_symmetry_about_the_vertex(make, rest):
    contour = make(*rest, 0.3, 0.0)
    x, y = contour.point(ALPHAS)
    u, v = contour.point(-ALPHAS)
    np.testing.assert_array_equal(u, -x)
    np.testing.assert_array_equal(v, y)
    np.testing.assert_array_equal(contour.radius_of_curvature(-ALPHAS), contour.radius_of_curvature(ALPHAS))
    moved = make(*rest, 0.3, 0.25)
    assert np.all(np.abs(np.array(moved.point(ALPHAS)) - [x + 0.25, y]) <= 4 * EPS * (1 + np.abs(x)))


def test_the_papers_formulas():
    x = np.linspace(-0.9, 0.9, 19)
    np.testing.assert_allclose(paper_profile("I", 0.3).height(x), 0.7 * x**2 + 0.3, rtol=4 * EPS)
    np.testing.assert_allclose(paper_profile("II", 0.3).height(x), 0.5 * x**2 + 0.3, rtol=4 * EPS)
    np.testing.assert_allclose(paper_profile("III", 0.3).height(x), 1.3 - np.sqrt(1 - x**2), rtol=8 * EPS)
    iv = np.where(x < 0, 0.5 * x**2, x**4) + 0.3
    np.testing.assert_allclose(paper_profile("IV", 0.3).height(x), iv, rtol=4 * EPS)
    with pytest.raises(ContourError, match="no profile 'V': choose 'I', 'II', 'III' or 'IV'"):
        paper_profile("V", 0.3)


def test_the_radius_jumps_at_the_vertex_of_profile_four():
    iv = paper_profile("IV", 0.3)
    assert float(iv.radius_of_curvature(-1e-12)) == pytest.approx(1.0, abs=1e-11)
    assert np.isinf(iv.radius_of_curvature(0.0))
    assert {float(k) for k in iv.knots} == {0.0}
    np.testing.assert_allclose(iv.point([-1e-300, 0.0, 1e-300]), [[0, 0, 0], [0.3] * 3], atol=1e-90)


def test_nothing_beyond_a_contours_end():
    circle = Circle(0.5, 0.3, 0.1)
    assert np.isnan(circle.height([-0.41, 0.61])).all()
    np.testing.assert_allclose(circle.height([-0.4, 0.6]), 0.8, rtol=4 * EPS)
    assert np.isnan(circle.point([1.58, -1.58])).all()
    for contour in CONTOURS.values():
        assert np.isnan(contour.point([2.0, -2.0, np.nan])).all()
    assert np.isnan(Parabola(0.5, 0.3).point(np.nextafter(np.pi / 2, 2))).all()
    with np.errstate(all="raise"):
        lo, hi = circle.domain
    assert (float(lo), float(hi)) == (-np.pi / 2, np.pi / 2)


KNOTS = np.linspace(-1.3, 1.3, 5)

ARRAYS = {
    "parabola": (lambda a, q: Parabola(a, q, 0.1), Parabola),
    "circle": (lambda a, q: Circle(a, q, 0.1), Circle),
    "ellipse": (lambda a, q: Ellipse(a, 0.7, q, 0.1), Ellipse),
    "power": (lambda a, q: PowerLaw(a, 3.0, q, 0.1), PowerLaw),
    "sharp power": (lambda a, q: PowerLaw(a, 1.0 + a, q, 0.1), PowerLaw),
    "shape-free": (lambda a, q: ShapeFree(KNOTS, np.multiply.outer(a, KNOTS), 0.1, q), ShapeFree),
    "edge": (lambda a, q: Joined(Parabola(0.2 * a, q, 1.0), Parabola(0.2 * a, q, -1.0), x=0.0), Joined),
    "joined": (lambda a, q: Joined(Parabola(a, q, 0.1), PowerLaw(2 * a, 4.0, q, 0.1)), Joined),
}


@pytest.mark.parametrize(("make", "family"), ARRAYS.values(), ids=ARRAYS)
def test_arrays_of_parameters(make, family):
    a, q = np.array([0.3, 0.5, 1.1]), np.array([[0.2], [0.4]])
    many = make(a, q)
    assert many.shape == (2, 3)
    assert make(0.3, 0.2).shape == ()
    x, y = many.point(0.4)
    full = many.broadcast_to((2, 3))
    assert isinstance(full, family)
    assert full.shape == (2, 3)
    flat = make(*(v.ravel() for v in np.broadcast_arrays(a, q))).broadcast_to((6,))
    picked = flat.take(np.array([5, 0, 0]))
    assert isinstance(picked, family)
    assert picked.shape == (3,)
    for i in range(2):
        for j in range(3):
            one = make(a[j], q[i, 0])
            for array, single in zip((x, y), one.point(0.4), strict=True):
                assert array[i, j] == single
            assert full.height(0.3)[i, j] == one.height(0.3)
    assert picked.height(0.3)[0] == make(1.1, 0.4).height(0.3)
    assert np.all(picked.height(0.3)[1:] == make(0.3, 0.2).height(0.3))
    # Lanes along one axis and several slopes along another.
    table = flat.take(np.arange(6)[:, None]).point(np.array([-0.3, 0.0, 0.5]))
    assert np.shape(table) == (2, 6, 3)


def BATH(x):
    return np.maximum(np.abs(x) - 0.5, 0.0) ** 4


def BATH_SLOPE(x):
    return 4 * np.sign(x) * np.maximum(np.abs(x) - 0.5, 0.0) ** 3


def BATH_CURVATURE(x):
    return 12 * np.maximum(np.abs(x) - 0.5, 0.0) ** 2


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Parabola(0.0, 0.3), r"Parabola: a must be positive, else .*not strictly convex; found a = 0\.0"),
        (lambda: Parabola([0.5, -0.2], 0.3), r"not strictly convex; found a = -0\.2"),
        (lambda: Parabola(np.nan, 0.3), r"found a = nan"),
        (lambda: Parabola(np.inf, 0.3), r"found a = inf"),
        (lambda: Parabola(0.5, np.nan), r"Parabola: q and x_c must be finite; found q = nan, x_c = 0\.0"),
        (lambda: Parabola(0.5, 0.3, [0.0, np.inf]), r"found q = 0\.3, x_c = inf"),
        (lambda: Circle(0.0, 0.3), r"Circle: the radius r must be positive and finite; found r = 0\.0"),
        (lambda: Circle(-1.0, 0.3), r"found r = -1\.0"),
        (lambda: Circle(np.inf, 0.3), r"found r = inf"),
        (lambda: Circle(1.0, np.inf), r"Circle: q and x_c must be finite"),
        (lambda: PowerLaw(-1.0, 4, 0.3), r"PowerLaw: a must be positive"),
        (lambda: PowerLaw(1.0, 1.0, 0.3), r"PowerLaw: n must be at least 1\.1.*as good as an edge.*found n = 1\.0"),
        (lambda: Ellipse(0.0, 1.0, 0.3), r"Ellipse: the half-axis a must be positive and finite; found a = 0\.0"),
        (lambda: Ellipse(1.0, [1.0, -2.0], 0.3), r"the half-axis b must be positive.*found b = -2\.0"),
        (lambda: PowerLaw(1.0, np.nan, 0.3), r"found n = nan"),
        (lambda: PowerLaw(1.0, 4, 0.3, np.nan), r"PowerLaw: q and x_c must be finite"),
        (
            lambda: Joined(Parabola(0.5, 0.3), Parabola(0.5, 0.31)),
            r"Joined: the halves must meet at the joint: give both .*left y = 0\.3, .*right y = 0\.31",
        ),
        (lambda: Joined(Parabola(0.5, 0.3, 0.1), PowerLaw(1.0, 4, 0.3)), r"Joined: .*the same vertex"),
        (lambda: Joined(Parabola(0.5, 0.3), Circle(1.0, 0.3, 3.0), x=0.1), r"Circle.* is not there at x = 0\.1"),
        (lambda: Joined(Parabola(0.2, 0.3, -1.0), Parabola(0.2, 0.3, 1.0), x=0.0), r"the slope must not fall .*a dent"),
        (lambda: ShapeFree([0.0, 0.1, 0.1, 0.2], np.zeros(4), 0, 0.3), r"ShapeFree: .*increasing angles"),
        (lambda: ShapeFree(KNOTS, np.zeros(4), 0, 0.3), r"ShapeFree: log_radius of shape \(4,\).*each of 5"),
        (lambda: ShapeFree(KNOTS, [0, 0, np.nan, 0, 0], 0, 0.3), r"ShapeFree: log_radius must be finite"),
        (lambda: ShapeFree([-1, 0, 1e-6, 1], [0, 0, 1, 0], 0, 0.3), r"log_radius runs off to .*: knots that nearly"),
        (lambda: ShapeFree(KNOTS, np.zeros(5), 0, np.inf), r"ShapeFree: x and y must be finite"),
        (lambda: ShapeFree(KNOTS, np.zeros(5), 0, 0.3, at=1.4), r"at = 1\.4 is not among .* -1\.3 to 1\.3"),
        (lambda: from_function(np.abs, (-1, 1)), r"from_function: absolute is not smooth enough .*Joined"),
        (lambda: from_function(np.sin, (-1, 1)), r"not strictly convex: .*negative from x = 0\.00\d* to 0\.99"),
        (lambda: from_function(np.sqrt, (-1, 1)), r"sqrt is nan at x = -.*: shrink the domain"),
        (lambda: from_function(np.square, (1, -1)), r"the domain is \(1\.0, -1\.0\)"),
        (lambda: from_function(np.square, (-1, 1), slope=np.abs), r"both slope and curvature"),
        (lambda: from_function(lambda x: 1.0, (-1, 1)), r"<lambda> gives \(\).*element by element"),
        (
            lambda: from_function(np.square, (-1, 1), slope=lambda x: 2 * x, curvature=lambda x: 3 + 0 * x),
            r"the curvature given is not the derivative of the slope: from x = .* differ by 0\.00785",
        ),
        (
            lambda: from_function(np.square, (-1, 1), slope=lambda x: 3 * x, curvature=lambda x: 3 + 0 * x),
            r"the slope given is not the derivative of the function",
        ),
        (lambda: from_function(BATH, (-2, 2), slope=BATH_SLOPE, curvature=BATH_CURVATURE), r"straight from x = -0\.4"),
    ],
)
def test_refusals_say_what_was_wrong(build, message):
    with pytest.raises(ContourError, match=message):
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
    p = np.linspace(edge.parameter_of_slope(-0.9), edge.parameter_of_slope(0.9), 400)
    here = edge.locate(p)
    assert np.all(np.diff(here.slope_angle) > 0)
    assert np.all(np.diff(here.x) >= 0)
    assert np.abs(np.diff(here.slope_angle)).max() < 2 * np.diff(p).max()
    assert [edge.end_name(side) for side in ("left", "right")] == ["where it is over", "where it stands upright"]


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


# --- as the rod sees it ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mirrored", [False, True])
@each
def test_seen_from_the_pivot(contour, mirrored):
    """Relative to the pivot, in rod lengths, mirrored: the same points, and rates that are derivatives still."""
    length, standoff, base = 0.25, 0.02, (0.1, -0.2)
    side = -1.0 if mirrored else 1.0
    lanes = 2
    seen = SeenContour(
        contour.broadcast_to((lanes,)),
        np.full(lanes, base[0]),
        np.full(lanes, base[1]),
        length,
        standoff,
        np.full(lanes, mirrored),
    )
    alpha = np.array([-0.7, -0.2, 0.3, 0.9])
    p = side * contour.parameter_of_slope(alpha)
    locus = seen.locate(np.ones(4, dtype=np.intp), p)
    x, y = contour.point(alpha)
    bound = 64 * EPS * (1 + np.abs(x) + np.abs(y)) / length
    u, v = x + standoff * np.sin(alpha), y - standoff * np.cos(alpha)
    assert np.all(np.abs(locus.x - side * (u - base[0]) / length) <= bound)
    assert np.all(np.abs(locus.y - (v - base[1]) / length) <= bound)
    np.testing.assert_allclose(locus.slope_angle, side * alpha, rtol=0, atol=16 * EPS)
    ratio = locus.arclength_rate / locus.slope_rate
    np.testing.assert_allclose(ratio, (contour.radius_of_curvature(alpha) + standoff) / length, rtol=1e-13)
    h = 1e-5
    ahead, behind = (seen.locate(np.zeros(4, dtype=np.intp), p + s * h) for s in (1, -1))
    travelled = np.hypot(ahead.x - behind.x, ahead.y - behind.y) / (2 * h)
    np.testing.assert_allclose(travelled, locus.arclength_rate, rtol=1e-7)
    lo, hi = seen.domain()
    assert np.all(lo < hi)
    assert seen.knots().shape == (len(contour.knots), lanes)


def test_an_open_end_is_brought_in_to_beyond_the_rods_reach():
    contour = PowerLaw(np.array([0.5, 2.0]), 4.0, 0.3, np.array([0.0, 3.0])).broadcast_to((2,))
    seen = SeenContour(contour, np.zeros(2), np.zeros(2), 1.0, 0.0, np.array([False, True]))
    lo, hi = seen.domain()
    lanes = np.arange(2)
    assert np.all(seen.locate(lanes, lo).x < -1)
    assert np.all(seen.locate(lanes, hi).x > 1)
    assert np.all(np.isfinite([lo, hi]))

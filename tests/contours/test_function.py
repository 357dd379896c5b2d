"""Contours from functions: narrow features, jumps and kinks, and whether the advice of a refusal works."""

import math

import numpy as np
import pytest

from helpers.refusals import refused
from tactile_bayes import scan
from tactile_bayes.contours import Joined, Parabola, PowerLaw, from_function
from tactile_bayes.errors import ContourError

DOMAIN = (-2.0, 2.0)


def bumped(size, width, at=0.3):
    """A parabola with a bump, which is a dent where the size is positive."""
    return lambda x: 0.3 + 0.5 * x**2 + size * np.exp(-(((x - at) / width) ** 2))


@pytest.mark.parametrize("width", [0.02, 0.005, 0.001])
@pytest.mark.parametrize("at", [0.3, -1.234, 1.9])
def test_a_narrow_dent_is_refused_as_a_dent_with_its_place(width, at):
    with refused(ContourError, "convex", "from x =") as error:
        from_function(bumped(0.05, width, at), DOMAIN)
    words = str(error.value).replace(";", " ").split()
    left, right = (float(words[words.index(word) + shift]) for word, shift in (("from", 3), ("to", 1)))
    assert at - 12 * width < left < at + width
    assert at - width < right < at + 12 * width


def test_an_interpolant_is_the_function_between_its_nodes_too():
    """Seventeen nodes on (−2, 2) would miss a groove of this width, which leaves the object convex."""
    groove = bumped(-1e-3, 0.05, 0.11)
    contour = from_function(groove, DOMAIN)
    x = np.linspace(*DOMAIN, 5001)
    np.testing.assert_allclose(contour.height(x), groove(x), rtol=0, atol=1e-11)
    assert scan(contour).sweeps[0].snap_off.drive_angle != scan(Parabola(0.5, 0.3)).sweeps[0].snap_off.drive_angle


def test_a_narrow_feature_with_its_derivatives():
    """Narrower than the places at which derivatives are tried: they are right all the same."""
    e = 1e-6

    def rounded(factor):
        slope, curvature = lambda x: x / np.sqrt(x * x + e), lambda x: factor * e / np.sqrt(x * x + e) ** 3
        return from_function(lambda x: np.sqrt(x * x + e), DOMAIN, slope=slope, curvature=curvature)

    assert float(rounded(1.0).radius_of_curvature(0.0)) == pytest.approx(1e-3, rel=1e-9)
    with refused(ContourError, "g'' is not the derivative of g'"):
        rounded(1.1)


def two_parabolas(at):
    """y = x² and 0.5 x², shifted: the curvature jumps from 2 to 1."""
    g = lambda x: 0.3 + np.where(x < at, 1.0, 0.5) * (x - at) ** 2  # noqa: E731
    return g, lambda x: np.where(x < at, 2.0, 1.0) * (x - at), lambda x: np.where(x < at, 2.0, 1.0)


@pytest.mark.parametrize("at", [0.0, 0.1, -0.7])
@pytest.mark.parametrize("told", [False, True])
def test_where_the_curvature_jumps_halves_are_asked_for_and_they_work(at, told):
    g, slope, curvature = two_parabolas(at)
    given = {"slope": slope, "curvature": curvature} if told else {}
    with refused(ContourError, "at x ≈", "Joined(left, right, x=") as error:
        from_function(g, DOMAIN, **given)
    if told:
        assert "from 2 to 1" in str(error.value)
    x = float(str(error.value).rsplit("x=", 1)[1].rstrip(")"))
    assert x == pytest.approx(at, abs=1e-12)
    halves = [from_function(g, part) for part in ((DOMAIN[0], x), (x, DOMAIN[1]))]
    whole, truth = Joined(*halves, x=x), Joined(Parabola(1.0, 0.3, at), Parabola(0.5, 0.3, at))
    ours, theirs = (scan(contour, base=(at + 0.05, 0.0)) for contour in (whole, truth))
    for direction in ("forward", "backward"):
        a, b = (result.events[direction].snap_off for result in (ours, theirs))
        assert a.drive_angle == pytest.approx(b.drive_angle, abs=1e-9)


@pytest.mark.parametrize("at", [0.0, 0.13])
def test_a_power_with_a_broken_exponent_needs_its_derivatives_and_is_exact_with_them(at):
    def g(x):
        return 0.3 + np.abs(x - at) ** 2.5

    with refused(ContourError, f"x ≈ {at:g}", "slope", "curvature"):
        from_function(g, DOMAIN)
    contour = from_function(
        g,
        DOMAIN,
        slope=lambda x: 2.5 * np.sign(x - at) * np.abs(x - at) ** 1.5,
        curvature=lambda x: 3.75 * np.abs(x - at) ** 0.5,
    )
    ours, theirs = (scan(c, drive_step=0.1) for c in (contour, PowerLaw(1.0, 2.5, 0.3, at)))
    for name in ("holding_moment", "force_x", "force_y"):
        np.testing.assert_allclose(ours.record[name], theirs.record[name], rtol=0, atol=1e-11)
    assert ours.sweeps[0].snap_off.drive_angle == pytest.approx(theirs.sweeps[0].snap_off.drive_angle, abs=1e-13)


JUMPING, SLOPE, CURVATURE = two_parabolas(0.0)


@pytest.mark.parametrize(
    ("build", "named"),
    [
        (lambda: from_function(math.cosh, (-1, 1)), ["cosh", "np.vectorize(g)"]),
        (lambda: from_function(lambda x: x if x > 0 else -x, (-1, 1)), ["<lambda>", "np.vectorize(g)"]),
        (lambda: from_function(np.cosh, (-1, 1), slope=math.sinh, curvature=math.cosh), ["slope", "arrays"]),
        (lambda: from_function(0.3, (-1, 1)), ["g", 0.3]),
        (lambda: from_function(np.cosh, (-1, 1), slope=0, curvature=1), ["slope", 0]),
        (lambda: from_function(np.cosh, 1.0), ["domain", 1.0]),
        (
            lambda: from_function(
                lambda x: np.abs(x - 0.3) + x**2,
                DOMAIN,
                slope=lambda x: np.where(x < 0.3, -1.0, 1.0) + 2 * x,
                curvature=lambda x: 2.0 + 0.0 * x,
            ),
            ["g'", "x ≈ 0.3", "from -0.4 to 1.6", "Joined"],
        ),
        (
            lambda: from_function(lambda x: np.abs(x - 0.3) ** 2.5 + np.abs(x + 0.5) ** 2.5, DOMAIN),
            ["smooth", "(-2, 2)"],
        ),
        (
            lambda: from_function(JUMPING, DOMAIN, slope=SLOPE, curvature=lambda x: CURVATURE(x) + 0.01 * (x > 0.0)),
            ["g''", "from x ="],
        ),
    ],
)
def test_refusals(build, named):
    with refused(ContourError, *named):
        build()


def test_functions_of_one_number_work_when_vectorised():
    contour = from_function(np.vectorize(math.cosh), (-1, 1))
    assert float(contour.height(0.3)) == pytest.approx(math.cosh(0.3), abs=1e-14)

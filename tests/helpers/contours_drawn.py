"""Contours of every family, pivots and senses for hypothesis to draw: from tame to as odd as the library admits."""

from dataclasses import replace
from functools import singledispatch
from typing import NamedTuple

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from tactile_bayes.contours import (
    Circle,
    Contour,
    Ellipse,
    Joined,
    MeasuredContour,
    Parabola,
    PowerLaw,
    ShapeFree,
    from_function,
    from_points,
)
from tactile_bayes.contours.function import FunctionContour
from tactile_bayes.errors import ContourError, ReachError
from tactile_bayes.mechanics.paths import Paths
from tactile_bayes.sweep.path import sweep_paths


class Scene(NamedTuple):
    """A contour, and how it is swept."""

    contour: Contour
    base: tuple[float, float] = (0.0, 0.0)
    direction: str = "forward"

    def paths(self) -> Paths:
        """The path of the sweep."""
        return sweep_paths(self.contour, base=self.base, direction=self.direction)


def log_uniform(low: float, high: float) -> st.SearchStrategy[float]:
    """Sizes."""
    return st.floats(np.log(low), np.log(high)).map(lambda v: float(np.exp(v)))


heights = st.floats(0.05, 0.9)
places = st.floats(-0.6, 0.6)
exponents = st.one_of(st.sampled_from([1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0]), st.floats(1.2, 6.0))

parabolas = st.builds(Parabola, log_uniform(0.05, 10.0), heights, places)
circles = st.builds(Circle, log_uniform(0.02, 10.0), heights, places)
ellipses = st.builds(Ellipse, log_uniform(0.05, 5.0), log_uniform(0.05, 5.0), heights, places)
power_laws = st.builds(PowerLaw, log_uniform(0.05, 20.0), exponents, heights, places)


@st.composite
def vertex_joints(draw) -> Contour:
    """Two halves with one vertex, where the radius of curvature jumps: profile IV is one of them."""
    q, x_c = draw(heights), draw(places)

    def half():
        size, other = log_uniform(0.1, 5.0), log_uniform(0.1, 3.0)
        return draw(
            st.one_of(
                st.builds(lambda a: Parabola(a, q, x_c), size),
                st.builds(lambda a, b: Ellipse(a, b, q, x_c), other, other),
                st.builds(lambda a, n: PowerLaw(a, n, q, x_c), size, exponents),
            )
        )

    return Joined(half(), half())


def edge(x: float, y: float, slope_angles: tuple[float, float], sizes: tuple[float, float]) -> Contour:
    """Two parabolas that cross at a point, with an edge there, each with its slope angle and its size."""

    def half(slope_angle: float, a: float) -> Parabola:
        x_c = x - np.tan(slope_angle) / (2.0 * a)
        return Parabola(a, y - a * (x - x_c) ** 2, x_c)

    return Joined(*map(half, slope_angles, sizes), x=x)


@st.composite
def edges(draw) -> Contour:
    """Edges between parabolas."""
    x, y = draw(st.floats(-0.5, 0.5)), draw(st.floats(0.05, 0.8))
    before = draw(st.floats(-1.2, 1.0))
    after = min(before + draw(st.floats(1e-3, 2.0)), 1.3)
    return edge(x, y, (before, after), (draw(log_uniform(0.05, 10.0)), draw(log_uniform(0.05, 10.0))))


@st.composite
def shapes(draw) -> Contour:
    """Radii that go up and down by several factors of e, from one knot to the next."""
    count = draw(st.integers(4, 9))
    level, spread = draw(st.floats(-1.5, 0.8)), draw(st.floats(0.1, 1.5))
    wiggles = draw(st.lists(st.floats(-1.7, 1.7), min_size=count, max_size=count))
    radii = level + spread * np.array(wiggles)
    return ShapeFree(np.linspace(-1.5, 1.5, count), radii, draw(st.floats(-0.4, 0.4)), draw(heights))


contours = st.one_of(parabolas, circles, ellipses, power_laws, vertex_joints(), edges(), shapes())


@st.composite
def scenes(draw) -> Scene:
    """Sweeps that find their contour."""
    base = draw(st.one_of(st.just((0.0, 0.0)), st.tuples(st.floats(-0.6, 0.6), st.floats(-0.5, 0.2))))
    scene = Scene(draw(contours), base, draw(st.sampled_from(["forward", "backward"])))
    try:
        scene.paths()
    except (ContourError, ReachError):
        assume(False)
    return scene


# --- families that no sweep is drawn from ----------------------------------------------------------------------------

all_power_laws = st.builds(PowerLaw, log_uniform(0.05, 20.0), st.floats(1.1, 8.0), heights, places)


@st.composite
def functions(draw) -> Contour:
    """Catenaries, exponentials, and polynomials bent like sums of squares; with their derivatives given or not."""
    x_c, q = draw(places), draw(heights)
    domain = x_c - draw(st.floats(0.1, 1.5)), x_c + draw(st.floats(0.1, 1.5))
    kind = draw(st.sampled_from(["catenary", "exponential", "polynomial"]))
    if kind == "catenary":
        size = draw(log_uniform(0.3, 5.0))
        parts = (
            lambda x: q + 2.0 * size * np.sinh(0.5 * (x - x_c) / size) ** 2,
            lambda x: np.sinh((x - x_c) / size),
            lambda x: np.cosh((x - x_c) / size) / size,
        )
    elif kind == "exponential":
        size, rate = draw(log_uniform(0.05, 1.0)), draw(st.sampled_from([-1.0, 1.0])) * draw(log_uniform(0.5, 2.5))
        tilt = draw(st.floats(-1.0, 1.0))
        parts = (
            lambda x: q + size * np.exp(rate * (x - x_c)) + tilt * x,
            lambda x: size * rate * np.exp(rate * (x - x_c)) + tilt,
            lambda x: size * rate**2 * np.exp(rate * (x - x_c)),
        )
    else:
        root, width = np.polynomial.Polynomial([-draw(st.floats(-1.0, 1.0)), 1.0]), draw(log_uniform(0.1, 2.0))
        bend = draw(log_uniform(0.1, 3.0)) * (root**2 + width) ** draw(st.integers(1, 4))
        slope = bend.integ(k=draw(st.floats(-1.0, 1.0)))
        parts = slope.integ(k=q), slope, bend
    if draw(st.booleans()):
        return from_function(parts[0], domain, slope=parts[1], curvature=parts[2])
    return from_function(parts[0], domain)


@st.composite
def measured_contours(draw) -> Contour:
    """Fits to points of a function that scatter little."""
    truth, rng = draw(functions()), np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    x = rng.uniform(*truth.domain, draw(st.integers(12, 60)))
    y = truth.height(x)
    scatter = draw(st.sampled_from([0.0, 1e-6, 1e-3])) * np.ptp(y)
    try:
        return from_points(x, y + scatter * rng.standard_normal(x.size))
    except ContourError:  # as good as straight, or a false alarm
        assume(False)


FAMILIES = {
    "parabola": parabolas,
    "circle": circles,
    "ellipse": ellipses,
    "power-law": all_power_laws,
    "vertex": vertex_joints(),
    "edge": edges(),
    "function": functions(),
    "measured": measured_contours(),
    "shape-free": shapes(),
}


# --- mirrored --------------------------------------------------------------------------------------------------------


@singledispatch
def mirrored(contour: Contour) -> Contour:
    """The contour with x → −x: its family with the vertex on the other side."""
    return replace(contour, x_c=-contour.x_c)


@mirrored.register
def _(contour: Joined) -> Contour:
    return Joined(mirrored(contour.right), mirrored(contour.left), None if contour.x is None else -contour.x)


@mirrored.register
def _(contour: ShapeFree) -> Contour:
    knots, radii = -contour.slope_angles[::-1], contour.log_radius[..., ::-1]
    return ShapeFree(knots, radii, -contour.x, contour.y, -contour.at)


@mirrored.register
def _(contour: FunctionContour) -> Contour:
    return from_function(lambda x: contour.g(-x), (-contour.right, -contour.left))


@mirrored.register
def _(contour: MeasuredContour) -> Contour:
    return from_points(-contour.x, contour.y)

"""Contours of every family, pivots and senses for hypothesis to draw: from tame to as odd as the library admits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from tactile_bayes.contours import Circle, Contour, Ellipse, Joined, Parabola, PowerLaw, ShapeFree
from tactile_bayes.errors import ContourError, ReachError
from tactile_bayes.path import Paths
from tactile_bayes.sweep_path import sweep_paths


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


@st.composite
def edges(draw) -> Contour:
    """Two parabolas that cross, with an edge between them."""
    x, y = draw(st.floats(-0.5, 0.5)), draw(st.floats(0.05, 0.8))
    before = draw(st.floats(-1.2, 1.0))
    after = min(before + draw(st.floats(1e-3, 2.0)), 1.3)

    def half(slope_angle: float) -> Parabola:
        a = draw(log_uniform(0.05, 10.0))
        x_c = x - np.tan(slope_angle) / (2.0 * a)
        return Parabola(a, y - a * (x - x_c) ** 2, x_c)

    return Joined(half(before), half(after), x=x)


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

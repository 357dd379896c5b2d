"""Contours, rods and drives of all kinds, drawn at random, for tests of what scans of them hand out."""

import numpy as np

import tactile_bayes as tb
from helpers.contours_drawn import edge
from tactile_bayes.contours import Circle, Contour, Ellipse, Parabola, PowerLaw, from_function, from_points
from tactile_bayes.sweep.drive import Carried


def contour(rng: np.random.Generator) -> Contour:
    """A contour with a vertex or an edge, a closed one, or one that ends."""
    q, x_c = rng.uniform(0.2, 0.7), rng.uniform(-0.4, 0.4)
    match rng.integers(7):
        case 0:
            return Parabola(np.exp(rng.uniform(-1.5, 1.5)), q, x_c)
        case 1:
            return Circle(rng.uniform(0.05, 0.8), q, x_c)
        case 2:
            return Ellipse(rng.uniform(0.1, 0.8), rng.uniform(0.1, 0.8), q, x_c)
        case 3:
            return PowerLaw(np.exp(rng.uniform(-1.0, 1.5)), rng.uniform(1.4, 4.0), q, x_c)
        case 4:
            before, size = rng.uniform(-1.2, 0.8), np.exp(rng.uniform(-1.5, 1.0))
            after, other = min(before + rng.uniform(0.1, 1.8), 1.3), np.exp(rng.uniform(-1.5, 1.0))
            return edge(x_c, q, (before, after), (size, other))
        case 5:
            a, ends = rng.uniform(0.3, 2.0), x_c + np.array([-1.0, 1.0]) * rng.uniform(0.3, 1.0, 2)
            return from_function(lambda x: q + a * (np.cosh(x - x_c) - 1.0), ends)
        case _:
            x = np.sort(rng.uniform(x_c - rng.uniform(0.4, 1.0), x_c + rng.uniform(0.4, 1.0), 40))
            return from_points(x, q + rng.uniform(0.3, 2.0) * (x - x_c) ** 2)


def rod(rng: np.random.Generator, bend: float = 0.6) -> tb.Rod:
    """A straight, curved, tapered or thick rod, on a stem or not, of length one."""
    stem = float(rng.choice([0.0, rng.uniform(0.02, 0.3)]))
    curved = float(rng.uniform(-bend, bend))
    match rng.integers(5):
        case 0:
            return tb.Rod(stem=stem)
        case 1:
            return tb.Rod(rest_curvature=curved, stem=stem)
        case 2:
            return tb.Rod(taper=float(rng.uniform(0.1, 0.8)), diameter=0.02, stem=stem)
        case 3:
            return tb.Rod(diameter=float(rng.uniform(0.005, 0.05)), stem=stem)
        case _:
            return tb.Rod(rest_curvature=lambda s: curved * (0.3 + s), taper=float(rng.uniform(0.0, 0.6)), stem=stem)


def carried_drive(rng: np.random.Generator) -> Carried:
    """A drive that carries the base past the object, along one line or several."""
    count = int(rng.integers(2, 5))
    side = rng.choice([-1.0, 1.0])
    x = side * np.linspace(rng.uniform(0.5, 1.5), -rng.uniform(0.3, 1.5), count)
    y = rng.uniform(-0.6, 0.2) + rng.uniform(-0.3, 0.3, count)
    begin = rng.uniform(0.5, 2.2)
    angle = begin + rng.choice([0.0, 1.0]) * rng.uniform(-0.6, 0.6, count)
    angle = angle if side > 0.0 else np.pi - angle
    if count == 2 and rng.integers(2):
        way = np.array([x[-1] - x[0], y[-1] - y[0]])
        return tb.Translation(
            (float(x[0]), float(y[0])), float(np.arctan2(way[1], way[0])), float(angle[0]), float(np.hypot(*way))
        )
    return tb.Motion(x, y, angle)


def aimed_drive(rng: np.random.Generator, contour: Contour) -> Carried:
    """A drive of any heading and any direction of the rod, whose tip comes near the object or into it."""
    angle, heading = rng.uniform(-0.4, np.pi + 0.4), rng.uniform(-np.pi, np.pi)
    lowest = float(np.nanmin(contour.height(np.linspace(-0.5, 0.5, 41))))
    tip = np.array([rng.uniform(-1.2, 1.2), lowest + rng.uniform(-0.6, 0.4)])
    way, past = rng.uniform(0.3, 1.2), rng.uniform(0.0, 1.0)
    along = np.array([np.cos(heading), np.sin(heading)])
    begin = tip - np.array([np.cos(angle), np.sin(angle)]) - way * along
    if rng.integers(2):
        return tb.Translation((float(begin[0]), float(begin[1])), heading, angle, way + past)
    end = begin + (way + past) * along
    return tb.Motion([begin[0], end[0]], [begin[1], end[1]], [angle, angle + rng.uniform(-0.5, 0.5)])

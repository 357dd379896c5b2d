"""Strictly convex contours by slope angle; each family is a class on one small base."""

from tactile_bayes.contours.base import Contour, Graph, Locus, Single
from tactile_bayes.contours.checking import check
from tactile_bayes.contours.function import from_function
from tactile_bayes.contours.joined import Joined
from tactile_bayes.contours.oval import Circle, Ellipse
from tactile_bayes.contours.paper import paper_profile
from tactile_bayes.contours.parabola import Parabola
from tactile_bayes.contours.points import MeasuredContour, from_points
from tactile_bayes.contours.polyline import Polyline
from tactile_bayes.contours.power_law import PowerLaw
from tactile_bayes.contours.shape_free import ShapeFree
from tactile_bayes.contours.smooth import Smooth

__all__ = [
    "Circle",
    "Contour",
    "Ellipse",
    "Graph",
    "Joined",
    "Locus",
    "MeasuredContour",
    "Parabola",
    "Polyline",
    "PowerLaw",
    "ShapeFree",
    "Single",
    "Smooth",
    "check",
    "from_function",
    "from_points",
    "paper_profile",
]

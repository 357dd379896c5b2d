"""Strictly convex contours by slope angle; one family a class on one small base."""

from tactile_bayes.contours.base import Contour, Graph, Locus
from tactile_bayes.contours.circle import Circle
from tactile_bayes.contours.joined import Joined
from tactile_bayes.contours.paper import paper_profile
from tactile_bayes.contours.parabola import Parabola
from tactile_bayes.contours.power_law import PowerLaw

__all__ = ["Circle", "Contour", "Graph", "Joined", "Locus", "Parabola", "PowerLaw", "paper_profile"]

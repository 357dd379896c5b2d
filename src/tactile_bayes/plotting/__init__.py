"""Figures: every function takes and returns Axes.

Without Axes a function makes a figure itself, about 7 inches wide. Axes hold data in the units of the record, angles in
degrees; in SI their tick labels carry the prefix that the axis label names. Matplotlib is loaded when a figure is
made; its settings are left alone, and nothing is shown.
"""

from tactile_bayes.plotting.axes import PALETTE
from tactile_bayes.plotting.maps import band_detail, contour, rods
from tactile_bayes.plotting.posteriors import pairs, trace
from tactile_bayes.plotting.records import observables, predictive

__all__ = ["PALETTE", "band_detail", "contour", "observables", "pairs", "predictive", "rods", "trace"]

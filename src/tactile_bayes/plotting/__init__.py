"""Figures: every function takes and returns Axes.

If no Axes are given, a function makes a figure, about 7 inches wide. Axes hold data in the units of the record, angles
in degrees; in SI, tick labels carry the prefix that the axis label names. Matplotlib is loaded when a figure is made;
its settings do not change, and no figure is shown. `style` is a context manager that gives figures one look, for print
or for the screen.
"""

from tactile_bayes.plotting.alternatives import assumptions, families
from tactile_bayes.plotting.calibration_panels import calibration_ranks, coverage
from tactile_bayes.plotting.contacts import contact_ellipses, contact_regions, tightening
from tactile_bayes.plotting.contour_map import band_detail, contour, gap, overlaid
from tactile_bayes.plotting.design_map import design
from tactile_bayes.plotting.posteriors import pairs, trace
from tactile_bayes.plotting.reach_map import posterior_contours, prior_contours
from tactile_bayes.plotting.records import inspection, observables, predictive
from tactile_bayes.plotting.requirements import error_map, required_noise, required_rod
from tactile_bayes.plotting.scan_maps import rods, touched
from tactile_bayes.plotting.style import PALETTE, style
from tactile_bayes.plotting.sweep_plans import amplification, information, noise_shares

__all__ = [
    "PALETTE",
    "amplification",
    "assumptions",
    "band_detail",
    "calibration_ranks",
    "contact_ellipses",
    "contact_regions",
    "contour",
    "coverage",
    "design",
    "error_map",
    "families",
    "gap",
    "information",
    "inspection",
    "noise_shares",
    "observables",
    "overlaid",
    "pairs",
    "posterior_contours",
    "predictive",
    "prior_contours",
    "required_noise",
    "required_rod",
    "rods",
    "style",
    "tightening",
    "touched",
    "trace",
]

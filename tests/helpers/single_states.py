"""States of straight rods at given points of a contour, in closed form: independent of the path that leads there."""

from tactile_bayes.mechanics.elastica import wrench_from_contact
from tactile_bayes.mechanics.paths import States


def states_at(paths, index, parameter):
    """States at parameters of the contours, on their paths or beyond the end."""
    locus = paths.sweep_frame.locate(index, parameter)
    wrench = wrench_from_contact(locus.x, locus.y, locus.slope_angle, paths.sweeps.friction_angle[index])
    return States(parameter, locus.x, locus.y, locus.slope_angle, wrench)

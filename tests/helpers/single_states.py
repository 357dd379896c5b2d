"""Single states at given points of a contour: independent of the path that leads there."""

import numpy as np

from tactile_bayes.mechanics.elastica import wrench_from_contact
from tactile_bayes.mechanics.paths import States


def states_at(paths, index, parameter):
    """States of straight rods at parameters of the contours, on their paths or beyond the end."""
    locus = paths.sweep_frame.locate(index, parameter)
    wrench = wrench_from_contact(locus.x, locus.y, locus.slope_angle, paths.sweeps.friction_angle[index])
    return States(parameter, locus.x, locus.y, locus.slope_angle, wrench)


def assert_slopes_are_differences(x, y, alpha, delta, *, rtol=1e-5, atol, **rod):
    """Derivatives of the drive angle, where there is a difference to take: not near the end of the rod's reach."""
    out, step = wrench_from_contact(x, y, alpha, delta, **rod), 1e-5

    def angle(stretch, slope):
        return wrench_from_contact(stretch * x, stretch * y, alpha + slope, delta, phase=out.phase, **rod).drive_angle

    by_slope = (angle(1.0, step) - angle(1.0, -step)) / (2.0 * step)
    # r² changes by 4 ε of itself between points stretched by 1 ± ε.
    by_distance = (angle(1.0 + step, 0.0) - angle(1.0 - step, 0.0)) / (4.0 * step * (x * x + y * y))
    for found, right in ((out.by_slope, by_slope), (out.by_distance, by_distance)):
        smooth = np.abs(right) < 20.0
        assert smooth.mean() > 0.7
        np.testing.assert_allclose(found[smooth], right[smooth], rtol=rtol, atol=atol)

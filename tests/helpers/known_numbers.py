"""Numbers of all parameters of a rig that may be known, and a rig beside which they are: in its units, and in SI."""

from dataclasses import replace

import numpy as np

from tactile_bayes.contours import Circle
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig.parameters import PARAMETERS

# In units of the rod.
KNOWN = {
    "rigidity_scale": 1.04,
    "drive_angle_offset": 0.015,
    "moment_bias": 0.05,
    "force_x_bias": -0.04,
    "force_y_bias": 0.03,
    "lever_x": 0.005,
    "lever_y": -0.007,
    "backlash": 0.02,
    "friction": 0.15,
    "moment_drift": 0.1,
    "force_x_drift": 0.07,
    "force_y_drift": -0.08,
    "moment_gain": 1.03,
    "force_x_gain": 0.96,
    "force_y_gain": 1.05,
    "moment_curve_quadratic": -0.01,
    "moment_curve_cubic": 0.004,
    "lag": 1.3,
    "moment_lag": 0.4,
    "force_x_lag": 0.9,
    "force_y_lag": 2.1,
    "lag_seconds": 0.2,
    "moment_lag_seconds": 0.3,
    "force_x_lag_seconds": 0.1,
    "force_y_lag_seconds": 0.05,
    "play": 0.02,
    "moment_play": 0.03,
    "force_x_play": 0.01,
    "force_y_play": 0.05,
    "suspension_compliance": 0.03,
    "contact_compliance": 0.02,
    "rest_curvature": 0.11,
    "rest_shape_1": 0.7,
    "rest_shape_2": -0.4,
    "rest_shape_3": 1.2,
    "rest_shape_4": 0.5,
    "rest_shape_5": -0.8,
    "taper": 0.25,
    "taper_error": 0.9,
    "stem": 0.055,
    "length": 1.02,
    "gauge_x": 0.006,
    "gauge_y": -0.008,
    "noise_scale": 1.7,
    "base_2_x": 0.009,
    "base_2_y": -0.004,
}
PIN = Circle(0.3, 0.5, 0.02)
MODES = (
    lambda s: 0.3 * (1.0 - s) ** 2,
    lambda s: 0.2 * s,
    *(lambda s, k=k: 0.1 * np.cos(3.0 * k * s) for k in (2, 4, 6)),
)
ROD = Rod(rest_curvature=0.2, taper=0.2, stem=0.04, rest_shape_modes=MODES, taper_deviation=0.04)
CELL = LoadCell(gain=((1.02, 0, 0.03), (0, 0.97, 0.01), (0, 0, 1)), lever=(0.01, 0.02), moment_curve=(0.02, 0.001))
BASES = ((0.0, 0.0), (0.1, 0.03))


def scaled(length: float, rigidity: float):
    """Rod, load cell, contour, pivots and known numbers in SI."""
    modes = [lambda s, of=of: of(s / length) / length for of in MODES]
    options = {"stem": 0.04 * length, "rest_shape_modes": modes, "taper_deviation": 0.04}
    whole = Rod(length, rigidity, rest_curvature=0.2 / length, taper=0.2, **options)
    moment, force = whole.moment_unit, whole.force_unit
    units = {
        name: (force if name.startswith("force") else moment) ** of.powers[0] * length ** of.powers[1]
        for name, of in PARAMETERS.items()
    } | dict.fromkeys(("base_2_x", "base_2_y"), length)
    cell = replace(
        CELL,
        gain=((1.02, 0, 0.03 * length), (0, 0.97, 0.01), (0, 0, 1)),
        lever=(0.01 * length, 0.02 * length),
        moment_curve=(0.02 / moment, 0.001 / moment**2),
    )
    contour = Circle(0.3 * length, 0.5 * length, 0.02 * length)
    bases = tuple((x * length, y * length) for x, y in BASES)
    return whole, cell, contour, bases, {name: value * units[name] for name, value in KNOWN.items()}

"""Numbers of all parameters of a rig that may be known, and a rig beside which they are: in its units, and in SI."""

from dataclasses import replace

import numpy as np

from tactile_bayes.contours import Circle
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig.parameters import GROUPS, MEMORY, PARAMETERS

_NUMBERS = {
    ("rigidity_scale", "drive_angle_offset", "backlash", "friction", "noise_scale"): (1.04, 0.015, 0.02, 0.15, 1.7),
    ("lag", "lag_seconds", "play", "suspension_compliance", "contact_compliance"): (1.3, 0.2, 0.02, 0.03, 0.02),
    ("rest_curvature", "taper", "taper_error", "stem", "length"): (0.11, 0.25, 0.9, 0.055, 1.02),
    ("base_2_x", "base_2_y"): (0.009, -0.004),
    GROUPS["bias"]: (0.05, -0.04, 0.03),
    GROUPS["lever"]: (0.005, -0.007),
    GROUPS["drift"]: (0.1, 0.07, -0.08),
    GROUPS["gain"]: (1.03, 0.96, 1.05),
    GROUPS["moment_curve"]: (-0.01, 0.004),
    GROUPS["rest_shape"]: (0.7, -0.4, 1.2, 0.5, -0.8),
    GROUPS["gauge"]: (0.006, -0.008),
    MEMORY["lag"]: (0.4, 0.9, 2.1),
    MEMORY["lag_seconds"]: (0.3, 0.1, 0.05),
    MEMORY["play"]: (0.03, 0.01, 0.05),
}
# By name, in units of the rod.
KNOWN = {name: value for names, values in _NUMBERS.items() for name, value in zip(names, values, strict=True)}
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

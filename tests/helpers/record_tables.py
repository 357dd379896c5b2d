"""Tables that are records, and tables that are nearly so."""

import numpy as np

from tactile_bayes.mechanics.rods.rod import Rod

WIRE = Rod(length=0.2, flexural_rigidity=2.4e-3, diameter=0.7e-3)


def columns(**changes):
    """A sweep forward and one backward, of three samples each; a change to None takes a column away."""
    table = {
        "sweep": [0, 0, 0, 1, 1, 1],
        "direction": ["forward"] * 3 + ["backward"] * 3,
        "base_x": np.zeros(6),
        "base_y": np.full(6, 0.25),
        "drive_angle": [1.0, 1.1, 1.2, 2.0, 1.9, 1.8],
        "holding_moment": [0.0, 0.1, 0.2, 0.0, -0.1, -0.2],
        "force_x": [0.0, -0.1, -0.3, 0.0, 0.1, 0.3],
        "force_y": [0.0, 0.5, 0.7, 0.0, 0.5, 0.7],
        **changes,
    }
    return {name: values for name, values in table.items() if values is not None}


def edited(name, sample, value):
    """The columns with one cell replaced."""
    cells = list(columns()[name])
    cells[sample] = value
    return columns(**{name: cells})

"""Rods of every kind, drawn."""

import numpy as np

import tactile_bayes as tb


def drawn_rod(rng):
    """A rod that is straight, an arc, tapered, of a rigidity profile, of an uneven curvature, or traced."""
    taper = float(rng.choice([0.0, rng.uniform(0.1, 0.95)]))
    match rng.integers(6):
        case 0:
            return tb.Rod()
        case 1:
            return tb.Rod(rest_curvature=float(rng.uniform(-2.5, 2.5)))
        case 2:
            return tb.Rod(taper=float(rng.uniform(0.1, 0.95)))
        case 3:
            rate = rng.uniform(-3.0, 3.0)
            return tb.Rod(
                rigidity_profile=lambda s: np.exp(rate * s), rest_curvature=float(rng.choice([0.0, rng.uniform(-1, 1)]))
            )
        case 4:
            return tb.Rod(rest_curvature=(np.linspace(0.0, 1.0, 6), rng.uniform(-4.0, 4.0, 6)), taper=taper)
    angle = rng.uniform(-1.5, 1.5) * np.linspace(0.0, 1.0, 60) ** 2
    return tb.Rod.from_shape(np.cumsum(np.cos(angle)) / 60.0, np.cumsum(np.sin(angle)) / 60.0, taper=taper)

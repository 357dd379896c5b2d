"""Simulation-based calibration: do intervals hold as often as they state."""

from tactile_bayes.calibration.calibrate import calibrate, calibration_replicate
from tactile_bayes.calibration.simulated_experiment import Misspecification

__all__ = ["Misspecification", "calibrate", "calibration_replicate"]

"""Plans of a measurement: how its errors grow, what load cell and rod it needs, and where to sweep next."""

from tactile_bayes.planning.design import Criterion, design, usual_drives
from tactile_bayes.planning.error_map import Bands, error_map
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.requirement import required_noise, required_rod
from tactile_bayes.planning.rest_of_sweep import rest_of_sweep
from tactile_bayes.planning.sensitivity import sensitivity

__all__ = [
    "Bands",
    "Criterion",
    "Plan",
    "design",
    "error_map",
    "required_noise",
    "required_rod",
    "rest_of_sweep",
    "sensitivity",
    "usual_drives",
]

"""The load cell: what a sensor does to a record, and how likely what it measured is."""

from tactile_bayes.load_cell.cell import LoadCell
from tactile_bayes.load_cell.drift import OrnsteinUhlenbeck, RandomWalk
from tactile_bayes.load_cell.lone_samples import LoneSamples
from tactile_bayes.load_cell.roughness import rough_noise
from tactile_bayes.load_cell.zero_load import zero_load

__all__ = ["LoadCell", "LoneSamples", "OrnsteinUhlenbeck", "RandomWalk", "rough_noise", "zero_load"]

"""The load cell: a model of the sensor, which corrupts records and gives the likelihood of readings."""

from tactile_bayes.load_cell.cell import LoadCell
from tactile_bayes.load_cell.drift import OrnsteinUhlenbeck, RandomWalk
from tactile_bayes.load_cell.lone_samples import LoneSamples
from tactile_bayes.load_cell.zero_load import zero_load

__all__ = ["LoadCell", "LoneSamples", "OrnsteinUhlenbeck", "RandomWalk", "zero_load"]

"""Several independent emcee ensembles, run until R̂ and the effective sample size show that they agree.

Walkers of one ensemble are not independent: a chain is a whole ensemble, with its draws walker-major. Laid out step by
step, neighbours would be different walkers, and pass for nearly independent draws.
"""

from tactile_bayes.inference.ensembles.sampling import Draws, Progress, sample
from tactile_bayes.inference.ensembles.settings import SamplerSettings, settings_of
from tactile_bayes.inference.ensembles.walkers import scatter_walkers

__all__ = ["Draws", "Progress", "SamplerSettings", "sample", "scatter_walkers", "settings_of"]

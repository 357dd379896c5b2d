"""Several independent emcee ensembles, run until R̂ and the effective sample size show that they agree.

The walkers of one ensemble propose from one another and are not independent, so a convergence test across walkers
means nothing. Here a chain is a whole ensemble, several of them run side by side from their own starts and random
numbers, and the diagnostics compare ensembles. The draws of a chain are laid out walker-major, each walker's history in
one piece: laid out step by step, neighbours would be different walkers, and pass for nearly independent draws.

By default, seven proposals in ten come from a t distribution fitted to those walkers of the ensemble that do not move
meanwhile (after Boehl 2022, doi 10.2139/ssrn.4250395), which gives three to four times the effective draws per
evaluation if a posterior is nearly normal. The others are differential evolution (ter Braak 2006, doi
10.1007/s11222-006-8769-1; Nelson et al. 2014, doi 10.1088/0067-0049/210/1/11). Parameters may be sampled in other
coordinates, in which a proposal may be known, from which most steps are then taken; diagnoses and results are always of
the parameters. With a checkpoint, the state of the run is on disk every few seconds.
"""

from tactile_bayes.inference.ensembles.sampling import Draws, Progress, sample
from tactile_bayes.inference.ensembles.settings import SamplerSettings, settings_of
from tactile_bayes.inference.ensembles.walkers import scatter_walkers

__all__ = ["Draws", "Progress", "SamplerSettings", "sample", "scatter_walkers", "settings_of"]

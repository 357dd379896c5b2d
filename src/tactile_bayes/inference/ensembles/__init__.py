"""Several independent emcee ensembles, run until R̂ and the effective sample size show that they agree.

The walkers of one ensemble propose from one another and are not independent, so a convergence test across walkers
means nothing. Here a chain is a whole ensemble, several of them run side by side from their own starts and random
numbers, and the diagnostics compare ensembles.

The draws of a chain are laid out walker-major: each walker's history in one piece, one walker after the other. Laid
out step by step, neighbours in the array would be different walkers, and any estimate of autocorrelation would take
the draws for nearly independent.

By default, seven proposals in ten come from a t distribution fitted to those walkers of the ensemble that do not move
meanwhile (after Boehl 2022, doi 10.2139/ssrn.4250395), which gives three to four times the effective draws per
evaluation if a posterior is nearly normal. The others are differential evolution (ter Braak 2006, doi
10.1007/s11222-006-8769-1; Nelson et al. 2014, doi 10.1088/0067-0049/210/1/11): the difference of two other walkers,
scaled, which adapts to any shape, and now and then unscaled, which lets a walker jump between separated modes.

Parameters may be sampled in other coordinates; diagnoses and results are always of the parameters. `learn_coordinates`
finds such coordinates, and a proposal in them, by a short run whose draws are discarded. If there is a proposal, most
steps are taken from it; differential evolution with long and short steps covers what it misses.

With a checkpoint, every block of steps is on disk before the next begins. A block's file holds the last positions of
the walkers and the states of their random numbers, so that a killed run makes the same draws as an uninterrupted one.
"""

from tactile_bayes.inference.ensembles.draws import Draws
from tactile_bayes.inference.ensembles.sampling import Progress, sample
from tactile_bayes.inference.ensembles.settings import SamplerSettings, settings_of
from tactile_bayes.inference.ensembles.walkers import scatter_walkers

__all__ = ["Draws", "Progress", "SamplerSettings", "sample", "scatter_walkers", "settings_of"]

"""Several independent emcee ensembles, run until R̂ and the effective sample size say that they agree.

The walkers of one ensemble propose from one another and are not independent, so a convergence test across walkers
means nothing. Here a chain is a whole ensemble, several of them run side by side from their own starts and random
numbers, and the diagnostics compare ensembles.

The draws of a chain are laid out walker-major: each walker's history in one piece, one walker after the other. Laid
out step by step, neighbours in the array would be different walkers, and any estimate of autocorrelation would take
the draws for nearly independent.

Where nothing else is known, seven proposals in ten come from a t distribution fitted to those walkers of the ensemble
that do not move meanwhile (after Boehl 2022, doi 10.2139/ssrn.4250395), which gives three to four times the effective
draws per evaluation where a posterior is nearly normal. The others are differential evolution (ter Braak 2006, doi
10.1007/s11222-006-8769-1; Nelson et al. 2014, doi 10.1088/0067-0049/210/1/11): the difference of two other walkers,
scaled, which follows whatever shape there is, and now and then unscaled, which lets a walker jump between separated
modes.

Walkers may walk in other coordinates than the parameters, which then are what is judged and returned. `learned` finds
such coordinates, and a proposal in them, by a short run whose draws are thrown away. Where there is a proposal, most
steps are taken from it; what it misses is left to differential evolution, with long and short steps.

With a checkpoint, every block of steps is on disk before the next begins. A block's file holds the last positions of
the walkers and the states of their random numbers, so that a run that was killed makes the same draws as one that was
not.
"""

from tactile_bayes.inference.ensembles.coordinates import Coordinates, Logarithms, Plain, Proposing, in_coordinates
from tactile_bayes.inference.ensembles.draws import Draws
from tactile_bayes.inference.ensembles.moves import whitened_moves
from tactile_bayes.inference.ensembles.pilot import learned
from tactile_bayes.inference.ensembles.places import Place
from tactile_bayes.inference.ensembles.proposal import ANYTHING, Ends, Mixture, Proposal, approximate
from tactile_bayes.inference.ensembles.sampling import Progress, sample
from tactile_bayes.inference.ensembles.settings import SamplerSettings, settings_of
from tactile_bayes.inference.ensembles.straightened import Straightened
from tactile_bayes.inference.ensembles.walkers import Seed, scatter_walkers, seed_sequence, spawn

__all__ = [
    "ANYTHING",
    "Coordinates",
    "Draws",
    "Ends",
    "Logarithms",
    "Mixture",
    "Place",
    "Plain",
    "Progress",
    "Proposal",
    "Proposing",
    "SamplerSettings",
    "Seed",
    "Straightened",
    "approximate",
    "in_coordinates",
    "learned",
    "sample",
    "scatter_walkers",
    "seed_sequence",
    "settings_of",
    "spawn",
    "whitened_moves",
]

"""The posterior of every single contact, given its sample alone.

density        on the two sheets of contacts that a rod can make
proposal       normal densities on both, cut at the edge where they meet
importance     proposals weighed, with a certificate
draws          of all samples, by importance sampling or emcee
posterior      what users call
"""

from tactile_bayes.inference.contact_posterior.posterior import infer_contacts

__all__ = ["infer_contacts"]

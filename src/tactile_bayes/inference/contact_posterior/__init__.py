"""The posterior of every single contact, given its sample alone.

density        posterior density on the two sheets of contacts that a rod can make
proposal       normal proposal densities on both sheets, truncated at the edge where they meet
importance     importance sampling, with a certificate
draws          draws for all samples, by importance sampling or emcee
posterior      the public function
"""

from tactile_bayes.inference.contact_posterior.posterior import infer_contacts

__all__ = ["infer_contacts"]

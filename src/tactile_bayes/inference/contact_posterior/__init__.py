"""The posterior of every single contact, given its sample alone."""

from tactile_bayes.inference.contact_posterior.posterior import infer_contacts

__all__ = ["infer_contacts"]

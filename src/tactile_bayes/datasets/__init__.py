"""Synthetic data sets: from a specification to shards, a manifest and a data card, and back to records."""

from tactile_bayes.datasets.collection import open_dataset as open
from tactile_bayes.datasets.production import generate
from tactile_bayes.datasets.single_record import contour_of, record
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.datasets.specification_reading import read_specification
from tactile_bayes.datasets.verification import Verification, verify

__all__ = ["Specification", "Verification", "contour_of", "generate", "open", "read_specification", "record", "verify"]

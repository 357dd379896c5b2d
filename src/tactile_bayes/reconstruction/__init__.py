"""Step 2: contact points from a measured record, sample by sample, raw or constrained to possible contacts."""

from tactile_bayes.reconstruction.axial_score import AXIAL_ALARM
from tactile_bayes.reconstruction.estimate import STATUSES
from tactile_bayes.reconstruction.histories import drive_histories, least_turn, turned_sweeps
from tactile_bayes.reconstruction.samples import FALSE_ALARM, Samples, loaded_samples, samples_of
from tactile_bayes.reconstruction.senses import with_likelier_senses
from tactile_bayes.reconstruction.sides import (
    CONTACT_SIDES,
    OTHER_SIDE,
    contact_sides,
    side_of,
    sides_and_doubts,
    with_sides,
)
from tactile_bayes.reconstruction.step2 import contacts_of, reconstruct

__all__ = [
    "AXIAL_ALARM",
    "CONTACT_SIDES",
    "FALSE_ALARM",
    "OTHER_SIDE",
    "STATUSES",
    "Samples",
    "contact_sides",
    "contacts_of",
    "drive_histories",
    "least_turn",
    "loaded_samples",
    "reconstruct",
    "samples_of",
    "side_of",
    "sides_and_doubts",
    "turned_sweeps",
    "with_likelier_senses",
    "with_sides",
]

"""How far a posterior lets contours, contacts and readings range: bands, regions, moments and the gap."""

from tactile_bayes.uncertainty.band import contour_band, normal_band
from tactile_bayes.uncertainty.budget import uncertainty_budget
from tactile_bayes.uncertainty.contact_region import contact_moments, contact_region
from tactile_bayes.uncertainty.gap import gap
from tactile_bayes.uncertainty.implied_contacts import implied_contacts
from tactile_bayes.uncertainty.overlay import Overlay, overlay_distance, read_overlay
from tactile_bayes.uncertainty.predictive_interval import predictive_interval

__all__ = [
    "Overlay",
    "contact_moments",
    "contact_region",
    "contour_band",
    "gap",
    "implied_contacts",
    "normal_band",
    "overlay_distance",
    "predictive_interval",
    "read_overlay",
    "uncertainty_budget",
]

"""Step 1: the readings of a sweep along a contour, or states at slope angles, with events, labels and units."""

from tactile_bayes.sweep.columns import ManyUnits, to_lab_frame
from tactile_bayes.sweep.drive import (
    Carried,
    Direction,
    Drive,
    Motion,
    Rotation,
    Translation,
    drives_of,
    recorded_drives,
)
from tactile_bayes.sweep.events import Event, SweepEvents
from tactile_bayes.sweep.scanning import Scan, equilibria, scan
from tactile_bayes.sweep.scanning_many import scan_many
from tactile_bayes.sweep.template import blind_angles, record_template

__all__ = [
    "Carried",
    "Direction",
    "Drive",
    "Event",
    "ManyUnits",
    "Motion",
    "Rotation",
    "Scan",
    "SweepEvents",
    "Translation",
    "blind_angles",
    "drives_of",
    "equilibria",
    "record_template",
    "recorded_drives",
    "scan",
    "scan_many",
    "to_lab_frame",
]

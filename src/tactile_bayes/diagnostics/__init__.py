"""Diagnostics of a record and of a result.

`inspection`        inspects a record before anything is inferred from it
`units_and_signs`   checks units and signs of a record
`record_check`      checks a record against the model with which its contour was inferred
`verdicts`          judges a result and its assumptions
"""

from tactile_bayes.diagnostics.inspection import Inspection, inspect_record
from tactile_bayes.diagnostics.record_check import check_record
from tactile_bayes.diagnostics.units_and_signs import check_units_and_signs
from tactile_bayes.diagnostics.verdicts import verdicts

__all__ = ["Inspection", "check_record", "check_units_and_signs", "inspect_record", "verdicts"]

"""Diagnostics of a record and of a result.

`findings`          the table of what may be wrong, in sentences
`inspection`        inspects a record before anything is inferred from it
`result_check`      checks a result and its assumptions
`predictive_check`  compares a record with what its posterior predicts
"""

from tactile_bayes.diagnostics.findings import Finding
from tactile_bayes.diagnostics.inspection import Inspection, inspect_record
from tactile_bayes.diagnostics.result_check import Check, check

__all__ = ["Check", "Finding", "Inspection", "check", "inspect_record"]

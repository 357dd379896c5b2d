"""Diagnostics of a record and of a result."""

from tactile_bayes.diagnostics.findings import Finding
from tactile_bayes.diagnostics.inspection import Inspection, inspect_record
from tactile_bayes.diagnostics.result_check import Check, check

__all__ = ["Check", "Finding", "Inspection", "check", "inspect_record"]

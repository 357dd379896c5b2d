"""Inspection of a record before anything is inferred from it: its contents, and what looks wrong."""

from tactile_bayes.diagnostics.inspection.inspection import CellSource, Inspection, inspect_record, known_cell

__all__ = ["CellSource", "Inspection", "inspect_record", "known_cell"]

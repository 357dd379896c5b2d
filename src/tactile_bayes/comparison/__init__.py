"""Comparison of families of contours: cross-validation, stacking, evidence and a verdict."""

from tactile_bayes.comparison.families import compare_families
from tactile_bayes.comparison.streams import StreamComparison

__all__ = ["StreamComparison", "compare_families"]

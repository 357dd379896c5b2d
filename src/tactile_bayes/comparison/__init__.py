"""Comparison of families of contours: cross-validation, stacking, evidence and a verdict."""

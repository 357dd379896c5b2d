"""The comparison of families of contours: cross-validation, stacking, evidence and what they say."""

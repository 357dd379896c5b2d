"""Diagnostics of a record and of a result.

`inspection`        inspects a record before anything is inferred from it
`units_and_signs`   checks units and signs of a record
`record_check`      checks a record against the model with which its contour was inferred
`verdicts`          judges a result and its assumptions
"""

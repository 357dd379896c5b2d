"""The family of errors: each says what was wrong, where, and what to do."""

from __future__ import annotations

__all__ = [
    "ContourError",
    "InferenceError",
    "ParameterError",
    "ReachError",
    "RecordError",
    "TactileBayesError",
]


class TactileBayesError(Exception):
    """Base of every error that this package raises on purpose."""


class ParameterError(TactileBayesError, ValueError):
    """A parameter has a value that it cannot have."""


class ContourError(TactileBayesError, ValueError):
    """A contour is not strictly convex, cuts the base, or is asked for beyond its end."""


class ReachError(ContourError):
    """The rod cannot touch the contour from this base."""


class RecordError(TactileBayesError, ValueError):
    """A table cannot be a record of a sweep."""


class InferenceError(TactileBayesError, RuntimeError):
    """A posterior cannot be set up or sampled."""

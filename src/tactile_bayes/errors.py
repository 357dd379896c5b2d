"""The family of errors and warnings: each says what was wrong, where, and what to do."""

from __future__ import annotations

__all__ = [
    "CalibrationError",
    "ClearanceWarning",
    "ContourError",
    "DriftWarning",
    "InferenceError",
    "ParameterError",
    "ReachError",
    "RecordError",
    "SpecificationError",
    "StrainWarning",
    "StudyError",
    "TactileBayesError",
    "TactileBayesWarning",
    "TaskError",
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


class SpecificationError(TactileBayesError, ValueError):
    """A specification of a data set is impossible, or a folder holds another data set."""


class CalibrationError(TactileBayesError, ValueError):
    """A folder holds the replicates of another calibration."""


class StudyError(TactileBayesError, ValueError):
    """A folder holds the cells of another study, or the candidates of another design."""


class TaskError(TactileBayesError, RuntimeError):
    """Processes died over a task again and again."""


class TactileBayesWarning(UserWarning):
    """Base of every warning of this package."""


class ClearanceWarning(TactileBayesWarning):
    """After snap-off a straight rod would cut the object."""


class DriftWarning(TactileBayesWarning):
    """The zero of a load cell moved during a record."""


class StrainWarning(TactileBayesWarning):
    """A rod is bent beyond its elastic limit."""

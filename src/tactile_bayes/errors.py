"""Errors and warnings; each message says what is wrong, where, and what to do."""

__all__ = [
    "CalibrationError",
    "ClearanceWarning",
    "ContourError",
    "DriftWarning",
    "InferenceError",
    "ParameterError",
    "ReachError",
    "RecordError",
    "RecordWarning",
    "SpecificationError",
    "StrainWarning",
    "StudyError",
    "TactileBayesError",
    "TactileBayesWarning",
    "TaskError",
]


class TactileBayesError(Exception):
    """Base of all errors that this package raises deliberately."""


class ParameterError(TactileBayesError, ValueError):
    """A parameter has an invalid value."""


class ContourError(TactileBayesError, ValueError):
    """A contour is not strictly convex, cuts the base, or is needed beyond its end."""


class ReachError(ContourError):
    """The rod cannot touch the contour from this base."""


class RecordError(TactileBayesError, ValueError):
    """A table cannot be a record of a sweep.

    Attributes
    ----------
    lines : tuple of int
        Lines of a file with rows that no record can have; empty if something else is wrong.
    """

    lines: tuple[int, ...] = ()


class InferenceError(TactileBayesError, RuntimeError):
    """A posterior cannot be set up or sampled."""


class SpecificationError(TactileBayesError, ValueError):
    """The specification of a data set is invalid, or a folder contains another data set."""


class CalibrationError(TactileBayesError, ValueError):
    """A folder contains the replicates of another calibration."""


class StudyError(TactileBayesError, ValueError):
    """A folder contains the cells of another study, or the candidates of another design."""


class TaskError(TactileBayesError, RuntimeError):
    """Processes died repeatedly over a task."""


class TactileBayesWarning(UserWarning):
    """Base of all warnings of this package."""


class ClearanceWarning(TactileBayesWarning):
    """The unloaded rod would cut the object after snap-off."""


class DriftWarning(TactileBayesWarning):
    """The zero of a load cell moved during a record."""


class RecordWarning(TactileBayesWarning):
    """A file is read with units that it does not state, or may be cut short."""


class StrainWarning(TactileBayesWarning):
    """A rod is bent beyond its elastic limit."""

"""The record of a tactile sensor: its schema, validation, units, frame, and files (CSV and NetCDF)."""

from tactile_bayes.record.files import write_record
from tactile_bayes.record.frame import frame_of, in_frame, turned
from tactile_bayes.record.identity import record_hash
from tactile_bayes.record.points import read_points
from tactile_bayes.record.positions import means_of_positions, positions_of
from tactile_bayes.record.schema import (
    CHANNELS,
    COLUMNS,
    FRAMES,
    LOAD_CELL_UNITS,
    MEASURED,
    REQUIRED,
    Column,
    Frame,
    column_of,
    loads_of,
    present_channels,
)
from tactile_bayes.record.sweep import base_of_sample, bases_of, carried_sweeps, rows_of_sweeps, travel_unit, travels_of
from tactile_bayes.record.units import rod_of, to_dimensionless, to_si, with_rod
from tactile_bayes.record.validation import validate

__all__ = [
    "CHANNELS",
    "COLUMNS",
    "FRAMES",
    "LOAD_CELL_UNITS",
    "MEASURED",
    "REQUIRED",
    "Column",
    "Frame",
    "base_of_sample",
    "bases_of",
    "carried_sweeps",
    "column_of",
    "frame_of",
    "in_frame",
    "loads_of",
    "means_of_positions",
    "positions_of",
    "present_channels",
    "read_points",
    "record_hash",
    "rod_of",
    "rows_of_sweeps",
    "to_dimensionless",
    "to_si",
    "travel_unit",
    "travels_of",
    "turned",
    "validate",
    "with_rod",
    "write_record",
]

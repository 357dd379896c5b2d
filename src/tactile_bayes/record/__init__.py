"""The record of a tactile sensor: its schema, its validation, its units, and its files (CSV and NetCDF)."""

from tactile_bayes.record.channels import present_channels
from tactile_bayes.record.construction import make_record
from tactile_bayes.record.files import read_record, write_record
from tactile_bayes.record.identity import record_hash
from tactile_bayes.record.schema import CHANNELS, COLUMNS, MEASURED, REQUIRED, Column, column_of
from tactile_bayes.record.units import rod_of, to_dimensionless, to_si
from tactile_bayes.record.validation import validate

__all__ = [
    "CHANNELS",
    "COLUMNS",
    "MEASURED",
    "REQUIRED",
    "Column",
    "column_of",
    "make_record",
    "present_channels",
    "read_record",
    "record_hash",
    "rod_of",
    "to_dimensionless",
    "to_si",
    "validate",
    "write_record",
]

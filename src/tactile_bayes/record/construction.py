"""The construction of records, from columns and from tables."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_mapping, check_names, check_optional, refused, unmasked
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record.attributes import completed_attributes
from tactile_bayes.record.cell import number_in
from tactile_bayes.record.schema import CHANNELS, Frame
from tactile_bayes.record.table import Cells, Source, Table
from tactile_bayes.record.validation import checked_record

__all__ = ["completed_record", "make_record"]


def make_record(
    columns: Mapping[str, Any],
    *,
    rod: Rod | None = None,
    attrs: Mapping[str, Any] | None = None,
    missing: Collection[str] = (),
    load_cell_frame: Frame | None = None,
) -> xr.Dataset:
    """Make a record from a mapping of columns.

    Parameters
    ----------
    columns : mapping of str to array, shape (n_samples,)
        The columns of `MEASURED`, in the units of the record (angles in radians), and any further columns of numbers
        or text; a single value stands for a whole column. base_x and base_y are 0 by default. A channel that the rig
        does not measure is a column of NaN, or named in `missing`. Attributes `units` and `long_name` of a column (of a
        DataArray) are kept; true and false become 1 and 0.
    rod : Rod, optional
        The rod, with length and stiffness in SI units; the record is then SI. Without it, or with the dimensionless
        `Rod()`, the record is dimensionless: lengths in rod lengths L, moments in EI/L, forces in EI/L². Units and rod
        in `attrs` have precedence.
    attrs : mapping, optional
        Attributes of the record, strings and numbers: `load_cell_force_noise` and `load_cell_moment_noise` belong to
        the data sheet of the sensor, in the record's units; others are kept as they are.
    missing : collection of str, optional
        Channels that the rig does not measure.
    load_cell_frame : {"fixed", "turning"}, optional
        Frame of force_x and force_y: the axes of the laboratory, or those of a load cell that turns with the drive,
        along the rod at the pivot, (cos φ0, sin φ0), and across it, (−sin φ0, cos φ0), with the drive angle φ0. By
        default as `attrs` state, else "fixed".

    Returns
    -------
    xr.Dataset
        The record, dimension "sample"; every variable has attributes `units` and `long_name`.

    Raises
    ------
    RecordError
        If the columns are not a valid record; see `validate`.
    ParameterError
        If `missing` names something that is not a channel.

    Examples
    --------
    >>> from tactile_bayes.record import present_channels
    >>> record = make_record(
    ...     {"sweep": 0, "direction": "forward", "drive_angle": [1.2, 1.3], "holding_moment": [0.0, 0.4]},
    ...     missing=("force_x", "force_y"),
    ... )
    >>> record.attrs["units"], present_channels(record)
    ('dimensionless', ('holding_moment',))
    """
    if not isinstance(columns, Mapping) or isinstance(columns, xr.DataTree):
        raise refused("columns", columns, "give arrays by name of a column")
    check_mapping("attrs", attrs, "give strings and numbers by name")
    check_optional("the rod", rod, Rod)
    cells = {str(name): (np.array(unmasked(values)), getattr(values, "attrs", {})) for name, values in columns.items()}
    source = Source()
    lengths = [len(values) for values, _ in cells.values() if values.ndim == 1]
    shape = (lengths[0] if lengths else 0,)
    for name, (values, column_attrs) in cells.items():
        if values.ndim == 0 and lengths:
            cells[name] = (np.full(shape, values), column_attrs)
        elif values.shape != shape:
            expected = f"others have {shape}" if lengths else "(n_samples,) is wanted"
            raise source.error(f"column {name!r} has shape {values.shape}, where {expected}: give one value per sample")
    return completed_record(Table(cells, attrs or {}, source), rod, missing, load_cell_frame)


def completed_record(table: Table, rod: Rod | None, missing: Collection[str], frame: Frame | None) -> xr.Dataset:
    """Make a record from a table, with the given rod, missing channels and frame."""
    columns = _with_missing(table, [missing] if isinstance(missing, str) else check_names("missing", missing))
    return checked_record(Table(columns, completed_attributes(table.attrs, rod, frame, table.source), table.source))


def _with_missing(table: Table, missing: Collection[str]) -> dict[str, Cells]:
    """Add an empty column for each channel that is declared missing."""
    columns = dict(table.columns)
    for name in missing:
        if name not in CHANNELS:
            raise refused("missing", missing, f"{name!r} is no channel; the channels are {', '.join(CHANNELS)}")
        if name not in columns:
            columns[name] = (np.full(table.samples, np.nan), {})
        elif not all(_is_empty(cell) for cell in columns[name][0].tolist()):
            raise table.source.error(
                f"column {name!r} has values, but is declared missing: leave it out of missing=, or empty the column"
            )
    return columns


def _is_empty(cell: Any) -> bool:
    number = number_in(cell)
    return number is not None and math.isnan(number)

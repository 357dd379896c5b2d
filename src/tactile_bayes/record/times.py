"""The times of the samples of a record."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import RecordError
from tactile_bayes.record.origin import stem_and_unit
from tactile_bayes.record.quantity import converted, same_quantity
from tactile_bayes.record.schema import column_of

_ELSE = "give the lag in readings (lag) in place of seconds (lag_seconds)"


def times_of(record: xr.Dataset) -> Floats:
    """Return the times of the samples [s], from the further column of numbers in a unit of time, refuse without one.
    The unit is an attribute, or in the name, as in "time [ms]" or time_s. Of several columns that of "time" is taken.
    """
    found: dict[str, Floats] = {}
    for name in map(str, record.variables):
        (_, in_name), (before, _, ending) = stem_and_unit(name), name.rpartition("_")
        units = str(record[name].attrs.get("units", "")), in_name or (before and ending)
        pair = next(filter(None, (same_quantity(unit, "s") for unit in units)), None)
        if pair is not None and column_of(name) is None and record[name].dtype.kind in "fiu":
            found[name] = converted(record[name].values.astype(float), *pair)
    named = [name for name in found if "time" in name.lower()] or list(found)
    if len(named) != 1:
        which = f"several columns of times, {', '.join(named)}" if named else "no column of times, like time_s"
        raise RecordError(f"the record has {which}: name one time, or {_ELSE}")
    times = found[named[0]]
    is_later = np.isfinite(times)
    is_later[1:] &= times[1:] >= times[:-1]
    if not is_later.all():
        sample = int(np.argmin(is_later))
        raise RecordError(f"{named[0]} is {times[sample]:g} s at sample {sample}, not later: correct it, or {_ELSE}")
    return times

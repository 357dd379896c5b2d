"""A record that grows by samples in the order of their measurement."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.errors import RecordError
from tactile_bayes.record import carried_sweeps, validate


def continued(record: xr.Dataset, samples: xr.Dataset) -> xr.Dataset:
    """Return a record with new samples behind its own."""
    new = validate(samples)
    for name in sorted({*record.attrs, *new.attrs}, key=str):
        one, other = record.attrs.get(name, ""), new.attrs.get(name, "")
        if not np.array_equal(one, other):
            raise RecordError(
                f"attribute {name!r} of the new samples is {other!r}, but was {one!r}: give all samples in the same "
                "units, of the same rod and load cell"
            )
    if set(record.variables) != set(new.variables):
        odd = ", ".join(map(repr, sorted(map(str, set(record.variables) ^ set(new.variables)))))
        raise RecordError(f"the new samples and those before do not have the same columns, they differ in {odd}")
    last, first = int(record.sweep[-1]), int(new.sweep[0])
    had = set(record.sweep.values.tolist()) - {last}
    if again := sorted(had & set(new.sweep.values.tolist())):
        raise RecordError(
            f"sweep {again[0]} was over when sweep {last} began: give samples in the order in which they were measured"
        )
    joined = validate(xr.concat([record, new], "sample", combine_attrs="override"))
    if first == last and last not in carried_sweeps(joined):
        _refuse_return(record, new, last)
    return joined


def _refuse_return(record: xr.Dataset, new: xr.Dataset, sweep: int) -> None:
    """Refuse new samples that begin further back in a sweep than its encoder scatters."""
    sense = 1.0 if str(new.direction.values[0]) == "forward" else -1.0
    before, after = (sense * each.drive_angle.values[each.sweep.values == sweep] for each in (record, new))
    scatter = max((float(-np.diff(part).min(initial=0.0)) for part in (before, after)), default=0.0)
    scatter = max(scatter, float(record.attrs.get("load_cell_drive_angle_noise", 0.0)))
    if after[0] < before[-1] - 6.0 * scatter - 1e-9:
        raise RecordError(
            f"the new samples of sweep {sweep} begin at a drive angle of {sense * after[0]:.6g} rad, behind the last "
            f"one, {sense * before[-1]:.6g} rad: give each sample once, in the order in which they were measured"
        )

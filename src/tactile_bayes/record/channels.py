"""The channels of the load cell that a record has measured."""

from __future__ import annotations

import numpy as np
import xarray as xr

from tactile_bayes.record.schema import CHANNELS

__all__ = ["present_channels"]


def present_channels(record: xr.Dataset) -> tuple[str, ...]:
    """The channels that a record has measured: those that are not NaN throughout.

    Parameters
    ----------
    record : xr.Dataset
        A record.

    Examples
    --------
    >>> from tactile_bayes.record import make_record
    >>> columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2], "force_y": [0.1], "force_x": [0.0]}
    >>> present_channels(make_record(columns, missing=("holding_moment",)))
    ('force_x', 'force_y')
    """
    return tuple(name for name in CHANNELS if not np.isnan(record[name].values).all())

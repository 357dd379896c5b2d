"""Values of the wrong kind for one argument or another."""

import datetime
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers import public_calls as calls
from helpers.load_cells import CELL

# Values that few arguments take.
WRONG: list[Any] = [
    *(None, "", "left", "0.1", b"raw", math.nan, math.inf, -math.inf, -1, -0.5, 0, 1e-320, 1e308, 10**400, True),
    *(np.bool_(False), 1.5, 2 + 1j, np.complex128(1j), np.datetime64("2020-01-01")),
    *([], [None], ["left", 1], [math.nan, 1.0], [1.0, math.inf], [True, 1.0], [[1.0, 2.0], [3.0]]),
    *({}, {"left": 1}, {1: 2.0}, set(), np.array([]), np.array([1j, 2.0]), np.array(["a", "b"]), np.array([None, 1.0])),
    *(np.zeros((2, 3, 4)), np.array(math.nan), object(), xr.Dataset(), xr.DataArray([1.0, 2.0]), xr.DataTree()),
    *(tb.contours.Circle(0.5, 0.5), tb.contours.Circle([0.5, 0.6], 0.5), tb.Rod(), tb.Rod(0.1, 1e-5), CELL),
    *(tb.SamplerSettings(), stats.norm(0.0, 1.0), np.random.default_rng(1)),
]
# More of them, for tests that know of fewer arguments what is right.
MORE: list[Any] = [
    *(95, [0.1, 0.2], "no/such/file.nc", datetime.datetime(2020, 1, 1), np.ma.masked_array([1.0, 2.0], [False, True])),
    *(pd.Series([1.0, 2.0]), pd.DataFrame({"a": [1.0]}), tb.Rod, tb.LoadCell, tb.contours.Parabola, math.sin, tb),
    *(xr.Dataset({"force_x": (dimension, [1.0, 2.0])}) for dimension in ("time", "sample")),
    *(xr.DataTree.from_dict({"posterior": xr.Dataset()}), iter([1.0, 2.0]), slice(0, 2)),
]
# Makers of results, of which most arguments take one kind or none.
RESULTS: list[Callable[[], Any]] = [
    *(calls.measured, calls.posterior, calls.contacts, calls.contacts_drawn, calls.implied, calls.band, calls.gap),
    *(calls.scanned, calls.plan, calls.sensitivity, calls.designed, calls.compared, calls.calibrated, calls.trusted),
    calls.inspected,
]

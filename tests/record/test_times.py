"""Times of the samples of a record: where they are found, and what is refused."""

import numpy as np
import pytest

from helpers.load_cells import ideal
from helpers.refusals import refused
from tactile_bayes.errors import RecordError
from tactile_bayes.record.times import times_of

TIMES = np.array([0.5, 0.6, 0.6, 0.9, 1.5])


def record(units=None, **columns):
    made = ideal(**columns)
    for name in columns:
        made[name].attrs |= {} if units is None else {"units": units}
    return made


@pytest.mark.parametrize(
    "found",
    [
        record("s", clock=TIMES),
        record("ms", time=1000.0 * TIMES),
        record(t_s=TIMES),
        record(**{"Time (ms)": 1000.0 * TIMES}),
        record(**{"t [µs]": np.round(1e6 * TIMES).astype(int)}),
        record(time_s=TIMES, dwell_s=TIMES - 1.0),
        record(time_s=TIMES, s=np.zeros(5), time=list("abcde"), weight_N=TIMES),
    ],
)
def test_a_column_in_a_unit_of_time_has_the_times(found):
    np.testing.assert_allclose(times_of(found), TIMES, rtol=1e-12)


@pytest.mark.parametrize(
    ("found", "named"),
    [
        (record(time=TIMES), "time_s"),
        (record(time_s=TIMES, time_ms=TIMES), "time_ms"),
        (record(time_s=TIMES[::-1]), "sample 1"),
        (record(time_s=np.where(TIMES > 1.0, np.nan, TIMES)), "sample 4"),
        (record(time_s=np.full(5, np.inf)), "sample 0"),
    ],
)
def test_without_times_or_with_times_that_go_back_a_lag_is_in_readings(found, named):
    with refused(RecordError, named, "lag_seconds"):
        times_of(found)

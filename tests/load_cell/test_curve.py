"""The curve of a sensor: its inverse, its saturation, and what it changes in a cell."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helpers.load_cells import cell, ideal
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.load_cell.curve import curved, straightened, unsaturated

COEFFICIENTS = st.floats(-2.0, 2.0).map(lambda v: round(v, 3))


@given(COEFFICIENTS, COEFFICIENTS, st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=8))
def test_the_curve_is_inverted_up_to_saturation(quadratic, cubic, moments):
    moments = np.array(moments)
    low, high = unsaturated(quadratic, cubic)
    values = curved(moments, quadratic, cubic)
    back = straightened(values, quadratic, cubic)
    np.testing.assert_allclose(curved(back, quadratic, cubic), values, rtol=1e-9, atol=1e-9)
    inside = (moments > low) & (moments < high)
    assert np.all((back >= low) & (back <= high))
    slopes = 1.0 + moments * (2.0 * quadratic + 3.0 * cubic * moments)
    steep = inside & (slopes > 0.01)
    np.testing.assert_allclose(back[steep], moments[steep], rtol=1e-7, atol=1e-7)


@given(COEFFICIENTS, COEFFICIENTS)
def test_the_curve_never_falls(quadratic, cubic):
    moments = np.linspace(-10.0, 10.0, 2001)
    values = curved(moments, quadratic, cubic)
    assert np.all(np.diff(values) >= -1e-12 * np.abs(values).max())
    low, high = unsaturated(quadratic, cubic)
    inside = moments[(moments > low) & (moments < high)]
    np.testing.assert_array_equal(
        curved(inside, quadratic, cubic), inside * (1.0 + inside * (quadratic + cubic * inside))
    )


def test_the_end_is_at_the_extremum_of_the_cubic():
    assert unsaturated(0.1, -0.02)[1] == pytest.approx(max(np.roots([-0.06, 0.2, 1.0])))
    assert unsaturated(0.0, 0.0) == (-np.inf, np.inf)


def test_a_saturated_sensor_reads_the_same_from_there_on():
    record = ideal()
    strong = record.assign(holding_moment=record.holding_moment * 100.0)
    measured = LoadCell(moment_curve=(0.0, -1.0)).measure(strong, rng=1)
    assert float(measured.holding_moment.max()) == pytest.approx(2.0 / np.sqrt(27.0))


def test_the_moment_alone_is_straightened():
    sheet = LoadCell(gain=((2.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), moment_curve=(0.3, 0.1))
    record = ideal(missing=("force_x", "force_y"))
    measured = sheet.measure(record, rng=1)
    moment = record.holding_moment.values
    np.testing.assert_allclose(measured.holding_moment, 2.0 * (moment + 0.3 * moment**2 + 0.1 * moment**3), rtol=1e-14)
    np.testing.assert_allclose(sheet.corrected(measured).holding_moment, moment, rtol=1e-12, atol=1e-14)


def test_slopes_are_those_of_readings():
    sheet = cell(gain=((1.1, 0.02, 0.0), (0.0, 0.9, 0.0), (0.1, 0.0, 1.0)), lever=(0.1, 0.2), moment_curve=(0.3, 0.1))
    loads = np.random.default_rng(1).normal(size=(7, 3))
    for channel in range(3):
        step = 1e-6 * np.eye(3)[channel]
        change = (sheet.expected(loads + step) - sheet.expected(loads - step)) / 2e-6
        np.testing.assert_allclose(sheet.slopes(loads)[..., channel], change, atol=1e-7)

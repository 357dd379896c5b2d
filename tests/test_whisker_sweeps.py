"""A real whisker: the rod of its trace explains its readings at known points, and along a real cylinder."""

import numpy as np
import pytest
from benchmarks import whisker_sweeps
from scipy.optimize import least_squares

from helpers.contour_posteriors import only
from tactile_bayes.contours import Circle
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.family import Gauge
from tactile_bayes.rig import Rig

# The likeliest draw of `python -m benchmarks.whisker_sweeps`.
RIG = {
    "drive_angle_offset": -0.0168945,
    "friction": 0.499503,
    "rest_shape_1": 0.484229,
    "rest_shape_2": 0.0182758,
    "rest_shape_3": 0.379892,
    "rest_shape_4": 2.64461,
    "rest_shape_5": -0.576152,
    "moment_gain": 0.875982,
    "moment_curve_quadratic": 778.27,
    "moment_curve_cubic": 1.82393e6,
    "suspension_compliance": 1300.49,
    "gauge_x": 0.289417e-3,
    "gauge_y": 3.31184e-3,
}


def model_of(record, unknown, **contour):
    rig = Rig(load_cell=whisker_sweeps.SENSOR, unknown=only(*unknown))
    model = Experiment(record, rig, **contour).model
    model.likelihood.exact = True  # a table would pay from a thousand evaluations on
    return model


def residuals(model, values):
    """Readings less those expected, in counts."""
    point = np.array([[values[name] for name in model.forward_parameters]])
    expected = model.likelihood.load_cell.expected(model.loads(point))[0, :, 0] * model.likelihood.rod.moment_unit
    return model.measured.holding_moment.values - expected


@pytest.fixture(scope="module")
def whisker():
    if not whisker_sweeps.MEASURED.is_dir():
        missing = f"no folder {whisker_sweeps.MEASURED}"
        pytest.skip(f"the measured whisker is not here: {missing} (set TACTILE_BAYES_MEASURED)")
    return whisker_sweeps.whisker()


def test_readings_at_known_points_are_explained(whisker):
    """Readings reach 3,200 counts; there and back they differ by 6."""
    gauge = Gauge(Circle(r=1e-5, q=-1e-5))
    left = residuals(model_of(whisker_sweeps.points(whisker), RIG, gauge=gauge), RIG)
    assert np.sqrt(np.mean(left**2)) < 6.0


@pytest.mark.slow
@pytest.mark.parametrize("trial", [0, 3])
def test_a_cylinder_of_15_mm_is_found(whisker, trial):
    """With the rig of the points, and a coefficient of friction of its own; 0.3 more is a radius of 0.7 mm less."""
    record = whisker_sweeps.record_of(f"cylinder_may25/trial{trial}", whisker)
    rig = {name: v for name, v in RIG.items() if not name.startswith("gauge")} | {"friction": 0.2}
    model = model_of(record, [*rig, "moment_bias"], family="circle")

    def left(place):
        r, q, x_c, bias = place
        return residuals(model, rig | {"r": 1e-3 * r, "q": 1e-3 * q, "x_c": 1e-3 * x_c, "moment_bias": bias})

    found = least_squares(left, [10.0, 15.0, 0.0, 0.0], x_scale=[1.0, 1.0, 1.0, 10.0], diff_step=1e-4)
    assert np.sqrt(np.mean(found.fun**2)) < 6.0
    assert found.x[0] == pytest.approx(15.0, abs=1.0)

"""A real whisker: the rig of its files explains readings at known points, and along a real cylinder."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from benchmarks import whisker_square, whisker_sweeps
from scipy.optimize import least_squares

import tactile_bayes as tb
from helpers.contour_posteriors import only
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.family import Gauge

# The likeliest draw of `calibrate-rig` with points.toml.
RIG = {
    "drive_angle_offset": -0.0172311,
    "friction": 0.518344,
    "rest_shape_1": -0.0704946,
    "rest_shape_2": 0.0812379,
    "rest_shape_3": -0.185097,
    "rest_shape_4": 1.12729,
    "rest_shape_5": -1.76606,
    "moment_gain": 0.881639,
    "moment_curve_quadratic": 482.103,
    "moment_curve_cubic": 1.90475e6,
    "suspension_compliance": 1576.23,
    "stem": 3.9979e-3,
    "gauge_x": 0.236672e-3,
    "gauge_y": 2.77545e-3,
}


def model_of(name, rig, unknown, **contour):
    record = tb.read_record(whisker_sweeps.MEASURED / name, rig)
    model = Experiment(record, replace(rig, unknown=only(*unknown)), **contour).model
    model.likelihood.exact = True  # a table would pay from a thousand evaluations on
    return model


def residuals(model, values):
    """Readings less those expected, in counts."""
    point = np.array([[values[name] for name in model.forward_parameters]])
    expected = model.likelihood.load_cell.expected(model.loads(point))[0, :, 0] * model.likelihood.rod.moment_unit
    return model.measured.holding_moment.values - expected


@pytest.fixture(scope="module")
def rigs(tmp_path_factory):
    """The rigs of the points and of the sweeps."""
    if not whisker_sweeps.MEASURED.is_dir():
        missing = f"no folder {whisker_sweeps.MEASURED}"
        pytest.skip(f"the measured whisker is not here: {missing} (set TACTILE_BAYES_MEASURED)")
    folder = tmp_path_factory.mktemp("whisker")
    whisker_sweeps.prepare(folder)
    points = tb.Rig.read(folder / "points.toml")
    (folder / "rig").mkdir()
    points.write(folder / "rig" / "rig.toml")
    return points, tb.Rig.read(folder / "sweeps.toml")


@pytest.mark.parametrize(("series", "most"), [("series < 5", 6.0), ("series >= 5", 9.0)])
def test_readings_at_known_points_are_explained(rigs, series, most):
    """Readings reach 3,200 counts; there and back, of which the rig is from the former, they differ by 6."""
    table = rigs[0].format.table
    points = replace(rigs[0], file={**table, "where": table["where"].replace("series < 5", series)})
    probe = Gauge(tb.contours.Circle(r=1e-5, q=-1e-5))
    left = residuals(model_of("calibration_in_plane.csv", points, RIG, gauge=probe), RIG)
    assert left.size == 30
    assert np.sqrt(np.mean(left**2)) < most


@pytest.mark.parametrize("trial", [0, pytest.param(3, marks=pytest.mark.slow)])
def test_a_cylinder_of_15_mm_is_found(rigs, trial):
    """With the rig of the points, and a coefficient of friction of its own; 0.3 more is a radius of 0.7 mm less."""
    rig = {name: v for name, v in RIG.items() if not name.startswith("gauge")} | {"friction": 0.2}
    model = model_of(f"cylinder_may25/trial{trial}.csv", rigs[1], [*rig, "moment_bias"], family="circle")

    def left(place):
        r, q, x_c, bias = place
        return residuals(model, rig | {"r": 1e-3 * r, "q": 1e-3 * q, "x_c": 1e-3 * x_c, "moment_bias": bias})

    found = least_squares(left, [12.0, -13.0, 0.0, 0.0], x_scale=[1.0, 1.0, 1.0, 10.0], diff_step=1e-4)
    assert np.sqrt(np.mean(found.fun**2)) < 6.0
    assert found.x[0] == pytest.approx(15.0, abs=1.0)


def test_a_drawing_is_within_a_band_of_itself():
    x = np.linspace(-4e-3, 12e-3, 41)
    slope = np.where(
        x < whisker_square.RADIUS * np.sqrt(0.5), np.arcsin(np.minimum(x / whisker_square.RADIUS, 0.7)), np.pi / 4
    )
    band = xr.Dataset({"y": ("x", whisker_square.drawing(x)), "slope_angle": ("x", slope)}, coords={"x": x})
    np.testing.assert_allclose(whisker_square.distances(band, np.zeros(2)), 0.0, atol=1e-9)
    off = whisker_square.distances(band, np.array([0.0, 1e-4]))
    np.testing.assert_allclose(off, 1e-4 * np.cos(slope), atol=5e-7)

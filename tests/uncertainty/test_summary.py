"""A posterior in numbers, and where the rod touched its contours."""

import math

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.contour_posteriors import posterior
from helpers.refusals import refused
from tactile_bayes.cli.analysis import quantities
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import InferenceError
from tactile_bayes.report.page import parameter_cells
from tactile_bayes.uncertainty.band import normal_band
from tactile_bayes.uncertainty.rod_reach import BEYOND_REACH, beyond_reach, reach, reach_attributes
from tactile_bayes.uncertainty.summary import gap_if_any, summary


def test_the_summary_has_the_probability_it_is_asked_for(analysed):
    run, _ = analysed
    wide, narrow = (summary(run.posterior, p, gap_if_any(run.posterior, p)) for p in (0.95, 0.5))
    assert wide.quantity.values[-1] == "gap width"
    assert (narrow["lower"] > wide["lower"]).all()
    assert (narrow["upper"] < wide["upper"]).all()


def test_people_read_angles_in_degrees():
    values = {"median": 0.02, "lower": -0.01, "upper": 0.03, "r_hat": 1.0, "ess_bulk": 9.0, "ess_tail": 9.0}
    row = {name: ("quantity", [value]) for name, value in values.items()} | {"unit": ("quantity", ["rad"])}
    numbers = xr.Dataset(row, {"quantity": ["backlash"]}, {"probability": 0.95})
    _, *printed = [next(column.cells) for column in quantities(numbers, {"backlash": 0.025}).columns]
    _, _, unit, *reported = parameter_cells(numbers.isel(quantity=0), "circle")
    assert printed[4] == unit == "°"
    for shown in (printed[1:4], [cell.replace("−", "-") for cell in reported]):
        np.testing.assert_allclose([float(cell) for cell in shown], np.degrees([0.02, -0.01, 0.03]), atol=0.05)
    np.testing.assert_allclose(float(printed[0]), math.degrees(0.025), atol=0.05)


def test_the_band_is_where_events_are(analysed):
    """Of draws whose contour is not touched, or ends before, there are none."""
    posterior = analysed[0].posterior.copy(deep=True)
    events = posterior["events"]
    events["snap_off_contact_x"][:, ::3] = np.nan
    x = np.concatenate([events[f"{when}_contact_x"].values.ravel() for when in ("first", "snap_off")])
    expected = np.quantile(x[np.isfinite(x)], [0.05, 0.95])
    np.testing.assert_allclose(reach(posterior)[[0, -1]], expected, rtol=1e-13)
    for when in ("first", "snap_off"):
        events[f"{when}_contact_x"][:] = np.nan
    with refused(InferenceError, "contours"):
        reach(posterior)


@pytest.mark.parametrize("band", [tb.contour_band, normal_band])
def test_a_band_says_where_the_rod_cannot_touch(band):
    found = band(posterior(), [-100.0, -1.01, -0.99, 0.0, 0.99, 1.01, 100.0])
    assert found.status.values.tolist() == [*[BEYOND_REACH] * 2, *["ok"] * 3, *[BEYOND_REACH] * 2]
    assert np.isfinite(found["median"]).all()


def test_the_reach_is_that_of_all_pivots_and_of_stem_and_diameter():
    contour = paper_profile("II", q=0.5)
    record = tb.scan(
        contour, base=[(0.0, 0.0), (0.2, 0.0)], rig=tb.Rig(rod=tb.Rod(stem=0.1, diameter=0.02)), drive_step=0.1
    ).record
    assert list(reach_attributes(record).values()) == pytest.approx([-1.11, 1.31])


def test_a_result_without_a_rod_does_not_judge():
    assert not beyond_reach(xr.Dataset(), np.array([0.0, 1e6])).any()
    comparison = xr.Dataset(attrs={"reach_left": -1.0, "reach_right": 1.0})
    assert beyond_reach(comparison, np.array([-1.1, 0.0, 1.1])).tolist() == [True, False, True]

"""Another contour over an inferred one: distances and shares that are exact, units and refusals."""

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.contour_posteriors import touched, tree
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Polyline
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.uncertainty import Overlay, overlay_distance, read_overlay


def band_of(circle, x, half=1e-3, status="ok"):
    median = np.asarray(circle.height(x))
    columns = {"lower": median - half, "median": median, "upper": median + half, "status": np.full(x.size, status)}
    return xr.Dataset({name: ("x", values) for name, values in columns.items()}, coords={"x": x})


def polyline(circle, low, high):
    x = np.linspace(low, high, 4001)
    return Polyline([np.column_stack([x, circle.height(x)])])


def test_the_distance_of_a_shifted_circle_is_the_shift():
    x = np.linspace(-0.05, 0.05, 201)
    band = band_of(Circle(0.1, q=0.2), x)
    larger = overlay_distance(band, Overlay("it", polyline(Circle(0.102, q=0.198), -0.09, 0.09)))
    assert [larger.rms, larger.largest] == pytest.approx([2e-3, 2e-3], rel=1e-4)
    raised = overlay_distance(band, Overlay("it", polyline(Circle(0.1, q=0.2005), -0.09, 0.09)))
    assert raised.largest == pytest.approx(5e-4, rel=1e-4)
    assert raised.at == pytest.approx(0.0, abs=1e-3)
    assert [raised.left, raised.right, raised.share_inside] == pytest.approx([-0.05, 0.05, 1.0])
    assert larger.share_inside == 0.0


def test_it_counts_only_what_both_cover_and_the_rod_reaches():
    x = np.linspace(-0.05, 0.05, 201)
    band, circle = band_of(Circle(0.1, q=0.2), x), Circle(0.1, q=0.2)
    half = overlay_distance(band, Overlay("it", polyline(circle, 0.0, 0.09)))
    assert [half.left, half.right, half.rms] == pytest.approx([0.0, 0.05, 0.0], abs=1e-6)
    band["status"] = band["status"].where(x < 0.02, "beyond the reach of the rod")
    assert overlay_distance(band, Overlay("it", polyline(circle, 0.0, 0.09))).right == pytest.approx(0.0195)
    assert np.isnan(overlay_distance(band, Overlay("it", polyline(circle, 0.06, 0.09)))).all()


def test_a_sloping_line_is_inside_where_it_is():
    x = np.linspace(0.0, 1.0, 101)
    flat = band_of(Circle(1e9, q=0.0), x, half=0.3)
    found = overlay_distance(flat, Overlay("it", Polyline([[(-1.0, -1.0), (2.0, 2.0)]])))
    assert found.share_inside == pytest.approx(31 / 101)
    assert found.largest == pytest.approx(np.sqrt(0.5), rel=1e-6)


@pytest.fixture
def posterior():
    flat = tree("circle", units="SI", r=np.full(9, 0.1), q=np.full(9, 0.2), x_c=np.zeros(9))
    return touched(flat, first_contact_x=-0.05, snap_off_contact_x=0.05)


def test_files_are_read_in_the_unit_of_the_record(posterior, tmp_path):
    path = tmp_path / "true.csv"
    for head, assumed, width in (("x [mm],y [mm]", False, 0.002), ("x,y", True, 2.0)):
        path.write_text(f"{head}\n-1,1\n1,2\n", encoding="utf-8")
        found = read_overlay(path, posterior)
        assert found.name == "true.csv"
        assert found.is_unit_assumed is assumed
        assert np.ptp(found.polyline.pieces[0][:, 0]) == pytest.approx(width)
    path.write_text("x [L],y [L]\n-1,1\n1,2\n", encoding="utf-8")
    with refused(ParameterError, "true.csv is in rod lengths", "convert"):
        read_overlay(path, posterior)


def test_another_run_is_its_median_with_its_band(posterior, tmp_path):
    with refused(InferenceError, "there is no file"):
        read_overlay(tmp_path, posterior)
    tb.write_result(posterior, tmp_path / "posterior.nc")
    found = read_overlay(tmp_path, posterior)
    assert found.band["median"].values == pytest.approx(Circle(0.1, q=0.2).height(found.band["x"].values))
    assert overlay_distance(found.band, found).largest == pytest.approx(0.0, abs=1e-12)
    posterior.attrs["units"] = "dimensionless"
    with refused(InferenceError, "rod lengths"):
        read_overlay(tmp_path, posterior)

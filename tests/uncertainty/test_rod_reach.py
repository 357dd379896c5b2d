import numpy as np
import pytest
import xarray as xr

from helpers.contour_posteriors import posterior
from tactile_bayes.contours import paper_profile
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import scan
from tactile_bayes.uncertainty.band import contour_band, normal_band
from tactile_bayes.uncertainty.rod_reach import BEYOND_REACH, beyond_reach, reach_attributes


@pytest.mark.parametrize("band", [contour_band, normal_band])
def test_a_band_says_where_the_rod_cannot_touch(band):
    found = band(posterior(), [-100.0, -1.01, -0.99, 0.0, 0.99, 1.01, 100.0])
    assert found.status.values.tolist() == [*[BEYOND_REACH] * 2, *["ok"] * 3, *[BEYOND_REACH] * 2]
    assert np.isfinite(found["median"]).all()


def test_the_reach_is_that_of_all_pivots_and_of_stem_and_diameter():
    contour = paper_profile("II", q=0.5)
    record = scan(
        contour, base=[(0.0, 0.0), (0.2, 0.0)], rig=Rig(rod=Rod(stem=0.1, diameter=0.02)), drive_step=0.1
    ).record
    assert list(reach_attributes(record).values()) == pytest.approx([-1.11, 1.31])


def test_a_result_without_a_rod_does_not_judge():
    assert not beyond_reach(xr.Dataset(), np.array([0.0, 1e6])).any()
    comparison = xr.Dataset(attrs={"reach_left": -1.0, "reach_right": 1.0})
    assert beyond_reach(comparison, np.array([-1.1, 0.0, 1.1])).tolist() == [True, False, True]

import json

import numpy as np
import pytest
import xarray as xr

from helpers.refusals import refused
from tactile_bayes.errors import InferenceError
from tactile_bayes.uncertainty.band import averaged_heights, contour_band


def comparison(probability, weight=None, none_fits=0):
    """A parabola at the height 0.3, and a circle at 0.5, each known exactly."""
    draws = np.full((2, 10, 4), np.nan)
    draws[0, :, :3], draws[1, :, :3] = (0.5, 0.3, 0.0), (0.8, 0.5, 0.0)
    variables = {"contour_draws": (("family", "contour_draw", "contour_parameter"), draws)}
    for name, values in {"probability": probability, "weight": weight}.items():
        variables |= {} if values is None else {name: ("family", np.array(values, dtype=float))}
    attrs = {"none_fits": none_fits, "units": "dimensionless"}
    return xr.Dataset(variables, coords={"family": ["parabola", "circle"]}, attrs=attrs)


def test_each_family_has_its_share_of_the_contours():
    heights = averaged_heights(comparison([0.75, 0.25]), np.zeros(1), 4000)[:, 0]
    assert np.count_nonzero(heights == 0.3) == 3000
    assert np.count_nonzero(heights == 0.5) == 1000


def test_the_band_spans_the_families_that_count():
    both = contour_band(comparison([0.75, 0.25]), [0.0], 0.9)
    assert [float(both[name][0]) for name in ("lower", "median", "upper")] == pytest.approx([0.3, 0.3, 0.5])
    assert both.attrs["averaged_by"] == "evidence"
    assert json.loads(both.attrs["weights"]) == {"parabola": 0.75, "circle": 0.25}
    one = contour_band(comparison([1.0, 0.0]), [0.0, 1.0], 0.9)
    assert one["upper"].values == pytest.approx([0.3, 0.8])  # though the circle ends before x = 1


def test_stacking_weights_replace_evidence_that_is_missing():
    band = contour_band(comparison([np.nan, np.nan], weight=[0.2, 0.8]), [0.0])
    assert band.attrs["averaged_by"] == "stacking"
    assert float(band["median"][0]) == pytest.approx(0.5)


def test_what_cannot_be_averaged_is_refused():
    for made, named in (
        (comparison([0.5, 0.5], none_fits=1), "fits"),
        (comparison([np.nan, 0.5]), "evidence"),
        (comparison([0.5, 0.5]).drop_vars("contour_draws"), "draws"),
    ):
        with refused(InferenceError, named):
            contour_band(made, [0.0])

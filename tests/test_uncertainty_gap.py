"""The gap, against quantiles and exact events."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from helpers.contour_posteriors import TRUTH, posterior
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.scanning import scan
from tactile_bayes.uncertainty.gap import gap


def tree(x, strokes):
    values = xr.DataArray(x, dims=("chain", "draw", "stroke"), coords={"stroke": strokes}, attrs={"units": "m"})
    return xr.DataTree.from_dict({"events": xr.Dataset({"snap_off_contact_x": values})})


def test_bounds_are_quantiles():
    rng = np.random.default_rng(1)
    right, left = rng.normal(0.1, 0.01, size=(2, 500)), rng.normal(-0.2, 0.02, size=(2, 500))
    found = gap(tree(np.stack([right, left], axis=-1), ["forward", "backward"]), 0.9)
    for name, values in (("left", left), ("right", right), ("width", right - left)):
        np.testing.assert_allclose(found[name], np.quantile(values, [0.05, 0.5, 0.95]), rtol=1e-12)
        assert found[name].attrs["units"] == "m"
    assert found.bound.values.tolist() == ["lower", "median", "upper"]
    assert found.attrs["probability"] == 0.9


def test_several_pivots_leave_open_what_none_has_reached():
    strokes = ["forward", "backward", "forward", "backward"]
    found = gap(tree([[[0.3, -0.2, 0.1, -0.4]]], strokes)).sel(bound="median")
    assert (float(found.left), float(found.right)) == (-0.2, 0.1)
    assert float(found.width) == pytest.approx(0.3)


def test_sweeps_may_overlap():
    assert float(gap(tree([[[-0.1, 0.1]]], ["forward", "backward"])).width.sel(bound="median")) == pytest.approx(-0.2)


def test_of_an_inferred_contour():
    """The true gap lies within a central interval of 99.99 %."""
    events = scan(Parabola(**TRUTH)).events
    true = {"left": events["backward"].snap_off.contact_x, "right": events["forward"].snap_off.contact_x}
    found = gap(posterior(), 0.9999)
    for name, value in {**true, "width": true["right"] - true["left"]}.items():
        lower, _, upper = found[name].values
        assert lower < value < upper, name


@pytest.mark.parametrize("there", ["forward", "backward"])
def test_one_direction_leaves_no_gap(there):
    missing = {"forward": "backward", "backward": "forward"}[there]
    with pytest.raises(InferenceError, match=f"there is no {missing} one here"):
        gap(tree([[[0.1]]], [there]))


def test_an_impossible_probability_is_refused():
    with pytest.raises(ParameterError, match="give a number between 0 and 1"):
        gap(tree([[[-0.1, 0.1]]], ["forward", "backward"]), 95.0)

"""The figure of the gap: what it draws, and what it says."""

import numpy as np
import xarray as xr

from helpers.contour_posteriors import tree
from helpers.pictures import labels, texts
from tactile_bayes.contours import Parabola
from tactile_bayes.plotting import gap as draw
from tactile_bayes.uncertainty.gap import gap

TRUTH = Parabola(5.0, q=0.03)


def posterior(left, right, share=0.01):
    """Draws about the true contour; the gap is from `left` to `right`, in metres."""
    rng, dims, size = np.random.default_rng(1), ("chain", "draw", "segment"), (2, 200)
    spread = {"a": (5.0, share * 5.0), "q": (0.03, share * 1e-3), "x_c": (0.0, share * 0.01)}
    ends = {"snap_off_contact_x": (right, left), "first_contact_x": (0.09, -0.09), "snap_off_drive_angle": (3.2, -0.1)}
    out = tree("parabola", units="SI", **{name: rng.normal(*of, size) for name, of in spread.items()})
    events = {name: (dims, rng.normal(pair, 1e-4, (*size, 2))) for name, pair in ends.items()}
    out["events"] = xr.DataTree(xr.Dataset(events, {"segment": ["forward", "backward"]}))
    return out


def test_widths_are_side_by_side():
    made = posterior(-0.006, 0.01)
    found = gap(made, 0.9, without_events=posterior(-0.006, 0.01, share=0.05))
    ax = draw(found, truth=TRUTH)
    said = labels(ax)
    width = float(found.triangle_width.sel(bound="median"))
    assert f"triangle of chord and tangents, {1e6 * width:.3g} µm wide" in said
    rim = 1e6 * float((found.triangle_upper - found.triangle_lower).max())
    assert f"triangle with uncertain ends, 90 %, {rim:.3g} µm wide" in said
    assert f"90 % band, {1e6 * float(found.band_width):.3g} µm wide" in said
    assert f"90 % band without events, {1e6 * float(found.band_width_without_events):.3g} µm wide" in said
    assert {"chord", "end tangents", "end contacts", "median", "true contour"} < set(said)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$ [mm]", "$y$ − chord [µm]")


def test_the_triangle_is_measured_from_the_chord():
    found = gap(posterior(-0.006, 0.01)).sel(bound="median")
    ax = draw(gap(posterior(-0.006, 0.01)))
    (triangle,) = ax.patches
    corners = triangle.get_xy()[:3]
    np.testing.assert_allclose(corners[[0, 2]], [[found.left, 0.0], [found.right, 0.0]], atol=1e-15)
    share = (found.apex_x - found.left) / (found.right - found.left)
    chord = found.left_y + share * (found.right_y - found.left_y)
    np.testing.assert_allclose(corners[1], [found.apex_x, found.apex_y - chord], rtol=1e-12)
    low, high = ax.get_ylim()
    assert low < corners[1, 1] < 0.0 < high
    assert not any("without events" in label for label in labels(ax))


def test_where_no_gap_is_left_the_axes_say_so():
    found = gap(posterior(0.006, -0.01))
    ax = draw(found)
    assert texts(ax) == [found.status.item()]
    assert not ax.axison

"""The gap, against quantiles, hand geometry and exact events."""

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers import contour_posteriors as posteriors
from helpers.contour_posteriors import TRUTH, posterior, touched
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Joined, Parabola, PowerLaw
from tactile_bayes.contours.base import Locus
from tactile_bayes.contours.shape_free import ShapeFree
from tactile_bayes.errors import InferenceError
from tactile_bayes.uncertainty.gap import triangle

BOTH = ["forward", "backward"]
A, Q, X_C = 0.5, 0.3, 0.05


def tree(last, segments=BOTH, *, first=None, a=A, q=Q, x_c=X_C):
    """Parabolas whose sweeps end at `last`, of shape (chain, draw, segment)."""
    last, is_forward = np.asarray(last, dtype=float), np.array(segments) == "forward"
    values = {name: np.broadcast_to(v, last.shape[:2]) for name, v in {"a": a, "q": q, "x_c": x_c}.items()}
    return touched(
        posteriors.tree("parabola", units="SI", **values),
        segments,
        snap_off_contact_x=last,
        first_contact_x=np.where(is_forward, 1.0, -1.0) if first is None else first,
        snap_off_drive_angle=np.where(is_forward, 3.2, -0.1),
    )


def spread(size=500):
    rng = np.random.default_rng(1)
    a, q, x_c = rng.normal([[[A]], [[Q]], [[X_C]]], [[[0.05]], [[0.01]], [[0.03]]], size=(3, 2, size))
    right, left = rng.normal(0.1, 0.01, size=(2, size)), rng.normal(-0.2, 0.02, size=(2, size))
    return tree(np.stack([right, left], axis=-1), a=a, q=q, x_c=x_c), left, right, a, q, x_c


def test_bounds_are_quantiles():
    """The triangle of a parabola is half of a w² wide, and its apex in the middle."""
    made, left, right, a, q, x_c = spread()
    found = tb.gap(made, 0.9)
    expected = {
        "left": left,
        "right": right,
        "width": right - left,
        "left_y": a * (left - x_c) ** 2 + q,
        "right_slope_angle": np.arctan(2.0 * a * (right - x_c)),
        "vertex_x": x_c,
        "vertex_y": q,
        "apex_x": 0.5 * (left + right),
        "triangle_width": 0.5 * a * (right - left) ** 2,
        "triangle_height": 0.5 * a * (right - left) ** 2 * np.cos(np.arctan(a * (left + right - 2.0 * x_c))),
    }
    for name, values in expected.items():
        np.testing.assert_allclose(found[name], np.quantile(values, [0.05, 0.5, 0.95]), rtol=1e-9, err_msg=name)
        assert found[name].attrs["units"] == ("rad" if name.endswith("_angle") else "m")
    np.testing.assert_allclose(found.snap_off_drive_angle.sel(segment="forward"), 3.2, rtol=1e-15)
    assert found.bound.values.tolist() == ["lower", "median", "upper"]
    assert (found.attrs["probability"], found.attrs["gaps"]) == (0.9, 1)
    assert (found.status.item(), found.share_open.item()) == ("ok", 1.0)


def test_one_contour_has_its_triangle_and_no_band():
    found = tb.gap(tree([[[0.2, -0.1]] * 5]))
    np.testing.assert_allclose(found.triangle_width, 0.5 * A * 0.3**2, rtol=1e-13)
    y = A * (found.x - X_C) ** 2 + Q
    np.testing.assert_allclose(found.band_median, y, rtol=1e-14)
    assert found.band_width.item() == 0.0
    assert (found.triangle_lower <= y + 1e-15).all()
    assert (found.triangle_upper >= y - 1e-15).all()
    np.testing.assert_allclose(found.triangle_upper, Q + A * 0.15**2, rtol=1e-13)  # the vertex is in the middle


def test_bands_are_compared_over_the_same_places():
    made, other = spread()[0], spread()[0]
    other["posterior"]["q"] = other["posterior"]["q"] + 3.0 * (other["posterior"]["q"] - Q)
    found = tb.gap(made, 0.9, without_events=other)
    # Quantiles are in order because each contour is in its own triangle.
    assert (found.triangle_lower <= found.band_lower + 1e-12).all()
    assert (found.triangle_upper >= found.band_upper - 1e-12).all()
    assert (found.x[0], found.x[-1]) == (found.left.sel(bound="median"), found.right.sel(bound="median"))
    for name, posterior_ in (("band", made), ("band_without_events", other)):
        band = tb.contour_band(posterior_, found.x.values, 0.9)
        for edge in ("lower", "median", "upper"):
            np.testing.assert_array_equal(found[f"{name}_{edge}"], band[edge])
        widest = float((band.upper - band.lower).max())
        assert found[name.replace("band", "band_width")].item() == widest
    assert found.band_width < found.band_width_without_events
    assert "band_width_without_events" not in tb.gap(made)


def test_events_belong_to_the_draws_of_their_labels():
    """Events are there for some draws only."""
    made, _, right, a, _, x_c = spread()
    some = made.copy()
    some["events"] = made["events"].to_dataset().assign_coords(draw=np.arange(500)).isel(draw=slice(3, None, 7))
    expected = np.median(np.arctan(2.0 * a * (right - x_c))[:, 3::7])
    np.testing.assert_allclose(tb.gap(some).right_slope_angle.sel(bound="median"), expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("last", "first", "left", "right", "gaps"),
    [
        ([0.3, -0.2, 0.1, -0.4], None, -0.2, 0.1, 1),
        # The second pivot's backward arc fills the middle of the first one's gap: the wider rest is described.
        ([0.3, -0.3, 0.6, 0.1], [1.0, -1.0, 1.0, -0.2], 0.1, 0.3, 2),
        ([0.3, -0.3, 0.6, 0.1], [1.0, -1.0, 1.0, -0.05], -0.3, -0.05, 2),
        ([0.3, -0.3, 0.6, 0.35], [1.0, -1.0, 1.0, -0.4], 0.35, 0.3, 0),
    ],
)
def test_several_pivots_leave_open_what_none_has_reached(last, first, left, right, gaps):
    found = tb.gap(tree([[last]], ["forward", "backward"] * 2, first=first))
    middle = found.sel(bound="median")
    assert (float(middle.left), float(middle.right), found.attrs["gaps"]) == (left, right, gaps)
    assert float(middle.width) == pytest.approx(right - left)
    assert middle.snap_off_drive_angle.sizes == {"segment": 4}


def test_sweeps_may_overlap():
    found = tb.gap(tree([[[-0.1, 0.1]]]))
    assert float(found.width.sel(bound="median")) == pytest.approx(-0.2)
    assert "no gap" in found.status.item()
    for name in ("triangle_width", "apex_x", "band_width", "band_lower", "triangle_upper"):
        assert np.isnan(found[name]).all(), name


def test_sweeps_may_overlap_in_some_contours():
    found = tb.gap(tree([[[0.1, -0.1], [0.1, -0.1], [0.1, 0.12]]]))
    np.testing.assert_allclose(found.triangle_width, 0.5 * A * 0.2**2, rtol=1e-13)
    assert found.share_open.item() == pytest.approx(2.0 / 3.0)
    assert "overlap in some" in found.status.item()
    assert np.isfinite(found.band_width)
    found = tb.gap(tree([[[0.1, -0.1], [0.1, 0.14], [0.1, 0.12]]]))
    assert "overlap in most" in found.status.item()
    assert np.isnan(found.band_width)
    assert np.isfinite(found.triangle_width).all()


def test_of_an_inferred_contour():
    """The true gap, its vertex and its angles lie within central intervals of 99.99 %."""
    truth = Parabola(**TRUTH)
    events = tb.scan(truth).events
    last = {"left": events["backward"].snap_off, "right": events["forward"].snap_off}
    found = tb.gap(posterior(), 0.9999)
    true = {side: event.contact_x for side, event in last.items()}
    true |= {f"{side}_y": event.contact_y for side, event in last.items()}
    true |= {f"{side}_slope_angle": event.slope_angle for side, event in last.items()}
    true |= {"width": true["right"] - true["left"], "vertex_x": TRUTH["x_c"], "vertex_y": TRUTH["q"]}
    true |= {"triangle_width": 0.5 * TRUTH["a"] * true["width"] ** 2}
    for name, value in true.items():
        lower, _, upper = found[name].values
        assert lower < value < upper, name
    for segment in BOTH:
        lower, _, upper = found.snap_off_drive_angle.sel(segment=segment).values
        assert lower < events[segment].snap_off.drive_angle < upper
    y = truth.height(found.x.values)
    assert np.all((found.triangle_lower < y) & (y < found.triangle_upper))
    assert found.status.item() == "ok"


def with_events(made, **there):
    """The same with events only in some of the draws, which are said for one segment."""
    events = made["events"].to_dataset()
    for name, (draws, segment) in there.items():
        gone = ~draws[:, None] & (np.arange(2) == segment)
        events[name] = events[name].where(~xr.DataArray(gone, dims=("draw", "segment")))
    out = made.copy()
    out["events"] = xr.DataTree(events)
    return out


def test_draws_without_an_event_do_not_count():
    """As if they were not there, but for the band, which is of contours that need not be touched."""
    made, *_ = spread()
    number = np.arange(500)
    lost = with_events(made, snap_off_contact_x=(number % 7 > 0, 0), first_contact_x=(number % 11 > 0, 1))
    rest = made.copy()
    rest["events"] = xr.DataTree(
        made["events"].to_dataset().assign_coords(draw=number).isel(draw=(number % 7 > 0) & (number % 11 > 0))
    )
    found, expected = tb.gap(lost, 0.9), tb.gap(rest, 0.9)
    for name in ("left", "right", "width", "triangle_height", "snap_off_drive_angle", "band_lower", "band_upper"):
        np.testing.assert_array_equal(found[name], expected[name], err_msg=name)
    assert expected.status == "ok"
    assert "not touched" in found.status.item()


NEVER = np.zeros(500, dtype=bool)


@pytest.mark.parametrize(
    ("made", "named"),
    [
        (tree([[[0.1]]], ["forward"]), "backward"),
        (tree([[[0.1]]], ["backward"]), "forward"),
        (with_events(spread()[0], first_contact_x=(NEVER, 0)), "every sweep"),
    ],
    ids=["no backward sweep", "no forward sweep", "no event"],
)
def test_what_leaves_no_gap_is_refused(made, named):
    with refused(InferenceError, named):
        tb.gap(made)


def at(contour, *x):
    return [contour.locate(contour.parameter_of_x(np.atleast_1d(value))) for value in x]


def corner(x, y, slope_angle):
    values = [np.atleast_1d(np.asarray(v, dtype=float)) for v in (x, y, slope_angle)]
    return Locus(*values, np.ones(1), np.ones(1))


def test_a_right_angle_on_its_tip():
    found = triangle(corner(-1.0, 1.0, -np.pi / 4), corner(1.0, 1.0, np.pi / 4))
    np.testing.assert_allclose(
        [found.apex_x, found.apex_y, found.height, found.width], [[0], [0], [1], [1]], atol=1e-15
    )


def test_on_an_incline_height_and_width_differ():
    """The triangle of before, turned by 30 degrees about its tip."""
    turn = np.pi / 6
    left, right = (s * np.cos(turn) - np.sin(turn) + 1j * (s * np.sin(turn) + np.cos(turn)) for s in (-1.0, 1.0))
    found = triangle(corner(left.real, left.imag, turn - np.pi / 4), corner(right.real, right.imag, turn + np.pi / 4))
    np.testing.assert_allclose([found.apex_x, found.apex_y], 0.0, atol=1e-15)
    np.testing.assert_allclose([found.height[0], found.width[0]], [1.0, 1.0 / np.cos(turn)], rtol=1e-14)
    lower, upper = found.between(np.array([0.0]))
    np.testing.assert_allclose(upper - lower, found.width[:, None], rtol=1e-14)


def test_of_a_circle():
    """Tangents at ± 0.5 meet at r / cos 0.5 from the centre; the chord is at r cos 0.5."""
    r, half = 2.0, 0.5
    found = triangle(*at(Circle(r, q=-r), -r * np.sin(half), r * np.sin(half)))
    np.testing.assert_allclose(found.apex_y, -r / np.cos(half), rtol=1e-14)
    np.testing.assert_allclose(found.height, r / np.cos(half) - r * np.cos(half), rtol=1e-13)


def test_upright_tangents_have_a_triangle():
    found = triangle(corner(-1.0, 1.0, -np.pi / 2), corner(1.0, 1.5, np.pi / 4))
    np.testing.assert_allclose([found.apex_x, found.apex_y], [[-1.0], [-0.5]], rtol=1e-14)


def drawn(rng, kind):
    """A convex contour that extends beyond x from −0.5 to 0.5."""
    if kind == "shape-free":
        return ShapeFree(np.linspace(-1.4, 1.4, 7), rng.normal(0.0, 0.4, 7), x=0.0, y=rng.normal())
    q, x_c = rng.normal(0.0, 0.1, 2)
    if kind == "circle":
        return Circle(rng.uniform(0.9, 2.0), q, x_c)
    if kind == "power-law":
        return PowerLaw(rng.uniform(0.2, 2.0), rng.uniform(1.2, 6.0), q, x_c)
    return Joined(Parabola(rng.uniform(0.2, 2.0), q, x_c), PowerLaw(1.0, rng.uniform(2.0, 6.0), q, x_c))


@pytest.mark.parametrize("kind", ["shape-free", "circle", "power-law", "joined"])
def test_the_contour_lies_in_its_triangle(kind):
    rng = np.random.default_rng(1)
    for _ in range(40):
        contour, (low, high) = drawn(rng, kind), np.sort(rng.uniform(-0.5, 0.5, 2))
        found = triangle(*at(contour, low, high))
        x = np.linspace(low, high, 101)[1:-1]
        lower, upper = found.between(x)
        y = contour.height(x)
        assert np.all(y >= lower - 1e-12)
        assert np.all(y <= upper + 1e-12)
        assert np.max(upper - lower) <= found.width[0] * (1.0 + 1e-9)
        assert low < found.apex_x[0] < high


def test_an_all_but_straight_stretch_has_no_height():
    found = triangle(*at(PowerLaw(1.0, 50.0, q=0.3), -1e-8, 1e-8))
    assert found.height.tolist() == found.width.tolist() == [0.0]
    np.testing.assert_array_equal(found.apex_x, 0.0)


def test_ends_that_overlap_have_none():
    found = triangle(*at(Parabola(0.5, q=0.3), 0.1, -0.1))
    assert np.isnan([found.height, found.width, found.apex_x, found.apex_y]).all()
    assert np.isnan(found.between(np.linspace(-0.1, 0.1, 5))).all()


def test_beside_the_ends_it_says_nothing():
    lower, upper = triangle(*at(Parabola(0.5, q=0.3), -0.1, 0.1)).between(np.array([-0.2, 0.0, 0.2]))
    assert np.isnan(lower).tolist() == np.isnan(upper).tolist() == [[True, False, True]]

"""Contacts that a posterior of the contour implies: against scans of its contours, their layout, and how tight."""

import json
from functools import cache

import numpy as np
import pytest
import xarray as xr
from matplotlib.patches import Ellipse

from helpers.contour_posteriors import CELL, measured, posterior, swept
from helpers.pictures import own_axes
from helpers.refusals import refused
from tactile_bayes import Rig, Rod, infer_contacts, plotting, reconstruct, scan
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.errors import InferenceError, ParameterError
from tactile_bayes.record import in_frame, record_hash
from tactile_bayes.uncertainty.contact_region import contact_moments, contact_region
from tactile_bayes.uncertainty.implied_contacts import implied_contacts

COLUMNS = ("contact_x", "contact_y", "slope_angle", "contact_arclength")
STEP = float(np.radians(6.0))
THICK = Rod(length=0.1, flexural_rigidity=1.2e-5, diameter=0.003)


def tree_of(record, family, draws, *, friction=0.0, unknowns=()) -> xr.DataTree:
    """What `infer_contour` would have returned of these draws."""
    values = {name: (("chain", "draw"), np.atleast_2d(np.asarray(v, dtype=float))) for name, v in draws.items()}
    loads = ["holding_moment", "force_x", "force_y"]
    tree = xr.DataTree.from_dict(
        {
            "posterior": xr.Dataset(values).assign_coords(chain=[0], draw=np.arange(np.size(draws["q"]))),
            "observed_data": record[loads],
            "constant_data": record.drop_vars(loads).drop_attrs(deep=False),
        }
    )
    attrs = ("units", "rod_length", "rod_flexural_rigidity", "rod_diameter", "load_cell_frame")
    tree.attrs = {name: record.attrs[name] for name in attrs if name in record.attrs} | {
        "family": family,
        "known": json.dumps({"friction": friction} if friction else {}),
        "nuisances": json.dumps(unknowns),
        "data_sha256": record_hash(record),
        "message": "made up",
    }
    return tree


@cache
def implied() -> xr.DataTree:
    return implied_contacts(posterior(), draws=100)


@cache
def single() -> xr.Dataset:
    """Contacts of the same record, each by itself."""
    return reconstruct(measured(), method="constrained", rig=Rig(load_cell=CELL))


def parameters(contour):
    return {name: [getattr(contour, name)] * 3 for name in ("a", "r", "q", "x_c") if hasattr(contour, name)}


@pytest.mark.parametrize(
    ("family", "contour", "frame", "options"),
    [
        ("parabola", Parabola(0.5, 0.5), "fixed", {}),
        ("parabola", Parabola(0.5, 0.6, 0.03), "fixed", {"bases": ((0.0, 0.0), (0.2, 0.05))}),
        ("circle", Circle(1.0, 0.4), "fixed", {"friction": 0.2}),
        ("parabola", Parabola(5.0, 0.05), "fixed", {"rod": THICK, "bases": ((0.01, 0.002),)}),
        ("parabola", Parabola(0.5, 0.5), "turning", {}),
    ],
    ids=["two directions", "two bases", "friction", "SI, thick rod", "turning frame"],
)
def test_the_contacts_of_one_contour_are_those_of_its_scan(family, contour, frame, options):
    record = in_frame(swept(contour, step=STEP, **options), frame)
    tree = tree_of(record, family, parameters(contour), friction=options.get("friction", 0.0))
    found = implied_contacts(tree)
    length = record.attrs["rod_length"]
    for name in COLUMNS:
        draws = found["posterior"][name]
        assert draws.dims == ("chain", "draw", "sample")
        assert draws.shape == (1, 3, record.sizes["sample"])
        unit = 1.0 if name == "slope_angle" else length
        expected = np.broadcast_to(record[f"truth_{name}"].values, draws.shape)
        np.testing.assert_allclose(draws.values, expected, rtol=0.0, atol=1e-9 * unit, equal_nan=True)
    phase = record.truth_contact_phase.values
    expected = np.select([phase == "none", phase == "tip"], [np.nan, 0.0], 1.0)
    np.testing.assert_array_equal(found["posterior"].tangential.values[0, 1], expected)
    stats = found["sample_stats"].to_dataset()
    np.testing.assert_array_equal(stats.contact_probability, (phase != "none").astype(float))
    np.testing.assert_array_equal(stats.tangential_probability, expected)


@pytest.mark.parametrize("name", ["drive_angle_offset", "backlash"])
def test_an_inferred_offset_is_taken_off_the_drive_angle_draw_by_draw(name):
    contour, offsets = Parabola(0.5, 0.5), np.array([0.0, 0.02, -0.03])
    record = swept(contour, step=STEP)
    tree = tree_of(record, "parabola", parameters(contour) | {name: offsets}, unknowns=[name])
    found = implied_contacts(tree)["posterior"].to_dataset().isel(chain=0)
    for k, offset in enumerate(offsets):
        for direction in ("forward", "backward"):
            on = record.direction.values == direction
            share = {"drive_angle_offset": 1.0, "backlash": 0.5 if direction == "forward" else -0.5}[name]
            angles = record.drive_angle.values[on] - share * offset
            there = scan(contour, direction=direction, drive_angles=angles).record.sortby("drive_angle")
            draw = found.isel(draw=k, sample=np.flatnonzero(on)[np.argsort(angles)])
            for column in COLUMNS:
                np.testing.assert_allclose(draw[column], there[f"truth_{column}"], rtol=0.0, atol=1e-9, equal_nan=True)
            touched = there.truth_contact_phase.values != "none"
            np.testing.assert_allclose(draw.drive_angle, np.where(touched, np.sort(angles), np.nan), atol=1e-14)


def test_inferred_friction_and_compliance_go_into_the_paths_draw_by_draw():
    """With a compliant suspension the rod's slope at the pivot is that of a scan at the same state."""
    contour, friction, compliance = Parabola(0.5, 0.5), np.array([0.0, 0.2, 0.1]), np.array([0.0, 0.0, 0.05])
    record = swept(contour, step=STEP)
    further = {"friction": friction, "suspension_compliance": compliance}
    tree = tree_of(record, "parabola", parameters(contour) | further, unknowns=list(further))
    found = implied_contacts(tree)["posterior"].to_dataset().isel(chain=0)
    for k in range(3):
        draw = found.isel(draw=k).dropna("sample")
        for direction in ("forward", "backward"):
            on = draw.isel(sample=record.direction.values[draw.sample.values] == direction)
            state = scan(
                contour, direction=direction, drive_angles=on.drive_angle, rig=Rig(unknown={"friction": friction[k]})
            ).record
            state = state.isel(sample=np.argsort(state.drive_angle.values)[np.argsort(np.argsort(on.drive_angle))])
            driven = on.drive_angle + compliance[k] * state.holding_moment.values
            np.testing.assert_allclose(driven, record.drive_angle.values[on.sample], rtol=0.0, atol=1e-9)
            for name in COLUMNS:
                np.testing.assert_allclose(on[name], state[f"truth_{name}"], rtol=0.0, atol=1e-8)


@pytest.mark.slow
def test_contact_begins_and_ends_with_the_events_of_the_same_draw():
    tree = implied_contacts(posterior())
    events = posterior()["events"].to_dataset()
    np.testing.assert_array_equal(tree["posterior"].draw, events.draw)
    angle, direction = measured().drive_angle.values, measured().direction.values
    first, snap = (events[f"{name}_drive_angle"] for name in ("first", "snap_off"))
    for segment in ("forward", "backward"):
        on = direction == segment
        low, high = (x.sel(segment=segment) for x in ((first, snap) if segment == "forward" else (snap, first)))
        within = (angle[on] >= low.values[..., None]) & (angle[on] <= high.values[..., None])
        np.testing.assert_array_equal(np.isfinite(tree["posterior"].contact_x.values[..., on]), within)


def test_a_sample_that_only_some_contours_touch_says_so():
    contour = Parabola(0.5, 0.5)
    record = swept(contour, step=STEP)
    q = np.linspace(0.5, 0.65, 40)
    tree = implied_contacts(tree_of(record, "parabola", {"a": 0.0 * q + 0.5, "q": q, "x_c": 0.0 * q}), draws=40)
    share = tree["sample_stats"].contact_probability.values
    has = np.isfinite(tree["posterior"].contact_x.values)
    np.testing.assert_allclose(share, has.mean(axis=(0, 1)))
    partly = np.flatnonzero((share > 0.3) & (share < 0.9))
    assert partly.size
    assert len(contact_region(tree, int(partly[0])).draws) == has[..., partly[0]].sum()
    moments = contact_moments(tree)
    np.testing.assert_array_equal(moments.contact_probability, share)
    np.testing.assert_array_equal(np.isnan(moments.tangent_sd), has.sum(axis=(0, 1)) < 10)


def test_moments_are_those_of_the_draws():
    single = infer_contacts(measured().isel(sample=[50, 60]), rig=Rig(load_cell=CELL), rng=1, draws=400)
    moments, draws = contact_moments(single), single["posterior"].to_dataset().isel(sample=1)
    x, y = draws.contact_x.values.ravel(), draws.contact_y.values.ravel()
    slope = draws.slope_angle.values.mean()
    at = moments.isel(sample=1)
    assert float(at.contact_x_sd) == pytest.approx(x.std())
    assert float(at.contact_xy_correlation) == pytest.approx(np.corrcoef(x, y)[0, 1])
    assert float(at.tangent_sd) == pytest.approx((np.cos(slope) * x + np.sin(slope) * y).std())
    assert float(at.normal_sd) == pytest.approx((np.cos(slope) * y - np.sin(slope) * x).std())
    assert str(at.contact_phase.values) == "tangential"


def test_the_layout_is_that_of_infer_contacts():
    single = infer_contacts(measured().isel(sample=[50]), rig=Rig(load_cell=CELL), rng=1, draws=4)
    tree = implied()
    assert set(tree.children) == set(single.children)
    ours, theirs = (
        [(name, v.dims, v.dtype, v.attrs) for name, v in made["posterior"].data_vars.items()] for made in (tree, single)
    )
    assert ours == theirs
    for group in ("observed_data", "constant_data"):
        assert list(tree[group].data_vars) == list(single[group].data_vars)
    assert dict(tree["posterior"].sizes) == {"chain": 2, "draw": 100, "sample": measured().sizes["sample"]}
    assert tree.attrs["draws"] == 200
    assert tree.attrs["data_sha256"] == record_hash(measured())
    assert all(words in tree.attrs["message"] for words in (" 200 contours ", "; converged"))


def test_draws_are_picked_evenly():
    count = posterior()["posterior"].sizes["draw"]
    assert implied_contacts(posterior(), draws=3)["posterior"].draw.values.tolist() == [0, (count - 1) // 2, count - 1]


def of_another_record():
    tree = posterior().copy()
    tree["observed_data"] = tree["observed_data"].to_dataset() * 1.01
    return tree


@pytest.mark.parametrize(
    ("tree", "draws", "error", "named"),
    [
        *((posterior, draws, ParameterError, ["draws", draws]) for draws in (0, -1, 2.0, True, "all")),
        *((thing, 200, InferenceError, ["infer_contour"]) for thing in (implied, measured, lambda: None)),
        (of_another_record, 200, InferenceError, ["record", "posterior"]),
    ],
)
def test_what_implies_no_contacts_is_refused(tree, draws, error, named):
    with refused(error, *named):
        implied_contacts(tree(), draws=draws)


def ratios(ax):
    return [line for line in ax.get_lines() if len(line.get_xdata()) > 2]


def test_the_figure_shows_both_and_their_ratio():
    axes = own_axes(5)
    found = plotting.tightening(implied(), single(), probability=0.5, truth=Parabola(0.5, 0.5), axes=axes)
    assert found.tolist() == axes.tolist()
    tight = contact_moments(implied())
    expected = (
        (single().tangent_sd / tight.tangent_sd).where(single().status == "ok").where(tight.contact_probability == 1)
    )
    drawn = np.concatenate([line.get_ydata() for line in ratios(axes[4])[:2]])
    np.testing.assert_allclose(drawn, expected, rtol=1e-12)
    for ax in axes[1:4]:
        small, large = sorted(max(patch.width, patch.height) for patch in ax.patches[1:] if isinstance(patch, Ellipse))
        assert 3.0 * small < large
        assert ax.get_aspect() == 1.0
    assert len(axes[0].texts) == 3
    assert "drive angle" in axes[4].get_xlabel()


def test_the_figure_takes_posteriors_of_single_contacts_and_chosen_samples():
    posteriors = infer_contacts(measured(), rig=Rig(load_cell=CELL), rng=1, draws=40)
    axes = plotting.tightening(implied(), posteriors, samples=[40, 60, 120], axes=own_axes(5))
    x = contact_moments(implied()).contact_x.values[[40, 60, 120]]
    assert [text.xy[0] for text in axes[0].texts] == x.tolist()


@pytest.mark.parametrize(
    ("changes", "options", "named"),
    [
        ({"contacts": lambda: single().isel(sample=slice(100))}, {}, ["one record"]),
        (
            {"contacts": lambda: single().assign(status=single().status.where(False, "nonlinear"))},
            {},
            ["three contacts"],
        ),
        ({"implied": lambda: implied()["posterior"].to_dataset()}, {}, ["implied", "tree"]),
        ({"axes": lambda: own_axes(2)}, {}, ["axes", "(2,)"]),
        ({}, {"samples": [0, 60]}, ["samples", [0, 60]]),
        ({}, {"probability": 1.0}, ["probability", 1.0]),
    ],
)
def test_the_figure_refuses_what_does_not_belong_together(changes, options, named):
    given = {"implied": implied, "contacts": single, "axes": lambda: own_axes(5)} | changes
    with refused(ParameterError, *named):
        plotting.tightening(given["implied"](), given["contacts"](), axes=given["axes"](), **options)

"""Many contours in one call, against one scan for each."""

from dataclasses import fields

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Ellipse, Parabola, PowerLaw
from tactile_bayes.errors import ParameterError
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig import Rig

TRUTH = ("contact_x", "contact_y", "slope_angle", "contact_arclength", "tip_angle")
ANGLES = np.linspace(0.4, 3.6, 240)


def parameters(count, *ranges):
    rng = np.random.default_rng(7)
    return [rng.uniform(low, high, count) for low, high in ranges]


@pytest.mark.parametrize(
    ("family", "ranges"),
    [
        (Parabola, [(0.2, 3.0), (0.3, 0.7), (-0.2, 0.2)]),
        (Circle, [(0.2, 1.5), (0.3, 0.7), (-0.2, 0.2)]),
        (Ellipse, [(0.3, 1.5), (0.2, 1.0), (0.3, 0.7), (-0.2, 0.2)]),
        (PowerLaw, [(0.3, 3.0), (2.0, 5.0), (0.3, 0.7), (-0.2, 0.2)]),
    ],
)
@pytest.mark.parametrize(("direction", "friction"), [("forward", 0.0), ("backward", 0.3)])
@pytest.mark.parametrize("rod", [pytest.param(None, marks=pytest.mark.slow), tb.Rod(0.2, 2.4e-3, 0.7e-3)])
def test_each_is_what_its_own_scan_says(family, ranges, direction, friction, rod):
    length = rod.length if rod else 1.0
    powers = {"a": 0 if family is Ellipse else -1, "n": 0, "b": 1, "r": 1, "q": 1, "x_c": 1}
    if family is Ellipse:
        powers["a"] = 1
    names = [field.name for field in fields(family)]
    values = dict(zip(names, parameters(5, *ranges), strict=True))
    if family is PowerLaw:
        values["a"] = values["a"] * length ** (1.0 - values["n"])
        powers["a"] = 0
    values = {name: value * length ** powers[name] for name, value in values.items()}
    base = parameters(5, (-0.1 * length, 0.1 * length), (-0.1 * length, 0.0))
    many = tb.scan_many(
        family(**values), ANGLES, direction=direction, base=base, rig=Rig(rod=rod, unknown={"friction": friction})
    )
    assert set(many.status.values) == {"ok"}
    for i in range(5):
        one = tb.scan(
            family(**{name: float(value[i]) for name, value in values.items()}),
            direction=direction,
            base=(float(base[0][i]), float(base[1][i])),
            drive_angles=ANGLES,
            rig=Rig(rod=rod, unknown={"friction": friction}),
        )
        record = one.record.sortby("drive_angle")
        events = one.sweeps[0]
        mine = many.isel(contour=i)
        near = np.abs(ANGLES - events.snap_off.drive_angle) < 1e-9
        assert bool(mine.clear) == events.clear
        for name in CHANNELS:
            largest = np.abs(record[name].values).max()
            np.testing.assert_allclose(
                mine[name].values, record[name].values, rtol=0, atol=1e-7 * largest, err_msg=name
            )
        for name in TRUTH:
            scale = length if name.startswith("contact") else 1.0
            np.testing.assert_allclose(
                mine[name].values[~near], record[f"truth_{name}"].values[~near], rtol=0, atol=2e-5 * scale, err_msg=name
            )
        assert (mine.contact_phase == record.truth_contact_phase).mean() > 0.99
        for event in ("first_contact", "snap_off"):
            for name in ("drive_angle", "slope_angle", "contact_x", "contact_y"):
                expected = getattr(getattr(events, event), name)
                np.testing.assert_allclose(float(mine[f"{event}_{name}"]), expected, rtol=1e-9, atol=1e-9 * length)
        kinds = [events.first_contact.kind, *(change.kind.split(" → ")[1] for change in events.transitions)]
        assert str(mine.phases.values) == "-".join("A" if kind == "tip" else "B" for kind in kinds)


def test_a_small_fall_beside_a_sharp_vertex_is_no_snap_off():
    """The drive angle falls by 4e-6 rad before the vertex, where the radius of curvature is zero, and rises again."""
    vertex = 0.6637, 1.6517, 0.4240, -0.8370
    alone = tb.scan(PowerLaw(*vertex), direction="backward").events["backward"]
    many = tb.scan_many(PowerLaw(*np.array(vertex)[:, None]), ANGLES, direction="backward")
    assert many.snap_off_drive_angle.item() == pytest.approx(alone.snap_off.drive_angle, abs=1e-12)


def test_what_cannot_be_swept_says_why():
    many = tb.scan_many(Circle(np.array([0.5, 0.5, 0.5, 0.5]), np.array([0.4, 1.2, -0.1, 0.01])), ANGLES)
    assert many.status.values.tolist() == ["ok", "out of reach", "cuts the pivot", "too close to the pivot"]
    lost = many.isel(contour=slice(1, None))
    assert not np.any(lost.holding_moment)
    assert np.all(np.isnan(lost.contact_x))
    assert np.all(np.isnan(lost.snap_off_drive_angle))
    assert set(lost.contact_phase.values.ravel()) == {"none"}
    assert lost.phases.values.tolist() == ["", "", ""]


@pytest.mark.parametrize(
    ("arguments", "options", "named"),
    [
        ((Parabola(np.ones(2), 0.5), np.degrees(ANGLES)), {}, ["2π", 206.265, "np.radians"]),
        (([Parabola(0.5, 0.5)] * 2, ANGLES), {}, ["contours", "list"]),
        ((Parabola(0.5, 0.5), ANGLES), {}, ["(n,)", "()", "scan"]),
        ((Parabola(np.ones(2), 0.5), ANGLES), {"direction": "up"}, ["direction", "'up'"]),
        ((Parabola(np.ones(2), 0.5), np.ones((3, 4))), {}, ["2 contours", "drive_angles", "(k,)", "(2, k)"]),
        ((Parabola(np.ones(2), 0.5), 1.0), {}, ["2 contours", "drive_angles"]),
        ((Parabola(np.ones(2), 0.5), [np.nan]), {}, ["radians"]),
        ((Parabola(np.ones(2), 0.5), ANGLES), {"base": ([0.0, 0.0, 0.0], 0.0)}, ["(2,)"]),
    ],
)
def test_what_does_not_fit_is_refused(arguments, options, named):
    with refused(ParameterError, *named):
        tb.scan_many(*arguments, **options)

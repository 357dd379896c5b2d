"""Many contours in one call, against one scan for each."""

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Ellipse, Parabola, PowerLaw
from tactile_bayes.errors import ParameterError
from tactile_bayes.record import CHANNELS
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import scan_many

TRUTH = ("contact_x", "contact_y", "slope_angle", "contact_arclength", "tip_angle")
ANGLES = np.linspace(0.4, 3.6, 240)


ROD = tb.Rod(0.2, 2.4e-3, 0.7e-3)
LENGTH, COUNT = ROD.length, 5
RNG = np.random.default_rng(7)
SIZE, OTHER, POWER = (RNG.uniform(low, high, COUNT) for low, high in ((0.3, 1.5), (0.3, 1.0), (2.0, 5.0)))
Q, X_C, *BASE = (LENGTH * RNG.uniform(*ends, COUNT) for ends in ((0.3, 0.7), (-0.2, 0.2), (-0.1, 0.1), (-0.1, 0.0)))
CONTOURS = {
    "parabola": Parabola(SIZE / LENGTH, Q, X_C),
    "circle": Circle(SIZE * LENGTH, Q, X_C),
    "ellipse": Ellipse(SIZE * LENGTH, OTHER * LENGTH, Q, X_C),
    "power law": PowerLaw(SIZE * LENGTH ** (1.0 - POWER), POWER, Q, X_C),
}


@pytest.mark.parametrize("contours", CONTOURS.values(), ids=CONTOURS)
@pytest.mark.parametrize(("direction", "friction"), [("forward", 0.0), ("backward", 0.3)])
def test_each_is_what_its_own_scan_says(contours, direction, friction):
    rig = Rig(rod=ROD, unknown={"friction": friction})
    many = scan_many(contours, ANGLES, direction=direction, base=BASE, rig=rig)
    assert set(many.status.values) == {"ok"}
    for i in range(COUNT):
        base = tuple(float(value[i]) for value in BASE)
        one = tb.scan(contours.take(i), direction=direction, base=base, drive_angles=ANGLES, rig=rig)
        record = one.record.sortby("drive_angle")
        events = one.sweeps[0]
        mine = many.isel(contour=i)
        near = np.abs(ANGLES - events.snap_off.drive_angle) < 1e-9
        assert bool(mine.clear) == events.clear
        for name in CHANNELS:
            atol = 1e-7 * np.abs(record[name].values).max()
            np.testing.assert_allclose(mine[name].values, record[name].values, rtol=0, atol=atol, err_msg=name)
        for name in TRUTH:
            atol, theirs = 2e-5 * (LENGTH if name.startswith("contact") else 1.0), record[f"truth_{name}"].values
            np.testing.assert_allclose(mine[name].values[~near], theirs[~near], rtol=0, atol=atol, err_msg=name)
        assert (mine.contact_phase == record.truth_contact_phase).mean() > 0.99
        for event in ("first_contact", "snap_off"):
            for name in ("drive_angle", "slope_angle", "contact_x", "contact_y"):
                expected = getattr(getattr(events, event), name)
                np.testing.assert_allclose(float(mine[f"{event}_{name}"]), expected, rtol=1e-9, atol=1e-9 * LENGTH)
        kinds = [events.first_contact.kind, *(change.kind.split(" → ")[1] for change in events.transitions)]
        assert str(mine.phases.values) == "-".join("A" if kind == "tip" else "B" for kind in kinds)


def test_a_small_fall_beside_a_sharp_vertex_is_no_snap_off():
    """The drive angle falls by 4e-6 rad before the vertex, where the radius of curvature is zero, and rises again."""
    vertex = 0.6637, 1.6517, 0.4240, -0.8370
    alone = tb.scan(PowerLaw(*vertex), direction="backward").events["backward"]
    many = scan_many(PowerLaw(*np.array(vertex)[:, None]), ANGLES, direction="backward")
    assert many.snap_off_drive_angle.item() == pytest.approx(alone.snap_off.drive_angle, abs=1e-12)


def test_what_cannot_be_swept_says_why():
    many = scan_many(Circle(np.array([0.5, 0.5, 0.5, 0.5]), np.array([0.4, 1.2, -0.1, 0.01])), ANGLES)
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
        ((Parabola(np.ones(2), 0.5), np.degrees(ANGLES)), {}, ["drive_angles", "2π", "np.radians"]),
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
        scan_many(*arguments, **options)

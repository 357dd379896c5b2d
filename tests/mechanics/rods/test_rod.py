"""Rods: their units, and what is refused."""

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.errors import ContourError, ParameterError
from tactile_bayes.mechanics.rods.traced import measured_cone
from tactile_bayes.record import record_hash, rod_of, to_dimensionless, to_si, write_record
from tactile_bayes.record.attributes import same_rod
from tactile_bayes.record.units import with_rod
from tactile_bayes.rig import Rig, read_record

ARC = tb.Rod(0.2, 2.4e-3, 7e-4, rest_curvature=2.5)
CIRCLE = tb.contours.Circle(0.06, 0.1)


def test_a_rod_says_how_it_is_curved_and_what_it_bears_only_if_that_is_stated():
    wire = tb.Rod.circular(length=0.2, diameter=0.5e-3, youngs_modulus=206e9, elastic_strain=0.02)
    for rod in (ARC, wire):
        assert eval(repr(rod), {"Rod": tb.Rod}) == rod
    assert repr(tb.Rod(0.2)) == "Rod(length=0.2, flexural_rigidity=1.0, diameter=0.0)"
    assert tb.Rod(0.2, elastic_strain=0.1) != tb.Rod(0.2, elastic_strain=0.2)


def test_records_of_rods_of_other_shape_are_other_records():
    record = tb.scan(CIRCLE, rig=Rig(rod=ARC), drive_step=0.1).record
    assert record.attrs["rod_rest_curvature"] == 2.5
    straight = with_rod(record, tb.Rod(0.2, 2.4e-3, 7e-4))
    assert record_hash(straight) != record_hash(record)
    assert "rod_rest_curvature" not in straight.attrs


def test_a_rest_curvature_given_completes_a_record_that_does_not_state_it(tmp_path):
    record = tb.scan(CIRCLE, rig=Rig(rod=ARC), drive_step=0.1).record
    del record.attrs["rod_rest_curvature"]
    write_record(record, tmp_path / "arc.csv")
    assert rod_of(read_record(tmp_path / "arc.csv", Rig(rod=ARC))) == ARC


def test_where_a_rod_would_touch_twice_a_scan_says_so():
    with refused(ContourError, "touch the contour twice", "in contact at ("):
        tb.scan(tb.contours.Parabola(0.5, 0.5), rig=Rig(rod=tb.Rod(rest_curvature=0.9)), direction="forward")


WHISKERS = {
    "arc": ARC,
    "tapered": tb.Rod(0.2, 2.4e-3, 1e-3, taper=0.5),
    "function": tb.Rod(0.2, 2.4e-3, rest_curvature=lambda s: -30.0 * s, taper=0.9),
    "table": tb.Rod(0.2, 2.4e-3, rest_curvature=([0.0, 0.05, 0.2], [0.0, -0.5, -2.0])),
    "on a stem": tb.Rod(0.2, 2.4e-3, 8e-4, rest_curvature=lambda s: -10.0 * s, stem=0.016),
    "rigidity": tb.Rod(0.2, 2.4e-3, rest_curvature=-1.0, rigidity_profile=lambda s: np.exp(-10.0 * s)),
}


@pytest.mark.parametrize("ending", ["csv", "nc"])
@pytest.mark.parametrize("name", WHISKERS)
def test_a_file_states_any_rod(tmp_path, name, ending):
    rod = WHISKERS[name]
    record = tb.scan(CIRCLE, rig=Rig(rod=rod), drive_step=0.1, direction="forward").record
    write_record(record, tmp_path / f"rod.{ending}")
    read = read_record(tmp_path / f"rod.{ending}")
    assert rod_of(read) == rod
    assert record_hash(read) == record_hash(record)
    assert same_rod(rod_of(to_si(to_dimensionless(read), rod)), rod)


@pytest.mark.parametrize("name", WHISKERS)
def test_rods_in_their_own_units_are_swept_alike(name):
    rod = WHISKERS[name]
    si = tb.scan(CIRCLE, rig=Rig(rod=rod), drive_step=0.1, direction="forward").record
    own = tb.scan(
        tb.contours.Circle(0.3, 0.5), rig=Rig(rod=rod.in_lengths()), drive_step=0.1, direction="forward"
    ).record
    np.testing.assert_allclose(si["force_x"], rod.force_unit * own["force_x"], atol=1e-8 * rod.force_unit)


def test_what_a_rod_says_of_itself():
    rod = WHISKERS["function"]
    assert (rod.is_uniform, rod.is_arc, ARC.is_arc, WHISKERS["table"].is_uniform) == (False, False, True, True)
    assert rod.mean_rest_curvature == pytest.approx(-3.0)
    assert ARC.mean_rest_curvature == 2.5
    assert ARC.profile is None
    assert "taper=0.9" in repr(rod)
    assert tb.Rod(rigidity_profile=1.0) == tb.Rod()


@pytest.mark.parametrize(
    ("given", "named"),
    [
        *(({"rest_curvature": bent}, ["rest_curvature", "give"]) for bent in (math.nan, math.inf, "bent", None, True)),
        *(({"length": 0.2, "rest_curvature": bent}, ["rest_curvature", "half circle"]) for bent in (16.0, -16.0)),
        ({"rest_curvature": lambda s: 8.0 * s}, ["curl back"]),
        ({"rest_curvature": ([0.0, 0.5], [0.0, 1.0])}, ["to the tip, 1"]),
        ({"rest_curvature_deviation": -1.0}, ["rest_curvature_deviation"]),
        ({"taper": 0.99}, ["the rod's taper is 0.99"]),
        ({"taper": -0.1}, ["the rod's taper is -0.1"]),
        ({"rigidity_profile": lambda s: 1.0 - 2.0 * s}, ["a rigidity is positive"]),
    ],
)
def test_rods_that_cannot_be_are_refused(given, named):
    with refused(ParameterError, *named):
        tb.Rod(**given)


@pytest.mark.parametrize("turned", [0.0, 2.0])
def test_a_traced_rod_is_the_one_that_was_traced(turned):
    """Wherever and however it lay; its mean curvature within four of the standard deviations that it states."""
    true = tb.Rod(0.05, 1e-8, rest_curvature=lambda s: 10.0 + 400.0 * s, taper=0.5)
    s = np.linspace(0.0, 0.05, 40)
    slope = turned + 10.0 * s + 200.0 * s**2
    x, y = (cumulative_simpson(way, x=s, initial=0.0) for way in (np.cos(slope), np.sin(slope)))
    rng = np.random.default_rng(5)
    found = tb.Rod.from_shape(x + rng.normal(0.2, 2e-5, s.size), y + rng.normal(0.1, 2e-5, s.size), 1e-8, taper=0.5)
    assert found.length == pytest.approx(0.05, abs=1e-4)
    off = found.mean_rest_curvature - true.mean_rest_curvature
    assert 0.0 < found.rest_curvature_deviation < 1.0
    assert abs(off) < 4.0 * found.rest_curvature_deviation
    assert found.taper == 0.5
    own = tb.Rod.from_shape(x, y)
    assert own.is_dimensionless
    assert own.mean_rest_curvature == pytest.approx(1.0, abs=1e-3)


def test_tapers_measured_at_points_have_the_deviation_that_they_state():
    """Of 300 cones the tapers are off by their standard deviations; a limit of 0.15 is exceeded once in 3e5 times."""
    rng, s = np.random.default_rng(1), np.linspace(0.0, 1.0, 20)
    off = []
    for taper in rng.uniform(0.2, 0.9, 300):
        diameters = 0.01 * (1.0 - taper * s) + rng.normal(0.0, 2e-4, s.size)
        cone = measured_cone(s, diameters)
        off.append((cone.taper - taper) / cone.deviation)
        assert cone.diameter == pytest.approx(0.01, abs=1e-3)
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=0.2)
    assert np.mean(np.abs(off) < 1.645) == pytest.approx(0.9, abs=0.08)


def test_a_traced_rod_may_have_its_diameters_beside_its_points():
    s = np.linspace(0.0, 0.05, 40)
    rod = tb.Rod.from_shape(s, 0.0 * s, 1e-8, diameter=1e-3 * (1.0 - 8.0 * s))
    assert (rod.diameter, rod.taper) == pytest.approx((1e-3, 0.4))
    assert rod.taper_deviation < 1e-9
    uniform = tb.Rod.from_shape(s, 0.0 * s, diameter=np.full(s.size, 1e-3) + 1e-5 * np.cos(99.0 * np.arange(s.size)))
    assert 0.0 <= uniform.taper < 0.02
    assert uniform.diameter == pytest.approx(0.02, rel=0.01)
    with refused(ParameterError, "linearly", "rigidity_profile"):
        tb.Rod.from_shape(s, 0.0 * s, diameter=1e-3 * (1.0 - 200.0 * s**2))
    with refused(ParameterError, "taper", "leave it out"):
        tb.Rod.from_shape(s, 0.0 * s, diameter=np.full(s.size, 1e-3), taper=0.1)
    for wrong in (s[1:], -1e-3 * np.ones(s.size)):
        with refused(ParameterError, "diameter", "each point"):
            tb.Rod.from_shape(s, 0.0 * s, diameter=wrong)


def test_a_tip_beyond_the_normal_slips_off_or_is_held():
    """It is turned by more than a right angle to the tangent of the contour where it first touches."""
    contour, rod = tb.contours.Circle(0.7992, 0.7331, -0.7511), tb.Rod(rest_curvature=1.5)
    slips, held = (
        tb.scan(contour, rig=Rig(rod=rod, unknown={"friction": friction}), direction="forward").sweeps[0]
        for friction in (0.2, 0.3)
    )
    assert slips.snap_off.kind == "release"
    assert [change.kind for change in held.transitions] == ["stick"]
    assert held.snap_off.drive_angle > slips.snap_off.drive_angle + 1.0

"""Rods: their units, and what is refused."""

import math

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.errors import ContourError, ParameterError
from tactile_bayes.record import read_record, record_hash, rod_of, write_record
from tactile_bayes.record.units import with_rod

ARC = tb.Rod(0.2, 2.4e-3, 7e-4, rest_curvature=2.5)
CIRCLE = tb.contours.Circle(0.06, 0.1)


@pytest.mark.parametrize("curvature", [16.0, -16.0])
def test_more_than_a_half_circle_is_refused(curvature):
    with refused(ParameterError, "the rod's rest_curvature is", "half circle"):
        tb.Rod(0.2, 2.4e-3, rest_curvature=curvature)


@pytest.mark.parametrize("curvature", [math.nan, math.inf, "bent", None, True])
def test_what_is_no_rest_curvature_is_refused(curvature):
    with refused(ParameterError, "the rod's rest_curvature is", "give"):
        tb.Rod(0.2, 2.4e-3, rest_curvature=curvature)


def test_a_rod_says_how_it_is_curved_only_if_it_is():
    assert eval(repr(ARC), {"Rod": tb.Rod}) == ARC
    assert "rest_curvature" not in repr(tb.Rod(0.2, 2.4e-3))


@pytest.mark.parametrize("ending", ["csv", "nc"])
def test_a_file_states_the_rest_curvature(tmp_path, ending):
    record = tb.scan(CIRCLE, rod=ARC, drive_step=0.1).record
    assert record.attrs["rod_rest_curvature"] == 2.5
    write_record(record, tmp_path / f"arc.{ending}")
    read = read_record(tmp_path / f"arc.{ending}")
    assert rod_of(read) == ARC
    assert record_hash(read) == record_hash(record)
    straight = with_rod(read, tb.Rod(0.2, 2.4e-3, 7e-4))
    assert record_hash(straight) != record_hash(read)
    assert "rod_rest_curvature" not in straight.attrs


def test_a_rest_curvature_given_completes_a_record_that_does_not_state_it(tmp_path):
    record = tb.scan(CIRCLE, rod=ARC, drive_step=0.1).record
    del record.attrs["rod_rest_curvature"]
    write_record(record, tmp_path / "arc.csv")
    assert rod_of(read_record(tmp_path / "arc.csv", rod=ARC)) == ARC


@pytest.mark.parametrize("length", [1.0, 0.2])
def test_units_do_not_matter(length):
    """A sweep in SI is that in rod lengths, for arcs too."""
    own, rod = tb.Rod(rest_curvature=0.5), tb.Rod(length, 3e-3, rest_curvature=0.5 / length)
    one = tb.scan(tb.contours.Circle(0.3, 0.5), rod=own).record
    other = tb.scan(tb.contours.Circle(0.3 * length, 0.5 * length), rod=rod).record
    for name, unit in zip(("holding_moment", "force_x", "force_y"), rod.load_units, strict=True):
        np.testing.assert_allclose(other[name], unit * one[name], atol=1e-9 * unit)


def test_forward_and_backward_sweeps_of_an_arc_differ():
    """The object is symmetric, the rod is not: the backward sweep sees its mirror image."""
    forward, backward = (
        tb.scan(tb.contours.Circle(0.3, 0.5), rod=tb.Rod(rest_curvature=curvature), direction=direction).sweeps[0]
        for curvature, direction in ((0.5, "forward"), (-0.5, "backward"))
    )
    assert backward.snap_off.drive_angle == pytest.approx(math.pi - forward.snap_off.drive_angle, abs=1e-12)
    both = tb.scan(tb.contours.Circle(0.3, 0.5), rod=tb.Rod(rest_curvature=0.5)).events
    assert abs(math.pi - both["backward"].snap_off.drive_angle - both["forward"].snap_off.drive_angle) > 0.01


def test_where_a_rod_would_touch_twice_a_scan_says_so():
    with refused(ContourError, "touch the contour twice", "in contact at ("):
        tb.scan(tb.contours.Parabola(0.5, 0.5), rod=tb.Rod(rest_curvature=0.9), direction="forward")

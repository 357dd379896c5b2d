"""Rigs: several bases, ends of contours, what happens after snap-off, strain, and units."""

import warnings

import numpy as np
import pytest

from helpers.integration import rod
from helpers.refusals import refused
from tactile_bayes import Rig, Rod, scan
from tactile_bayes.contours import (
    Circle,
    Ellipse,
    Joined,
    Parabola,
    PowerLaw,
    from_function,
    from_points,
    paper_profile,
)
from tactile_bayes.errors import ClearanceWarning, ContourError, ParameterError, StrainWarning
from tactile_bayes.record import CHANNELS


def test_several_bases_are_the_single_ones_in_one_record():
    bases = [(0.0, 0.0), (0.35, -0.05), (-0.3, 0.1)]
    contour = paper_profile("II", q=0.5)
    several = scan(contour, base=bases)
    assert [(s.base, s.direction) for s in several.sweeps] == [(b, d) for b in bases for d in ("forward", "backward")]
    assert np.unique(several.record.sweep).tolist() == list(range(6))
    for number, base in enumerate(bases):
        alone = scan(contour, base=base)
        for sweep, direction in enumerate(("forward", "backward")):
            ours = several.record.isel(sample=several.record.sweep.values == 2 * number + sweep)
            theirs = alone.record.isel(sample=alone.record.sweep.values == sweep)
            for name in ("base_x", "base_y", "drive_angle", *CHANNELS, "truth_contact_x", "truth_contact_phase"):
                np.testing.assert_array_equal(ours[name], theirs[name])
            assert several.sweeps[2 * number + sweep] == alone.events[direction] == alone.sweeps[sweep]
    with refused(ParameterError, "'forward'", "scan.sweeps"):
        several.events["forward"]
    with refused(ParameterError, "'backward'", "'forward'"):
        scan(contour, direction="forward").events["backward"]


HALF = np.linspace(0.1, 0.9, 30)
POINTS, ARC = from_points(HALF, 0.3 + 0.5 * HALF**2), Circle(0.3, 0.3)
JOINED = Joined(Circle(0.4, 0.3), Parabola(0.5, 0.3))
TOUCHED, STILL = "would touch beyond", "still touch"


def part(low, high):
    """A parabola of which no more is known."""
    return from_function(lambda x: 0.3 + 0.5 * x**2, (low, high))


@pytest.mark.parametrize(
    ("contour", "base", "direction", "named"),
    [
        (ARC, (0.6, 0.2), "forward", [TOUCHED, "right end", "(0.3, 0.6)", "vertical"]),
        (ARC, (-0.6, 0.2), "backward", [TOUCHED, "left end", "(-0.3, 0.6)", "vertical"]),
        (Ellipse(0.3, 0.2, 0.3), (0.6, 0.2), "forward", ["right end", "(0.3, 0.5)", "vertical"]),
        (part(-0.9, 0.5), (0.0, 0.0), "forward", ["right end", "(0.5, 0.425)", "domain"]),
        (POINTS, (0.0, 0.0), "forward", [STILL, "left end", "(0.1, 0.305)", "first point"]),
        (JOINED, (-0.7, 0.25), "backward", ["left end", "(-0.4, 0.7)", "vertical"]),
        # Of several bases the one is named.
        (part(-0.9, 0.5), [(-0.45, 0.15), (0.0, 0.05)], "forward", ["forward sweep", "(0, 0.05)", TOUCHED]),
        (part(0.2, 1.2), [(0.6, 0.0), (0.0, 0.05)], "forward", ["forward sweep", "(0, 0.05)", STILL]),
    ],
)
def test_contact_beyond_an_end_is_refused_with_its_name(contour, base, direction, named):
    with refused(ContourError, *named):
        scan(contour, base=base, direction=direction)


def test_half_a_contour_will_do_if_the_rod_lets_go_before_its_end():
    whole = scan(Parabola(0.5, 0.5), direction="forward")
    half = scan(from_function(lambda x: 0.5 + 0.5 * x**2, (0.0, 2.0)), direction="forward")
    np.testing.assert_allclose(half.record.holding_moment, whole.record.holding_moment, rtol=0, atol=1e-12)


def test_a_rod_that_would_be_stopped_again_is_said_so():
    """A tip slips over the sharp vertex of a nearly flat object, whose other flank is still in the rod's way."""
    contour = PowerLaw(0.06, 1.2, 0.5, 0.8)
    with pytest.warns(ClearanceWarning, match=r"forward .*\(0, 0\).* 1\.29428 rad"):
        result = scan(contour, direction="forward", drive_step=0.01)
    sweep = result.sweeps[0]
    assert not sweep.clear
    along = np.linspace(0.01, 1.0, 100)
    height = contour.height(along * np.cos(sweep.snap_off.drive_angle))
    assert np.any(along * np.sin(sweep.snap_off.drive_angle) > height)  # the unloaded rod would be inside
    last = result.record.drive_angle.values[-1]
    assert sweep.snap_off.drive_angle - 0.01 <= last <= sweep.snap_off.drive_angle
    assert result.record.force_y.values[-1] > 0.0
    with pytest.warns(ClearanceWarning):
        record = scan(contour, direction="forward", drive_angles=[1.0, 2.0, 3.0]).record
    np.testing.assert_array_equal(record.drive_angle, [1.0])
    with pytest.warns(ClearanceWarning), refused(ParameterError, "drive_angles", "1.29428 rad"):
        scan(contour, direction="forward", drive_angles=[2.0, 3.0])


WIRE = Rod.circular(length=0.2, diameter=0.5e-3, youngs_modulus=206e9, elastic_strain=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("direction", ["forward", "backward"])
@pytest.mark.parametrize("q", [0.06, 0.1])
def test_the_largest_strain_against_integration(direction, q):
    """Half the diameter times the greatest curvature of any state, found by integrating the rod from its base."""
    contour = Parabola(2.5, q)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StrainWarning)
        result = scan(contour, direction=direction, rig=Rig(rod=WIRE), drive_step=np.radians(0.5))
    record, greatest = result.record, 0.0
    for i in np.flatnonzero(record.truth_contact_phase.values != "none"):
        angle, length = (float(record[name][i]) for name in ("drive_angle", "truth_contact_arclength"))
        loads = [float(record[name][i]) / WIRE.flexural_rigidity for name in CHANNELS]
        along = rod([angle, *loads], length, max_step=length / 100)
        greatest = max(greatest, float(np.abs(along.y[3]).max()))
    strain = result.sweeps[0].largest_strain
    # On the grid of half a degree the greatest is a little less than on the whole path, which is sampled, too.
    assert greatest * 0.5 * WIRE.diameter * (1 - 1e-4) <= strain <= 1.05 * greatest * 0.5 * WIRE.diameter


@pytest.mark.parametrize(
    ("contour", "rod", "said"),
    [
        (Parabola(2.5, 0.1), Rod.circular(0.2, 0.5e-3, 206e9, elastic_strain=0.001), r"0\.00\d+, .*0\.001"),
        (Parabola(0.5, 0.5), Rod(diameter=0.2, elastic_strain=0.9), r"0\.6: .*0\.1"),  # beyond the model
    ],
)
def test_a_rod_bent_beyond_its_limit_is_warned_of(contour, rod, said):
    with pytest.warns(StrainWarning, match=said):
        scan(contour, rig=Rig(rod=rod), direction="forward")


def test_a_rod_without_thickness_is_not_strained():
    assert scan(Parabola(0.5, 0.5)).sweeps[0].largest_strain == 0.0

"""Where a carried rod touches: on which side, and as far as the contour is known."""

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Joined, Parabola, PowerLaw
from tactile_bayes.errors import ContourError
from tactile_bayes.rig import Rig


@pytest.mark.parametrize("contour", [Parabola(0.02, 0.8), PowerLaw(0.02, 2.5, 0.8)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_contact_goes_as_far_as_the_drive_carries_it(contour, side):
    """Farther than the rod reaches from where it touches first."""
    (sweep,) = tb.scan(contour, drive=tb.Motion([2.0 * side, 2.0 * side, -2.0 * side], [-0.3, 0.0, 0.0], 1.0)).sweeps
    assert sweep.snap_off.kind == "release"
    assert sweep.snap_off.contact_x == pytest.approx(-sweep.first_contact.contact_x, abs=1e-9)
    assert abs(sweep.snap_off.contact_x) > 1.3


@pytest.mark.parametrize("diameter", [0.0, 0.038])
def test_a_contact_beyond_the_end_from_which_the_rod_comes_is_refused(diameter):
    drive = tb.Motion([-0.835, -0.201], [-0.143, 0.207], 0.969)
    with refused(ContourError, "beyond the contour's left end", "vertical"):
        tb.scan(Circle(0.544, 0.203, 0.343), drive=drive, rig=Rig(rod=tb.Rod(diameter=diameter)))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_wall_is_touched_from_beside_the_object(side):
    """Its other end faces away from the base."""
    halves = [Parabola(2.0, 0.4, -0.3 * side), Parabola(1.0, -1.83, -1.7 * side)]
    contour = Joined(*halves[:: int(side)], x=-0.2 * side)
    heading, angle = (-2.12, 3.03) if side > 0.0 else (np.pi + 2.12, np.pi - 3.03)
    (sweep,) = tb.scan(contour, drive=tb.Translation((1.75 * side, 3.4), heading, angle, 1.24)).sweeps
    assert sweep.direction == ("backward" if side > 0.0 else "forward")
    assert sweep.first_contact.kind == "tip"
    x, y = sweep.first_contact.contact_x, sweep.first_contact.contact_y
    assert y == pytest.approx(float(contour.height(x)), abs=1e-9)


@pytest.mark.parametrize("angle", [-0.32, np.pi + 0.32])
def test_a_drive_into_the_object_is_not_too_far_from_it(angle):
    side = 1.0 if angle < 0.0 else -1.0
    with refused(ContourError, "cuts the path"):
        tb.scan(Circle(0.29, 0.32, -0.17 * side), drive=tb.Motion([-0.19 * side, 0.32 * side], [0.03, 1.9], angle))

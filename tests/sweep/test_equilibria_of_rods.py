"""Equilibria of rods that are not straight and uniform: against the states of their sweeps, and themselves."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from helpers.profiled_rods import given_rod, given_rods
from tactile_bayes.contours import Circle, Parabola, paper_profile
from tactile_bayes.errors import ClearanceWarning, ContourError
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import equilibria, scan

RODS = given_rods()
SLOW = ("cone", "parabolic", "tables")
CONTOURS = {
    "I": paper_profile("I", 0.7),
    "II": paper_profile("II", 0.5),
    "III": paper_profile("III", 0.5),
    "circle": Circle(0.2, 0.35, 0.05),
}
COLUMNS = ("drive_angle", "holding_moment", "force_x", "force_y", "contact_arclength", "tip_angle")


def states_of_sweep(contour, direction, rod, friction=0.0, drive_step=np.pi / 180):
    """States in contact by the names of `equilibria`; None if there would be two contacts."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ClearanceWarning)
            record = scan(
                contour, direction=direction, rig=Rig(rod=rod, unknown={"friction": friction}), drive_step=drive_step
            ).record
    except ContourError:
        return None
    record = record.isel(sample=np.flatnonzero(record.truth_contact_phase.values != "none"))
    names = ("slope_angle", "contact_phase", "contact_x", "contact_y", "contact_arclength", "tip_angle")
    return record.rename({f"truth_{name}": name for name in names})


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in RODS]
)
def test_states_of_sweeps_once_the_contact_comes_back(name):
    """While the contact moves outward, a load that does not bend the rod back only straightens it. There `equilibria`
    promises the other state. At the sample that is farthest out it may be either."""
    rod, same, different, swept = replace(RODS[name].rod, diameter=0.01), 0, 0, 0
    for contour in CONTOURS.values():
        for direction, side in (("forward", 1.0), ("backward", -1.0)):
            for friction in (0.0, 0.4):
                swept_states = states_of_sweep(contour, direction, rod, friction)
                if swept_states is None:
                    continue
                swept += 1
                slopes = swept_states.slope_angle.values
                farthest = int(np.argmax(side * slopes))
                if friction:  # friction acts outward at first, and then holds the contact
                    off = np.arctan2(-swept_states.force_x, swept_states.force_y).values - slopes
                    farthest = max(
                        farthest, int(np.flatnonzero(side * off < np.arctan(friction) - 1e-9).max(initial=0))
                    )
                found = equilibria(
                    contour, slopes, direction=direction, rig=Rig(rod=rod, unknown={"friction": friction})
                )
                off = np.max([np.abs(found[name].values - swept_states[name].values) for name in COLUMNS], axis=0)
                assert np.all(off[farthest + 1 :] < 1e-9)
                later = found.contact_phase.values[farthest + 1 :]
                np.testing.assert_array_equal(later, swept_states.contact_phase.values[farthest + 1 :])
                if friction == 0.0:
                    assert np.all(swept_states.contact_phase.values[:farthest] == "tip")
                    assert not np.any(off[:farthest] < 1e-9)
                same, different = same + slopes.size - farthest - 1, different + farthest
    assert swept >= 8
    assert same > 10 * different


@pytest.mark.parametrize(("name", "height"), [("arc", 0.5), ("half cone", 0.75), ("parabolic", 0.7)])
def test_backward_is_the_mirror_image(name, height):
    """A mirrored contour with the mirrored rod: x → −x, φ0 → π − φ0, m0 and fAx change their signs."""
    rod, plain = RODS[name]
    mirrored = given_rod(lambda s: -plain.curvature(s), taper=rod.taper).rod
    slopes = np.linspace(-0.1, 0.8, 10)
    scene = Parabola(0.5, height, 0.1), "forward", rod
    mirror = Parabola(0.5, height, -0.1), "backward", mirrored
    states, mirror_states = (
        equilibria(contour, sign * slopes, direction=direction, rig=Rig(rod=of_scene, unknown={"friction": 0.2}))
        for sign, (contour, direction, of_scene) in ((1.0, scene), (-1.0, mirror))
    )
    for one, other in ((states, mirror_states), (states_of_sweep(*scene, 0.2), states_of_sweep(*mirror, 0.2))):
        assert {"tip", "tangential"} <= set(one.contact_phase.values)
        np.testing.assert_array_equal(other.contact_phase, one.contact_phase)
        for column in ("drive_angle", "tip_angle"):
            np.testing.assert_allclose(other[column], np.pi - one[column], atol=1e-11)
        for column in ("holding_moment", "force_x", "contact_x"):
            np.testing.assert_allclose(other[column], -one[column], atol=1e-11)
        for column in ("force_y", "contact_y", "contact_arclength"):
            np.testing.assert_allclose(other[column], one[column], atol=1e-11)


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_a_sweep_in_other_units(direction):
    """A rod of SI that is the dimensionless one in units of its own."""
    length, rigidity = 0.08, 3e-5
    one = Rod(rest_curvature=lambda s: 0.4 - 0.9 * s, taper=0.5)
    si = Rod(length, rigidity, rest_curvature=lambda s: (0.4 - 0.9 * s / length) / length, taper=0.5)
    contours = Parabola(0.5, 0.5, 0.1), Parabola(0.5 / length, 0.5 * length, 0.1 * length)
    units = {"holding_moment": rigidity / length, "contact_arclength": length, "contact_x": length, "contact_y": length}
    units |= dict.fromkeys(("force_x", "force_y"), rigidity / length**2) | dict.fromkeys(
        ("drive_angle", "tip_angle"), 1
    )
    slopes = (1.0 if direction == "forward" else -1.0) * np.linspace(0.0, 0.8, 9)
    bare, of_si = (
        equilibria(c, slopes, direction=direction, rig=Rig(rod=r)) for c, r in zip(contours, (one, si), strict=True)
    )
    bare_sweep, si_sweep = (
        states_of_sweep(c, direction, r, drive_step=0.05) for c, r in zip(contours, (one, si), strict=True)
    )
    np.testing.assert_array_equal(of_si.contact_phase, bare.contact_phase)
    np.testing.assert_array_equal(si_sweep.contact_phase, bare_sweep.contact_phase)
    for column, unit in units.items():
        np.testing.assert_allclose(of_si[column] / unit, bare[column], atol=1e-10)
        np.testing.assert_allclose(si_sweep[column] / unit, bare_sweep[column], atol=1e-10)

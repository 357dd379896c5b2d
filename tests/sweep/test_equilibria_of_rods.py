"""Equilibria of rods that are not straight and uniform: against the states of their sweeps, and themselves."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from helpers.profiled_rods import given_rods
from tactile_bayes import Rig, equilibria, scan
from tactile_bayes.contours import Circle, paper_profile
from tactile_bayes.errors import ClearanceWarning, ContourError

RODS = given_rods()
SLOW = ("cone", "parabolic", "tables")
CONTOURS = {
    "I": paper_profile("I", 0.7),
    "II": paper_profile("II", 0.5),
    "III": paper_profile("III", 0.5),
    "circle": Circle(0.2, 0.35, 0.05),
}
COLUMNS = ("drive_angle", "holding_moment", "force_x", "force_y", "contact_arclength", "tip_angle")


def states_of_sweep(contour, direction, rod, friction=0.0):
    """States in contact by the names of `equilibria`; None if there would be two contacts."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ClearanceWarning)
            record = scan(contour, direction=direction, rig=Rig(rod=rod, unknown={"friction": friction})).record
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

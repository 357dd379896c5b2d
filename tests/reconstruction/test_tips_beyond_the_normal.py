"""Contacts of tips that are turned beyond the normal of the contour, where the moment vanishes for the second time."""

import numpy as np
import pytest

import tactile_bayes as tb
from tactile_bayes.mechanics.centreline import rod_shape
from tactile_bayes.mechanics.contacts.contact_coordinates import contact_states
from tactile_bayes.mechanics.elastica import contact_from_wrench
from tactile_bayes.rig import Rig, make_record

CELL = tb.LoadCell(force_noise=0.01, moment_noise=0.005)
PSI1 = np.array([1.8, 2.0, 2.2])
RODS = {
    "arc": tb.Rod(rest_curvature=2.0),
    "curved to its tip": tb.Rod(rest_curvature=lambda s: 2.5 * s + 0.7),
    "tapered arc": tb.Rod(rest_curvature=2.0, taper=0.3),
}


def touching(name, side=1.0, force=2.0, psi1=PSI1, arclength=1.0):
    """Record and places of three states in forward or backward contact, from their coordinates."""
    rod = RODS[name]
    z = np.column_stack([np.full(3, force), psi1, np.full(3, arclength), np.full(3, 1.5)])
    rods = rod.mirrored(np.ones(3))
    found = contact_states(z, 0.0, rods)
    moment, force_x, force_y = found.loads
    columns = {
        "sweep": np.zeros(3, dtype=int),
        "direction": np.full(3, "forward" if side > 0.0 else "backward"),
        "drive_angle": z[:, 3] if side > 0.0 else np.pi - z[:, 3],
        "holding_moment": side * moment,
        "force_x": side * force_x,
        "force_y": force_y,
    }
    if side < 0.0:
        shape = rod.rest_curvature
        rod = tb.Rod(rest_curvature=(lambda s: -shape(s)) if callable(shape) else -shape, taper=rod.taper)
    return make_record(columns), rod, np.array([side, 1.0, side])[:, None] * found.place[:3]


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("name", RODS)
def test_step_2_returns_the_second_point_without_moment(name, side):
    record, rod, place = touching(name, side)
    assert np.all(side * record["holding_moment"].values > 0.0)
    for method, cell in (("raw", None), ("raw", CELL), ("constrained", CELL)):
        found = tb.reconstruct(record, rig=Rig(rod=rod, load_cell=cell), method=method)
        assert set(found["contact_phase"].values) == {"tip"}
        for name_of, values in zip(("contact_x", "contact_y", "slope_angle"), place, strict=True):
            np.testing.assert_allclose(found[name_of], values, atol=1e-9, err_msg=f"{method} {name_of}")


def test_one_state_is_that_of_its_wrench_and_its_shape_ends_there():
    record, _, place = touching("arc")
    wrench = [record[name].values for name in ("drive_angle", "holding_moment", "force_x", "force_y")]
    found = contact_from_wrench(*wrench, side=1, rest_curvature=2.0)
    np.testing.assert_allclose([found.contact_x, found.contact_y], place[:2], atol=1e-12)
    x, y = rod_shape(*wrench, points=5, side=1.0, rest_curvature=2.0)
    np.testing.assert_allclose([x[:, -1], y[:, -1]], place[:2], atol=1e-12)


def test_two_points_that_are_nearly_as_good_are_both_returned():
    """Moments that vanish 0.1 L before the tip, and where the rod is at 0.64, 0.44 and 0.24 rad to the contour."""
    record, rod, place = touching("arc", force=8.0, psi1=np.array([2.5, 2.7, 2.9]), arclength=0.9)
    found = tb.reconstruct(record, rig=Rig(rod=rod))
    assert found["status"].values.tolist() == ["ok", "ok", "ambiguous"]
    np.testing.assert_allclose([found["contact_x"], found["contact_y"]], place[:2], atol=1e-9)
    np.testing.assert_array_equal(np.isfinite(found["other_contact_x"]), [False, False, True])
    assert float(found["other_contact_arclength"][2]) == pytest.approx(0.089, abs=1e-3)


def test_it_is_a_branch_of_the_posterior():
    record, rod, place = touching("arc")
    tree = tb.infer_contacts(record, rig=Rig(rod=rod, load_cell=CELL), rng=1)
    assert tree["sample_stats"]["converged"].values.all()
    np.testing.assert_array_less(tree["sample_stats"]["tangential_probability"].values, 0.01)
    draws = tree["posterior"].to_dataset().stack(all=("chain", "draw"))
    for name, values in zip(("contact_x", "contact_y", "slope_angle"), place, strict=True):
        away = np.abs(draws[name].mean("all") - values) / draws[name].std("all")
        assert float(away.max()) < 1.5

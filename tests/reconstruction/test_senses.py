"""Step 2 where friction may hold the rod or act the other way."""

from __future__ import annotations

import numpy as np
import pytest

import tactile_bayes as tb
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.rig import Rig

UPRIGHT = 0.5 * np.pi
PARABOLA, CIRCLE = Parabola(0.6, 0.45, 0.1), Circle(0.3, 0.8)
SWEPT = {
    "upright, to the left": (CIRCLE, tb.Translation((0.6, 0.0), np.pi, UPRIGHT, 1.2)),
    "upright, to the right": (CIRCLE, tb.Translation((-0.6, 0.0), 0.0, UPRIGHT, 1.2)),
    "turned back": (PARABOLA, tb.Motion(0.0, 0.0, [0.4, 2.2, 0.4])),
    "turned back from the other side": (PARABOLA, tb.Motion(0.0, 0.0, [2.9, 1.2, 2.9])),
}
PLACE = ("contact_x", "contact_y", "slope_angle")
ROUNDING = 1e-9


@pytest.mark.parametrize("diameter", [0.0, 0.02])
@pytest.mark.parametrize(("contour", "drive"), SWEPT.values(), ids=SWEPT)
def test_contact_points_are_right_and_slopes_are_between_their_ends(contour, drive, diameter):
    rig = Rig(rod=tb.Rod(diameter=diameter), unknown={"friction": 0.3})
    record = tb.scan(contour, rig, drive=drive).record
    contacts = tb.reconstruct(record, rig)
    loaded = np.hypot(record.force_x, record.force_y).values > 1e-3
    assert np.count_nonzero(loaded) > 50
    truth = record.truth_slope_angle.values[loaded]
    low, high = (contacts[f"{end}_slope_angle"].values[loaded] for end in ("least", "greatest"))
    np.testing.assert_allclose(high - low, 2.0 * np.arctan(0.3), rtol=1e-9)
    assert np.all((low - ROUNDING < truth) & (truth < high + ROUNDING))
    # Of a thick rod the point on its surface is as uncertain as the slope.
    most = ROUNDING if diameter == 0.0 else 0.5 * diameter * 2.0 * np.arctan(0.3)
    for name in ("contact_x", "contact_y"):
        assert np.abs(contacts[name].values - record[f"truth_{name}"].values)[loaded].max() < most


def test_ways_of_a_drive_have_their_own_sense():
    """With noise each way takes the sense that fits better: at the tip slopes are right where the rod slides."""
    contour, drive = SWEPT["turned back"]
    record = tb.scan(contour, Rig(unknown={"friction": 0.3}), drive=drive).record
    cell = tb.LoadCell(force_noise=0.002, moment_noise=0.001)
    rig = Rig(load_cell=cell, unknown={"friction": 0.3})
    contacts = tb.reconstruct(cell.measure(record, rng=1), rig, method="constrained")
    forth = np.arange(record.sizes["sample"]) < record.sizes["sample"] // 2
    steady = contacts.slope_angle.values - record.truth_slope_angle.values
    strong = np.hypot(record.force_x, record.force_y).values > 1.0
    assert np.median(np.abs(steady[strong & forth])) < 0.01
    late = np.flatnonzero(strong)[-10:]
    assert np.median(np.abs(steady[late])) < 0.01


def test_a_straight_rod_that_turns_one_way_has_one_slope():
    rig = Rig(unknown={"friction": 0.3})
    record = tb.scan(PARABOLA, rig, drive_step=0.1).record
    contacts = tb.reconstruct(record, rig)
    loaded = (record.force_y != 0.0).values
    np.testing.assert_array_equal(contacts.least_slope_angle[loaded], contacts.slope_angle[loaded])
    np.testing.assert_array_equal(contacts.greatest_slope_angle[loaded], contacts.slope_angle[loaded])


@pytest.mark.parametrize("friction", [0.1, 0.5])
@pytest.mark.parametrize(("contour", "drive"), SWEPT.values(), ids=SWEPT)
def test_contacts_under_noise_hold_whether_the_rod_slides_or_sticks(contour, drive, friction):
    cell = tb.LoadCell(force_noise=0.02, moment_noise=0.01)
    rig = Rig(load_cell=cell, unknown={"friction": friction})
    record = cell.measure(tb.scan(contour, rig, drive=drive).record, rng=1).isel(sample=slice(None, None, 4))
    truth = np.stack([record[f"truth_{name}"].values for name in PLACE])
    contacts = tb.reconstruct(record, rig, method="constrained")
    good = contacts.status.values == "ok"
    assert np.count_nonzero(good) > 7
    off = np.stack(
        [
            (contacts[name].values - at) / contacts[f"{name}_sd"].values
            for name, at in zip(PLACE[:2], truth[:2], strict=True)
        ]
    )
    np.testing.assert_array_less(np.abs(off[:, good]), 4.0)
    draws = tb.infer_contacts(record, rig, rng=1)["posterior"]
    every = np.stack([draws[name].values.reshape(-1, record.sizes["sample"]) for name in PLACE])
    low, high = np.quantile(every, [0.025, 0.975], axis=1)
    touched = np.isfinite(low).all(axis=0) & np.isfinite(truth).all(axis=0)
    held = ((low <= truth) & (truth <= high))[:, touched]
    assert held.shape[1] > 15
    np.testing.assert_array_less(0.8, held.mean(axis=1))

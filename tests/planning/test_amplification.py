"""Errors of contact points to first order: against differences of `reconstruct`, and against noise that is drawn."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import tactile_bayes as tb
from tactile_bayes.contours import paper_profile
from tactile_bayes.planning.amplification import METHODS, SOURCES, amplification, contact_errors
from tactile_bayes.planning.plan import Plan, enlarged

PROFILE = paper_profile("II", q=0.5)

# So little noise that every sample is loaded, and its phase certain.
QUIET = tb.LoadCell(force_noise=5e-6, moment_noise=2e-6)
THICK = tb.Rod.circular(length=0.2, diameter=5e-3, youngs_modulus=1e9)
QUIET_SI = tb.LoadCell(force_noise=5e-6 * THICK.force_unit, moment_noise=2e-6 * THICK.moment_unit)

TALKING = ((1.02, 0.01, -0.02), (0.03, 0.97, 0.01), (-0.01, 0.02, 1.01))
CIRCLE = tb.contours.Circle(0.3, 0.8)
SHIFTS = [tb.Translation((0.8, 0.0), np.pi, 1.1, 1.6), tb.Translation((-0.8, 0.0), 0.0, np.pi - 1.1, 1.6)]
PLANS = {
    "cross-talk": Plan(PROFILE, tb.Rig(load_cell=replace(QUIET, gain=TALKING, drive_angle_offset=0.02))),
    "correlated noise": Plan(PROFILE, tb.Rig(load_cell=replace(QUIET, correlation=(0.3, -0.2, 0.5)))),
    "all of it turning": Plan(
        enlarged(PROFILE, 0.2),
        tb.Rig(THICK, replace(QUIET_SI, drive_angle_noise=2e-6, frame="turning", correlation=(0.1, 0.2, 0.5))),
    ),
    "friction": Plan(PROFILE, tb.Rig(load_cell=replace(QUIET, drive_angle_noise=2e-6), unknown={"friction": 0.3})),
    "another pivot": Plan(paper_profile("III", q=0.4), tb.Rig(load_cell=QUIET), drive=tb.Rotation((0.2, -0.1))),
}


@cache
def in_the_middle(name):
    """Of both sweeps, clear of their ends and of changes of phase."""
    plan = PLANS[name]
    angles = []
    for sweep in plan.scan.sweeps:
        first, snap = sweep.first_contact.drive_angle, sweep.snap_off.drive_angle
        every = first + (snap - first) * np.linspace(0.05, 0.95, 10)
        changes = np.array([change.drive_angle for change in sweep.transitions])
        angles.append(every[np.all(np.abs(every[:, None] - changes) > 0.02, axis=1)])
    plan = plan.at_angles(np.concatenate(angles))
    return plan, amplification(plan)


STEPS = {"raw": (1e-5, 2e-5), "constrained": (2e-4, 4e-4)}
# Rounding of 1e-13 rod lengths over 1e-5, and some cubes; a fit is settled to 1e-12 of a sum of squares, which is 1e-6
# of what it moved, and some times that across.
TOLERANCES = {"raw": 2e-6, "constrained": 2e-5}


def loaded(plan):
    return plan.record.isel(sample=np.flatnonzero(plan.scan.record.truth_contact_phase.values != "none"))


def reconstructed(record, plan, method):
    rig = tb.Rig(rod=plan.rod, load_cell=plan.cell, unknown={"friction": plan.friction})
    found = tb.reconstruct(record, method=method, rig=rig)
    return np.array([found.contact_x.values, found.contact_y.values])


def along_and_across(x, y, record):
    slope = record.truth_slope_angle.values
    return np.cos(slope) * x + np.sin(slope) * y, np.cos(slope) * y - np.sin(slope) * x


def differences(plan, method, source):
    """Central ones of contacts along and across the contour, over two and four standard deviations: (samples, 2)."""
    record, units = loaded(plan), {"holding_moment": plan.rod.moment_unit, "drive_angle": 1.0}
    found = []
    for step in STEPS[method]:
        step = step * units.get(source, plan.rod.force_unit)
        more, less = (
            reconstructed(record.assign({source: record[source] + sign * step}), plan, method) for sign in (1, -1)
        )
        found.append(np.stack(along_and_across(*((more - less) / (2.0 * step)), record), axis=1))
    return (4.0 * found[0] - found[1]) / 3.0  # Richardson


SLOW = {name: pytest.param(name, marks=pytest.mark.slow) for name in PLANS}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "name", ["cross-talk", SLOW["correlated noise"], "all of it turning", "friction", SLOW["another pivot"]]
)
def test_gains_are_differences_of_reconstruct(name, method):
    """Both phases, both directions; relative to the largest gain of a sample, by the same source."""
    plan, grown = in_the_middle(name)
    assert {"forward", "backward"} == set(grown.direction.values)
    if name != "another pivot":
        assert {"tip", "tangential"} == set(grown.contact_phase.values)
    assert grown.holds.values.all() or method == "raw"
    for source in SOURCES:
        right = differences(plan, method, source)
        of = grown.sel(reconstruction=method, source=source)
        found = np.stack([of.gain_along.values, of.gain_across.values], axis=1)
        scale = np.abs(right).max(axis=1, keepdims=True) + plan.rod.length * 1e-2
        np.testing.assert_array_less(np.abs(found - right) / scale, TOLERANCES[method])


def test_gains_of_a_carried_rod_are_differences_of_reconstruct():
    plan = Plan(CIRCLE, tb.Rig(load_cell=QUIET), drive=SHIFTS)
    found, record = contact_errors(plan), loaded(plan)
    strong = np.hypot(record.force_x, record.force_y).values > 0.2
    assert strong.sum() > 10
    gain = found.gain_along.sel(reconstruction="raw", source="force_y").values
    np.testing.assert_allclose(differences(plan, "raw", "force_y")[strong, 0], gain[strong], rtol=1e-3, atol=1e-4)


def test_distances_are_along_the_drive():
    plan = Plan(CIRCLE, tb.Rig(load_cell=QUIET), drive=replace(SHIFTS[0], drive_step=0.05))
    found, (sweep,) = amplification(plan), plan.scan.sweeps
    travel = 0.8 - found.base_x.values
    np.testing.assert_allclose(found.after_first_contact, travel - sweep.first_contact.travel, atol=1e-12)
    np.testing.assert_allclose(found.before_snap_off, sweep.snap_off.travel - travel, atol=1e-12)
    assert {found[name].attrs["units"] for name in ("after_first_contact", "before_snap_off")} == {"1"}
    both = amplification(Plan(CIRCLE, tb.Rig(load_cell=QUIET), drive=[tb.Rotation(), SHIFTS[0]]))
    assert both.before_snap_off.attrs["units"] == "rad, 1"


@pytest.mark.parametrize("name", ["all of it turning", SLOW["correlated noise"], SLOW["friction"], SLOW["cross-talk"]])
def test_standard_deviations_are_those_of_noise_that_is_drawn(name):
    """Within 4.5 standard errors: of some 30 numbers for each rig, false alarms in 1 of 3000 runs."""
    draws = 600
    plan, grown = in_the_middle(name)
    record, rng = loaded(plan), np.random.default_rng(1)
    every = np.arange(0, record.sizes["sample"], 3)
    record, grown = record.isel(sample=every), grown.isel(sample=every)
    cell = replace(plan.cell, bias=(0.0, 0.0, 0.0), gain=tb.LoadCell().gain)
    noise = cell.simulate(np.zeros((draws, every.size, 3)), rng=rng).reshape(-1, 3)
    many = record.isel(sample=np.repeat(np.arange(every.size), draws))  # so that the drive does not turn back
    noisy = {name: many[name] + noise[:, k] for k, name in enumerate(tb.record.CHANNELS)}
    noisy["drive_angle"] = many.drive_angle + cell.drive_angle_noise * rng.standard_normal(noise.shape[0])
    truth = np.array([record.truth_contact_x.values, record.truth_contact_y.values])
    for method in METHODS:
        off = reconstructed(many.assign(noisy), plan, method).reshape(2, every.size, draws) - truth[..., None]
        of = grown.sel(reconstruction=method)
        for error, sd in zip(along_and_across(*off.swapaxes(1, 2), record), (of.sd_along, of.sd_across), strict=True):
            ratio = np.sqrt(np.mean(error**2, axis=0)) / sd.values
            assert np.all(np.abs(ratio - 1.0) < 4.5 / np.sqrt(2.0 * draws)), (method, ratio)


def test_standard_deviations_are_those_that_reconstruct_states():
    """These come from another route, by covariances of place."""
    plan, grown = in_the_middle("all of it turning")
    record = loaded(plan)
    for method in METHODS:
        stated = tb.reconstruct(record, method=method, rig=tb.Rig(rod=plan.rod, load_cell=plan.cell))
        of = grown.sel(reconstruction=method)
        np.testing.assert_allclose(of.sd_along.values, stated.tangent_sd.values, rtol=1e-3)
        np.testing.assert_allclose(of.sd_across.values, stated.normal_sd.values, rtol=1e-3)
        assert of.sd_along.attrs["units"] == "m"


def test_raw_errors_grow_like_one_over_the_distance_from_first_contact_and_not_toward_snap_off():
    """Loads begin in proportion to the distance, noise is what it is; a slope of logarithms over two decades."""
    grown = amplification(Plan(PROFILE))
    for name in ("growth_along", "growth_across"):
        raw = grown[name].sel(reconstruction="raw")
        np.testing.assert_allclose(raw.sel(event="first contact").values, -1.0, atol=0.02)
        np.testing.assert_allclose(raw.sel(event="snap-off").values, 0.0, atol=0.02)

"""A number is known: a scan of a rig, read by it, is what inference expects at that value."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from helpers.expected_readings import assert_expected
from helpers.known_numbers import KNOWN as EVERY
from helpers.known_numbers import PIN, ROD, scaled
from helpers.refusals import refused
from tactile_bayes import LoadCell, Rig, Rod, Rotation, Translation, equilibria, scan
from tactile_bayes.errors import ParameterError
from tactile_bayes.planning.plan import Plan
from tactile_bayes.record import bases_of
from tactile_bayes.rig import NOTHING
from tactile_bayes.rig.parameters import GROUPS, PARAMETERS, SENSOR
from tactile_bayes.sweep import scan_many

NOT_SWEPT = {*GROUPS["gauge"], *GROUPS["discrepancy"], "moment_noise", "force_noise"}
KNOWN = {name: value for name, value in EVERY.items() if name not in GROUPS["gauge"]}


def test_numbers_of_all_parameters_are_tried():
    assert {name for name in KNOWN if not name.startswith("base")} == set(PARAMETERS) - NOT_SWEPT


@pytest.mark.parametrize(
    ("name", "length"),
    [
        *((name, 0.1) for name in [*KNOWN, "all"]),
        ("all", None),
        *(pytest.param(name, None, marks=pytest.mark.slow) for name in KNOWN),
    ],
)
def test_a_scan_that_is_read_is_what_inference_expects(name, length):
    rod, cell, contour, bases, known = scaled(length or 1.0, 1.0 if length is None else 2e-4)
    every = {other: known[other] for other in KNOWN if other != "taper_error"}  # which is in the taper
    said = {**NOTHING, **(every if name == "all" else {name: known[name]})}
    rig = Rig(rod if length else replace(ROD), cell, said)
    swept = scan(contour, rig, drive=[Rotation(base, drive_step=0.1) for base in bases])
    times = np.cumsum(np.random.default_rng(1).uniform(20.0, 200.0, swept.record.sizes["sample"]))
    record = rig.measure(swept.record.assign(time_ms=("sample", times)), rng=1)
    assert record.attrs["units"] == ("SI" if length else "dimensionless")
    np.testing.assert_allclose(bases_of(record), bases, rtol=0, atol=1e-15)
    assert_expected(record, rig, vars(contour), 1e-9)


def test_many_scans_and_equilibria_yield_too():
    rig = Rig(unknown={"suspension_compliance": 0.05, "friction": 0.1, "length": 1.01})
    swept = scan(PIN, rig, direction="backward", drive_step=0.1)
    record, event = swept.record, swept.events["backward"]
    many = scan_many(PIN.broadcast_to((1,)), record.drive_angle.values, direction="backward", rig=rig).isel(contour=0)
    np.testing.assert_allclose(many.holding_moment, record.holding_moment, rtol=0, atol=1e-8)
    assert float(many.snap_off_drive_angle) == pytest.approx(event.snap_off.drive_angle, rel=1e-9)
    loaded = record.isel(sample=record.truth_contact_phase.values != "none").isel(sample=slice(0, 5))
    found = equilibria(PIN, loaded.truth_slope_angle.values, direction="backward", rig=rig)
    np.testing.assert_allclose(found.drive_angle, loaded.drive_angle, rtol=0, atol=1e-9)
    stiff = scan(PIN, rig.with_unknown(suspension_compliance=0.0), direction="backward").events["backward"]
    assert abs(stiff.snap_off.drive_angle - event.snap_off.drive_angle) > 1e-3


@pytest.mark.parametrize("second", [Rotation((0.1, 0.03)), Translation((0.9, -0.1), 3.1416, 1.4, 1.8)])
def test_a_shifted_place_is_where_the_rod_begins(second):
    rig = Rig(unknown={"base": 0.01})
    record = scan(PIN, rig, drive=[Rotation(), second]).record
    np.testing.assert_allclose(bases_of(record), [(0.0, 0.0), np.add(second.base, 0.01)], atol=1e-15)
    np.testing.assert_allclose(bases_of(rig.measure(record, rng=1)), [(0.0, 0.0), second.base], atol=1e-15)


@pytest.mark.parametrize("name", sorted(NOT_SWEPT))
def test_what_no_sweep_has_is_refused(name):
    with refused(ParameterError, name):
        scan(PIN, Rig(unknown={name: 0.01}))


def test_a_drawn_rig_has_numbers_alone():
    rig = Rig(Rod(0.1, 1e-4), LoadCell(bias_uncertainty=(1e-5, 0.0, 0.0)), {"friction": stats.halfnorm(scale=2.0)})
    one, same, other = (rig.draw(seed, pivots=2).known for seed in (0, 0, 1))
    assert set(one) == set(rig.said) - {"moment_bias", *GROUPS["rest_shape"], "taper_error"}
    assert one == same != other
    frictions = [rig.draw(seed).known["friction"] for seed in range(300)]
    whole, most = stats.halfnorm(scale=2.0), PARAMETERS["friction"].high
    assert stats.kstest(frictions, lambda x: whole.cdf(x) / whole.cdf(most)).pvalue > 1e-4
    with refused(ParameterError, "discrepancy_scale", "not drawn"):
        Rig(unknown={"discrepancy": "default"}).draw(1)


def test_a_plan_has_known_numbers():
    rod, cell, contour, bases, known = scaled(0.1, 2e-4)
    noises = {"force_noise": 0.05 * rod.force_unit, "moment_noise": 0.02 * rod.moment_unit}
    left = ("noise_scale", "taper_error", *SENSOR[2:])
    said = {**NOTHING, **{name: known[name] for name in KNOWN if name not in left}}
    plan = Plan(
        contour, Rig(rod, replace(cell, **noises), said), drive=[Rotation(base, drive_step=0.1) for base in bases]
    )
    assert_expected(plan.record, plan.rig, vars(contour), 1e-9)
    contacts = plan.reconstruct(plan.record, "raw")
    sure = (contacts.status == "ok").values & (plan.record.truth_contact_phase != "none").values
    assert sure.sum() > 20
    off = np.hypot(contacts.contact_x - plan.record.truth_contact_x, contacts.contact_y - plan.record.truth_contact_y)
    assert float(off.values[sure].max()) < 1e-6 * rod.length

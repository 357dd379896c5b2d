"""Step 2, sample by sample: what comes back without noise, and what becomes of samples that are no contacts."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import example, given, settings
from scipy.stats import binomtest

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes import LoadCell, Rig, Rod, make_record, reconstruct, scan
from tactile_bayes.contours import Circle, Parabola, paper_profile
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.reconstruction import FALSE_ALARM, STATUSES, loaded_samples
from tactile_bayes.rig import NOTHING

NUMBERS = ("contact_x", "contact_y", "contact_arclength", "slope_angle")
CONTOUR = Parabola(0.5, 0.5)
WIRE = Rod(length=0.2, flexural_rigidity=2.4e-3, diameter=0.7e-3)


@pytest.fixture(scope="module")
def swept():
    return scan(CONTOUR, drive_step=0.1).record


def assert_contour_comes_back(record, contacts, contour, length=1.0):
    touching = record.truth_contact_phase.values != "none"
    assert touching.any()
    assert not touching.all()
    assert (contacts.status.values == np.where(touching, "ok", "no contact")).all()
    assert (contacts.contact_phase.values == record.truth_contact_phase.values).all()
    for name in NUMBERS:
        scale = 1.0 if name == "slope_angle" else length
        found, true = contacts[name].values[touching], record[f"truth_{name}"].values[touching]
        np.testing.assert_allclose(found / scale, true / scale, rtol=0.0, atol=1e-10)
        assert np.isnan(contacts[name].values[~touching]).all()
    heights = contour.height(contacts.contact_x.values[touching])
    np.testing.assert_allclose(contacts.contact_y.values[touching] / length, heights / length, rtol=0.0, atol=1e-10)


def assert_statuses_tell_the_truth(contacts):
    finite = np.all([np.isfinite(contacts[name].values) for name in NUMBERS], axis=0)
    empty = np.all([np.isnan(contacts[name].values) for name in NUMBERS], axis=0)
    status, phase = contacts.status.values, contacts.contact_phase.values
    assert set(status) <= set(STATUSES)
    assert (finite | empty).all()
    assert (finite == np.isin(status, ("ok", "nonlinear", "beyond the tip"))).all()
    assert ((phase == "none") == empty).all()


@pytest.mark.parametrize(("base", "friction"), [((0.0, 0.0), 0.0), ((0.15, -0.05), 0.3)])
@pytest.mark.parametrize("q", [0.5, *(pytest.param(q, marks=pytest.mark.slow) for q in (0.1, 0.8))])
@pytest.mark.parametrize("profile", ["I", "II", "III", "IV"])
def test_a_record_without_noise_gives_the_contour_back(profile, q, base, friction):
    contour = paper_profile(profile, q)
    record = scan(contour, base=base, rig=Rig(unknown={"friction": friction}), drive_step=np.radians(3)).record
    assert set(record.direction.values) == {"forward", "backward"}
    assert_contour_comes_back(record, reconstruct(record, rig=Rig(unknown={"friction": friction})), contour)


@pytest.mark.parametrize(
    ("contour", "base", "rod", "friction"),
    [
        (Parabola(2.5, 0.1, 0.01), (0.02, -0.01), WIRE, 0.2),
        (Circle(0.2, 0.1), (0.0, 0.0), Rod(0.2, 2.4e-3, diameter=4e-3), 0.0),
        (Parabola(0.5, 0.5), (0.0, 0.0), Rod(diameter=0.03), 0.0),
    ],
)
def test_units_and_thickness_of_the_rod_come_out_right(contour, base, rod, friction):
    record = scan(contour, base=base, rig=Rig(rod=rod, unknown={"friction": friction}), drive_step=np.radians(3)).record
    contacts = reconstruct(record, rig=Rig(unknown={"friction": friction}))
    assert_contour_comes_back(record, contacts, contour, rod.length)
    metre = "m" if record.attrs["units"] == "SI" else "1"
    assert [contacts[name].attrs["units"] for name in NUMBERS] == [metre, metre, metre, "rad"]
    assert contacts.attrs["units"] == record.attrs["units"]


def test_what_identifies_a_sample_is_kept(swept):
    contacts = reconstruct(swept)
    for name in ("sweep", "direction", "base_x", "base_y", "drive_angle"):
        assert (contacts[name].values == swept[name].values).all()


def test_friction_that_is_left_out_turns_the_slope_by_its_angle():
    record = scan(Parabola(0.5, 0.3), rig=Rig(unknown={"friction": 0.3}), drive_step=0.1).record
    on = record.truth_contact_phase.values != "none"
    turn = (reconstruct(record).slope_angle - record.truth_slope_angle).values[on]
    side = np.where(record.direction.values[on] == "forward", 1.0, -1.0)
    np.testing.assert_allclose(turn, side * np.arctan(0.3), atol=1e-10)


@pytest.mark.parametrize(
    ("loads", "status"),
    [
        ((0.1, 0.0, 0.5), "ok"),
        ((0.0, 0.0, 0.0), "no contact"),
        ((5.0, 0.0, 1.0), "no zero of curvature"),  # m0² > 2f (1 + sin ψ0): the rod is bent all along
        ((0.5, 0.0, 0.0), "no zero of curvature"),  # a moment and no force
        ((0.0, 0.0, 0.5), "no zero of curvature"),  # a force through the pivot of a straight rod
        ((-0.2, 0.0, 0.5), "no zero of curvature"),  # a moment of the other side
        ((1e-3, 0.0, 1e-3), "beyond the tip"),  # m0/f, the lever of the force, is a rod length
    ],
)
@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_each_status_is_reached(swept, loads, status, direction):
    """One sample among good ones, whose moments say on which side the object lies."""
    good = swept.isel(sample=swept.direction.values == direction)
    good = good.drop_vars([name for name in good.data_vars if name.startswith("truth_")])
    good["sweep"][:] = 0
    sign, angle = (1.0, 1.2) if direction == "forward" else (-1.0, np.pi - 1.2)
    table = {name: good[name].values for name in good.data_vars}
    place = int(np.searchsorted(sign * table["drive_angle"], sign * angle))
    moment, force_x, force_y = loads
    row = {"sweep": 0, "direction": direction, "base_x": 0.0, "base_y": 0.0, "drive_angle": angle}
    row |= {"holding_moment": sign * moment, "force_x": sign * force_x, "force_y": force_y}
    mixed = make_record({name: np.insert(values, place, row[name]) for name, values in table.items()})

    contacts = reconstruct(mixed)
    assert contacts.status.values[place] == status
    assert_statuses_tell_the_truth(contacts)
    others = contacts.drop_isel(sample=place)
    for name in NUMBERS:
        np.testing.assert_array_equal(others[name].values, reconstruct(good)[name].values)


def test_a_contact_beyond_the_tip_keeps_its_numbers():
    columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2], "holding_moment": [1e-3]}
    contacts = reconstruct(make_record(columns | {"force_x": 0.0, "force_y": 1e-3}))
    assert contacts.status.item() == "beyond the tip"
    assert contacts.contact_arclength.item() > 1.0
    assert contacts.contact_x.item() == pytest.approx(1.0)  # the lever m0/f of a vertical force


def test_a_load_beyond_all_numbers_has_no_zero_of_curvature():
    """In SI units it is a number, in those of the rod it is none."""
    columns = {"sweep": 0, "direction": "forward", "drive_angle": [1.2, 1.2], "holding_moment": [1e300, 1e-5]}
    contacts = reconstruct(make_record({**columns, "force_x": 0.0, "force_y": 1e-3}, Rig(rod=Rod(0.1, 1e-12))))
    assert contacts.status.values[0] == "no zero of curvature"
    assert_statuses_tell_the_truth(contacts)


magnitudes = st.floats(-100, 100).map(lambda power: 10.0**power) | st.just(0.0)
signed = st.tuples(magnitudes, st.sampled_from([-1.0, 1.0])).map(lambda pair: pair[0] * pair[1])
usual = st.floats(-3.0, 3.0, width=32)


@given(
    loads=st.lists(st.tuples(*(3 * [usual | signed])), min_size=1, max_size=8),
    angle=st.floats(-6.0, 6.0),
    direction=st.sampled_from(["forward", "backward"]),
    noise=st.sampled_from([None, 0.02, 1e-300]),
    friction=st.sampled_from([0.0, 0.5]),
)
@example(loads=[(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], angle=0.0, direction="backward", noise=1e-300, friction=0.0)
@settings(max_examples=40, deadline=None)
def test_no_sample_raises_and_none_is_silently_empty(loads, angle, direction, noise, friction):
    moment, force_x, force_y = np.array(loads).T
    columns = {"sweep": 0, "direction": direction, "drive_angle": np.full(len(loads), angle)}
    record = make_record({**columns, "holding_moment": moment, "force_x": force_x, "force_y": force_y})
    cell = None if noise is None else LoadCell(force_noise=noise, moment_noise=noise)
    assert_statuses_tell_the_truth(reconstruct(record, rig=Rig(load_cell=cell, unknown={"friction": friction})))


def test_the_data_sheet_in_the_record_is_the_default(swept):
    measured = LoadCell(force_noise=0.05, moment_noise=0.02).measure(swept, rng=1)
    by_default = reconstruct(measured)
    assert by_default.identical(reconstruct(measured, rig=Rig(load_cell=LoadCell(force_noise=0.05, moment_noise=0.02))))
    assert (reconstruct(measured, rig=Rig(load_cell=LoadCell())).status.values != "no contact").all()


@pytest.mark.parametrize("missing", [(), ("holding_moment",), ("force_x", "force_y")], ids=["all", "forces", "moment"])
def test_unloaded_samples_are_taken_for_loaded_as_rarely_as_stated(missing):
    """Of 50 000 samples; the test itself fails for one seed in a million."""
    columns = {"sweep": 0, "direction": "forward", "drive_angle": np.full(50_000, 1.2)}
    columns |= {name: 0.0 for name in ("holding_moment", "force_x", "force_y") if name not in missing}
    unloaded = make_record(columns, Rig(file={"missing": missing}))
    measured = LoadCell(force_noise=0.05, moment_noise=0.02).measure(unloaded, rng=1)
    alarms = int(loaded_samples(measured).sum())
    assert binomtest(alarms, 50_000, FALSE_ALARM).pvalue > 1e-6
    if not missing:
        assert np.count_nonzero(reconstruct(measured).status.values != "no contact") == alarms


@pytest.mark.parametrize("name", ["holding_moment", "force_x", "force_y"])
def test_a_missing_channel_is_refused(swept, name):
    with refused(RecordError, name):
        reconstruct(swept.assign({name: np.nan * swept[name]}))


def test_a_rod_in_si_does_not_fit_a_dimensionless_record(swept):
    with refused(ParameterError, "dimensionless", WIRE):
        reconstruct(swept, rig=Rig(rod=WIRE))


def test_a_rod_that_is_given_holds_against_the_one_stated():
    contour = Parabola(2.5, 0.1)
    record = scan(contour, rig=Rig(rod=WIRE), drive_step=0.1).record
    wrong = record.assign_attrs(rod_length=0.3, rod_flexural_rigidity=1e-3, rod_diameter=0.0)
    assert_contour_comes_back(record, reconstruct(wrong, rig=Rig(rod=WIRE)), contour, WIRE.length)
    assert wrong.attrs["rod_length"] == 0.3
    with pytest.raises(AssertionError):
        assert_contour_comes_back(record, reconstruct(wrong), contour, WIRE.length)


def test_a_carried_rod_that_slides_the_other_way_is_found():
    """Its flank slides against the sense of its side; the posterior of contacts has the same sense."""
    drive = tb.Motion([-1.2, 1.2], [-0.36735194, 0.06182908], [0.52707784, 1.35185622], drive_step=0.08)
    rig = Rig(load_cell=LoadCell(force_noise=1e-4, moment_noise=1e-4), unknown={"friction": 0.0343})
    record = tb.scan(Parabola(0.15874053, 0.28976189, 0.19207482), rig, drive=drive).record
    lying = np.flatnonzero(record.truth_contact_phase.values == "tangential")
    assert lying.size
    measured = rig.load_cell.measure(record, rng=1)
    contacts = reconstruct(measured, rig=rig, method="constrained")
    drawn = tb.infer_contacts(measured, rig, rng=1, draws=400)["posterior"].mean(("chain", "draw"))
    for found in (contacts, drawn):
        off = np.hypot(found.contact_x - record.truth_contact_x, found.contact_y - record.truth_contact_y)
        assert float(off[lying].max()) < 2e-3


def test_a_number_for_all_pivots_is_one_for_each_of_them():
    record = scan(CONTOUR, base=[(0.0, 0.0), (0.2, 0.0)], drive_step=0.1).record
    every, each = ({**NOTHING, "base": 0.01}, {**NOTHING, "base_2_x": 0.01, "base_2_y": 0.01})
    found, same = (reconstruct(record, rig=Rig(unknown=unknown)) for unknown in (every, each))
    assert found.equals(same)
    assert not found.equals(reconstruct(record, rig=Rig(unknown=NOTHING)))

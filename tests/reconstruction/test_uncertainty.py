"""Step 2 with standard deviations: against Monte Carlo, the law of the misfit, and what becomes of doubtful samples."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import xarray as xr
from scipy.stats import kstest

from helpers.load_cells import CELL, GAIN, SHARED
from helpers.refusals import refused
from tactile_bayes import LoadCell, Rig, Rod, make_record, reconstruct, scan
from tactile_bayes.contours import Parabola, paper_profile
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import OrnsteinUhlenbeck, RandomWalk
from tactile_bayes.record import CHANNELS, in_frame, loads_of

METHODS = pytest.mark.parametrize("method", ["raw", "constrained"])
PLACE = ("contact_x", "contact_y", "slope_angle", "contact_arclength")
SPREADS = (*(f"{name}_sd" for name in PLACE), "tangent_sd", "normal_sd")
NUMBERS = (*PLACE, *SPREADS, "contact_xy_correlation")
WIRE = Rod(length=0.2, flexural_rigidity=2.4e-3, diameter=4e-3)
SOFT = Rod(length=0.2, flexural_rigidity=0.8 * 2.4e-3, diameter=4e-3)

COPIES = 4000
SMALL = 1e-4  # factor on forces and moments of ordinary noise, so that first order is all there is


def cell(**options) -> LoadCell:
    return LoadCell(**{"force_noise": 5.0 * SMALL, "moment_noise": 2.0 * SMALL, **options})


@pytest.fixture(scope="module")
def swept():
    return scan(paper_profile("II", q=0.5), drive_step=0.05).record


@pytest.fixture(scope="module")
def scenes(swept):
    """Ideal records, with the friction in them."""
    return {
        "plain": (swept, 0.0),
        "turning": (in_frame(swept, "turning"), 0.0),
        "friction": (scan(paper_profile("II", q=0.5), drive_step=0.05, rig=Rig(unknown={"friction": 0.3})).record, 0.3),
        "SI": (scan(Parabola(2.5, 0.1), drive_step=0.05, rig=Rig(rod=WIRE)).record, 0.0),
    }


def pick(record, phase, direction="forward"):
    """A contact in the middle of a phase: far from the edge, where noise is small."""
    there = np.flatnonzero((record.truth_contact_phase == phase) & (record.direction == direction))
    return int(there[len(there) // 2])


SI_NOISE = {"force_noise": 5.0 * SMALL * WIRE.force_unit, "moment_noise": 2.0 * SMALL * WIRE.moment_unit}
SENSORS = {
    "white": ("plain", cell()),
    "correlated": ("plain", cell(correlation=SHARED)),
    "cross-talk and bias": ("plain", cell(gain=GAIN, bias=(0.1, -0.2, 0.3))),
    "cross-talk, correlated": ("plain", cell(gain=GAIN, correlation=SHARED)),
    "relative": ("plain", cell(relative_noise=5.0 * SMALL)),
    "relative, cross-talk": ("plain", cell(relative_noise=5.0 * SMALL, gain=GAIN, bias=(0.1, -0.2, 0.3))),
    "encoder": ("plain", cell(drive_angle_noise=3.0 * SMALL, drive_angle_offset=0.01)),
    "encoder's steps": ("plain", cell(drive_angle_noise=3.0 * SMALL, drive_angle_resolution=6.0 * SMALL)),
    "turning": ("turning", cell(correlation=SHARED)),
    "encoder, turning": ("turning", cell(drive_angle_noise=3.0 * SMALL, gain=GAIN)),
    "steps": ("plain", cell(force_resolution=5.0 * SMALL, moment_resolution=2.0 * SMALL)),
    "outliers": ("plain", cell(degrees_of_freedom=12.0)),
    "friction": ("friction", cell()),
    "SI, thick rod, encoder": ("SI", LoadCell(**SI_NOISE, drive_angle_noise=2.0 * SMALL, bias=(1e-5, 1e-4, 0.0))),
}


def assert_spread_is_as_stated(contacts: xr.Dataset, copies=COPIES):
    """Whatever is stated, first order: no more than 4.5 standard errors off, which of 1000 tests fails one. The
    standard error of a standard deviation is 1/√(2n) of it, for normal numbers; outliers add some."""
    error = 4.5 / np.sqrt(2.0 * copies)
    x, y = (contacts[name].values - contacts[name].values.mean() for name in ("contact_x", "contact_y"))
    alpha = contacts.slope_angle.values.mean()
    found = {f"{name}_sd": contacts[name].values.std() for name in PLACE}
    found["tangent_sd"] = (np.cos(alpha) * x + np.sin(alpha) * y).std()
    found["normal_sd"] = (np.cos(alpha) * y - np.sin(alpha) * x).std()
    for name, value in found.items():
        stated = float(contacts[name].median())
        if name == "contact_arclength_sd" and stated < 1e-12:
            assert value < 1e-14
        else:
            assert abs(value / stated - 1.0) < error, (name, value, stated)
    correlation = float(contacts.contact_xy_correlation.median())
    # Fisher's transformation: artanh of a correlation has the standard error 1/√n.
    if abs(correlation) < 1.0 - 1e-6:
        off = np.arctanh(np.corrcoef(x, y)[0, 1]) - np.arctanh(correlation)
        assert abs(off) < 4.5 / np.sqrt(copies)


ONCE = {("raw", "tip", "forward"), ("constrained", "tangential", "backward")}
TWICE = ("white", "encoder, turning")


def is_quick(method, sensor, phase, direction):
    in_both = (phase, direction) in (("tip", "forward"), ("tangential", "backward"))
    return (method, phase, direction) in ONCE or (sensor in TWICE and in_both)


FULL = [
    pytest.param(*case, marks=[] if is_quick(*case) else [pytest.mark.slow])
    for case in product(("raw", "constrained"), SENSORS, ("tip", "tangential"), ("forward", "backward"))
]


@pytest.mark.parametrize(("method", "sensor", "phase", "direction"), FULL)
def test_contacts_scatter_as_stated(scenes, method, sensor, phase, direction):
    name, load_cell = SENSORS[sensor]
    record, friction = scenes[name]
    copies = record.isel(sample=np.full(COPIES, pick(record, phase, direction)))
    seed = [sum(map(ord, sensor + phase + direction))]
    measured = load_cell.measure(copies, rng=np.random.default_rng(seed))
    contacts = reconstruct(measured, method=method, rig=Rig(unknown={"friction": friction}))
    assert set(contacts.status.values) <= {"ok", "beyond the tip"}
    if method == "constrained":
        assert (contacts.contact_phase == phase).all()
    assert_spread_is_as_stated(contacts)
    assert contacts.contact_x_sd.attrs["units"] == ("m" if record.attrs["units"] == "SI" else "1")
    assert contacts.slope_angle_sd.attrs["units"] == "rad"
    truth = record.isel(sample=pick(record, phase, direction))
    for number in PLACE:
        # Second order shifts the mean by less than the noise's square.
        error = contacts[f"{number}_sd"].values[0] * 5.0 / np.sqrt(COPIES)
        assert contacts[number].values.mean() == pytest.approx(float(truth[f"truth_{number}"]), abs=error + 1e-5)


SHARING = {
    "unknown bias": cell(bias_uncertainty=(1e-3, 5e-4, 2e-3)),
    "random walk": cell(drive_angle_noise=SMALL, drift=RandomWalk(moment=1e-4, force=2e-4)),
    "drift that forgets": cell(drift=OrnsteinUhlenbeck(moment=1e-3, force=5e-4, time=5.0)),
}


@pytest.mark.parametrize(
    ("method", "kind"),
    [
        *(("raw", kind) for kind in SHARING),
        ("constrained", "random walk"),
        *(pytest.param("constrained", kind, marks=pytest.mark.slow) for kind in ("unknown bias", "drift that forgets")),
    ],
)
def test_errors_that_samples_share_are_in_each(swept, method, kind):
    """One sample late in each of 2000 records, against what is stated of a sample at that place in one record."""
    late, records = 80, 2000
    load_cell = SHARING[kind]
    for phase in ("tip", "tangential"):
        one = swept.isel(sample=np.full(late + 1, pick(swept, phase)))
        loads = loads_of(one)
        readings = load_cell.simulate(np.broadcast_to(loads, (records, late + 1, 3)), rng=1)[:, -1]
        angles = one.drive_angle.values[0] + load_cell.drive_angle_noise * np.random.default_rng(2).normal(size=records)
        stated = reconstruct(one, method=method, rig=Rig(load_cell=load_cell)).isel(sample=-1)
        table = {"sweep": 0, "direction": "forward", "drive_angle": angles}
        record = make_record(table | dict(zip(CHANNELS, readings.T, strict=True)))
        contacts = reconstruct(record, method="raw", rig=Rig(load_cell=LoadCell()))
        if method == "constrained":
            moment, force_x, force_y = np.sqrt(np.diag(load_cell.covariance(np.zeros((late + 1, 3)))[-1]))
            white = LoadCell(
                moment_noise=moment,
                force_noise=force_x,
                bias_uncertainty=(0.0, 0.0, float(np.sqrt(max(force_y**2 - force_x**2, 0.0)))),
                drive_angle_noise=load_cell.drive_angle_noise,
            )
            contacts = reconstruct(record, method=method, rig=Rig(load_cell=white))
        for name in (*SPREADS[:3], *(() if method == "constrained" and phase == "tip" else SPREADS[3:4])):
            found = contacts[name.removesuffix("_sd")].values.std()
            assert abs(found / float(stated[name]) - 1.0) < 4.5 / np.sqrt(2.0 * records), (phase, name)


def noisy_records(record, load_cell, count):
    return [load_cell.measure(record, rng=seed) for seed in range(count)]


def in_contact(record):
    return record.isel(sample=np.flatnonzero(np.abs(record.holding_moment.values) > 0.3))


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["white", "correlated", "encoder", "encoder, turning", "friction"])
def test_the_misfit_is_chi_square_clear_of_the_edge(scenes, sensor):
    """Kolmogorov and Smirnov's test at one in ten thousand, at a thirtieth of ordinary noise."""
    name, load_cell = SENSORS[sensor]
    record, friction = scenes[name]
    contacts = [
        reconstruct(measured, method="constrained", rig=Rig(unknown={"friction": friction}))
        for measured in noisy_records(in_contact(record), load_cell, 20)
    ]
    misfit, distance = (np.concatenate([c[name].values for c in contacts]) for name in ("misfit", "edge_distance"))
    assert np.count_nonzero(distance > 3.0) > 800
    assert kstest(misfit[distance > 3.0], "chi2", (1,)).pvalue > 1e-4


@pytest.mark.slow
def test_the_probability_of_the_misfit_is_uniform_where_the_model_holds(swept):
    """At ordinary noise, of 100 records; at one in ten thousand."""
    ideal = in_contact(swept).isel(sample=slice(None, None, 3))
    attrs = [reconstruct(m, method="constrained").attrs for m in noisy_records(ideal, CELL, 100)]
    assert kstest([a["misfit_probability"] for a in attrs], "uniform").pvalue > 1e-4


def test_the_attributes_sum_up_the_misfits(swept):
    contacts = reconstruct(CELL.measure(swept, rng=1), method="constrained")
    clear = contacts.edge_distance.values > 3.0
    assert contacts.attrs["misfit_samples"] == clear.sum()
    assert contacts.attrs["misfit_sum"] == pytest.approx(contacts.misfit.values[clear].sum(), rel=1e-12)
    shared = LoadCell(force_noise=0.05, moment_noise=0.02, bias_uncertainty=(0.01, 0.0, 0.0))
    contacts = reconstruct(shared.measure(swept, rng=1), method="constrained")
    assert np.isnan(contacts.attrs["misfit_probability"])
    raw = reconstruct(CELL.measure(swept, rng=1))
    assert not {"misfit", "edge_distance"} & set(raw.data_vars)
    assert "misfit_sum" not in raw.attrs


WRONG = {
    "friction that is ignored": (paper_profile("II", q=0.3), Rig(unknown={"friction": 0.3}), Rig()),
    "a rod that is stiffer than stated": (Parabola(1.5, 0.06), Rig(rod=WIRE), Rig(rod=SOFT)),
    "a rod that is curved": (Parabola(0.5, 0.5), Rig(rod=Rod(rest_curvature=0.4)), Rig(rod=Rod())),
}


@pytest.mark.parametrize(("contour", "true", "stated"), WRONG.values(), ids=WRONG)
def test_the_misfit_tells_of_a_rig_that_is_not_as_stated(contour, true, stated):
    rod = true.rod or Rod()
    record = scan(contour, rig=true, drive_step=0.05).record
    load_cell = LoadCell(force_noise=0.05 * rod.force_unit, moment_noise=0.02 * rod.moment_unit)
    measured = load_cell.measure(record, rng=1)
    assert reconstruct(measured, method="constrained", rig=stated).attrs["misfit_probability"] < 1e-12
    assert 1e-4 < reconstruct(measured, method="constrained", rig=true).attrs["misfit_probability"] < 1.0 - 1e-4


@METHODS
def test_samples_that_are_cut_off_or_unloaded_have_no_contact(swept, method):
    """A channel at the end of its range is cut off."""
    limit = 0.6 * float(np.abs(swept.force_y).max())
    load_cell = LoadCell(force_noise=0.05, moment_noise=0.02, force_range=limit)
    measured = load_cell.measure(swept, rng=1)
    over = np.abs(measured.force_y.values) >= limit * (1.0 - 1e-12)
    contacts = reconstruct(measured, method=method)
    assert 3 < over.sum() < 40
    assert (contacts.status.values[over] == "cut off").all()
    assert not (contacts.status.values[~over] == "cut off").any()
    assert (contacts.contact_phase.values[over] == "none").all()
    none = contacts.status.values == "no contact"
    assert none[swept.truth_contact_phase.values == "none"].mean() > 0.95
    for name in NUMBERS:
        assert np.isnan(contacts[name].values[over | none]).all()


def lone(moment, force_x, force_y, angle=1.2):
    columns = {"sweep": 0, "direction": "forward", "drive_angle": [angle], "holding_moment": [moment]}
    return make_record({**columns, "force_x": [force_x], "force_y": [force_y]})


@METHODS
def test_a_weak_load_is_nonlinear(method):
    """Twice the noise of the forces, and of the moment."""
    weak = reconstruct(lone(0.04, 0.0, 0.1), method=method, rig=Rig(load_cell=CELL))
    assert weak.status.item() in ("no contact", "nonlinear")
    exact = LoadCell(force_noise=5e-3, moment_noise=2e-3)
    strong = reconstruct(lone(0.4, 0.0, 1.0), method=method, rig=Rig(load_cell=exact))
    assert strong.status.item() == ("ok" if method == "raw" else "does not fit")  # the four numbers are arbitrary


@pytest.mark.slow
def test_samples_near_the_edge_are_at_the_edge(swept):
    """About the change from tip to tangential contact, and nowhere else."""
    record = in_contact(swept)
    words = np.stack([reconstruct(m, method="constrained").status.values for m in noisy_records(record, CELL, 20)])
    share = (words == "between phases").mean(axis=0)
    assert share.max() > 0.5
    ideal = reconstruct(record, method="constrained", rig=Rig(load_cell=CELL))
    assert (share[ideal.edge_distance.values > 6.0] == 0.0).all()
    assert (share > 0.0).sum() < 0.3 * share.size


def test_without_a_noise_level_there_are_no_standard_deviations(swept):
    contacts = reconstruct(swept)
    for name in (*SPREADS, "contact_xy_correlation"):
        assert np.isnan(contacts[name].values).all()
    assert set(contacts.status.values) == {"ok", "no contact"}


NOISELESS = ["LoadCell(force_noise=..., moment_noise=...)"]
WITHOUT_VARIANCE = ["method='raw'", "degrees of freedom"]


@pytest.mark.parametrize(
    ("load_cell", "named"),
    [
        (None, NOISELESS),
        (LoadCell(force_noise=0.05), NOISELESS),
        (LoadCell(moment_noise=0.02), NOISELESS),
        (replace(CELL, degrees_of_freedom=2.0), WITHOUT_VARIANCE),
    ],
)
def test_the_constrained_method_needs_the_variance_of_every_channel(swept, load_cell, named):
    with refused(ParameterError, *named):
        reconstruct(swept, method="constrained", rig=Rig(load_cell=load_cell))


# Relative agreement of the same sample told in other words: a search ends where its next gain is below 1e-12.
SETTLED = {"raw": 1e-9, "constrained": 1e-6}


def assert_same(one, other, tolerance=1e-9, signs=None):
    np.testing.assert_array_equal(one.status.values, other.status.values)
    np.testing.assert_array_equal(one.contact_phase.values, other.contact_phase.values)
    for name in [*NUMBERS, *(n for n in ("misfit", "edge_distance") if n in one)]:
        expected = (signs or {}).get(name, 1.0) * other[name]
        np.testing.assert_allclose(one[name], expected, rtol=tolerance, atol=tolerance, err_msg=name)


@METHODS
@pytest.mark.parametrize("frame", ["fixed", "turning"])
def test_a_mirrored_record_has_mirrored_contacts(method, frame):
    record = scan(paper_profile("II", q=0.5), direction="forward", drive_step=0.05).record
    load_cell = replace(CELL, drive_angle_noise=0.003, correlation=(0.5, -0.3, 0.2))
    measured = load_cell.measure(in_frame(record, frame), rng=1)
    # Seen in the turning frame, what points along the rod is mirrored onto itself, and what points across it is not.
    m, x, y = signs = (-1.0, -1.0, 1.0) if frame == "fixed" else (-1.0, 1.0, -1.0)
    table = {
        "sweep": measured.sweep.values,
        "direction": "backward",
        "drive_angle": np.pi - measured.drive_angle.values,
    }
    table |= {name: sign * measured[name].values for name, sign in zip(CHANNELS, signs, strict=True)}
    other = make_record(table, attrs={"load_cell_frame": frame})
    mirrored = replace(load_cell, correlation=(0.5 * m * x, -0.3 * m * y, 0.2 * x * y))
    forward = reconstruct(measured, method=method)
    backward = reconstruct(other, method=method, rig=Rig(load_cell=mirrored))
    turned = dict.fromkeys(("contact_x", "slope_angle", "contact_xy_correlation"), -1.0)
    assert_same(backward, forward, SETTLED[method], signs=turned)


@METHODS
def test_the_order_of_samples_does_not_matter_for_white_noise(swept, method):
    measured = CELL.measure(swept.assign(sweep=swept.sweep), rng=1)
    order = np.random.default_rng(1).permutation(measured.sizes["sample"])
    shuffled = reconstruct(measured.isel(sample=order), method=method)
    assert_same(shuffled, reconstruct(measured, method=method).isel(sample=order))


@METHODS
@pytest.mark.parametrize("bad", [(5.0, 0.0, 1.0), (30.0, 30.0, 30.0)])
def test_one_bad_sample_leaves_the_others_as_they_are(swept, method, bad):
    measured = CELL.measure(swept, rng=1)
    place = pick(swept, "tip")
    spoiled = measured.copy(deep=True)
    for name, value in zip(CHANNELS, bad, strict=True):
        # The side of contact is that of the whole sweep: it is not to change.
        spoiled[name].values[place] = abs(value) if name == "holding_moment" else value
    contacts = reconstruct(spoiled, method=method)
    good = reconstruct(measured, method=method)
    assert_same(contacts.drop_isel(sample=place), good.drop_isel(sample=place), 1e-12)

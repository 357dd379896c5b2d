"""What is not as stated about a rig: its loads against scans, what it costs in precision, and what is refused."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from helpers.contour_posteriors import CELL, DEVIATIONS, TRUTH, only
from helpers.refusals import refused
from tactile_bayes import LoadCell, Rig, Rod, SamplerSettings, Translation, infer_contour, make_record, scan
from tactile_bayes.contours import Circle, Parabola, paper_profile
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.parameters.unknowns import RigValues
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood
from tactile_bayes.record import CHANNELS, loads_of
from tactile_bayes.record.attributes import same_rod
from tactile_bayes.rig.parameters import GROUPS
from tactile_bayes.rig.stated import rod_with

SI = Rod(length=0.1, flexural_rigidity=2e-4, diameter=0.002)


def model_of(measured, unknowns, cell=CELL, exact=True):
    model = Experiment(measured, Rig(load_cell=cell, unknown=only(*unknowns))).model
    model.likelihood.exact = exact
    return model


def priors_of(measured, *names, cell=None):
    """Those of a rig of which nothing else is unknown; without names, of a real one."""
    return Experiment(measured, Rig(load_cell=cell, unknown=only(*names) if names else {})).priors


@pytest.mark.parametrize(
    ("unknowns", "channels", "expected"),
    [
        ([], CHANNELS, (0.0013, 0.00015, 0.0005)),
        (["rigidity_scale"], CHANNELS, (None, 0.0005, None)),
        (
            ["rigidity_scale", "drive_angle_offset", "bias", "friction", "suspension_compliance"],
            CHANNELS,
            (0.0020, 0.0008, 0.0017),
        ),
        ([], ("holding_moment",), (0.0022, 0.0003, 0.0009)),
        (["rigidity_scale"], ("holding_moment",), (0.0056, 0.0051, None)),
    ],
    ids=["none", "EI", "seven", "moment only", "moment only, EI"],
)
def test_what_unknowns_cost_is_what_was_found_independently(unknowns, channels, expected):
    """Standard deviations of a, q and x_c, of profile II in a double sweep at 2°, by Fisher information. Within a
    quarter, since they were quoted to a digit, with a step at events and priors that are not told."""
    measured = scan(paper_profile("II", q=0.5), drive_step=np.radians(2.0)).record
    measured = measured.assign({c: np.nan * measured[c] for c in CHANNELS if c not in channels})
    model = model_of(measured, unknowns)
    names = model.forward_parameters
    point = np.array([TRUTH.get(name, float(name == "rigidity_scale")) for name in names])
    kinked = np.isin(names, ("friction", "suspension_compliance"))  # no less than zero, of half-normal priors
    back = np.where(kinked, 0.0, 1.0)
    steps = 1e-5 * np.eye(point.size)
    ahead, behind = model.loads(point + steps), model.loads(point - back[:, None] * steps)
    slopes = (ahead - behind) / (1e-5 * (1.0 + back))[:, None, None] / DEVIATIONS
    # A sample that one of the two has lost at an event says nothing about how loads change.
    events = np.abs(ahead - behind).max(axis=(0, 2)) > 1e-3
    slopes = slopes[:, ~events][..., model.present].reshape(point.size, -1)
    information = slopes @ slopes.T
    for i in range(len(TRUTH), len(names)):
        prior = model.priors[names[i]]
        information[i, i] += 1.0 / (prior.kwds["scale"] if kinked[i] else prior.std()) ** 2
    deviations = np.sqrt(np.diag(np.linalg.inv(information)))
    for found, quoted in zip(deviations[:3], expected, strict=True):
        if quoted is not None:
            assert found == pytest.approx(quoted, rel=0.25)


FEW = SamplerSettings(ensembles=2, walkers=26, block_steps=10, max_steps=10)  # enough for names and units


def scanned(degrees=5.0, rod=None, **options):
    return scan(Parabola(0.5, 0.5), Rig(rod=rod), drive_step=np.radians(degrees), **options).record


@cache
def coarse():
    """One that is not to be changed."""
    return scanned()


def stack(count=1):
    """So many contours, all of them the true one."""
    return Parabola(*(np.full(count, value) for value in TRUTH.values()))


@pytest.mark.parametrize("frame", ["fixed", "turning"])
@pytest.mark.parametrize("exact", [False, True])
def test_a_lever_an_offset_and_a_backlash_may_be_known_or_inferred_or_both(exact, frame):
    """The readings of a cell without noise are expected, and the likelihood is the same whoever knows of them."""
    flaws = {"lever_x": 0.03, "lever_y": -0.02, "drive_angle_offset": 0.01, "backlash": 0.02}

    def cell_with(share, **noise):
        x, y, offset, backlash = (share * value for value in flaws.values())
        gain = ((1.1, 0.0, 0.02), (0.0, 1.0, 0.0), (0.0, 0.0, 0.9))
        return LoadCell(**noise, gain=gain, lever=(x, y), drive_angle_offset=offset, drive_angle_backlash=backlash)

    record = replace(cell_with(1.0), frame=frame).measure(scanned(), rng=1)
    values = []
    for known in (0.0, 0.3, 1.0):
        cell = cell_with(known, force_noise=0.05, moment_noise=0.02)
        model = model_of(record, ["lever", "drive_angle_offset", "backlash", "moment_gain"], cell, exact)
        point = TRUTH | {name: (1.0 - known) * value for name, value in flaws.items()}
        points = np.array(
            [[{**point, "moment_gain": factor}[name] for name in model.forward_parameters] for factor in (1.0, 1.02)]
        )
        read = model.likelihood.load_cell.expected(model.loads(points[:1]))[0]
        off = np.abs(read - model.likelihood.measured).max(axis=1)
        assert np.sort(off)[-3] < 3e-4 * np.abs(read).max()  # a sample just at snap-off may fall on its other side
        values.append(model.likelihood.score(*model.loads_and_discrepancy(points)[:2], pointwise=True))
    np.testing.assert_allclose(values[1:], [values[0]] * 2, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("frame", ["fixed", "turning"])
def test_of_a_mirrored_rig_the_lever_is_mirrored_and_the_backlash_is_the_same(frame):
    cell = replace(CELL, lever=(0.03, -0.02), drive_angle_backlash=0.02, drive_angle_offset=0.01)
    measured = replace(cell, frame=frame).measure(scan(Parabola(0.5, 0.5, 0.1), drive_step=0.1).record, rng=1)
    along = 1.0 if frame == "turning" else -1.0
    mirrored = measured.assign(
        holding_moment=-measured.holding_moment,
        force_x=along * measured.force_x,
        force_y=-along * measured.force_y,
        drive_angle=np.pi - measured.drive_angle,
        direction=xr.where(measured.direction == "forward", "backward", "forward"),
    )
    x, y = cell.lever
    swapped = replace(cell, lever=(x, -y) if frame == "turning" else (-x, y), drive_angle_offset=-0.01)
    contours = [Parabola(np.array([0.5, 0.52]), np.full(2, 0.5), np.array([x_c, x_c])) for x_c in (0.1, -0.1)]
    found = [
        RecordLikelihood(record, sheet).log_likelihood(contour, pointwise=True)
        for record, sheet, contour in zip((measured, mirrored), (cell, swapped), contours, strict=True)
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("exact", [False, True])
def test_backlash_goes_by_the_way_that_the_drive_moves_and_not_by_the_side_of_contact(exact):
    """A drive that turns back in contact comes back on the same states, and reads less."""
    out = scan(Parabola(0.5, 0.5), direction="forward").record.isel(sample=slice(0, 100))
    columns = {name: np.concatenate([out[name], out[name][::-1]]) for name in (*CHANNELS, "drive_angle")}
    columns |= {"sweep": np.repeat([0, 1], 100), "direction": np.repeat(["forward", "backward"], 100)}
    true = make_record(columns)
    read = LoadCell(drive_angle_backlash=0.02).measure(true, rng=1)
    loads = loads_of(true)
    largest = np.abs(loads).max()
    told, untold = (RecordLikelihood(read, replace(CELL, drive_angle_backlash=b), exact=exact) for b in (0.02, 0.0))
    for likelihood, rig in ((told, None), (untold, RigValues(drive_angle_backlash=0.02))):
        predicted, _ = likelihood.predict(stack(), rig)
        np.testing.assert_allclose(predicted[0], loads, rtol=0.0, atol=2e-4 * largest)
    assert np.abs(untold.predict(stack())[0][0] - loads).max() > 1e-2 * largest


def test_snap_offs_are_where_they_are_read_whatever_the_encoder_reads_too_much():
    record = LoadCell(drive_angle_offset=0.01, drive_angle_backlash=0.1).measure(scanned(2.0), rng=1)
    likelihood = RecordLikelihood(record, CELL)
    between = likelihood.segments.event_angles((record.force_y != 0.0).values)[:, 2:]
    off = RigValues(drive_angle_offset=0.01, drive_angle_backlash=0.1)
    rigs = (off, RigValues(drive_angle_offset=0.01))
    found, without = (likelihood.predict_with_events(stack(), rig)[2][0, :, 1] for rig in rigs)
    assert np.all((between[:, 0] < found) & (found < between[:, 1]))
    assert not np.any((between[:, 0] < without) & (without < between[:, 1]))


@pytest.mark.parametrize("exact", [False, True])
def test_a_pivot_may_be_off_where_the_record_has_it(exact):
    bases = [(0.0, 0.0), (0.25, 0.0), (-0.2, 0.05)]
    off = np.array([[0.0, 0.0], [0.01, -0.004], [0.0, 0.02]])
    true = scanned(2.0, base=[tuple(base) for base in np.array(bases) + off])
    stated = true.assign({name: true[name].copy() for name in ("base_x", "base_y")})
    for k, base in enumerate(bases):
        at = (true.base_x == base[0] + off[k, 0]).values
        stated.base_x[at], stated.base_y[at] = base
    likelihood = RecordLikelihood(stated, CELL, exact=exact)
    loads, usable = likelihood.predict(stack(2), RigValues(base_shifts=np.stack([off, np.zeros_like(off)])))
    assert usable.all()
    measured = loads_of(true)
    largest = np.abs(measured).max()
    assert np.sort(np.abs(loads[0] - measured).max(axis=1))[-6] < 2e-4 * largest  # one of six may be past an event
    of_first = (stated.base_x == 0.0).values
    assert np.median(np.abs(loads[1] - measured)[~of_first]) > 1e-3
    np.testing.assert_array_equal(loads[0, of_first], loads[1, of_first])


def test_pivots_are_named_from_the_second_on():
    record = scanned(base=[(0.0, 0.0), (0.25, 0.0), (-0.25, 0.0)])

    def named(*unknowns):
        return [name for name in priors_of(record, *unknowns) if name.startswith("base")]

    assert named("base") == ["base_2_x", "base_2_y", "base_3_x", "base_3_y"]
    assert named("base_y") == ["base_2_y", "base_3_y"]
    assert named("base_3_x", "base_x") == ["base_2_x", "base_3_x"]
    assert named("base_4_x") == []


@pytest.mark.parametrize("exact", [False, True])
def test_a_compliant_suspension_turns_with_the_moment(exact):
    """States are the same, but the drive stands elsewhere, until it stands farthest."""
    record, compliance = scan(Parabola(0.5, 0.5), drive_step=np.radians(0.5)).record, 0.02
    driven = record.drive_angle + compliance * record.holding_moment
    likelihood = RecordLikelihood(record.assign(drive_angle=driven), CELL, exact=exact)
    loads, usable = likelihood.predict(stack(), RigValues(suspension_compliance=compliance))
    assert usable.all()
    loaded = (record.holding_moment != 0.0).values
    true = loads_of(record)
    for direction, sense in (("forward", 1.0), ("backward", -1.0)):
        on_way = np.flatnonzero(loaded & (record.direction == direction).values)
        farthest = np.argmax(sense * driven.values[on_way])
        before, after = on_way[: farthest - 1], on_way[farthest + 1 :]
        assert before.size > 50
        np.testing.assert_allclose(loads[0, before], true[before], rtol=0.0, atol=2e-3 * np.abs(true).max())
        assert np.median(np.abs(loads[0, before] - true[before])) < 1e-4
        # Beyond, the states go with drive angles that were passed before, or are not on the path.
        assert np.all(np.abs(loads[0, after] - true[after]).max(axis=1) > 1e-3)


STRAIGHT, TRACED = Rod(0.1, 1e-5), Rod(0.1, 1e-5, rest_curvature=lambda s: 30.0 * s)
# Rods as they are stated, and numbers of the true ones.
SHAPED = {
    "taper": (STRAIGHT, {"taper": 0.07, "rest_curvature": 1.0}),
    "taper of an arc": (Rod(0.1, 1e-5, rest_curvature=3.0), {"taper": 0.07, "rest_curvature": 4.0}),
    "taper of a cone": (Rod(0.1, 1e-5, taper=0.4), {"taper": 0.47, "rest_curvature": 1.0}),
    "stem": (STRAIGHT, {"friction": 0.1, "stem": 0.003}),
    "stem of a traced rod": (replace(TRACED, stem=0.005), {"friction": 0.1, "stem": 0.008}),
    "length": (replace(STRAIGHT, stem=0.002), {"length": 0.102}),
    "length of a traced rod": (replace(TRACED, stem=0.002), {"length": 0.102}),
    "length and rest curvature": (replace(TRACED, stem=0.002), {"length": 0.102, "rest_curvature": 2.0}),
}


@pytest.mark.parametrize(("stated", "values"), SHAPED.values(), ids=SHAPED)
def test_the_rod_is_inferred_about_the_stated_one(stated, values):
    """In loads of scans; in another length alone a rod keeps its turn from base to tip."""
    cell, contour = LoadCell(force_noise=5e-5, moment_noise=2e-6), Parabola(5.0, 0.06)
    angles = np.linspace(0.3, 2.8, 59)
    record = cell.measure(scan(contour, rig=Rig(rod=stated), drive_angles=angles).record, rng=1)
    kept_turn = stated.mean_rest_curvature * stated.length / values.get("length", stated.length)
    true = stated.reshaped(
        values.get("rest_curvature", kept_turn),
        values.get("taper", stated.taper),
        values.get("stem", stated.stem),
        values.get("length"),
    )
    assert same_rod(rod_with(stated, {name: value for name, value in values.items() if name != "friction"}), true)
    rig = Rig(rod=true, unknown={"friction": values.get("friction", 0.0)})
    expected = scan(contour, rig=rig, drive_angles=angles).record
    model = model_of(record, list(values), cell)
    assert model.forward_parameters[3:] == tuple(values)
    if "length" in values:
        assert (model.priors["length"].mean(), model.priors["length"].std()) == pytest.approx((0.1, 0.001))
    found = model.loads(np.array([[5.0, 0.06, 0.0, *values.values()]]))[0]
    places, given = (list(zip(r.sweep.values, r.drive_angle.values, strict=True)) for r in (record, expected))
    kept = np.array([place in given for place in places])  # without those at which friction would hold the rod
    assert kept.mean() > 0.95
    loads = loads_of(expected) / stated.load_units
    np.testing.assert_allclose(found[kept], loads, atol=1e-6 * np.abs(loads).max())


@pytest.mark.parametrize(
    ("name", "rod", "step", "end"),
    [
        ("taper", Rod(), 0.05, 0.95),
        ("taper", Rod(taper=0.4), 0.05, 0.95),
        ("stem", Rod(), 0.02, np.inf),
        ("stem", Rod(stem=0.05), 0.02, np.inf),
    ],
)
def test_priors_of_tapers_and_stems_lie_about_the_stated_one_and_end_where_these_do(name, rod, step, end):
    model = model_of(scanned(rod=rod), [name])
    prior, stated = model.priors[name], getattr(rod, name)
    assert prior.support() == (pytest.approx(0.0, abs=1e-12), pytest.approx(end))
    assert prior.logpdf(stated) - prior.logpdf(stated + step) == pytest.approx(0.5)
    assert model.may_vanish[model.names.index(name)]


@pytest.mark.parametrize("rod", [Rod(), SI], ids=["dimensionless", "SI"])
def test_gains_biases_drifts_and_rigidity_change_what_is_sensed_as_they_say(rod):
    names = ["rigidity_scale", "moment_gain", "moment_curve", "force_y_gain", "lever", "bias", "force_y_drift"]
    length = rod.length
    gain = ((1.02, 0.0, 0.003 * length), (0.0, 0.97, 0.01), (0.0, 0.0, 1.0))
    noise = {"force_noise": 0.05 * rod.force_unit, "moment_noise": 0.02 * rod.moment_unit}
    cell = LoadCell(**noise, gain=gain, lever=(0.01 * length, 0.02 * length))
    record = scan(Parabola(0.5 / length, 0.5 * length), rig=Rig(rod=rod), drive_step=0.1).record
    model = model_of(record, names, cell)
    units = rod.load_units
    values = {"rigidity_scale": 1.1, "moment_gain": 0.9, "force_y_gain": 1.2, "force_y_drift": 0.05 * rod.force_unit}
    values |= {"lever_x": 0.03 * length, "lever_y": -0.05 * length}
    values |= {"moment_curve_quadratic": 0.03 / rod.moment_unit, "moment_curve_cubic": -0.005 / rod.moment_unit**2}
    values |= dict(
        zip(("moment_bias", "force_x_bias", "force_y_bias"), np.array([0.01, -0.02, 0.03]) * units, strict=True)
    )
    point = np.array([[0.5 / length, 0.5 * length, 0.0, *(values[name] for name in model.unknowns.names)]])
    loads = model.loads(point)
    found = model.likelihood.load_cell.expected(loads)[0] * units
    plain, _ = model.likelihood.predict(model.contours(point))
    plain[0, :, 0] += -0.04 * plain[0, :, 2] - 0.03 * plain[0, :, 1]
    true = 1.1 * plain[0]
    assert np.abs(true[:, 0]).max() < 6.0  # where the cubic turns back
    true[:, 0] += 0.03 * true[:, 0] ** 2 - 0.005 * true[:, 0] ** 3
    true *= np.array([0.9, 1.0, 1.2]) * units
    expected = true @ np.array(gain).T + np.array([0.01, -0.02, 0.03]) * units
    expected[:, 2] += np.linspace(-0.5, 0.5, len(expected)) * 0.05 * rod.force_unit
    np.testing.assert_allclose(found / units, expected / units, rtol=0.0, atol=1e-12)


@pytest.mark.slow
def test_what_is_standard_is_inferred_and_has_units():
    unit = LoadCell(force_noise=0.05 * SI.force_unit, moment_noise=0.02 * SI.moment_unit)
    measured = unit.measure(scan(Parabola(5.0, 0.05), rig=Rig(rod=SI), drive_step=0.1).record, rng=1)
    result = infer_contour(measured, rig=Rig(load_cell=unit), rng=1, settings=FEW)
    units = {name: draws.attrs["units"] for name, draws in result["posterior"].data_vars.items()}
    expected = {"a": "1/m", "moment_bias": "N m", "force_x_bias": "N", "force_y_bias": "N"}
    expected |= dict.fromkeys(("q", "x_c", "lever_x", "lever_y"), "m")
    expected |= dict.fromkeys(("drive_angle_offset", "backlash"), "rad")
    assert units == expected | dict.fromkeys(("rigidity_scale", "friction", "noise_scale"), "1")
    assert result["prior"]["lever_y"].std() == pytest.approx(0.005 * SI.length, rel=0.1)
    assert result["prior"]["force_x_bias"].std() == pytest.approx(0.1 * SI.force_unit, rel=0.1)


MISSING = {"no moment": "holding_moment", "no force along x": "force_x"}


@pytest.mark.parametrize(
    ("of", "left_out"),
    [
        ("both directions", set()),
        ("forward", {"backlash"}),
        ("backward", {"backlash"}),
        ("no moment", {"lever_x", "lever_y", "moment_bias"}),
        ("no force along x", {"force_x_bias"}),
    ],
)
def test_what_a_record_cannot_tell_is_left_out(of, left_out):
    """Also where it is asked for, except for a backlash, which is then a shift of the encoder."""
    record = scanned(direction=of) if of.endswith("ward") else coarse()
    if of in MISSING:
        record = record.assign({MISSING[of]: np.nan * record[MISSING[of]]})
    every = {"backlash", *GROUPS["lever"], *GROUPS["bias"]}
    assert every - set(priors_of(record)) == left_out
    assert every - set(priors_of(record, *every)) == left_out - {"backlash"}
    own = {name: stats.norm(0.0, 0.01) for name in left_out}
    assert left_out.intersection(Experiment(record, Rig(unknown=only(**own))).priors) <= {"backlash"}


UNSURE = replace(CELL, bias_uncertainty=(0.01, 0.0, 0.0))


@pytest.mark.parametrize(
    ("cell", "unknown", "name", "is_inferred"),
    [
        (CELL, {}, "friction", True),
        (CELL, {"friction": 0.2}, "friction", False),
        (CELL, {"gain": "default"}, "rigidity_scale", False),  # all gains take the place of the stiffness
        (CELL, {"gain": "default", "moment_gain": 1.0}, "rigidity_scale", True),
        (UNSURE, {}, "moment_bias", False),  # it is integrated out
        (UNSURE, only("moment_bias"), "moment_bias", False),
        (UNSURE, {}, "force_x_bias", True),
    ],
)
def test_what_is_known_or_integrated_out_is_not_inferred(cell, unknown, name, is_inferred):
    experiment = Experiment(coarse(), Rig(load_cell=cell, unknown=unknown))
    assert (name in experiment.priors) == is_inferred
    assert experiment.about["friction"] == unknown.get("friction", 0.0)


def carried():
    """A record in which the rod keeps its direction, on a pivot that does not yield."""
    return scan(Circle(0.3, 0.7), drive=Translation((1.0, 0.0), np.pi, 1.3, 1.9)).record


@pytest.mark.parametrize(
    ("record", "unknown", "named"),
    [
        (carried, only("stem", "lever"), ("stem", "lever")),
        (coarse, {"rigidity_scale": "default", "gain": "default"}, ("rigidity_scale", "moment_gain")),
        (coarse, {"rigidity_scale": stats.lognorm(s=0.1), "gain": "default"}, ("rigidity_scale", "force_y_gain")),
        (coarse, only("base_1_y"), ("base_1_y", "first pivot")),
        (coarse, {"moment_bias": stats.norm(0.0, 0.1)}, ("moment_bias", "bias_uncertainty")),
    ],
)
def test_unknowns_that_nothing_tells_apart_are_refused(record, unknown, named):
    with refused(ParameterError, *named):
        Experiment(record(), Rig(load_cell=UNSURE, unknown=unknown)).priors  # noqa: B018


def test_a_stem_is_told_from_a_lever_where_the_rod_turns_or_yields():
    assert "stem" in priors_of(carried(), "stem", "lever", "suspension_compliance")
    assert "stem" in priors_of(carried(), "stem", "moment_bias")
    assert "stem" in priors_of(coarse(), "stem", "lever")


def test_zeros_and_noises_are_expected_in_the_unit_of_the_readings():
    """A cell that counts has zeros and noises of counts."""
    record = make_record(
        {"sweep": 0, "direction": "forward", "drive_angle": [1.0, 1.1, 1.2], "holding_moment": [0.0, 1.0, 2.0]},
        Rig(file={"missing": ("force_x", "force_y")}),
    )
    gain = ((-900.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    names = ["moment_bias", "moment_drift"]
    priors = priors_of(record, *names, cell=LoadCell(gain=gain))
    ideal = priors_of(record, *names, cell=LoadCell())
    for name in (*names, "moment_noise"):
        np.testing.assert_allclose(priors[name].interval(0.5), 900.0 * np.array(ideal[name].interval(0.5)))

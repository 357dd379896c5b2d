"""The likelihood of a whole record, against normal densities summed over exact states."""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from helpers.contour_posteriors import CELL, DEVIATIONS, swept, without
from tactile_bayes import LoadCell, Motion, Rig, Rod, Translation, scan
from tactile_bayes.calibration.calibrate import experiment_of
from tactile_bayes.calibration.simulation import simulate
from tactile_bayes.contours import Circle, Contour, Parabola, PowerLaw
from tactile_bayes.inference.parameters.unknowns import RigValues
from tactile_bayes.inference.record_likelihood.likelihood import RecordLikelihood, events_of
from tactile_bayes.mechanics.branches.readings import STATE_COLUMNS
from tactile_bayes.record import CHANNELS, in_frame, loads_of, rod_of
from tactile_bayes.record.units import with_rod

SHARE = {False: 3e-4, True: 1e-6}  # error of the interpolated loads over their largest value, at worst, in 150 contours
WIRE = Rod.circular(length=0.2, diameter=0.7e-3, youngs_modulus=206e9)
WIRE_CELL = LoadCell(force_noise=3e-3, moment_noise=0.25e-3)


def exact_loads(record, contour, friction=0.0):
    """What an ideal sensor on the record's rig would have felt under the contour, (samples, 3), from `scan`. NaN where
    friction would hold a rod that is curved toward the object at first, which `scan` leaves out."""
    out = np.full((record.sizes["sample"], 3), np.nan)
    for sweep in np.unique(record.sweep.values):
        rows = np.flatnonzero(record.sweep.values == sweep)
        direction = str(record.direction.values[rows[0]])
        base = float(record.base_x[rows[0]]), float(record.base_y[rows[0]])
        angles = record.drive_angle.values[rows]
        other = scan(
            contour,
            direction=direction,
            base=base,
            drive_angles=angles,
            rig=Rig(rod=rod_of(record), unknown={"friction": friction}),
        ).record
        given = np.isin(angles, other.drive_angle.values)
        assert given.all() or (friction and rod_of(record).rest_curvature and np.mean(given) > 0.9)
        np.testing.assert_array_equal(other.drive_angle.values, angles[given])
        out[rows[given]] = loads_of(other)
    return out


def stack(contours):
    family = type(contours[0])
    return family(*(np.array([getattr(c, name) for c in contours], dtype=float) for name in vars(contours[0])))


class Case(NamedTuple):
    """A true contour, another one, and the rig that reads the loads."""

    true: Contour
    other: Contour
    rod: Rod = Rod()
    cell: LoadCell = CELL
    bases: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    friction: float = 0.0


PARABOLAS = Parabola(0.5, 0.5), Parabola(0.503, 0.4995)
CIRCLES = Circle(0.4, 0.4, 0.1), Circle(0.41, 0.401, 0.1)
WIRES = Parabola(2.5, 0.1), Parabola(2.52, 0.0999, 0.0004)
BENT_WIRE = Rod.circular(length=0.2, diameter=0.7e-3, youngs_modulus=206e9, rest_curvature=1.5)
BENT_CONE = Rod(diameter=0.02, taper=0.3, rest_curvature=lambda s: 0.6 * s - 0.2)
RIGS = {
    "dimensionless": Case(Parabola(0.5, 0.5), Parabola(0.503, 0.4995, 0.002)),
    "far off": Case(Parabola(0.5, 0.5), Parabola(0.9, 0.35, -0.1)),
    "circle": Case(Circle(0.6, 0.4, 0.1), Circle(0.61, 0.401, 0.1)),
    "SI": Case(*WIRES, WIRE, WIRE_CELL),
    "diameter": Case(*PARABOLAS, Rod(diameter=0.02)),
    "pivots": Case(*PARABOLAS, bases=((0.2, 0.1), (-0.3, 0.0))),
    "friction": Case(*PARABOLAS, friction=0.3),
    "arc": Case(*CIRCLES, Rod(rest_curvature=0.6), friction=0.3),
    "tapered": Case(*CIRCLES, Rod(diameter=0.03, taper=0.5)),
    "curved by a function": Case(*PARABOLAS, BENT_CONE, friction=0.3),
    "arc in SI": Case(*WIRES, BENT_WIRE, WIRE_CELL),
}


@cache
def measured_by(rig):
    """A record of the first contour, in steps of 5°, that is not to be changed."""
    true, _, rod, cell, bases, friction = RIGS[rig]
    return cell.measure(swept(true, bases=bases, rod=rod, friction=friction, step=np.radians(5.0)), rng=3)


@cache
def exact_by(rig):
    """The loads of the first contour there."""
    return exact_loads(measured_by(rig), RIGS[rig].true, RIGS[rig].friction)


# Rigs of which the loads are compared in every run, and sums of densities on demand.
ALIKE = ("far off", "circle", "diameter")
SUMMED = [pytest.param(rig, marks=pytest.mark.slow) if rig in ALIKE else rig for rig in RIGS]


@pytest.mark.parametrize("rig", SUMMED)
def test_against_an_independent_sum(rig):
    """Loads off by e change a normal log-density by r e/σ² + e²/(2σ²) at most, r the residual."""
    true, other, rod, cell, _, friction = RIGS[rig]
    whole = measured_by(rig)
    exact = [exact_by(rig), exact_loads(whole, other, friction)]
    scale = np.array([1.0, 1.3])
    for missing in ((), ("force_x", "force_y"), ("holding_moment",)):
        measured = without(whole, *missing)
        values = loads_of(measured)
        present = ~np.isnan(values[0])
        deviation = np.array([cell.standard_deviations[name] for name in CHANNELS])[present]
        units = rod.load_units[present]
        for exactly in (False,) if missing else (False, True):
            likelihood = RecordLikelihood(measured, cell, friction, exactly)
            found = likelihood.log_likelihood(stack([true, other]), scale[:, None])
            pointwise = likelihood.log_likelihood(stack([true, other]), scale[:, None], pointwise=True)
            np.testing.assert_allclose(pointwise.sum(axis=1), found, rtol=1e-12)
            for k, loads in enumerate(exact):
                sigma = scale[k] * deviation
                densities = stats.norm.logpdf(values[:, present], loads[:, present], sigma).sum(axis=1)
                expected = densities + np.log(units).sum()  # densities of dimensionless loads
                error = SHARE[exactly] * np.nanmax(np.abs(loads[:, present]), axis=0)
                slack = (np.abs(values - loads)[:, present] * error + 0.5 * error**2) / sigma**2
                is_right = np.abs(pointwise[k] - expected) <= slack.sum(axis=1) + 1e-9
                assert np.all(is_right | np.isnan(expected))


@pytest.mark.parametrize("rod", ["arc", "curved by a function"])
def test_taper_and_rest_curvature_of_a_rig_are_those_of_the_rod_in_addition(rod):
    """A likelihood that takes them as stated has another table; both have errors as large as noise requires."""
    true, other, stated, cell, _, friction = RIGS[rod]
    contours = stack([true, other])
    changed = stated.reshaped(stated.mean_rest_curvature + 0.1, stated.taper + 0.1)
    record = cell.measure(swept(true, rod=changed, friction=friction, step=np.radians(5.0)), rng=3)
    rig = RigValues(taper=np.array([0.1, 0.1]), rest_curvature=0.1, friction=friction)
    for exact in (True, False):
        known = RecordLikelihood(record, cell, friction, exact)
        with_rig = RecordLikelihood(with_rod(record, stated), cell, friction, exact)
        found, expected = with_rig.log_likelihood(contours, rig=rig), known.log_likelihood(contours)
        np.testing.assert_allclose(found, expected, atol=1e-8 if exact else 0.05)
        assert with_rig.log_likelihood(contours).max() < expected.max() - 10.0


def by_table_and_exactly(record, contours, rig, **options):
    """Loads of contours that both find usable, and both likelihoods."""
    both = [RecordLikelihood(record, CELL, exact=exact, **options) for exact in (False, True)]
    (loads, usable), (exact, usable_exactly) = (each.predict(contours, rig) for each in both)
    np.testing.assert_array_equal(usable, usable_exactly)
    return loads[usable], exact[usable], *both


@pytest.mark.slow
def test_a_sensor_that_counts_has_the_accuracy_of_one_that_does_not():
    counting = LoadCell(moment_noise=3e3, gain=((1e6, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    record = scan(Parabola(0.7, 0.4), drive_step=0.05).record
    counted = record.assign(holding_moment=1e6 * record.holding_moment)
    one = Parabola(np.array([0.7]), np.array([0.4]))
    told, _ = RecordLikelihood(record, LoadCell(moment_noise=3e-3)).predict(one)
    np.testing.assert_array_equal(RecordLikelihood(counted, counting).predict(one)[0][..., 0], told[..., 0])


def test_carried_rods_that_rub_in_either_sense_are_as_without_a_table():
    """First contact decides in which sense friction acts: here both occur, on a bent rod with a stem."""
    rod = Rod(rest_curvature=lambda s: -3.4 / (1.0 + np.exp(-(s - 0.55) / 0.08)), stem=0.03)
    rng, count, senses = np.random.default_rng(5), 6, []
    bend, friction = rng.uniform(-0.1, 0.1, count), np.abs(rng.normal(0.2, 0.1, count))
    rig = RigValues(rest_curvature=bend, friction=friction, stem=rng.uniform(-0.02, 0.02, count))
    for drive in (Translation((0.11, 0.0), np.pi, 1.13, 1.1), Translation((0.3, -1.2), 2.05, 1.13, 1.1)):
        scanned = scan(Circle(0.29, 0.21), rig=Rig(rod=rod, unknown={"friction": 0.2}), drive=drive)
        measured = CELL.measure(scanned.record, rng=1)
        circles = Circle(*(0.003 * rng.normal(size=(3, count)) + np.array([[0.29], [0.21], [0.0]])))
        loads, exact, likelihood, _ = by_table_and_exactly(measured, circles, rig)
        assert len(loads) > 3
        np.testing.assert_allclose(loads, exact, atol=2e-4 * np.abs(exact).max())
        angles = likelihood.paths(circles, rig).events[..., 0, STATE_COLUMNS.index("friction_angle")]
        senses += np.sign(angles[likelihood.usable(circles, rig)]).tolist()
    assert set(senses) == {-1.0, 1.0}


@pytest.mark.slow
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_rods_that_stick_are_as_without_a_table(sign):
    """A tip that first slides outward sticks before it slides back: with the table of its rod in tip contact."""
    rod = Rod(rest_curvature=lambda s: sign * (0.9 + 0.8 * s))
    rng, count = np.random.default_rng(5), 40
    rig = RigValues(friction=rng.uniform(0.0, 0.5, count))
    measured = swept(Parabola(2.0, 0.8), rod=rod, step=np.radians(2.0))
    contours = Parabola(*(rng.normal(size=(3, count)) * [[0.1], [0.02], [0.02]] + [[2.0], [0.8], [0.0]]))
    loads, exact, _, exactly = by_table_and_exactly(measured, contours, rig, rubs=True)
    assert len(loads) > 30
    np.testing.assert_allclose(loads, exact, atol=2e-4 * np.abs(exact).max())
    assert sum(any(mode.sticks for mode in modes) for modes in exactly.paths(contours, rig).modes()) > 10


def test_rods_curved_toward_a_flat_object_touch_it_twice_with_a_table_too():
    """Whether they do may differ for a few contours that are nearly as curved as the rod."""
    rng, rod = np.random.default_rng(3), Rod(taper=0.3, rest_curvature=lambda s: 0.6 * s - 0.2)
    record = swept(Parabola(0.5, 0.5), rod=rod, step=np.radians(10.0))
    flat = PowerLaw(*rng.uniform([0.3, 2.5, 0.2, -0.2], [2.0, 4.0, 0.8, 0.2], (100, 4)).T)
    usable = [RecordLikelihood(record, CELL, exact=exact).usable(flat) for exact in (False, True)]
    assert 20 < np.count_nonzero(usable[1]) < 80
    assert np.count_nonzero(usable[0] != usable[1]) <= 1


@pytest.mark.parametrize("rig", RIGS)
def test_predictions_are_in_the_frame_of_the_record(rig):
    true, _, rod, cell, _, friction = RIGS[rig]
    measured = measured_by(rig)
    likelihood = RecordLikelihood(in_frame(measured, "turning"), cell, friction, True)
    predicted, _ = likelihood.predict(stack([true]))
    angle = measured.drive_angle.values
    moment, x, y = (exact_by(rig) / rod.load_units).T
    exact = np.stack([moment, x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)], axis=-1)
    largest = np.abs([moment, x, y]).max(axis=1)
    error = SHARE[True] * np.array([largest[0], *[np.sum(largest[1:])] * 2])
    assert np.all(np.abs(predicted[0] - exact) <= error)
    np.testing.assert_array_equal(likelihood.measured[:, 0], measured.holding_moment.values / rod.moment_unit)


@pytest.mark.parametrize(
    "missing", [(), ("force_x", "force_y"), ("force_x",), ("force_y",), ("holding_moment", "force_y")]
)
def test_channels_may_be_missing_where_the_load_cell_turns(missing):
    """A single force is compared along its own axis, which the record alone could not be turned out of."""
    measured, contours = measured_by("dimensionless"), stack(RIGS["dimensionless"][:2])
    turning = without(in_frame(measured, "turning"), *missing)
    likelihood = RecordLikelihood(turning, CELL)
    whole, _ = RecordLikelihood(in_frame(measured, "turning"), CELL).predict(contours)
    present = [k for k, name in enumerate(CHANNELS) if name not in missing]
    densities = stats.norm.logpdf(
        np.stack([turning[CHANNELS[k]].values for k in present], axis=-1), whole[..., present], DEVIATIONS[present]
    )
    np.testing.assert_allclose(likelihood.log_likelihood(contours), densities.sum(axis=(1, 2)), rtol=1e-11)
    if missing == ("force_x", "force_y"):
        fixed = RecordLikelihood(without(measured, *missing), CELL)
        np.testing.assert_array_equal(likelihood.log_likelihood(contours), fixed.log_likelihood(contours))


def test_a_contour_out_of_reach_of_any_pivot_is_impossible():
    record = swept(Parabola(0.5, 0.5), bases=((0.0, 0.0), (0.3, 0.1)))
    likelihood = RecordLikelihood(record, CELL)
    contours = [
        Parabola(0.5, 0.5),
        Parabola(0.5, 1.02),  # within reach of the second pivot only
        Parabola(0.5, 1.3),
        Parabola(0.5, -0.1),
        Parabola(2.0, 0.05, 0.3),  # cuts the second pivot
    ]
    found = likelihood.log_likelihood(stack(contours))
    assert np.isfinite(found).tolist() == [True, False, False, False, False]
    assert np.all(np.isneginf(found[1:]))
    assert np.all(np.isneginf(likelihood.log_likelihood(stack(contours), pointwise=True)[1:]))


def test_order_of_sweeps_and_their_number_do_not_matter():
    measured = CELL.measure(swept(Parabola(0.5, 0.5), bases=((0.0, 0.0), (0.2, 0.1))), rng=3)
    contours = stack([Parabola(0.5, 0.5), Parabola(0.505, 0.5)])
    expected = RecordLikelihood(measured, CELL).log_likelihood(contours)
    mixed = measured.isel(sample=np.random.default_rng(1).permutation(measured.sizes["sample"]).argsort(kind="stable"))
    mixed = mixed.sortby("sweep", ascending=False)
    pointwise = RecordLikelihood(mixed, CELL).log_likelihood(contours, pointwise=True)
    np.testing.assert_allclose(pointwise.sum(axis=1), expected, rtol=1e-12)
    again = measured.copy()
    again["sweep"] = again.sweep + 4
    twice = xr.concat([measured, again], "sample", combine_attrs="override")
    # Of more samples, each is interpolated with a smaller error.
    np.testing.assert_allclose(RecordLikelihood(twice, CELL).log_likelihood(contours), 2.0 * expected, atol=1e-3)


@pytest.mark.parametrize("missing", [(), ("force_x", "force_y")])
def test_a_moment_that_is_counted_the_other_way_round_turns_no_side(missing):
    """The side of contact follows the moment's sign, once the cell's known gain and bias are taken out of it."""
    turned = replace(CELL, gain=((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), bias=(30.0, 0.0, 0.0))
    record = scan(Parabola(0.5, 0.5), drive_step=np.radians(3.0)).record
    values = []
    for cell in (CELL, turned):
        measured = without(cell.measure(record, rng=1), *missing)
        values.append(RecordLikelihood(measured, cell).log_likelihood(stack([Parabola(0.5, 0.5)]))[0])
    # Not one number: the noise on the moment has the other sign.
    assert values[0] == pytest.approx(values[1], abs=4.0 * np.sqrt(2.0 * record.sizes["sample"]))


def exact_sensed(model, point):
    """What the cell senses of one point, (1, samples, 3), from states at the drive angles to rounding."""
    likelihood, rig = model.likelihood, model.rig(point)
    paths = likelihood.paths(model.contours(point), rig)
    segment = likelihood.segments.of_sample
    signs = likelihood.segments.signs[segment]
    found = paths.states(segment, likelihood.segments.angles_in_sweep_frame - signs * likelihood.misread(rig)[0]).wrench
    loads = np.stack([signs * found.holding_moment, signs * found.force_x, found.force_y], axis=-1)
    scaled = np.atleast_1d(rig.rigidity_scale)[:, None, None] * np.nan_to_num(loads)[None]
    return model.unknowns.sensed(scaled, model.values(point), likelihood.load_cell)


def off_at_the_truth(noise, family, numbers):
    """By how much log-likelihoods of records from the default prior differ from exact ones."""
    cell = LoadCell(force_noise=0.05 * noise, moment_noise=0.02 * noise)
    experiment = experiment_of(family, Rig(load_cell=cell, unknown={"friction": 0.0}), rng=1)
    off = []
    for number in numbers:
        simulation = simulate(experiment, np.random.default_rng([9, number]))
        model = experiment.problem_of(simulation.measured).model
        point = np.array([[simulation.truth[name] for name in model.names]])
        reached = np.ones(1, dtype=bool)
        scale = model.noise_scale(point)
        exact = model.likelihood.score(exact_sensed(model, point)[:, None], reached, scale)
        off.append(float((model.likelihood.score(model.loads(point)[:, None], reached, scale) - exact)[0]))
    return np.abs(off)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [1.0, 0.1, 0.01])
@pytest.mark.parametrize(("family", "count"), [("parabola", 1000), ("power-law", 300), ("ellipse", 300)])
def test_interpolation_is_not_felt_at_the_truth(noise, family, count):
    """Log-likelihoods of default-prior records, near pivots too, are within 0.05 of the exact ones."""
    assert off_at_the_truth(noise, family, range(count)).max() < 0.05


def test_interpolation_is_not_felt_where_the_tip_touches_for_a_millionth_of_the_path():
    assert off_at_the_truth(0.01, "parabola", [610]).max() < 0.05


# Rods, friction coefficients, and whether taper, rest curvature and friction vary from one contour to the next.
VARIED = {
    "taper of a half": (Rod(taper=0.5), 0.3, False),
    "taper of nine tenths": (Rod(taper=0.9), 0.0, False),
    "curved by a function": (Rod(rest_curvature=lambda s: 0.6 * s), 0.0, False),
    "curved by a function, with friction": (Rod(rest_curvature=lambda s: 0.6 * s - 0.3), 0.3, False),
    "tapered arc": (Rod(rest_curvature=-0.4, taper=0.4), 0.2, False),
    "all of the rig inferred": (Rod(taper=0.5), 0.0, True),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", VARIED)
def test_loads_of_rods_that_vary_are_within_1e_5_of_the_largest(name):
    """Beyond what an error of 1e-6 rad of the drive angle explains, which is large just before a fold."""
    rod, friction, inferred = VARIED[name]
    rng, count, turn = np.random.default_rng(7), 150, 1e-7
    record = with_rod(swept(Parabola(0.5, 0.6), step=np.radians(1.0)), rod)
    drawn = Parabola(*rng.uniform([0.2, 0.3, -0.15], [1.0, 0.8, 0.15], (count, 3)).T)
    rig = RigValues(friction=friction)
    if inferred:
        taper, bend = rng.uniform(-0.14, 0.14, count), rng.uniform(-0.19, 0.19, count)
        rig = RigValues(friction=np.abs(rng.normal(0.0, 0.2, count)), taper=taper, rest_curvature=bend)
    by_table, exactly = (RecordLikelihood(record, CELL, friction, exact) for exact in (False, True))
    loads, usable = by_table.predict(drawn, rig)
    exact, usable_exactly = exactly.predict(drawn, rig)
    turned = exactly.predict(drawn, rig._replace(drive_angle_offset=turn))[0]
    assert np.count_nonzero(usable != usable_exactly) <= 2
    both = np.all([np.any(found != 0.0, axis=-1) for found in (loads, exact, turned)], axis=0)
    sample = exactly.segments.of_sample
    largest = np.stack([np.abs(exact[:, sample == k]).max(axis=1) for k in np.unique(sample)], axis=1)[:, sample]
    slack = 1e-5 * largest + 1e-6 / turn * np.abs(turned - exact)
    assert np.count_nonzero(both) > 5_000
    assert np.all((np.abs(loads - exact) <= slack)[both])


def test_a_rod_with_amplitudes_of_its_modes_is_the_rod_that_has_this_curvature():
    """Exactly, and by a table to what the noise allows; also where the mean of the curvature is another."""
    modes = (
        lambda s: 0.05 * (1.0 - s) ** 3,
        lambda s: 0.02 * s,
        *(lambda s, k=k: 0.01 * np.cos(3.0 * k * s) for k in (2, 4, 6)),
    )
    rod, rng, count = Rod(rest_curvature=0.2, rest_shape_modes=modes), np.random.default_rng(3), 6
    record = CELL.measure(with_rod(swept(Parabola(0.5, 0.6), step=0.05), rod), rng=1)
    drawn = Parabola(*rng.uniform([0.4, 0.5, -0.05], [0.6, 0.7, 0.05], (count, 3)).T)
    rig = RigValues(friction=rng.uniform(0.0, 0.3, count), rest_shape=rng.normal(size=(count, len(modes))))
    by_table, exactly = (RecordLikelihood(record, CELL, exact=exact) for exact in (False, True))
    found, exact = (of.log_likelihood(drawn, rig=rig) for of in (by_table, exactly))
    np.testing.assert_allclose(found, exact, rtol=1e-4, atol=0.05)
    exact = exactly.log_likelihood(drawn, rig=rig._replace(rest_curvature=0.02))
    for k, z in enumerate(rig.rest_shape):
        shaped = rod.shaped(z)
        shaped = shaped.reshaped(shaped.mean_rest_curvature + 0.02, 0.0)
        own = RecordLikelihood(with_rod(record, shaped), CELL, exact=True)
        one = own.log_likelihood(drawn.take(np.array([k])), rig=RigValues(friction=rig.friction[[k]]))
        np.testing.assert_allclose(one, exact[k], rtol=1e-9)


def test_a_drive_that_repeats_itself_is_followed_once_and_has_one_discrepancy():
    """Two sweeps through the same poses, and the same with the second further on by less than what matters."""
    there, contour = Translation((0.8, 0.0), np.pi, 1.2, 1.6, 0.05), Circle(0.3, 0.8)
    whole = scan(contour, drive=[there, there]).record
    measured = CELL.measure(whole, rng=1)
    apart = measured.assign(base_x=measured.base_x - 1e-12 * (measured.sweep == 1))
    once, twice = RecordLikelihood(measured, CELL), RecordLikelihood(apart, CELL)
    assert [len(each.segments) for each in (once, twice)] == [1, 2]
    contours = Circle(np.array([0.3, 0.305]), np.array([0.8, 0.8]), np.array([0.0, 0.01]))
    np.testing.assert_allclose(once.log_likelihood(contours), twice.log_likelihood(contours), atol=1e-6)
    np.testing.assert_array_equal(*np.split(once.predict(contours)[0], 2, axis=1))
    assert [np.count_nonzero(np.isinf(each.segments.course.step)) for each in (once, twice)] == [1, 2]
    assert once.segments.ways(np.array([[0.5]])) == pytest.approx(twice.segments.ways(np.array([[0.5, 0.5]]))[:, :1])


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("rod", [Rod(rest_curvature=2.0), Rod(rest_curvature=lambda s: 2.0 + 0.3 * s)])
def test_contours_that_release_a_rod_are_usable_in_a_likelihood_as_well(rod, friction):
    """Where contact ends without force, only small errors decide whether the rod at rest still touches."""
    at, rng = Parabola(1.0, 0.8315 if rod.profile is None else 0.81, 0.1), np.random.default_rng(1)
    found = scan(at, rig=Rig(rod=rod, unknown={"friction": friction}), drive_step=0.01)
    assert "release" in {sweep.snap_off.kind for sweep in found.events.values()}
    measured = CELL.measure(found.record, rng=1)
    contours = Parabola(*(rng.normal(0.0, 1e-4, (3, 60)) + np.array([[at.a], [at.q], [at.x_c]])))
    exact, fast = (RecordLikelihood(measured, CELL, friction, one, is_always_clear=False) for one in (True, False))
    np.testing.assert_array_equal(fast.usable(contours), exact.usable(contours))
    assert exact.usable(contours).any()


@pytest.mark.parametrize("rig", ["straight", "arc", "cone", "curved by a function", "carried"])
def test_the_length_of_a_rig_is_that_of_a_rod_of_the_same_proportions(rig):
    """Against a likelihood for which the rod is stated, in SI units; with a suspension and a stem."""
    shape = {
        "arc": {"rest_curvature": 4.0, "stem": 0.003},
        "cone": {"diameter": 1e-3, "taper": 0.5},
        "curved by a function": {"rest_curvature": lambda s: 80.0 * s},
    }
    stated = Rod(0.1, 2e-4, **{"diameter": 5e-4} | shape.get(rig, {}))
    longer = stated.reshaped(stated.mean_rest_curvature / 1.02, stated.taper, length=0.102)
    np.testing.assert_allclose(longer.mean_rest_curvature * longer.length, stated.mean_rest_curvature * stated.length)
    drive = Motion([0.08, 0.0, -0.08], [0.0, 0.002, 0.0], [0.9, 1.1, 1.1]) if rig == "carried" else None
    true = Circle(0.03, 0.045)
    record = scan(true, rig=Rig(rod=longer, unknown={"friction": 0.2}), drive=drive).record
    cell = LoadCell(force_noise=1e-4, moment_noise=1e-5)
    contours = stack([true, Circle(0.0303, 0.0452)])
    off = RigValues(friction=0.2, rigidity_scale=1.1, drive_angle_offset=1e-3)
    # The compliance is in rad per EI/L of the stated rod.
    of_known = off._replace(suspension_compliance=np.full(2, 0.01 / 1.02))
    of_found = off._replace(suspension_compliance=np.full(2, 0.01), length=np.full(2, 1.02))
    for exact in (True, False):
        known = RecordLikelihood(with_rod(record, longer), cell, exact=exact)
        found = RecordLikelihood(with_rod(record, stated), cell, exact=exact)
        expected, usable = known.predict(contours, of_known)
        loads, usable_too = found.predict(contours, of_found)
        assert usable.all()
        np.testing.assert_array_equal(usable_too, usable)
        expected, loads = expected * longer.load_units, loads * stated.load_units
        error = SHARE[exact] * np.abs(expected).max(axis=(0, 1))
        assert np.all(np.abs(loads - expected) <= error)
    events = events_of(found, contours, of_found)
    for name, expected in events_of(known, contours, of_known).items():
        np.testing.assert_allclose(events[name], expected, atol=1e-9, err_msg=name)


def test_events_lie_where_most_samples_say():
    """Also where some of them are taken for what they are not."""
    record = scan(Parabola(0.5, 0.5), drive_step=0.05).record
    likelihood = RecordLikelihood(record, CELL)
    loaded = (record.force_y != 0.0).values
    events = likelihood.segments.event_samples(loaded)
    for row, direction in zip(events, ("forward", "backward"), strict=True):
        own = np.flatnonzero((record.direction == direction).values)
        inside = own[loaded[own]]
        assert row.tolist() == [inside[0] - 1, inside[0], inside[-1], inside[-1] + 1]
    mistaken = loaded.copy()
    mistaken[[events[0, 3] + 3, events[1, 0] - 2, events[0, 1] + 4]] ^= True
    np.testing.assert_array_equal(likelihood.segments.event_samples(mistaken), events)
    angles = likelihood.segments.event_angles(loaded)
    contours = Parabola(np.array([0.5]), np.array([0.5]), np.array([0.0]))
    snap_offs = likelihood.predict_with_events(contours)[2][0, :, 1]
    assert np.all((angles[:, 2] < snap_offs) & (snap_offs < angles[:, 3]))
    assert (likelihood.segments.event_samples(np.zeros(loaded.size, dtype=bool)) == -1).all()

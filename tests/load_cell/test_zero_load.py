"""The zero load of a record: contact without labels, bias, and noise."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from helpers.refusals import refused
from tactile_bayes.contours import Circle, Ellipse, paper_profile
from tactile_bayes.errors import DriftWarning, RecordError
from tactile_bayes.load_cell import LoadCell, zero_load
from tactile_bayes.load_cell.contact_bounds import contact_bounds
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.record import CHANNELS, in_frame, to_si
from tactile_bayes.rig import make_record
from tactile_bayes.sweep import scan

RIG = LoadCell(force_noise=0.05, moment_noise=0.02, bias=(0.1, -0.3, 0.7))
SHARES = np.array([1.0, -0.6, 0.8])  # loads on the channels, of the largest


@pytest.fixture(scope="module")
def swept():
    """Profile II as an ideal cell reads it."""
    return scan(paper_profile("II", q=0.5)).record


@pytest.fixture(scope="module")
def read(swept):
    return RIG.measure(swept, rng=1)


def ramp(before, loaded, after, slope, offset=0.5):
    """Loads that begin straight between two samples and end at once, shape (samples, 3)."""
    loads = np.zeros((before + loaded + after, 3))
    loads[before : before + loaded] = np.outer(slope * (np.arange(loaded) + offset), SHARES)
    return loads


def record_of(*sweeps):
    """A record of sweeps of readings, each of shape (samples, 3)."""
    loads = np.concatenate(sweeps)
    columns = {
        "sweep": np.repeat(np.arange(len(sweeps)), [len(sweep) for sweep in sweeps]),
        "direction": "forward",
        "drive_angle": np.concatenate([np.linspace(1.0, 2.0, len(sweep)) for sweep in sweeps]),
        **dict(zip(CHANNELS, loads.T, strict=True)),
    }
    return make_record(columns)


def noisy(loads, seed, deviation=1.0, bias=(0.0, 0.0, 0.0)):
    return loads + bias + deviation * np.random.default_rng(seed).standard_normal(loads.shape)


def loaded_of(record, sweep):
    """First and last loaded sample of a sweep, by the truth."""
    loaded = np.flatnonzero((record.truth_contact_phase.values != "none") & (record.sweep.values == sweep))
    return int(loaded[0]), int(loaded[-1])


def assert_bracketed(found, ideal):
    """Onset and snap-off of both sweeps lie between the samples that are found."""
    for sweep in (0, 1):
        first, last = loaded_of(ideal, sweep)
        before, after = found.onset.values[sweep]
        assert before < first <= after
        assert found.snap_off.values[sweep].tolist() == [last, last + 1]


# --- Contact that is not there ------------------------------------------------------------------------------------


def most(sweeps, false_alarm):
    """What a binomial count exceeds once in 10⁴ tests, if the rate is what is allowed."""
    return stats.binom.isf(1e-4, sweeps, false_alarm)


WHITE = np.random.Generator.standard_normal


def correlated(rng, shape):
    root = np.linalg.cholesky([[1.0, 0.9, 0.8], [0.9, 1.0, 0.9], [0.8, 0.9, 1.0]])
    return rng.standard_normal(shape) @ root.T


def outliers(freedom):
    return lambda rng, shape: rng.standard_t(freedom, shape)


@pytest.mark.parametrize(
    ("draw", "samples", "channels", "sweeps", "false_alarm", "rate"),
    [
        *((WHITE, samples, 3, sweeps, 0.1, 0.1) for samples, sweeps in ((3, 300), (5, 300), (200, 200))),
        (WHITE, 20, 1, 300, 0.1, 0.1),
        (correlated, 40, 3, 400, 0.1, 0.1),
        *(
            pytest.param(WHITE, samples, channels, sweeps, 1e-3, 1e-3, marks=pytest.mark.slow)
            for samples, sweeps in ((5, 20_000), (20, 20_000), (200, 20_000), (2000, 8_000))
            for channels in (1, 2, 3)
        ),
        *(
            pytest.param(outliers(freedom), samples, 3, 2000, 1e-3, rate, marks=pytest.mark.slow)
            for freedom, rate in ((5.0, 0.01), (3.0, 0.04))
            for samples in (20, 200, 2000)
        ),
    ],
)
def test_contact_is_claimed_no_more_often_than_allowed(draw, samples, channels, sweeps, false_alarm, rate):
    """In noise alone: at the default, and more often, which fewer sweeps show."""
    rng, floor = np.random.default_rng([samples, channels]), np.zeros(channels)
    readings = (7.0 + draw(rng, (samples, channels)) for _ in range(sweeps))
    assert sum(contact_bounds(each, false_alarm, floor).found for each in readings) <= most(sweeps, rate)


def test_sweeps_without_contact_are_unloaded():
    used = 0
    for seed in range(30):
        found = zero_load(record_of(noisy(np.zeros((60, 3)), seed)))
        assert not found.contact.item()
        assert found.unloaded.all() or not found.unloaded.any()
        used += bool(found.unloaded[0])
        assert (found.onset == -1).all()
        assert (found.snap_off == -1).all()
        assert np.isnan(found.onset_drive_angle).all()
    assert used >= stats.binom.ppf(1e-4, 30, 0.9)  # in doubt at two levels of 5 %


# --- Contact that is there ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [pytest.param(1e-4, marks=pytest.mark.slow), 1e-2, 0.2])
@pytest.mark.parametrize("step", [*(pytest.param(step, marks=pytest.mark.slow) for step in (0.4, 1.0)), 3.0])
@pytest.mark.parametrize(
    "contour",
    [
        *(paper_profile(name, q=q) for name, q in (("I", 0.3), ("II", 0.5), ("III", 0.9))),
        paper_profile("IV", q=0.3),  # lets go with one force left of three loads
        Circle(0.1, 0.5),
        Ellipse(0.4, 0.1, 0.4),
    ],
)
def test_events_of_real_sweeps_are_bracketed(contour, step, noise):
    ideal = scan(contour, drive_step=np.radians(step)).record
    bias = (0.3, -2.0, 5.0)
    cell = LoadCell(force_noise=noise, moment_noise=0.4 * noise, bias=bias, drive_angle_noise=1e-3)
    measured = cell.measure(ideal, rng=3)
    found = zero_load(measured)
    assert found.contact.all()
    assert_bracketed(found, ideal)
    angles = measured.drive_angle.values[found.snap_off.values]
    np.testing.assert_array_equal(found.snap_off_drive_angle.values, angles)
    assert not (found.unloaded.values & (ideal.truth_contact_phase.values != "none")).any()
    # 3 channels in 54 records: beyond 6 standard errors (Student's t, 20 degrees of freedom) once in 1000 runs.
    assert (abs(found.bias - bias) < 6.0 * found.bias_uncertainty).all()
    truth = [0.4 * noise, noise, noise]
    assert (abs(found.noise - truth) < 6.0 * found.noise_uncertainty).all()


@pytest.mark.parametrize(
    ("before", "loaded", "after", "slope"),
    [
        (15, 60, 15, 1.0),
        (3, 30, 3, 5.0),
        pytest.param(15, 100, 15, 0.2, marks=pytest.mark.slow),
        pytest.param(15, 60, 15, 20.0, marks=pytest.mark.slow),
        pytest.param(40, 60, 0, 1.0, marks=pytest.mark.slow),
        pytest.param(0, 60, 15, 1.0, marks=pytest.mark.slow),
    ],
)
def test_bias_over_its_uncertainty_is_students_t(before, loaded, after, slope):
    rng, pulls, freedoms = np.random.default_rng(8), [], []
    for seed in range(80):
        readings = noisy(ramp(before, loaded, after, slope, rng.random()), seed)
        found = zero_load(record_of(readings), false_alarm=1e-3)
        count = int(found.unloaded.sum())
        if count < 3:
            continue
        pulls.append((found.bias / found.bias_uncertainty).values)
        freedoms.append(count - int(found.unloaded[0]) - int(found.unloaded[-1]))
    assert len(pulls) > 75
    scores = stats.norm.ppf(stats.t.cdf(np.array(pulls), np.array(freedoms)[:, None]))
    # Normal numbers: mean and variance of 240 of them, each off by more than this once in 10⁴ tests.
    assert abs(scores.mean()) < stats.norm.isf(0.5e-4) / np.sqrt(scores.size)
    assert (scores**2).sum() < stats.chi2.isf(1e-4, scores.size)
    assert (scores**2).sum() > stats.chi2.ppf(1e-4, scores.size)


def test_noise_over_its_truth_is_chi_squared():
    total, freedom = 0.0, 0
    for seed in range(30):
        found = zero_load(record_of(noisy(ramp(15, 60, 15, 1.0), seed, 0.3)))
        of_each = int(found.unloaded.sum()) - 2
        total += of_each * float(((found.noise / 0.3) ** 2).sum())
        freedom += 3 * of_each
    assert stats.chi2.ppf(1e-4, freedom) < total < stats.chi2.isf(1e-4, freedom)


@pytest.mark.parametrize(
    ("parts", "height"),
    [((15, 15, 15), 9.0), ((15, 100, 15), 5.5), pytest.param((100, 500, 100), 2.5, marks=pytest.mark.slow)],
)
def test_a_weak_load_on_one_channel_is_found(parts, height):
    before, loaded, after = parts
    loads = ramp(before, loaded, after, height / loaded) * [1.0, 0.0, 0.0]
    found = sum(contact_bounds(noisy(loads, seed), 1e-3, np.zeros(3)).found for seed in range(60))
    assert found >= stats.binom.ppf(1e-4, 60, 0.95)


# --- Records that lack something ----------------------------------------------------------------------------------


def test_a_sweep_that_begins_or_ends_loaded_says_so():
    readings = noisy(np.concatenate([10.0 + ramp(0, 30, 0, 1.0), np.zeros((15, 3))]), 1)
    found = zero_load(record_of(readings, noisy(ramp(15, 30, 0, 1.0), 2)))
    assert found.contact.all()
    assert found.onset.sel(sweep=0).values.tolist() == [-1, 0]
    assert found.snap_off.sel(sweep=0).values.tolist() == [29, 30]
    assert found.snap_off.sel(sweep=1).values.tolist() == [89, -1]
    assert np.isnan(found.snap_off_drive_angle.sel(sweep=1, side="after"))
    assert (abs(found.bias) < 5.0 * found.bias_uncertainty).all()


@pytest.mark.parametrize("samples", [30, 300])
def test_a_sweep_that_is_loaded_throughout_tells_nothing(samples):
    load = np.linspace(0.2, 1.0, samples)
    record = record_of(noisy(1e3 * np.stack([load**1.5, -load, np.sin(3.0 * load)], axis=-1), 1))
    found = zero_load(record)
    assert not found.unloaded.any()
    assert np.isnan(found.bias).all()
    with refused(RecordError, "0 samples"):
        LoadCell.from_zero_load(record)


def test_a_few_samples_tell_nothing():
    for samples in (1, 2, 3, 11):
        found = zero_load(record_of(noisy(np.zeros((samples, 3)), 1)))
        assert not found.contact.item()
        assert not found.unloaded.any()


@pytest.mark.parametrize(
    "missing", [("holding_moment",), ("force_x", "force_y"), pytest.param(("force_y",), marks=pytest.mark.slow)]
)
def test_missing_channels_stay_missing(read, missing):
    complete = zero_load(read)
    measured = read.assign({name: np.nan * read[name] for name in missing})
    found = zero_load(measured)
    xr.testing.assert_identical(found.snap_off, complete.snap_off)
    for name in CHANNELS:
        assert bool(np.isnan(found.noise.sel(channel=name))) == (name in missing)
    cell = LoadCell.from_zero_load(measured)
    for index, name in enumerate(CHANNELS):
        assert (cell.bias_uncertainty[index] == 0.0) == (name in missing)
    assert (cell.moment_noise == 0.0) == ("holding_moment" in missing)
    assert (cell.force_noise == 0.0) == ("force_x" in missing)


def test_without_noise_everything_is_exact(swept):
    found = zero_load(LoadCell(bias=RIG.bias).measure(swept, rng=1))
    for sweep in (0, 1):
        first, last = loaded_of(swept, sweep)
        assert found.onset.values[sweep].tolist() == [first - 2, first]
        assert found.snap_off.values[sweep].tolist() == [last, last + 1]
    np.testing.assert_allclose(found.bias, RIG.bias, rtol=1e-15)
    assert (found.noise < 1e-15).all()


def test_a_hundred_thousand_samples():
    found = zero_load(record_of(noisy(ramp(30_000, 40_000, 30_000, 1.25e-3), 1)))
    before, after = found.onset.values[0]
    assert before < 30_000 <= after
    assert found.snap_off.values[0].tolist() == [69_999, 70_000]


# --- Sensors with other flaws -------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, 1e-3, 3e-2, 0.3])
def test_steps_are_seen_and_bound_what_is_known(swept, noise):
    step, bias = 0.1, (0.037, -0.311, 0.049)
    cell = LoadCell(force_noise=noise, moment_noise=noise, bias=bias, force_resolution=step, moment_resolution=step)
    found = zero_load(cell.measure(swept, rng=1))
    np.testing.assert_allclose(found.resolution, step, rtol=1e-6)
    assert (found.noise >= step / np.sqrt(12.0) * (1.0 - 1e-9)).all()
    assert (found.noise < 1.5 * np.hypot(noise, step / np.sqrt(12.0)) + 0.5 * step * (noise < step)).all()
    assert (abs(found.bias - bias) < 5.0 * found.bias_uncertainty).all()
    assert_bracketed(found, swept)


def test_steps_alone_make_no_contact():
    sweeps = np.random.default_rng(1).normal(0.3, 0.1, (200, 100, 3)).round()
    assert sum(contact_bounds(readings, 1e-3, np.full(3, 1.0 / 12.0)).found for readings in sweeps) <= most(200, 1e-3)


def test_outliers_leave_the_events_where_they_are(swept):
    cell = LoadCell(force_noise=0.02, moment_noise=0.01, degrees_of_freedom=4.0)
    for seed in range(10):
        found = zero_load(cell.measure(swept, rng=seed))
        assert (found.snap_off.values[:, 0] == [loaded_of(swept, sweep)[1] for sweep in (0, 1)]).all()
        assert (found.unloaded.groupby(swept.sweep).sum() > 20).all()


def test_a_zero_that_moves_between_sweeps_is_told_and_counted():
    loads = ramp(15, 60, 15, 5.0)
    moved = record_of(noisy(loads, 1), noisy(loads, 2, bias=(3.0, 0.0, 0.0)), noisy(loads, 3, bias=(-3.0, 0.0, 0.0)))
    with pytest.warns(DriftWarning, match="the zero of holding_moment"):
        found = zero_load(moved)
    assert found.same_bias_p_value[0] < 1e-10
    assert 2.0 < found.bias_uncertainty[0] < 4.0  # of 3, 0 and −3: √6 = 2.4 to 3
    assert (found.bias_uncertainty[1:] < 0.2).all()
    assert 0.8 < found.noise[0] < 1.2
    two = record_of(noisy(loads, 1), noisy(loads, 2, bias=(3.0, 0.0, 1.0)))
    with pytest.warns(DriftWarning, match=r"holding_moment and force_y .*\(p = \S+ and \S+"):
        zero_load(two)


def test_a_zero_that_moves_during_contact_is_told_and_the_snap_off_stays():
    readings = ramp(15, 100, 15, 1.0)
    readings[115:] += (5.0, 0.0, 0.0)
    with pytest.warns(DriftWarning, match="the zero of holding_moment"):
        found = zero_load(record_of(noisy(readings, 1)))
    assert found.snap_off.values.tolist() == [[114, 115]]


def test_a_zero_that_stays_is_not_said_to_move():
    loads = ramp(15, 30, 15, 5.0)
    for seed in range(0, 60, 3):  # warnings are errors
        zero_load(record_of(*(noisy(loads, seed + i) for i in range(3))))


# --- Units, frames, errors ----------------------------------------------------------------------------------------


def test_units_make_no_difference(read):
    rod = Rod(0.2, 2.4e-3)
    cell, si = LoadCell.from_zero_load(read), LoadCell.from_zero_load(to_si(read, rod))
    np.testing.assert_allclose(si.dimensionless(rod).bias, cell.bias, rtol=1e-9)
    np.testing.assert_allclose(si.dimensionless(rod).noise, cell.noise, rtol=1e-9)
    found = zero_load(to_si(read, rod))
    assert found.unit.values.tolist() == ["N m", "N", "N"]
    xr.testing.assert_identical(found.unloaded, zero_load(read).unloaded)


def test_a_turning_cell_has_its_bias_in_its_own_frame(swept):
    turning = LoadCell(force_noise=0.05, moment_noise=0.02, bias=(0.1, -0.3, 0.7), frame="turning")
    measured = turning.measure(in_frame(swept, "turning"), rng=1)
    cell = LoadCell.from_zero_load(measured)
    assert cell.frame == "turning"
    assert (np.abs(np.subtract(cell.bias, turning.bias)) < 5.0 * np.array(cell.bias_uncertainty)).all()
    corrected = cell.corrected(measured)
    assert abs(float(corrected.force_y[:10].mean())) < 0.1


def test_forces_share_their_noise_unless_they_differ():
    loads = ramp(30, 60, 30, 5.0)
    alike, found = LoadCell.from_zero_load(record_of(noisy(loads, 1))), zero_load(record_of(noisy(loads, 1)))
    assert alike.force_noise == pytest.approx(np.sqrt((found.noise[1:] ** 2).mean()))
    apart = LoadCell.from_zero_load(record_of(noisy(loads, 1, deviation=np.array([1.0, 0.2, 3.0]))))
    assert 2.0 < apart.force_noise < 4.0


def test_samples_of_sweeps_may_be_mixed(read):
    order = np.arange(read.sizes["sample"]).reshape(2, -1).T.ravel()
    found, mixed = zero_load(read), zero_load(read.isel(sample=order))
    np.testing.assert_array_equal(mixed.unloaded, found.unloaded.values[order])
    np.testing.assert_array_equal(order[mixed.snap_off], found.snap_off)


# --- Drives that stop, and sweeps without an unloaded sample --------------------------------------------------------


@pytest.fixture(scope="module")
def steps():
    """What an ideal cell reads at angles 3° apart."""
    return scan(paper_profile("II", q=0.5), drive_step=np.radians(3.0)).record


def stopped(record, readings, between, seed):
    """A record with several readings at each angle, and noise of some deviations that is the same for all of them."""
    rng, cell = np.random.default_rng(seed), LoadCell(force_noise=0.05, moment_noise=0.02)
    held = record.isel(sample=np.repeat(np.arange(record.sizes["sample"]), readings))
    measured = cell.measure(held, rng=rng)
    deviations = between * np.array(list(cell.standard_deviations.values()))
    common = np.repeat(rng.standard_normal((record.sizes["sample"], 3)) * deviations, readings, axis=0)
    angle = measured.drive_angle + 1e-3 * rng.standard_normal(measured.sizes["sample"])
    channels = {name: measured[name] + common[:, i] for i, name in enumerate(CHANNELS)}
    return measured.assign(drive_angle=angle.assign_attrs(units="rad"), **channels)


@pytest.mark.parametrize("between", [0.0, 1.0, 2.0])
@pytest.mark.parametrize("readings", [5, 20, 100])
def test_noise_that_is_the_same_at_one_angle_is_no_load(steps, readings, between):
    measured = stopped(steps, readings, between, seed=readings)
    found = zero_load(measured)
    assert found.contact.all()
    assert (found.onset.sel(side="before") >= 0).all()
    assert (found.snap_off.sel(side="after") >= 0).all()
    is_loaded = measured.truth_contact_phase.values != "none"
    unloaded = found.unloaded.values
    assert not np.any(unloaded & is_loaded)
    assert unloaded.sum() > 0.6 * (~is_loaded).sum()
    noise = np.array([0.02, 0.05, 0.05]) * np.hypot(1.0, between)
    np.testing.assert_allclose(found.noise, noise, rtol=0.35)
    assert (np.abs(found.bias) < 5.0 * found.bias_uncertainty).all()


@pytest.mark.parametrize("part", ["first", "middle", "last"])
@pytest.mark.parametrize("samples", [10, 15, 30])
def test_a_sweep_of_loaded_samples_alone_is_in_contact(steps, samples, part):
    loaded = np.flatnonzero((steps.truth_contact_phase.values != "none") & (steps.sweep.values == 0))
    begin = {"first": 0, "middle": (loaded.size - samples) // 2, "last": loaded.size - samples}[part]
    cropped = steps.isel(sample=loaded[begin : begin + samples])
    found = zero_load(LoadCell(force_noise=0.02, moment_noise=0.008).measure(cropped, rng=1))
    assert found.contact.all()
    assert not found.unloaded.any()


def test_a_drift_is_hardly_ever_contact():
    """Drifts by four deviations of the noise, of which the test of the ends alone finds one in a hundred."""
    rng = np.random.default_rng(4)
    for drift, most_found in ((0.0, 0), (4.0, 6)):
        sweeps = rng.standard_normal((200, 15, 3)) + drift * np.linspace(0.0, 1.0, 15)[:, None]
        assert sum(contact_bounds(readings, 1e-3, np.zeros(3)).found for readings in sweeps) <= most_found

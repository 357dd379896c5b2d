"""How likely readings are where they are normal: against the dense covariance of all of them, written out."""

from functools import partial

import hypothesis.strategies as st
import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as hnp
from scipy import stats

from helpers.load_cells import CELL, NORMAL, SHARED, UNKNOWN, WALK, WANDER, cell, moments
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell, OrnsteinUhlenbeck

DENSITIES = {
    "all": LoadCell.log_likelihood,
    "each given those before": partial(LoadCell.log_likelihood, pointwise=True),
    "each given all others": LoadCell.log_density_left_out,
}

numbers = st.floats(-100, 100)
factors = st.floats(0.01, 100)


# --- White noise ------------------------------------------------------------------------------------------------


# The sum of n log-densities is right to n roundings of its largest terms.
@given(
    st.integers(1, 8).flatmap(
        lambda n: st.tuples(
            hnp.arrays(float, (n, 3), elements=numbers), hnp.arrays(float, (2, 4, n, 3), elements=numbers)
        )
    ),
    st.sets(st.sampled_from([0, 1, 2])),
    st.sampled_from([(), (1,), (3,), (4, 1), (4, 3), (2, 1, 1), (2, 1, 3), (2, 4, 3)]).flatmap(
        lambda shape: hnp.arrays(float, shape, elements=factors)
    ),
)
def test_the_log_likelihood_is_the_sum_of_normal_log_densities(arrays, missing, noise_scale):
    """Of every sample and channel by itself; the factor of a missing channel does not matter."""
    measured, predicted = arrays
    present = [index for index in range(3) if index not in missing]
    measured[:, list(missing)] = np.nan
    deviations = np.array(list(CELL.standard_deviations.values())) * noise_scale
    densities = stats.norm.logpdf(measured, predicted, deviations[..., None, :])[..., present]
    result = CELL.log_likelihood(measured, predicted, noise_scale=noise_scale)
    assert result.shape == (2, 4)
    tolerance = 1e-14 * (np.abs(densities).sum(axis=(-2, -1)) + 24 * np.log(100) + 1)
    assert (np.abs(result - densities.sum(axis=(-2, -1))) <= tolerance).all()
    pointwise = CELL.log_likelihood(measured, predicted, noise_scale=noise_scale, pointwise=True)
    assert pointwise.shape == (2, 4, len(measured))
    assert (np.abs(pointwise - densities.sum(axis=-1)) <= tolerance[..., None]).all()


@pytest.mark.parametrize("name", ["white", "random walk", "drift that forgets, unknown bias"])
def test_a_prediction_without_a_value_has_none_either(name):
    sheet, predicted = NORMAL[name], np.zeros((2, 4, 3))
    predicted[1, 2, 0] = np.nan
    result, _, each = (density(sheet, np.ones((4, 3)), predicted) for density in DENSITIES.values())
    assert np.isfinite(result).tolist() == [True, False]
    assert np.isfinite(each[0]).all()
    assert np.isnan(each[1, 2])
    pointwise = CELL.log_likelihood(np.ones((4, 3)), predicted, pointwise=True)
    assert np.argwhere(np.isnan(pointwise)).tolist() == [[1, 2]]


def test_nothing_measured_says_nothing():
    nothing, loads = np.full((4, 3), np.nan), np.zeros((2, 4, 3))
    for sheet in (CELL, NORMAL["random walk"]):
        result, *each = (density(sheet, nothing, loads, noise_scale=[2, 3, 4]) for density in DENSITIES.values())
        assert result.tolist() == [0, 0]
        assert all(densities.tolist() == [[0] * 4] * 2 for densities in each)
    assert LoadCell().log_likelihood(np.empty((0, 3)), np.empty((0, 3))) == 0
    assert LoadCell().log_likelihood(np.empty((0, 3)), np.empty((0, 3)), pointwise=True).shape == (0,)


# --- Everything that is normal ----------------------------------------------------------------------------------

N = 6


def dense(sheet, measured, loads, noise_scale, samples=None):
    """Log-density of all or some samples from the covariance of all readings that were made."""
    mean, covariance = moments(sheet, loads, noise_scale)
    is_kept = np.isin(np.arange(measured.size) // 3, range(len(measured)) if samples is None else samples)
    there = np.flatnonzero(~np.isnan(measured.ravel()) & is_kept)
    if not there.size:
        return 0.0
    return stats.multivariate_normal(mean[there], covariance[np.ix_(there, there)]).logpdf(measured.ravel()[there])


def drawn(seed, batch=(), missing=(), samples=N):
    rng = np.random.default_rng(seed)
    measured = 0.2 * rng.normal(size=(samples, 3))
    measured[:, list(missing)] = np.nan
    return measured, 0.5 * rng.normal(size=(*batch, samples, 3)), rng


@pytest.mark.parametrize("missing", [(), (0,), (2,), (0, 1)])
@pytest.mark.parametrize("name", NORMAL)
def test_it_is_the_dense_normal_density(name, missing):
    """Of all samples, and of each given those before: the ratio of densities. The arguments are not changed."""
    sheet = NORMAL[name]
    measured, loads, rng = drawn(1, (2,), missing)
    if sheet.gain != CELL.gain and missing:
        loads[..., list(missing)] = 0.0
    scale = rng.uniform(0.5, 2.0, (2, 3))
    logs = [
        [dense(sheet, measured, *pair, range(samples)) for samples in range(N + 1)]
        for pair in zip(loads, scale, strict=True)
    ]
    given = measured.copy(), loads.copy(), scale.copy()
    whole, each = (sheet.log_likelihood(measured, loads, noise_scale=scale, pointwise=p) for p in (False, True))
    for array, before in zip((measured, loads, scale), given, strict=True):
        np.testing.assert_array_equal(array, before)
    np.testing.assert_allclose(whole, np.array(logs)[:, -1], rtol=1e-11)
    np.testing.assert_allclose(each, np.diff(logs), rtol=1e-10)


@pytest.mark.parametrize(
    ("samples", "missing", "tolerance"),
    [
        *((N, missing, 1e-10) for missing in ((), (0,), (2,), (0, 1))),
        (1, (), 1e-10),  # given nothing
        (2, (), 1e-10),
        pytest.param(40, (), 1e-8, marks=pytest.mark.slow),  # the dense density is a difference of numbers in thousands
    ],
)
@pytest.mark.parametrize("name", NORMAL)
def test_each_given_all_others_is_the_ratio_of_dense_densities_with_and_without_it(name, samples, missing, tolerance):
    measured, loads, rng = drawn(1, (4,), missing, samples)
    loads[..., list(missing)] = 0.0
    scale, every = rng.uniform(0.5, 2.0, (4, 3)), np.arange(samples)
    result = NORMAL[name].log_density_left_out(measured, loads, noise_scale=scale)
    for found, *pair in zip(result, loads, scale, strict=True):
        without = [dense(NORMAL[name], measured, *pair, np.delete(every, i)) for i in every]
        expected = dense(NORMAL[name], measured, *pair) - without
        np.testing.assert_allclose(found, expected, rtol=min(tolerance, 1e-9), atol=tolerance)


@pytest.mark.parametrize(
    "sheet", [cell(degrees_of_freedom=4.0), cell(force_resolution=0.1, moment_resolution=0.1, force_range=0.2)]
)
def test_independent_samples_know_nothing_of_one_another(sheet):
    measured, loads, _ = drawn(8, (4,))
    measured = np.clip(np.round(measured / 0.1) * 0.1, -0.2, 0.2)
    _, pointwise, left_out = (density(sheet, measured, loads) for density in DENSITIES.values())
    np.testing.assert_array_equal(left_out, pointwise)


SHAPES = [
    ((), ()), ((), (1,)), ((), (3,)), ((), (2, 1)), ((), (4, 3)), ((), (2, 1, 3)), ((4,), (3,)), ((4,), (4, 1)),
    ((4,), (1, 3)), ((2, 4), (4, 1)), ((2, 4), (4, 3)), ((2, 4), (2, 1, 1)), ((2, 4), (2, 4, 3)), ((2, 1), (4, 3)),
]  # fmt: skip


@pytest.mark.parametrize("density", DENSITIES)
@pytest.mark.parametrize("name", NORMAL)
def test_batches_of_every_shape_are_one_by_one(name, density):
    sheet, log_density = NORMAL[name], DENSITIES[density]
    for batch, shape in SHAPES:
        measured, loads, rng = drawn(3, batch)
        scale = rng.uniform(0.5, 2.0, shape)
        result = log_density(sheet, measured, loads, noise_scale=scale)
        whole = np.broadcast_shapes(batch, shape[:-1])
        assert result.shape == (whole if density == "all" else (*whole, N))
        every_load = np.broadcast_to(loads, (*whole, N, 3)).reshape(-1, N, 3)
        every_scale = np.broadcast_to(scale, (*whole, 3)).reshape(-1, 3)
        expected = [
            log_density(sheet, measured, load, noise_scale=factor)
            for load, factor in zip(every_load, every_scale, strict=True)
        ]
        np.testing.assert_allclose(result.reshape(np.shape(expected)), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("bias", [1e-8, 100.0])
@pytest.mark.parametrize("drift", [None, WALK, WANDER])
def test_a_bias_that_is_hardly_or_not_at_all_known(drift, bias):
    sheet = cell(bias_uncertainty=(bias, bias, bias), drift=drift)
    measured, loads, _ = drawn(4)
    # The dense covariance has the condition (bias / noise)², and loses as many digits.
    np.testing.assert_allclose(
        sheet.log_likelihood(measured, loads), dense(sheet, measured, loads, (1.0, 1.0, 1.0)), rtol=1e-7
    )


@pytest.mark.parametrize("drift", [None, WALK, WANDER])
@pytest.mark.parametrize("bias", [1e-6, 100.0, 1e4])
def test_each_given_all_others_is_exact_though_a_bias_is_hardly_known(drift, bias):
    """The covariance has the condition (bias / noise)²; with 40 digits this is no matter."""
    sheet = cell(bias_uncertainty=(bias, bias, bias), drift=drift)
    measured, loads, _ = drawn(4)
    measured[:, 1:] = np.nan
    known = moments(cell(drift=drift), loads)[1][::3, ::3]
    with mpmath.workdps(40):
        precision = (mpmath.matrix(known.tolist()) + mpmath.mpf(bias) ** 2 * mpmath.ones(N)) ** -1
        weighed = precision * mpmath.matrix((measured - loads)[:, 0].tolist())
        expected = [
            float((mpmath.log(precision[i, i] / (2 * mpmath.pi)) - weighed[i] ** 2 / precision[i, i]) / 2)
            for i in range(N)
        ]
    np.testing.assert_allclose(sheet.log_density_left_out(measured, loads), expected, rtol=1e-11)


@pytest.mark.parametrize(
    ("time", "limit", "tolerance"),
    [
        (1e-3, LoadCell(moment_noise=np.hypot(0.02, 0.03), force_noise=np.hypot(0.05, 0.02)), 1e-13),
        (1e14, cell(bias_uncertainty=(0.03, 0.02, 0.02)), 1e-9),
    ],
)
@pytest.mark.parametrize("density", DENSITIES.values(), ids=DENSITIES)
def test_a_drift_that_forgets_at_once_is_white_noise_and_one_that_never_does_is_a_bias(density, time, limit, tolerance):
    measured, loads, _ = drawn(5)
    drifting = cell(drift=OrnsteinUhlenbeck(moment=0.03, force=0.02, time=time))
    np.testing.assert_allclose(density(drifting, measured, loads), density(limit, measured, loads), rtol=tolerance)


def test_drift_of_a_channel_that_is_missing_does_not_matter():
    measured, loads, _ = drawn(6, missing=(1, 2))
    sheet = cell(drift=type(WALK)(force=0.1), bias_uncertainty=(0.0, 1.0, 1.0), degrees_of_freedom=4.0)
    expected = stats.t(4.0, loads[:, 0], 0.02).logpdf(measured[:, 0]).sum()
    assert sheet.log_likelihood(measured, loads) == pytest.approx(expected, rel=1e-13)


# --- Steps beside something that wanders: an approximation that is named -----------------------------------------


@pytest.mark.parametrize(
    "further",
    [
        {"drift": WALK},
        {"drift": WANDER, "bias_uncertainty": UNKNOWN},
        {"bias_uncertainty": UNKNOWN},
        {"correlation": SHARED},
        {"correlation": SHARED, "relative_noise": 0.2},
        {"correlation": SHARED, "drift": WALK},
        {"correlation": SHARED, "bias_uncertainty": UNKNOWN},
    ],
)
def test_steps_beside_what_wanders_are_noise_and_this_is_named(further):
    sheet = cell(force_resolution=0.05, moment_resolution=0.02, **further)
    measured, loads, _ = drawn(7)
    measured = np.round(measured / 0.1) * 0.1
    expected = dense(sheet, measured, loads, (0.5, 1.0, 2.0))
    result = sheet.log_likelihood(measured, loads, noise_scale=(0.5, 1.0, 2.0))
    assert result == pytest.approx(expected, rel=1e-11)
    (words,) = sheet.approximations
    assert "of the reading" in words
    assert ("drift" in words) == (set(further) & {"drift", "bias_uncertainty"} != set())
    assert cell(**further).approximations == ()
    exact = cell(force_resolution=0.05, moment_range=1.0, degrees_of_freedom=4.0, relative_noise=0.1)
    assert exact.approximations == ()


@pytest.mark.parametrize(("step", "stated", "stated_ratio"), [(0.5, 3e-5, 2e-4), (1.0, 4e-4, 3e-3), (2.0, 4e-3, 3e-2)])
def test_the_approximation_is_as_good_as_stated(step, stated, stated_ratio):
    """Against integration over the bias, for 10 samples of one channel with noise and bias of 1.

    What is stated is a standard deviation over records, to one digit; that of 300 has an error from its fourth moment.
    """
    rng = np.random.default_rng(8)
    sheet = LoadCell(moment_noise=1.0, moment_resolution=step, bias_uncertainty=(1.0, 0.0, 0.0))
    known = LoadCell(moment_noise=1.0, moment_resolution=step)
    bias = np.linspace(-6.0, 6.0, 241)
    weight = stats.norm.logpdf(bias) + np.log(bias[1] - bias[0])
    shift = np.where(np.arange(10) % 2, 1.0, -1.0) * np.sqrt((1.0 + step**2 / 12) / 10)
    errors, ratios = [], []
    for _ in range(300):
        loads = np.zeros((2, 10, 3))
        loads[..., 0] = rng.uniform(-3.0, 3.0, 10)
        measured = sheet.simulate(loads[0], rng=rng)
        measured[:, 1:] = np.nan
        loads[1, :, 0] += shift
        approximate = sheet.log_likelihood(measured, loads) + 10 * np.log(step)
        at_bias = loads[:, None] + np.stack([bias, 0 * bias, 0 * bias], axis=-1)[:, None, :]
        exact = np.logaddexp.reduce(known.log_likelihood(measured, at_bias) + weight, axis=-1)
        errors.append((approximate - exact)[0] / 10)
        ratios.append(np.diff(approximate - exact)[0])
    for values, digit in ((errors, stated), (ratios, stated_ratio)):
        spread = np.std(values)
        error = np.sqrt((np.mean(np.square(values) ** 2) - spread**4) / 300) / (2.0 * spread)
        assert abs(spread - digit) < 0.5 * 10.0 ** np.floor(np.log10(digit)) + 5.0 * error
    assert abs(np.mean(errors)) < 5.0 * np.std(errors) / np.sqrt(300) + 0.1 * stated


# --- What is refused --------------------------------------------------------------------------------------------


HALF, ZERO = np.full((4, 3), 0.5), np.zeros((4, 3))


def but_for(value):
    """Readings of zero, but for that of the third sample of force_x."""
    readings = np.zeros((4, 3))
    readings[2, 1] = value
    return readings


WANDERING = [{"drift": WALK}, {"drift": WANDER}, {"bias_uncertainty": UNKNOWN}]
AT_END = {"force_range": 1.0, "force_resolution": 0.3}
UNFIT = [(2,), (4,), (0,), (4, 3), (2, 4), (2, 4, 3)]


@pytest.mark.parametrize(
    ("sheet", "measured", "noise_scale", "named"),
    [
        *((cell(degrees_of_freedom=4.0, **more), HALF, 1, ["outliers", "degrees_of_freedom"]) for more in WANDERING),
        *(
            (cell(correlation=SHARED, relative_noise=0.1, **more), HALF, 1, ["correlated noise", "relative_noise"])
            for more in WANDERING
        ),
        *(
            (cell(correlation=SHARED, **WANDERING[2], **more), HALF, 1, ["unknown bias", "correlated noise"])
            for more in WANDERING[:2]
        ),
        (cell(bias_uncertainty=UNKNOWN, moment_range=0.5), HALF, 1, ["sample 0", "holding_moment"]),
        (cell(moment_range=0.1), HALF, 1, ["sample 0", "holding_moment", 0.5, 0.1]),
        (cell(drift=WALK, **AT_END), but_for(-0.9), 1, ["sample 2", "force_x", "drift"]),
        (cell(bias_uncertainty=UNKNOWN, **AT_END), but_for(-0.9), 1, ["sample 2", "force_x", "drift"]),
        (cell(correlation=SHARED, **AT_END), but_for(-0.9), 1, ["sample 2", "force_x", "correlated"]),
        (LoadCell(force_noise=1.0), ZERO, 1, ["holding_moment", "LoadCell(moment_noise="]),
        (LoadCell(moment_noise=1.0), ZERO, 1, ["force_x", "LoadCell(force_noise="]),
        *((sheet, but_for(np.nan), 1, ["sample 2", "force_x"]) for sheet in (CELL, NORMAL["random walk"])),
        *((CELL, ZERO, [[1.0], [factor]], ["noise_scale", factor]) for factor in (0.0, -1.0, np.nan)),
        *((CELL, ZERO, np.ones(shape), ["noise_scale", shape, "(2, 4, 3)", "(2, 3)"]) for shape in UNFIT),
        (CELL, np.tile([0.0, np.nan, 0.0], (4, 1)), np.ones(2), ["noise_scale", (2,), "(2, 4, 3)", "(2, 3)"]),
        (CELL, np.zeros((4, 2)), 1, ["shape"]),
        (CELL, np.zeros((5, 3)), 1, ["shape"]),
        (CELL, np.zeros(3), 1, ["shape"]),
    ],
)
def test_what_has_no_closed_form_or_cannot_be_is_refused(sheet, measured, noise_scale, named):
    with refused(ParameterError, *named):
        sheet.log_likelihood(measured, np.zeros((2, 4, 3)), noise_scale=noise_scale)


@pytest.mark.parametrize(
    ("sheet", "measured"),
    [
        *((cell(**AT_END, **more), but_for(-0.6)) for more in (*WANDERING, {"correlation": SHARED})),
        (LoadCell(moment_noise=1.0), np.tile([0.0, np.nan, np.nan], (4, 1))),
        (LoadCell(force_noise=1.0), np.tile([np.nan, 0.0, 0.0], (4, 1))),
    ],
)
def test_nothing_is_refused_within_the_range_or_for_a_channel_that_was_not_measured(sheet, measured):
    assert np.isfinite(sheet.log_likelihood(measured, ZERO))

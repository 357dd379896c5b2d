"""The load cell: its noise, its data sheet, and the likelihood of what it measured."""

from __future__ import annotations

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as hnp
from scipy import stats

from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import CHANNELS, frame_of, in_frame, make_record, present_channels, to_dimensionless
from tactile_bayes.rod import Rod

CELL = LoadCell(force_noise=0.05, moment_noise=0.02)


def ideal(samples=5, missing=(), rod=None, **further):
    """A sweep without noise."""
    table = {
        "sweep": 0,
        "direction": "forward",
        "drive_angle": np.linspace(1.0, 2.0, samples),
        "holding_moment": np.linspace(0.0, 0.5, samples),
        "force_x": np.linspace(0.0, -0.25, samples),
        "force_y": np.linspace(0.0, 2.0, samples),
        **further,
    }
    return make_record({k: v for k, v in table.items() if k not in missing}, missing=missing, rod=rod)


# --- The cell itself --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["force_noise", "moment_noise"])
@pytest.mark.parametrize("value", [-1e-9, np.nan, np.inf])
def test_an_impossible_standard_deviation_is_refused(name, value):
    with pytest.raises(ParameterError, match=f"the load cell's {name} is .*: give a standard deviation"):
        LoadCell(**{name: value})


def test_every_channel_has_its_standard_deviation():
    assert CELL.standard_deviations == {"holding_moment": 0.02, "force_x": 0.05, "force_y": 0.05}
    assert tuple(CELL.standard_deviations) == CHANNELS


def test_the_data_sheet_goes_with_the_record():
    assert LoadCell.from_record(ideal()) is None
    assert LoadCell.from_record(CELL.measure(ideal(), seed=1)) == CELL
    half = ideal()
    half.attrs["load_cell_force_noise"] = 0.5
    assert LoadCell.from_record(half) == LoadCell(force_noise=0.5)


def test_the_data_sheet_is_converted_with_the_record():
    rod = Rod(0.2, 2.4e-3)
    measured = CELL.measure(ideal(rod=rod), seed=1)
    assert LoadCell.from_record(to_dimensionless(measured)) == CELL.dimensionless(rod)
    assert CELL.dimensionless(Rod()) == CELL


# --- Measuring --------------------------------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_noise():
    record = ideal()
    first = CELL.measure(record, seed=3)
    assert CELL.measure(record, seed=3).identical(first)
    assert CELL.measure(record, seed=np.random.default_rng(3)).identical(first)
    assert not CELL.measure(record, seed=4).identical(first)


def test_a_generator_goes_on():
    rng = np.random.default_rng(3)
    assert not CELL.measure(ideal(), seed=rng).identical(CELL.measure(ideal(), seed=rng))


def test_truth_is_kept_and_the_argument_is_not_changed():
    record = ideal(note=["a"] * 5)
    before = record.copy(deep=True)
    measured = CELL.measure(record, seed=1)
    assert record.identical(before)
    for name in CHANNELS:
        np.testing.assert_array_equal(measured[f"truth_{name}"], record[name])
        assert (measured[name] != record[name]).all()
        assert measured[f"truth_{name}"].attrs["units"] == record[name].attrs["units"]
        assert measured[name].attrs == record[name].attrs
    for name in set(record) - set(CHANNELS):
        assert measured[name].identical(record[name])
    measured["truth_force_x"][:] = 7
    assert record.identical(before)


def test_measuring_twice_keeps_the_first_truth_and_adds_variances():
    once = CELL.measure(ideal(), seed=1)
    twice = LoadCell(force_noise=0.12, moment_noise=0.0).measure(once, seed=2)
    for name in CHANNELS:
        assert twice[f"truth_{name}"].identical(once[f"truth_{name}"])
    assert twice.attrs["load_cell_force_noise"] == pytest.approx(0.13, rel=1e-15)
    assert twice.attrs["load_cell_moment_noise"] == 0.02
    np.testing.assert_array_equal(twice["holding_moment"], once["holding_moment"])


def test_a_cell_that_turns_has_its_noise_on_what_it_measures():
    """The same numbers on axial and transversal force as on horizontal and vertical; turning leaves their law alone."""
    record = ideal()
    fixed, turning = CELL.measure(record, seed=1), CELL.measure(in_frame(record, "turning"), seed=1)
    assert frame_of(turning) == "turning"
    for name in CHANNELS:
        noise = fixed[name] - record[name]
        np.testing.assert_allclose(turning[name] - in_frame(record, "turning")[name], noise, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(turning[f"truth_{name}"], in_frame(record, "turning")[name])
    assert turning["truth_force_x"].attrs["long_name"] == "true axial support reaction"
    back = in_frame(turning, "fixed")
    np.testing.assert_allclose(back["truth_force_y"], record["force_y"], rtol=0, atol=1e-15)
    size = np.hypot(turning["force_x"] - turning["truth_force_x"], turning["force_y"] - turning["truth_force_y"])
    turned_size = np.hypot(back["force_x"] - back["truth_force_x"], back["force_y"] - back["truth_force_y"])
    np.testing.assert_allclose(turned_size, size, rtol=1e-13)


def test_a_cell_without_noise_changes_nothing():
    measured = LoadCell().measure(ideal(), seed=1)
    for name in CHANNELS:
        np.testing.assert_array_equal(measured[name], ideal()[name])


def test_a_missing_channel_stays_missing_and_the_others_have_the_same_noise():
    measured = CELL.measure(ideal(missing=("force_x",)), seed=1)
    assert present_channels(measured) == ("holding_moment", "force_y")
    assert "truth_force_x" not in measured
    whole = CELL.measure(ideal(), seed=1)
    for name in ("holding_moment", "force_y"):
        assert measured[name].identical(whole[name])


def test_noise_has_the_stated_moments_and_is_independent():
    # n = 40000 samples of three channels. Under the stated law each of the statistics below is standard normal up
    # to O(1/√n); twelve of them beyond 5 happen once in 1.5 million seeds.
    n = 40_000
    measured = CELL.measure(ideal(n), seed=20)
    noise = np.stack(
        [(measured[name] - measured[f"truth_{name}"]).values / CELL.standard_deviations[name] for name in CHANNELS]
    )
    mean = noise.mean(axis=1) * np.sqrt(n)
    variance = ((noise**2).mean(axis=1) - 1) / np.sqrt(2 / n)
    between_channels = np.array([noise[i] @ noise[j] for i, j in ((0, 1), (0, 2), (1, 2))]) / np.sqrt(n)
    between_samples = (noise[:, 1:] * noise[:, :-1]).sum(axis=1) / np.sqrt(n - 1)
    assert np.abs([mean, variance, between_channels, between_samples]).max() < 5


def test_noise_is_normal():
    # Kolmogorov and Smirnov's test on 3 x 5000 numbers; it fails for one seed in a million.
    measured = CELL.measure(ideal(5000), seed=21)
    noise = [(measured[name] - measured[f"truth_{name}"]).values / CELL.standard_deviations[name] for name in CHANNELS]
    assert stats.kstest(np.concatenate(noise), "norm").pvalue > 1e-6


@pytest.mark.parametrize("seed", [None, -1, 1.5, "1"])
def test_a_seed_that_is_none_is_refused(seed):
    with pytest.raises(ParameterError, match="give a nonnegative integer or a numpy"):
        CELL.measure(ideal(), seed=seed)


def test_what_is_no_record_is_refused():
    with pytest.raises(RecordError, match="there is no column 'drive_angle'"):
        CELL.measure(ideal().drop_vars("drive_angle"), seed=1)


# --- Likelihood -------------------------------------------------------------------------------------------------

numbers = st.floats(-100, 100)
factors = st.floats(0.01, 100)


def log_densities(measured, predicted, noise_scale):
    """Every sample and channel by itself."""
    deviations = np.array(list(CELL.standard_deviations.values())) * noise_scale
    return stats.norm.logpdf(measured, predicted, deviations[..., None, :])


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
    measured, predicted = arrays
    present = [index for index in range(3) if index not in missing]
    measured[:, list(missing)] = np.nan
    densities = log_densities(measured, predicted, noise_scale)[..., present]
    result = CELL.log_likelihood(measured, predicted, noise_scale=noise_scale)
    assert result.shape == (2, 4)
    tolerance = 1e-14 * (np.abs(densities).sum(axis=(-2, -1)) + 24 * np.log(100) + 1)
    assert (np.abs(result - densities.sum(axis=(-2, -1))) <= tolerance).all()
    pointwise = CELL.log_likelihood(measured, predicted, noise_scale=noise_scale, pointwise=True)
    assert pointwise.shape == (2, 4, len(measured))
    assert (np.abs(pointwise - densities.sum(axis=-1)) <= tolerance[..., None]).all()
    assert (np.abs(pointwise.sum(axis=-1) - result) <= 2 * tolerance).all()


def test_one_prediction_or_a_batch_give_the_same():
    rng = np.random.default_rng(5)
    measured, predicted = rng.normal(size=(9, 3)), rng.normal(size=(4, 9, 3))
    batch = CELL.log_likelihood(measured, predicted)
    single = [CELL.log_likelihood(measured, one) for one in predicted]
    assert np.shape(single[0]) == ()
    np.testing.assert_allclose(batch, single, rtol=1e-14)
    scales = np.array([0.5, 1.0, 2.0, 4.0])
    one_by_one = [CELL.log_likelihood(measured, predicted[0], noise_scale=scale) for scale in scales]
    result = CELL.log_likelihood(measured, predicted[0], noise_scale=scales[:, None])
    np.testing.assert_allclose(result, one_by_one, rtol=1e-14)


def test_one_prediction_takes_many_factors_for_each_channel():
    rng = np.random.default_rng(7)
    measured, predicted = rng.normal(size=(2, 9, 3))
    scales = rng.uniform(0.5, 2.0, (4, 3))
    expected = log_densities(measured, predicted, scales).sum(axis=-1)
    pointwise = CELL.log_likelihood(measured, predicted, noise_scale=scales, pointwise=True)
    np.testing.assert_allclose(pointwise, expected, rtol=1e-13)
    total = CELL.log_likelihood(measured, predicted, noise_scale=scales)
    np.testing.assert_allclose(total, expected.sum(axis=-1), rtol=1e-13)


@pytest.mark.parametrize("pointwise", [False, True])
@pytest.mark.parametrize("missing", [[0], [1], [0, 2]])
def test_the_factor_of_a_missing_channel_does_not_matter(missing, pointwise):
    rng = np.random.default_rng(8)
    measured, predicted = rng.normal(size=(9, 3)), rng.normal(size=(4, 9, 3))
    measured[:, missing] = np.nan
    scales = rng.uniform(0.5, 2.0, (4, 3))
    result = CELL.log_likelihood(measured, predicted, noise_scale=scales, pointwise=pointwise)
    others = scales.copy()
    others[:, missing] = 7.0
    again = CELL.log_likelihood(measured, predicted, noise_scale=others, pointwise=pointwise)
    np.testing.assert_array_equal(again, result)
    present = [index for index in range(3) if index not in missing]
    expected = log_densities(measured, predicted, scales)[..., present].sum(axis=-1)
    np.testing.assert_allclose(result, expected if pointwise else expected.sum(axis=-1), rtol=1e-13)


def test_the_arguments_are_not_changed():
    measured, predicted = np.ones((4, 3)), np.zeros((2, 4, 3))
    scales = np.full((2, 3), 2.0)
    for pointwise in (False, True):
        CELL.log_likelihood(measured, predicted, noise_scale=scales, pointwise=pointwise)
    assert (measured == 1).all()
    assert (predicted == 0).all()
    assert (scales == 2).all()


def test_a_prediction_without_a_value_has_none_either():
    predicted = np.zeros((2, 4, 3))
    predicted[1, 2, 0] = np.nan
    result = CELL.log_likelihood(np.ones((4, 3)), predicted)
    assert np.isfinite(result).tolist() == [True, False]
    pointwise = CELL.log_likelihood(np.ones((4, 3)), predicted, pointwise=True)
    assert np.argwhere(np.isnan(pointwise)).tolist() == [[1, 2]]


def test_nothing_measured_says_nothing():
    assert CELL.log_likelihood(np.full((4, 3), np.nan), np.zeros((2, 4, 3))).tolist() == [0, 0]
    assert LoadCell().log_likelihood(np.empty((0, 3)), np.empty((0, 3))) == 0
    pointwise = CELL.log_likelihood(np.full((4, 3), np.nan), np.zeros((2, 4, 3)), noise_scale=[2, 3, 4], pointwise=True)
    assert pointwise.tolist() == [[0] * 4] * 2
    assert LoadCell().log_likelihood(np.empty((0, 3)), np.empty((0, 3)), pointwise=True).shape == (0,)


def test_the_units_shift_the_log_likelihood_by_their_jacobian():
    rod = Rod(0.2, 2.4e-3)
    rng = np.random.default_rng(6)
    measured, predicted = rng.normal(size=(2, 7, 3))
    units = np.array([rod.moment_unit, rod.force_unit, rod.force_unit])
    dimensionless = CELL.dimensionless(rod).log_likelihood(measured / units, predicted / units)
    si = CELL.log_likelihood(measured, predicted)
    np.testing.assert_allclose(dimensionless, si + 7 * np.log(units).sum(), rtol=1e-13)


@pytest.mark.parametrize(
    ("cell", "name", "argument"),
    [
        (LoadCell(force_noise=1.0), "holding_moment", "moment_noise"),
        (LoadCell(moment_noise=1.0), "force_x", "force_noise"),
    ],
)
def test_a_channel_without_noise_is_refused_if_it_was_measured(cell, name, argument):
    measured = np.zeros((4, 3))
    message = rf"{name} is measured, but the load cell has no noise on it: give LoadCell\({argument}=...\)"
    with pytest.raises(ParameterError, match=message):
        cell.log_likelihood(measured, measured)
    for index, channel in enumerate(CHANNELS):
        if cell.standard_deviations[channel] == 0:
            measured[:, index] = np.nan
    assert np.isfinite(cell.log_likelihood(measured, np.zeros((4, 3))))


def test_a_channel_with_holes_is_refused():
    measured = np.zeros((4, 3))
    measured[2, 1] = np.nan
    with pytest.raises(ParameterError, match="measured misses sample 2 of force_x, but has others"):
        CELL.log_likelihood(measured, np.zeros((4, 3)))


@pytest.mark.parametrize("noise_scale", [0.0, -1.0, np.nan])
def test_an_impossible_noise_scale_is_refused(noise_scale):
    with pytest.raises(ParameterError, match=r"a noise_scale is .*: give positive factors"):
        CELL.log_likelihood(np.zeros((4, 3)), np.zeros((2, 4, 3)), noise_scale=[[1.0], [noise_scale]])
    with pytest.raises(ParameterError, match=r"a noise_scale is .*: give positive factors"):
        CELL.log_likelihood(np.zeros((4, 3)), np.zeros((2, 4, 3)), noise_scale=[1.0, noise_scale, 1.0])


@pytest.mark.parametrize("pointwise", [False, True])
@pytest.mark.parametrize("missing", [[], [1]])
@pytest.mark.parametrize("shape", [(2,), (4,), (0,), (4, 3), (2, 4), (2, 4, 3)])
def test_noise_scales_that_do_not_fit_are_refused(shape, missing, pointwise):
    measured = np.zeros((4, 3))
    measured[:, missing] = np.nan
    message = r"noise_scale has shape \(.*\) and predicted \(2, 4, 3\): give factors that broadcast to \(2, 3\)"
    with pytest.raises(ParameterError, match=message):
        CELL.log_likelihood(measured, np.zeros((2, 4, 3)), noise_scale=np.ones(shape), pointwise=pointwise)


@pytest.mark.parametrize(("measured", "predicted"), [((4, 2), (4, 2)), ((4, 3), (5, 3)), ((3,), (3,))])
def test_shapes_that_do_not_fit_are_refused(measured, predicted):
    with pytest.raises(ParameterError, match=r"give \(n_samples, 3\) and \(..., n_samples, 3\)"):
        CELL.log_likelihood(np.zeros(measured), np.zeros(predicted))

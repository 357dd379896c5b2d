"""How likely readings are that jump: outliers, steps of a converter, the ends of a range, against integration."""

from itertools import pairwise

import numpy as np
import pytest
from scipy import integrate, special, stats

from helpers.load_cells import CELL, cell
from tactile_bayes.load_cell import LoadCell

LAWS = {"normal": np.inf, "outliers": 3.0, "nearly normal": 30.0}
MOMENT_ALONE = np.array([1.0, np.nan, np.nan])


def density_of(degrees_of_freedom, place, scale):
    """The textbook's, of plain numbers: to be integrated."""
    if np.isinf(degrees_of_freedom):
        return lambda r: np.exp(-0.5 * ((r - place) / scale) ** 2) / (scale * np.sqrt(2.0 * np.pi))
    nu = degrees_of_freedom
    top = np.exp(special.gammaln((nu + 1.0) / 2.0) - special.gammaln(nu / 2.0)) / (scale * np.sqrt(nu * np.pi))
    return lambda r: top * (1.0 + ((r - place) / scale) ** 2 / nu) ** (-(nu + 1.0) / 2.0)


def of_moment(sheet, readings, loads, **options):
    """Log-likelihood of each moment under each load."""
    predicted = np.multiply.outer(np.atleast_1d(loads), np.ones((1, 3)))
    every = [sheet.log_likelihood(reading * MOMENT_ALONE[None], predicted, **options) for reading in readings]
    return np.squeeze(np.array(every).T)


@pytest.mark.parametrize("shape", [(), (3,), (4, 1), (4, 3)])
@pytest.mark.parametrize("missing", [(), (1,)])
def test_outliers_have_the_density_of_students_t(missing, shape):
    rng = np.random.default_rng(1)
    sheet = cell(degrees_of_freedom=3.5, relative_noise=0.1, bias=(0.1, 0.2, 0.3))
    measured, loads = rng.standard_t(2.0, (7, 3)), rng.normal(size=(4, 7, 3))
    measured[:, list(missing)] = np.nan
    scale = rng.uniform(0.5, 2.0, shape)
    white = np.hypot([0.02, 0.05, 0.05], 0.1 * loads) * np.broadcast_to(scale, (4, 3))[:, None]
    logs = stats.t(3.5, loads + np.array([0.1, 0.2, 0.3]), white).logpdf(measured)
    pointwise = sheet.log_likelihood(measured, loads, noise_scale=scale, pointwise=True)
    np.testing.assert_allclose(pointwise, np.nansum(logs, axis=-1), rtol=1e-12)
    np.testing.assert_allclose(sheet.log_likelihood(measured, loads, noise_scale=scale), np.nansum(logs, (1, 2)))


def test_many_degrees_of_freedom_are_normal():
    rng = np.random.default_rng(2)
    measured = np.array([0.02, 0.05, 0.05]) * rng.normal(size=(7, 3))
    nearly = cell(degrees_of_freedom=1e7).log_likelihood(measured, 0 * measured, pointwise=True)
    # (z⁴ − 2z² − 1)/4ν to first order, and the logarithm of the gamma function to 10 digits.
    np.testing.assert_allclose(nearly, CELL.log_likelihood(measured, 0 * measured, pointwise=True), atol=1e-5)


@pytest.mark.parametrize("scale", [0.5, 2.0])
@pytest.mark.parametrize("step", [0.004, 0.02, 0.1])
@pytest.mark.parametrize("degrees_of_freedom", LAWS.values(), ids=LAWS)
def test_a_step_has_the_integral_of_the_density_over_it(degrees_of_freedom, step, scale):
    sheet = cell(moment_resolution=step, degrees_of_freedom=degrees_of_freedom)
    readings = step * np.arange(-3, 4)
    for load in (0.0, 0.013, -0.1):
        density = density_of(degrees_of_freedom, load, 0.02 * scale)
        areas = [
            integrate.quad(density, r - step / 2, r + step / 2, epsabs=0, epsrel=1e-11, points=[load])[0]
            for r in readings
        ]
        result = of_moment(sheet, readings, load, noise_scale=scale)
        np.testing.assert_allclose(result, np.log(areas), rtol=1e-9)


@pytest.mark.parametrize("step", [0.0, 0.06])
@pytest.mark.parametrize("degrees_of_freedom", LAWS.values(), ids=LAWS)
def test_a_reading_at_the_end_of_the_range_is_anything_beyond(degrees_of_freedom, step):
    sheet = cell(moment_range=0.2, moment_resolution=step, degrees_of_freedom=degrees_of_freedom)
    last = 0.18 if step else 0.2
    for load in (-0.3, 0.0, 0.1, 0.17, 0.4):
        density = density_of(degrees_of_freedom, load, 0.02)
        beyond = stats.t(degrees_of_freedom, load, 0.02)  # with infinitely many, it is the normal one
        for sign in (-1, 1):
            edge = sign * (last - step / 2)
            # In pieces: the peak, if it is beyond, and what is left of the tail.
            cuts = sorted({edge, max(sign * load, sign * edge) * sign, sign * 3.0}, key=lambda v: sign * v)
            areas = [integrate.quad(density, *pair, epsabs=0, epsrel=1e-11)[0] for pair in pairwise(cuts)]
            area = sign * sum(areas) + beyond.sf(3.0 + load - sign * load)
            result = of_moment(sheet, [sign * last], load)
            assert result == pytest.approx(np.log(area), rel=1e-8)


@pytest.mark.parametrize("degrees_of_freedom", LAWS.values(), ids=LAWS)
def test_narrow_steps_are_density_times_step(degrees_of_freedom):
    """Also where the calculation changes, and far out."""
    loads = np.array([0.0, 0.01, 0.1, 1.0])
    plain = of_moment(cell(degrees_of_freedom=degrees_of_freedom), [0.003], loads)
    for step in 0.02 * np.array([1e-12, 1e-8, 0.99e-5, 1.01e-5, 1e-4]):
        narrow = of_moment(cell(moment_resolution=step, degrees_of_freedom=degrees_of_freedom), [0.003], loads)
        # To second order (z · step)²/24, and to the digits that are left of a difference.
        far = (np.abs(loads - 0.003) / 0.02 * step / 0.02) ** 2 / 24
        assert (np.abs(narrow - np.log(step) - plain) <= far + 1e-9).all()


@pytest.mark.parametrize("resolution", [0.0, 0.02, 1e-9])
@pytest.mark.parametrize("degrees_of_freedom", [np.inf, 1.0, 3.0, 30.0, 1000.0])
def test_far_tails_are_finite_and_fall(degrees_of_freedom, resolution):
    sheet = cell(moment_range=0.2, moment_resolution=resolution, degrees_of_freedom=degrees_of_freedom)
    loads = np.concatenate([-np.logspace(12, 0, 25), np.logspace(0, 12, 25)])
    for reading in (-0.2, -0.1, 0.0, 0.1, 0.2):
        values = of_moment(sheet, [reading], loads)
        assert np.isfinite(values).all()
        if abs(reading) < 0.2:
            assert (np.diff(values[:25]) > 0).all()
            assert (np.diff(values[25:]) < 0).all()
        else:  # on its own side it is certain
            own = loads * reading > 0
            np.testing.assert_allclose(values[own], 0.0, atol=0.1)
            assert (np.diff(values) * reading >= 0).all()
            assert (values[~own] < -1).all()


def test_tails_of_students_t_where_probabilities_are_no_numbers():
    """P(T < −z) → (z/√ν)^−ν · ν^(−1/2) Γ((ν+1)/2)/(√π Γ(ν/2)) · … for z² ≫ ν: the first term has the error ν/z²."""
    sheet = cell(moment_range=0.2, degrees_of_freedom=60.0)
    z = np.array([1e6, 1e8, 1e10])
    first = stats.t(60.0).logpdf(z) + np.log(z / 60.0)
    np.testing.assert_allclose(of_moment(sheet, [0.2], 0.2 - 0.02 * z), first, rtol=0, atol=1e-9)


def test_channels_have_their_own_steps_and_ranges():
    sheet = cell(moment_resolution=0.02, force_range=1.0)
    measured, loads = np.array([[0.04, 1.0, 0.3]]), np.array([[0.05, 0.97, 0.31]])
    expected = (
        np.log(np.diff(stats.norm(0.05, 0.02).cdf([0.03, 0.05]))[0])
        + stats.norm(0.97, 0.05).logsf(1.0)
        + stats.norm(0.31, 0.05).logpdf(0.3)
    )
    assert sheet.log_likelihood(measured, loads) == pytest.approx(expected, rel=1e-13)


def test_the_end_of_the_range_is_the_same_in_all_units():
    """2.5 steps, that may be 2.4999 or 2.5001 in another unit."""
    for unit in np.random.default_rng(3).uniform(0.1, 10.0, 50):
        sheet = LoadCell(moment_noise=0.2 * unit, moment_range=1.0 * unit, moment_resolution=0.4 * unit)
        assert sheet.limit[0] == pytest.approx(0.8 * unit, rel=1e-12)
        whole = LoadCell(moment_range=1.2 * unit, moment_resolution=0.4 * unit)
        assert whole.limit[0] == pytest.approx(1.2 * unit, rel=1e-12)
        readings = [0.8 * unit, 0.8 * unit * (1 + 1e-14)]
        expected = stats.norm(0.0, 0.2).logsf(0.6)
        np.testing.assert_allclose(of_moment(sheet, readings, 0.0), expected, rtol=1e-10)


@pytest.mark.parametrize("degrees_of_freedom", LAWS.values(), ids=LAWS)
def test_readings_are_as_frequent_as_they_are_likely(degrees_of_freedom):
    """Pearson's χ² over all readings that 50 000 samples gave; it fails for one seed in a million."""
    sheet = cell(moment_range=0.1, moment_resolution=0.02, degrees_of_freedom=degrees_of_freedom, bias=(0.01, 0.0, 0.0))
    n = 50_000
    made = sheet.simulate(np.tile([0.05, 0.0, 0.0], (n, 1)), rng=4)[:, 0]
    readings = 0.02 * np.arange(-5, 6)
    counts = np.array([np.count_nonzero(np.abs(made - r) < 1e-9) for r in readings])
    assert counts.sum() == n
    expected = n * np.exp(of_moment(sheet, readings, 0.05))
    often = expected > 10
    pooled = [np.append(v[often], v[~often].sum()) for v in (counts, expected)]
    pooled = [v[pooled[1] > 0.5] for v in pooled]
    assert stats.chi2(len(pooled[0]) - 1).sf(np.sum((pooled[0] - pooled[1]) ** 2 / pooled[1])) > 1e-6

"""Bridge sampling of integrals that are known.

A result is within 4 of its standard errors: false alarm 6e-5 if errors are normal, some 1e-3 allowing for their being
estimated. The standard deviation of z-scores over 120 repetitions is known to 6.5 %, so that its bounds of 0.7 and 1.4
are 4 standard errors from any true one between 0.95 and 1.1, and 2 from 0.8: that in 40 dimensions, where the two
results that are averaged share less of their errors than standard errors count on.
"""

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter
from scipy.special import gammaln, ndtr

from helpers.refusals import refused
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.ensembles import SamplerSettings, sample, scatter_walkers
from tactile_bayes.inference.evidence import Evidence, bridge_evidence

LOG_2PI = np.log(2.0 * np.pi)


class Normal:
    """Of any covariance and an unnormalised density."""

    def __init__(self, size, seed=3):
        rng = np.random.default_rng(seed)
        self.root = np.tril(rng.normal(size=(size, size)) / np.sqrt(size)) + np.diag(10.0 ** rng.uniform(-1, 1, size))
        self.mean = 10.0 * rng.normal(size=size)
        self.constant = -1234.5
        self.integral = self.constant + 0.5 * size * LOG_2PI + np.sum(np.log(np.abs(np.diag(self.root))))

    def log_density(self, x):
        standard = np.linalg.solve(self.root, (x - self.mean).T)
        return self.constant - 0.5 * np.sum(standard**2, axis=0)

    def transform(self, standard):
        return self.mean + standard @ self.root.T


class HalfNormals:
    """Standard normals, the first `walls` of which are positive."""

    def __init__(self, size, walls):
        self.walls = walls
        self.integral = 0.5 * size * LOG_2PI - walls * np.log(2.0)

    def log_density(self, x):
        inside = np.all(x[:, : self.walls] > 0.0, axis=1)
        return np.where(inside, -0.5 * np.sum(x**2, axis=1), -np.inf)

    def transform(self, standard):
        return np.concatenate([np.abs(standard[..., : self.walls]), standard[..., self.walls :]], axis=-1)


class Box:
    """A standard normal in a box, cut by both sides, by one, or hardly."""

    def __init__(self):
        self.low = np.array([-0.5, 0.5, -3.0, -np.inf])
        self.high = np.array([1.0, np.inf, 3.0, -1.0])
        self.integral = 2.0 * LOG_2PI + np.sum(np.log(ndtr(self.high) - ndtr(self.low)))

    def log_density(self, x):
        inside = np.all((x > self.low) & (x < self.high), axis=1)
        return np.where(inside, -0.5 * np.sum(x**2, axis=1), -np.inf)

    def transform(self, standard):
        return stats.truncnorm(self.low, self.high).ppf(ndtr(standard))


class HalfSpace:
    """Correlated normals behind a wall x₁ + … > 0.5 that is no axis' own."""

    def __init__(self, size, wall=0.5):
        self.wall = wall
        self.normal = np.ones(size) / np.sqrt(size)
        self.integral = 0.5 * size * LOG_2PI + stats.norm.logsf(wall)

    def log_density(self, x):
        return np.where(x @ self.normal > self.wall, -0.5 * np.sum(x**2, axis=1), -np.inf)

    def transform(self, standard):
        along = standard @ self.normal
        truncated = stats.norm.isf(stats.norm.sf(self.wall) * stats.norm.sf(along))
        return standard + (truncated - along)[..., None] * self.normal


class LogGammas:
    def __init__(self, size, shape):
        self.shape = shape
        self.integral = size * gammaln(shape)

    def log_density(self, x):
        return np.sum(self.shape * x - np.exp(x), axis=1)

    def transform(self, standard):
        return np.log(stats.gamma.isf(stats.norm.sf(standard), self.shape))


class LogNormals:
    def __init__(self, size, width):
        self.width = width
        self.integral = size * (np.log(width) + 0.5 * LOG_2PI)

    def log_density(self, x):
        logs = np.log(np.where(x > 0.0, x, 1.0))
        return np.where(np.all(x > 0.0, axis=1), np.sum(-0.5 * (logs / self.width) ** 2 - logs, axis=1), -np.inf)

    def transform(self, standard):
        return np.exp(self.width * standard)


class Banana:
    """A standard normal, bent without a change of volume (Haario et al. 1999)."""

    def __init__(self, size, bend):
        self.bend = bend
        self.integral = 0.5 * size * LOG_2PI

    def log_density(self, x):
        bent = x[:, 1] - self.bend * (x[:, 0] ** 2 - 1.0)
        return -0.5 * (np.sum(x**2, axis=1) - x[:, 1] ** 2 + bent**2)

    def transform(self, standard):
        x = standard.copy()
        x[..., 1] += self.bend * (x[..., 0] ** 2 - 1.0)
        return x


def standard_draws(shape, rng, correlation=0.0):
    """Normal, (chains, n, d), each chain of 10 walkers whose steps have this correlation."""
    chains, n, size = shape
    walkers = rng.normal(size=(chains, 10, n // 10, size))
    walkers[:, :, 1:] *= np.sqrt(1.0 - correlation**2)
    return lfilter([1.0], [1.0, -correlation], walkers, axis=2).reshape(shape)


def bridged(target, draws, rng, **options) -> Evidence:
    values = target.log_density(draws.reshape(-1, draws.shape[-1])).reshape(draws.shape[:2])
    return bridge_evidence(target.log_density, draws, values, rng, **options)


def z_scores(target, shape, repetitions, *, correlation=0.0, proposals):
    scores = []
    for seed in range(repetitions):
        rng = np.random.default_rng(seed)
        draws = target.transform(standard_draws(shape, rng, correlation))
        result = bridged(target, draws, rng, proposals=proposals)
        scores.append((result.log_evidence - target.integral) / result.standard_error)
    return np.array(scores)


ONCE = {
    "normal 2": (Normal(2), 2, 0.01),
    "normal 10": (Normal(10), 10, 0.02),
    "normal 35": (Normal(35), 35, 0.03),
    "half-normals 10": (HalfNormals(10, 8), 10, 0.02),
    "half-normals 40": (HalfNormals(40, 15), 40, 0.04),
    "box": (Box(), 4, 0.02),
    "half-space": (HalfSpace(5), 5, 0.02),
    "log-gammas 20": (LogGammas(20, 2.0), 20, 0.02),
    "log-normals 10": (LogNormals(10, 0.5), 10, 0.02),
    "banana": (Banana(5, 1.0), 5, 0.02),
}


@pytest.mark.parametrize("name", ONCE)
def test_known_integrals(name):
    target, size, largest = ONCE[name]
    rng = np.random.default_rng(1)
    result = bridged(target, target.transform(standard_draws((4, 500, size), rng)), rng)
    assert result.standard_error < largest
    assert abs(result.log_evidence - target.integral) < 4.0 * result.standard_error
    assert 0.5 < result.overlap < 1.0


# Of the normal fits' error both halves have the same, of a wall's none; walkers are correlated or not.
REPEATED = {
    "normal": (Normal(2), (4, 100, 2), 0.0),
    "normal of odd chains": (Normal(5), (3, 150, 5), 0.0),
    "correlated normal": (Normal(3), (4, 400, 3), 0.8),
    "box": (Box(), (4, 100, 4), 0.0),
    "half-space": (HalfSpace(5, 1.5), (4, 100, 5), 0.0),
    "correlated half-normals": (HalfNormals(5, 5), (4, 400, 5), 0.8),
    "log-normals": (LogNormals(3, 0.7), (2, 200, 3), 0.0),
    "banana": (Banana(2, 1.0), (4, 100, 2), 0.0),
}


QUICK = ("correlated normal",)


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in QUICK else pytest.mark.slow) for n in REPEATED])
def test_standard_errors_are_those_of_repetitions(name):
    target, shape, correlation = REPEATED[name]
    scores = z_scores(target, shape, 120, correlation=correlation, proposals=400)
    assert 0.7 < np.sqrt(np.mean(scores**2)) < 1.4
    assert abs(scores.mean()) < 0.5


SLOWLY_REPEATED = {
    "normal 10": (Normal(10), (4, 250, 10), 0.0),
    "normal 35": (Normal(35), (4, 250, 35), 0.0),
    "correlated normal 35": (Normal(35), (4, 2000, 35), 0.8),
    "half-normals 40": (HalfNormals(40, 15), (4, 250, 40), 0.0),
    "log-gammas 30": (LogGammas(30, 2.0), (4, 250, 30), 0.0),
    "correlated log-gammas 10": (LogGammas(10, 2.0), (4, 2000, 10), 0.8),
    "banana 20": (Banana(20, 0.5), (4, 250, 20), 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOWLY_REPEATED)
def test_standard_errors_are_those_of_repetitions_in_many_dimensions(name):
    target, shape, correlation = SLOWLY_REPEATED[name]
    scores = z_scores(target, shape, 120, correlation=correlation, proposals=3000)
    assert 0.7 < np.sqrt(np.mean(scores**2)) < 1.4
    assert abs(scores.mean()) < 0.5


class Regression:
    """Coefficients of N(0, 2²) each and noise of N(0, 0.5²): their posterior and the data are normal."""

    def __init__(self, design, data):
        self.design, self.data = design, data
        count, size = design.shape
        self.integral = stats.multivariate_normal(
            np.zeros(count), 4.0 * design @ design.T + 0.25 * np.eye(count)
        ).logpdf(data)
        precision = design.T @ design / 0.25 + np.eye(size) / 4.0
        self.root = np.linalg.cholesky(np.linalg.inv(precision))
        self.mean = np.linalg.solve(precision, design.T @ data / 0.25)

    def log_density(self, x):
        residuals = self.data - x @ self.design.T
        return np.sum(stats.norm.logpdf(x, scale=2.0), axis=1) + np.sum(stats.norm.logpdf(residuals, scale=0.5), axis=1)

    def transform(self, standard):
        return self.mean + standard @ self.root.T


def regressions(size, count=60):
    """With all regressors, and with the last left out, from which nothing comes."""
    rng = np.random.default_rng(size)
    design = rng.normal(size=(count, size))
    data = design[:, :-1] @ rng.normal(size=size - 1) + 0.5 * rng.normal(size=count)
    return Regression(design, data), Regression(design[:, :-1], data)


@pytest.mark.parametrize("size", [3, 12, 30])
def test_evidence_of_a_regression(size):
    model, _ = regressions(size)
    rng = np.random.default_rng(2)
    result = bridged(model, model.transform(standard_draws((4, 500, size), rng)), rng)
    assert result.standard_error < 0.05
    assert abs(result.log_evidence - model.integral) < min(4.0 * result.standard_error, 0.05)


def test_bayes_factor_of_two_regressions():
    results, models = [], regressions(8)
    for seed, model in enumerate(models):
        rng = np.random.default_rng(seed)
        results.append(bridged(model, model.transform(standard_draws((4, 500, model.mean.size), rng)), rng))
    with_it, without = results
    error = np.hypot(with_it.standard_error, without.standard_error)
    known = models[0].integral - models[1].integral
    assert known < -1.0
    assert error < 0.02
    assert abs(with_it.log_evidence - without.log_evidence - known) < 4.0 * error


def sampled(target, size, *, scatter, seed, **settings) -> Evidence:
    chosen = SamplerSettings(**settings)
    start = scatter_walkers(target.log_density, scatter, parameters=size, seed=seed, settings=chosen)
    names = [f"x{i}" for i in range(size)]
    draws = sample(target.log_density, start, names=names, seed=seed, settings=chosen)
    rng = np.random.default_rng(seed)
    return bridge_evidence(target.log_density, draws.samples, draws.log_probability, rng, proposals=2000)


@pytest.mark.slow
def test_draws_of_the_sampler():
    target = HalfNormals(3, 2)
    result = sampled(
        target, 3, scatter=lambda rng, n: 1.5 * rng.normal(size=(n, 3)), seed=1, min_ess=400, max_r_hat=1.05
    )
    assert result.standard_error < 0.03
    assert abs(result.log_evidence - target.integral) < 4.0 * result.standard_error


@pytest.mark.slow
def test_standard_errors_with_draws_of_the_sampler():
    target = LogGammas(4, 2.0)
    scores = []
    for seed in range(100):
        result = sampled(
            target, 4, scatter=lambda rng, n: rng.normal(size=(n, 4)), seed=seed, min_ess=400, max_r_hat=1.05
        )
        scores.append((result.log_evidence - target.integral) / result.standard_error)
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.4


@pytest.mark.slow
def test_draws_of_the_sampler_in_30_dimensions():
    target = Normal(30)
    result = sampled(target, 30, scatter=lambda rng, n: target.transform(2.0 * rng.normal(size=(n, 30))), seed=1)
    assert result.standard_error < 0.05
    assert abs(result.log_evidence - target.integral) < 4.0 * result.standard_error


def test_evaluations_and_scale():
    """As many points as asked for; the evidence of f(x/s)/sᵈ times a constant is that of f times it."""
    target, points = Normal(3), []
    draws = target.transform(standard_draws((4, 200, 3), np.random.default_rng(1)))
    values = target.log_density(draws.reshape(-1, 3)).reshape(4, 200)

    def counted(x):
        points.append(len(x))
        return target.log_density(x)

    first = bridge_evidence(counted, draws, values, np.random.default_rng(2), proposals=1000)
    assert points == [1000]
    scale = np.array([1e-6, 1.0, 1e6])
    scaled = bridge_evidence(
        lambda x: target.log_density(x / scale) + 1e3,
        draws * scale,
        values + 1e3,
        np.random.default_rng(2),
        proposals=1000,
    )
    np.testing.assert_allclose(scaled.log_evidence, first.log_evidence + 1e3, rtol=1e-9)
    np.testing.assert_allclose(scaled[1:], first[1:], rtol=1e-6)


def test_of_many_draws_some_are_used():
    target = Normal(2)
    rng = np.random.default_rng(5)
    result = bridged(target, target.transform(standard_draws((4, 30_000, 2), rng, correlation=0.9)), rng)
    assert result.standard_error < 0.01
    assert abs(result.log_evidence - target.integral) < 4.0 * result.standard_error


def test_overlap_is_that_of_the_densities():
    """It is nearly 1 with a normal, and falls with the number of walls that a fit cannot follow."""
    overlaps = []
    for target in (Normal(5), HalfSpace(5, 0.0), HalfSpace(5, 3.0), Banana(5, 3.0)):
        rng = np.random.default_rng(4)
        overlaps.append(bridged(target, target.transform(standard_draws((4, 500, 5), rng)), rng).overlap)
    assert overlaps[0] > 0.97
    assert np.all(np.diff(overlaps) < 0.0)


def plain(x):
    return -0.5 * np.sum(x**2, axis=-1)


DRAWS = np.random.default_rng(1).normal(size=(4, 50, 2))


def not_bridged(*named, log_density=plain, draws=DRAWS, log_densities=None):
    values = plain(draws) if log_densities is None else log_densities
    with refused(InferenceError, *named):
        bridge_evidence(log_density, draws, values, np.random.default_rng(1))


def test_too_little_is_refused():
    not_bridged("1 chains", "50 draws", draws=DRAWS[:1])
    not_bridged("8 draws", draws=DRAWS[:, :7])
    not_bridged("50 draws", draws=np.random.default_rng(1).normal(size=(4, 49, 20)))


def test_draws_that_cannot_be_are_refused():
    not_bridged("parameter 1", draws=np.where([True, False], DRAWS, 3.0))
    not_bridged("too few different points", draws=np.sign(DRAWS))
    not_bridged("plane", draws=DRAWS[..., :1] * [1.0, 2.0])


def test_chains_of_different_places_are_refused():
    apart = DRAWS + np.array([0.0, 0.0, 100.0, 100.0])[:, None, None]

    def density(x):
        return np.logaddexp(plain(x), plain(x - 100.0))

    not_bridged("chains", "same place", log_density=density, draws=apart, log_densities=density(apart))


def test_a_density_that_is_zero_at_all_proposals_is_refused():
    not_bridged("zero", "proposals", log_density=lambda x: np.where(np.isin(x[:, 0], DRAWS), plain(x), -np.inf))

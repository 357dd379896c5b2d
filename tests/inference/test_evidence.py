"""Bridge sampling of integrals that are known.

A result is within 4 of its standard errors: false alarm 6e-5 if errors are normal, some 1e-3 allowing for their being
estimated. The standard deviation of z-scores over 120 repetitions is known to 6.5 %, so that its bounds of 0.7 and 1.4
are 4 standard errors from any true one between 0.95 and 1.1, and 2 from 0.8: that in 40 dimensions, where the two
results that are averaged share less of their errors than standard errors count on.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter
from scipy.special import gammaln, ndtr

from helpers.contour_posteriors import CELL, only, swept
from helpers.refusals import refused
from tactile_bayes import Family, Rig, SamplerSettings
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour import sampled
from tactile_bayes.inference.ensembles import sample, scatter_walkers
from tactile_bayes.inference.evidence import WIDTHS, Evidence, bridge_evidence, contour_evidence
from tactile_bayes.inference.experiment import Experiment, contour_problem

LOG_2PI = np.log(2.0 * np.pi)


class Target(NamedTuple):
    """A density with the logarithm of its integral, and draws from it as a function of standard normal ones."""

    log_density: Callable
    transform: Callable
    integral: float


def normal(size):
    """Of any covariance and an unnormalised density."""
    rng = np.random.default_rng(3)
    root = np.tril(rng.normal(size=(size, size)) / np.sqrt(size)) + np.diag(10.0 ** rng.uniform(-1, 1, size))
    mean, constant = 10.0 * rng.normal(size=size), -1234.5
    return Target(
        lambda x: constant - 0.5 * np.sum(np.linalg.solve(root, (x - mean).T) ** 2, axis=0),
        lambda standard: mean + standard @ root.T,
        constant + 0.5 * size * LOG_2PI + np.sum(np.log(np.abs(np.diag(root)))),
    )


def cut(is_inside, transform, integral):
    """Standard normals where they are inside."""
    return Target(lambda x: np.where(is_inside(x), -0.5 * np.sum(x**2, axis=1), -np.inf), transform, integral)


def half_normals(size, walls):
    """Standard normals, the first `walls` of which are positive."""
    return cut(
        lambda x: np.all(x[:, :walls] > 0.0, axis=1),
        lambda standard: np.concatenate([np.abs(standard[..., :walls]), standard[..., walls:]], axis=-1),
        0.5 * size * LOG_2PI - walls * np.log(2.0),
    )


def box():
    """A standard normal in a box, cut by both sides, by one, or hardly."""
    low, high = np.array([-0.5, 0.5, -3.0, -np.inf]), np.array([1.0, np.inf, 3.0, -1.0])
    return cut(
        lambda x: np.all((x > low) & (x < high), axis=1),
        lambda standard: stats.truncnorm(low, high).ppf(ndtr(standard)),
        2.0 * LOG_2PI + np.sum(np.log(ndtr(high) - ndtr(low))),
    )


def half_space(size, wall=0.5):
    """Normals behind a wall x₁ + … > 0.5 that is no axis' own."""
    across = np.ones(size) / np.sqrt(size)

    def transform(standard):
        along = standard @ across
        truncated = stats.norm.isf(stats.norm.sf(wall) * stats.norm.sf(along))
        return standard + (truncated - along)[..., None] * across

    return cut(lambda x: x @ across > wall, transform, 0.5 * size * LOG_2PI + stats.norm.logsf(wall))


def log_gammas(size, shape):
    return Target(
        lambda x: np.sum(shape * x - np.exp(x), axis=1),
        lambda standard: np.log(stats.gamma.isf(stats.norm.sf(standard), shape)),
        size * gammaln(shape),
    )


def log_normals(size, width):
    def log_density(x):
        logs = np.log(np.where(x > 0.0, x, 1.0))
        return np.where(np.all(x > 0.0, axis=1), np.sum(-0.5 * (logs / width) ** 2 - logs, axis=1), -np.inf)

    return Target(log_density, lambda standard: np.exp(width * standard), size * (np.log(width) + 0.5 * LOG_2PI))


def banana(size, bend):
    """A standard normal, bent without a change of volume (Haario et al. 1999)."""

    def bent(x, sign):
        moved = x.copy()
        moved[..., 1] += sign * bend * (x[..., 0] ** 2 - 1.0)
        return moved

    return Target(lambda x: -0.5 * np.sum(bent(x, -1.0) ** 2, axis=1), lambda x: bent(x, 1.0), 0.5 * size * LOG_2PI)


def standard_draws(shape, rng, correlation=0.0):
    """Normal, (chains, n, d), each chain of 10 walkers whose steps have this correlation."""
    chains, n, size = shape
    walkers = rng.normal(size=(chains, 10, n // 10, size))
    walkers[:, :, 1:] *= np.sqrt(1.0 - correlation**2)
    return lfilter([1.0], [1.0, -correlation], walkers, axis=2).reshape(shape)


def bridged(target, draws, rng, **options) -> Evidence:
    values = target.log_density(draws.reshape(-1, draws.shape[-1])).reshape(draws.shape[:2])
    return bridge_evidence(target.log_density, draws, values, rng, **options)


ONCE = {
    "normal 2": (normal(2), 2, 0.01),
    "normal 10": (normal(10), 10, 0.02),
    "normal 35": (normal(35), 35, 0.03),
    "half-normals 10": (half_normals(10, 8), 10, 0.02),
    "half-normals 40": (half_normals(40, 15), 40, 0.04),
    "box": (box(), 4, 0.02),
    "half-space": (half_space(5), 5, 0.02),
    "log-gammas 20": (log_gammas(20, 2.0), 20, 0.02),
    "log-normals 10": (log_normals(10, 0.5), 10, 0.02),
    "banana": (banana(5, 1.0), 5, 0.02),
}


@pytest.mark.parametrize("name", ONCE)
def test_known_integrals(name):
    target, size, largest = ONCE[name]
    rng = np.random.default_rng(1)
    result = bridged(target, target.transform(standard_draws((4, 500, size), rng)), rng)
    assert result.standard_error < largest
    assert abs(result.log_evidence - target.integral) < 4.0 * result.standard_error
    assert 0.5 < result.overlap < 1.0


# Target, shape of the draws, correlation of a walker's steps, number of proposals.
# Of the normal fits' error both halves have the same, of a wall's none.
REPEATED = {
    "normal": (normal(2), (4, 100, 2), 0.0, 400),
    "normal of odd chains": (normal(5), (3, 150, 5), 0.0, 400),
    "correlated normal": (normal(3), (4, 400, 3), 0.8, 400),
    "box": (box(), (4, 100, 4), 0.0, 400),
    "half-space": (half_space(5, 1.5), (4, 100, 5), 0.0, 400),
    "correlated half-normals": (half_normals(5, 5), (4, 400, 5), 0.8, 400),
    "log-normals": (log_normals(3, 0.7), (2, 200, 3), 0.0, 400),
    "banana": (banana(2, 1.0), (4, 100, 2), 0.0, 400),
    "normal 10": (normal(10), (4, 250, 10), 0.0, 3000),
    "normal 35": (normal(35), (4, 250, 35), 0.0, 3000),
    "correlated normal 35": (normal(35), (4, 2000, 35), 0.8, 3000),
    "half-normals 40": (half_normals(40, 15), (4, 250, 40), 0.0, 3000),
    "log-gammas 30": (log_gammas(30, 2.0), (4, 250, 30), 0.0, 3000),
    "correlated log-gammas 10": (log_gammas(10, 2.0), (4, 2000, 10), 0.8, 3000),
    "banana 20": (banana(20, 0.5), (4, 250, 20), 0.0, 3000),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", REPEATED)
def test_standard_errors_are_those_of_repetitions(name):
    target, shape, correlation, proposals = REPEATED[name]
    scores = []
    for seed in range(120):
        rng = np.random.default_rng(seed)
        draws = target.transform(standard_draws(shape, rng, correlation))
        result = bridged(target, draws, rng, proposals=proposals)
        scores.append((result.log_evidence - target.integral) / result.standard_error)
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.4
    assert abs(np.mean(scores)) < 0.5


@pytest.mark.slow
def test_standard_errors_with_draws_of_the_sampler():
    target, names, settings = log_gammas(4, 2.0), list("abcd"), SamplerSettings(min_ess=400, max_r_hat=1.05)
    scores = []
    for seed in range(100):
        start = scatter_walkers(
            target.log_density, lambda rng, n: rng.normal(size=(n, 4)), parameters=4, seed=seed, settings=settings
        )
        draws = sample(target.log_density, start, names=names, seed=seed, settings=settings)
        rng = np.random.default_rng(seed)
        result = bridge_evidence(target.log_density, draws.samples, draws.log_probability, rng, proposals=2000)
        scores.append((result.log_evidence - target.integral) / result.standard_error)
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.4


def test_evaluations_and_scale():
    """As many points as asked for; the evidence of f(x/s)/sᵈ times a constant is that of f times it."""
    target, points = normal(3), []
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
    target = normal(2)
    rng = np.random.default_rng(5)
    result = bridged(target, target.transform(standard_draws((4, 30_000, 2), rng, correlation=0.9)), rng)
    assert result.standard_error < 0.01
    assert abs(result.log_evidence - target.integral) < 4.0 * result.standard_error


def test_overlap_is_that_of_the_densities():
    """It is nearly 1 with a normal, and falls with the number of walls that a fit cannot follow."""
    overlaps = []
    for target in (normal(5), half_space(5, 0.0), half_space(5, 3.0), banana(5, 3.0)):
        rng = np.random.default_rng(4)
        overlaps.append(bridged(target, target.transform(standard_draws((4, 500, 5), rng)), rng).overlap)
    assert overlaps[0] > 0.97
    assert np.all(np.diff(overlaps) < 0.0)


def plain(x):
    return -0.5 * np.sum(x**2, axis=-1)


DRAWS = np.random.default_rng(1).normal(size=(4, 50, 2))
APART = DRAWS + np.array([0.0, 0.0, 100.0, 100.0])[:, None, None]


def two_places(x):
    return np.logaddexp(plain(x), plain(x - 100.0))


@pytest.mark.parametrize(
    ("draws", "log_density", "named"),
    [
        (DRAWS[:1], plain, ["1 chains", "50 draws"]),
        (DRAWS[:, :7], plain, ["8 draws"]),
        (np.random.default_rng(1).normal(size=(4, 49, 20)), plain, ["50 draws"]),
        (np.where([True, False], DRAWS, 3.0), plain, ["parameter 1"]),
        (np.sign(DRAWS), plain, ["too few different points"]),
        (DRAWS[..., :1] * [1.0, 2.0], plain, ["plane"]),
        (APART, two_places, ["chains", "same place"]),
        (DRAWS, lambda x: np.where(np.isin(x[..., 0], DRAWS), plain(x), -np.inf), ["zero", "proposals"]),
    ],
)
def test_draws_that_say_too_little_are_refused(draws, log_density, named):
    with refused(InferenceError, *named):
        bridge_evidence(log_density, draws, log_density(draws), np.random.default_rng(1))


NARROW = {
    "parabola": {"a": stats.lognorm(s=0.02, scale=0.5), "q": stats.norm(0.5, 0.0015), "x_c": stats.norm(0.0, 0.005)},
    "circle": {"r": stats.lognorm(s=0.02, scale=0.8), "q": stats.norm(0.5, 0.0015), "x_c": stats.norm(0.0, 0.005)},
}
TRUTHS = {"parabola": Parabola(0.5, 0.5), "circle": Circle(0.8, 0.5, 0.0)}
SETTINGS = SamplerSettings(ensembles=2, min_ess=400, max_r_hat=1.03)


def problem_of(family, truth, noise=1.0):
    measured = CELL.measure(swept(TRUTHS[truth], step=0.15), rng=4)
    rig = Rig(load_cell=CELL, unknown=only(noise_scale=stats.lognorm(s=0.1, scale=noise)))
    return contour_problem(Experiment(measured, rig, Family(family, **NARROW[family])))


@pytest.mark.slow
@pytest.mark.parametrize("family", ["parabola", "circle"])
def test_evidence_is_the_mean_likelihood_over_the_prior(family):
    """Of 20,000 draws from the widest prior, weighed for the others; within 4 standard errors."""
    model = (problem := problem_of(family, family)).model
    found = contour_evidence(model, sampled(problem, seed=1, settings=SETTINGS), np.random.default_rng(1))
    rng, count = np.random.default_rng(2), 20_000
    size = "a" if family == "parabola" else "r"
    priors = {width: stats.lognorm(s=0.02 * width, scale=model.priors[size].median()) for width in WIDTHS}
    widest = {**model.priors, size: priors[2.0]}
    points = np.stack([widest[name].rvs(count, random_state=rng) for name in model.names], axis=1)
    likelihood = model.likelihood.score(*model.loads_and_discrepancy(points)[:2], model.noise_scale(points))
    for log_evidence, prior in zip(found.log_evidence, priors.values(), strict=True):
        logs = likelihood + prior.logpdf(points[:, 0]) - priors[2.0].logpdf(points[:, 0])
        weights = np.exp(logs - logs.max())
        error = np.std(weights) / np.mean(weights) / np.sqrt(count)
        assert error < 0.15
        assert found.standard_error < 0.05
        assert found.overlap > 0.5
        direct = logs.max() + np.log(weights.mean())
        assert abs(log_evidence - direct) < 4.0 * np.hypot(error, found.standard_error)

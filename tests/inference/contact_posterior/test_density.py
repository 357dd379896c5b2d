"""The density of single contacts and its prior, against sums over all contacts that know nothing of sheets."""

import numpy as np
import pytest
from scipy import stats

from helpers.contact_posteriors import (
    CELL,
    EXACT_ANGLE,
    SI_CELL,
    Sample,
    density_of,
    measured,
    posterior,
    posterior_at_exact_angle,
    weighed_moments,
)
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP

CELLS = {"plain": CELL, "turning": CELL, "SI": SI_CELL, "exact angle": EXACT_ANGLE}

# The first loaded sample of a sweep, in tip contact, in between, in tangential contact, and the last before snap-off.
SAMPLES = {
    "plain": [16, 17, 18, 19, 21, 24, 39, 61, 62, 96, 98, 99, 101, 119, 140, 141],
    "turning": [17, 19, 20, 22, 40, 61, 62, 95, 97, 98, 100, 118, 140, 141],
    "SI": [17, 19, 20, 22, 40, 62, 63, 97, 99, 100, 102, 120, 141, 142],
    "exact angle": [17, 18, 19, 20, 22, 25, 40, 61, 62, 96, 97, 98, 99, 101, 104, 119, 140, 141],
}


def assert_agrees(density, exact):
    """Within 4 standard errors of proposals and sum together; shares of a phase no nearer than a draw can tell."""
    (found,), weights = weighed_moments(density)
    draws = float(weights.effective_draws[0])
    error = np.sqrt(exact.spread**2 / draws + exact.error**2 + np.append(np.full(9, 1e-12), 1.0 / draws) ** 2)
    np.testing.assert_array_less(np.abs(found - exact.numbers) / error, 4.0)
    return weights


# Ten numbers a sample, normal errors: false alarm 6e-4 a sample.
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "i"), [(kind, i) for kind, numbers in SAMPLES.items() for i in numbers])
def test_the_posterior_is_that_of_a_sum_over_all_contacts(kind, i):
    sample = Sample(measured(kind), i, CELLS[kind])
    exact = posterior_at_exact_angle(sample, cells=300) if kind == "exact angle" else posterior(sample, cells=44)
    assert assert_agrees(density_of(measured(kind), CELLS[kind], i), exact).certified.all()


@pytest.mark.slow
def test_with_friction_too():
    exact = posterior(Sample(measured(), 141, CELL, 0.3))
    assert_agrees(density_of(measured(), CELL, 141, friction=0.3), exact)


def random_coordinates(rng, count):
    """Force, ψ1, arc length and drive angle on both sheets, and the phases."""
    phase = rng.choice([TIP, TANGENTIAL], count).astype(np.int8)
    tip = phase == TIP
    psi1 = np.where(tip, rng.uniform(0.05, 1.2, count), 0.0)
    arclength = np.where(tip, 1.0, rng.uniform(0.4, 0.95, count))
    return np.stack([rng.uniform(0.2, 2.0, count), psi1, arclength, rng.uniform(1.2, 2.2, count)], -1), phase


@pytest.mark.parametrize("i", [21, 101])
def test_the_density_is_likelihood_times_prior_times_volume(i):
    """The volume from differences of contact points, which have half of the digits."""
    rng, record = np.random.default_rng(4), measured()
    density, sample = density_of(record, CELL, i), Sample(record, i, CELL)
    z, phase = random_coordinates(rng, 200)
    logs, places = density.log_density(z[:, None], phase[:, None])[:, 0], density.contacts(z[:, None])[:3, :, 0].T
    expected, phases = sample.log_likelihood(places)
    use = np.isfinite(logs) & (logs > -1e4)
    assert use.sum() > 40
    assert {TIP, TANGENTIAL} <= set(phases[use])
    assert (phases[use] == phase[use]).all()
    columns = []
    for step in range(4):
        moved = (density.contacts((z + move * np.eye(4)[step])[:, None]) for move in (1e-6, -1e-6))
        ahead, behind = (each[:3, :, 0].T for each in moved)
        columns.append((ahead - behind) / 2e-6)
    slopes = np.stack(columns, axis=-1)
    free = np.where((phase == TIP)[:, None], [[0, 1, 3]], [[0, 2, 3]])
    volume = np.abs(np.linalg.det(np.take_along_axis(slopes, free[:, None, :], axis=2)))
    np.testing.assert_allclose(logs[use], (expected + np.log(volume))[use], rtol=0.0, atol=2e-5)


def test_what_no_rod_can_do_has_no_density():
    density = density_of(measured(), CELL, 21)
    z = np.array([[0.5, 0.3, 1.0, 1.5]] * 6)
    phase = np.array([TIP] * 6, dtype=np.int8)
    z[1, 0] = -0.1  # it pulls
    z[2, 1] = -0.1  # beyond the tangent
    z[3, 1] = 1.6  # pushed back along itself
    z[4, 2] = 1.1  # beyond the tip
    z[5, 3] = 3.4  # on a slope that looks down
    assert np.isfinite(density.log_density(z[:, None], phase[:, None])[:, 0]).tolist() == [True] + [False] * 5


@pytest.mark.slow
@pytest.mark.parametrize("i", [16, 101])
def test_polar_is_flat_over_distance(i):
    exact = posterior(Sample(measured(), i, CELL), log_prior=lambda x, y, slope: -0.5 * np.log(x**2 + y**2))
    assert_agrees(density_of(measured(), CELL, i, prior="polar"), exact)


@pytest.mark.parametrize(("kind", "i"), [pytest.param("plain", 21, marks=pytest.mark.slow), ("SI", 102)])
def test_a_prior_of_ones_own_is_in_the_record_s_units_and_axes(kind, i):
    record, cell = measured(kind), CELLS[kind]
    about = posterior(Sample(record, i, cell), cells=16)
    middle = about.mean + about.sd

    def prior(x, y, slope):
        return stats.norm.logpdf(x, middle[0], about.sd[0]) + stats.norm.logpdf(slope, middle[2], 2.0 * about.sd[2])

    exact = posterior(Sample(record, i, cell), log_prior=prior, cells=16)
    assert_agrees(density_of(record, cell, i, prior=prior), exact)


@pytest.mark.parametrize(
    ("prior", "named"),
    [
        ("round", ["prior", "'round'"]),
        (lambda x, y, slope: 0.0, ["prior", "shape"]),
        (lambda x, y, slope: x[0], ["prior", "shape"]),
    ],
)
def test_a_prior_that_is_none_is_refused(prior, named):
    with refused(ParameterError, *named):
        weighed_moments(density_of(measured(), CELL, [21, 61], prior=prior))

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
    posterior_by_roots,
    weighed_moments,
)
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.elastica import wrench_from_contact
from tactile_bayes.mechanics.phases import NONE, TANGENTIAL, TIP

CELLS = {"plain": CELL, "turning": CELL, "SI": SI_CELL, "exact angle": EXACT_ANGLE}

# The first loaded sample of a sweep, in tip contact, in between, in tangential contact, and the last before snap-off.
FEW = {"plain": [21, 99], "turning": [100], "SI": [102], "exact angle": [61]}
MORE = {
    "plain": [16, 17, 18, 19, 24, 39, 61, 62, 96, 98, 101, 119, 140, 141],
    "turning": [17, 19, 20, 22, 40, 61, 62, 95, 97, 98, 118, 140, 141],
    "SI": [17, 19, 20, 22, 40, 62, 63, 97, 99, 100, 120, 141, 142],
    "exact angle": [17, 18, 19, 20, 22, 25, 40, 62, 96, 97, 98, 99, 101, 104, 119, 140, 141],
}


def listed(samples):
    return [(kind, i) for kind, numbers in samples.items() for i in numbers]


def agree(found, weights, exact):
    """Within 4 standard errors of proposals and sum together; shares of a phase no nearer than a draw can tell."""
    draws = float(weights.effective_draws[0])
    error = np.sqrt(exact.spread**2 / draws + exact.error**2 + np.append(np.full(9, 1e-12), 1.0 / draws) ** 2)
    np.testing.assert_array_less(np.abs(found - exact.numbers) / error, 4.0)


def compare(kind, i, **sum_options):
    record, cell = measured(kind), CELLS[kind]
    sample = Sample(record, i, cell)
    exact = (posterior_at_exact_angle if kind == "exact angle" else posterior)(sample, **sum_options)
    (found,), weights = weighed_moments(density_of(record, cell, i))
    assert weights.certified.all()
    agree(found, weights, exact)


# Ten numbers a sample, normal errors: false alarm 6e-4 a sample.
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "i"), listed(FEW))
def test_the_posterior_is_that_of_a_sum_over_all_contacts(kind, i):
    compare(kind, i)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "i"), listed(FEW) + listed(MORE))
def test_every_posterior_is_that_of_a_fine_sum(kind, i):
    compare(kind, i, cells=300 if kind == "exact angle" else 44)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.3])
@pytest.mark.parametrize("i", [141])
def test_with_friction_too(friction, i):
    exact = posterior(Sample(measured(), i, CELL, friction))
    (found,), weights = weighed_moments(density_of(measured(), CELL, i, friction=friction))
    agree(found, weights, exact)


@pytest.mark.slow
@pytest.mark.parametrize("i", [39])
def test_two_sums_over_contacts_of_a_known_drive_angle_are_one(i):
    """One turns contacts until the drive angle is right, one looks for slopes: 5 standard errors of both."""
    sample = Sample(measured("exact angle"), i, EXACT_ANGLE)
    one, other = posterior_at_exact_angle(sample), posterior_by_roots(sample, cells=30)
    error = np.hypot(np.hypot(one.error, other.error), 1e-4 * one.spread + 1e-12)
    np.testing.assert_array_less(np.abs(one.numbers - other.numbers) / error, 5.0)


@pytest.mark.slow
@pytest.mark.parametrize("i", [20, 61])
def test_an_exact_drive_angle_is_the_limit_of_a_nearly_exact_one(i):
    """Of encoder errors that move the contact by a hundredth of its standard deviation: within 4 standard errors."""
    record = measured("exact angle")
    nearly = LoadCell(force_noise=0.05, moment_noise=0.02, drive_angle_noise=1e-5)
    (found,), weights = weighed_moments(density_of(record, EXACT_ANGLE, i))
    (limit,), others = weighed_moments(density_of(record, nearly, i), seed=2)
    spread = posterior_at_exact_angle(Sample(record, i, EXACT_ANGLE)).spread
    draws = 1.0 / (1.0 / weights.effective_draws + 1.0 / others.effective_draws)
    np.testing.assert_array_less(np.abs(found - limit), 4.0 * spread / np.sqrt(draws) + 1e-9)


# --- The density by itself --------------------------------------------------------------------------------------


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
    found = density.at(z[:, None, :], phase[:, None])
    logs, places = found.log_density[:, 0], density.to_lab_frame(found.contact)[:3, :, 0].T
    expected, phases = sample.log_likelihood(places)
    use = np.isfinite(logs) & (logs > -1e4)
    assert use.sum() > 40
    assert {TIP, TANGENTIAL} <= set(phases[use])
    assert (phases[use] == phase[use]).all()
    columns = []
    for step in range(4):
        moved = [z + sign * 1e-6 * np.eye(4)[step] for sign in (1.0, -1.0)]
        ahead, behind = (
            density.to_lab_frame(density.at(m[:, None, :], phase[:, None]).contact)[:3, :, 0].T for m in moved
        )
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
    assert np.isfinite(density.at(z[:, None], phase[:, None]).log_density[:, 0]).tolist() == [True] + [False] * 5


def test_a_part_of_the_samples_has_the_same_density():
    rng = np.random.default_rng(5)
    which = np.array([21, 61, 101])
    density = density_of(measured("turning"), CELL, which)
    z, phase = random_coordinates(rng, 12)
    z, phase = z.reshape(4, 3, 4), phase.reshape(4, 3)
    whole = density.at(z, phase).log_density
    for k in range(3):
        part = density.take(np.array([k])).at(z[:, [k]], phase[:, [k]]).log_density
        np.testing.assert_allclose(part[:, 0], whole[:, k], rtol=1e-13)


# --- The prior --------------------------------------------------------------------------------------------------


def reach_by_chance(rng, count):
    """Contacts that are uniform in place and slope among those that a rod can make forward, and their phases."""
    points = rng.uniform([-1.0, -1.0, -0.5 * np.pi], [1.0, 1.0, 0.5 * np.pi], (count, 3))
    wrench = wrench_from_contact(*points.T)
    there = (wrench.phase != NONE) & (wrench.holding_moment >= 0.0)
    return points[there], wrench.phase[there], wrench.drive_angle[there]


@pytest.mark.slow
def test_nothing_measured_leaves_the_flat_prior():
    """Noise beyond all loads: what is left is the prior where the encoder says that the rod is, in shares and means.

    Near the pivot the rod presses as hard as one likes: contacts nearer than a tenth of its length, of forces beyond
    400, are left out on both sides. Four standard errors of both.
    """
    vague = LoadCell(force_noise=1e5, moment_noise=1e5, drive_angle_noise=0.3)
    record, i = measured("plain"), 39
    density = density_of(record, vague, i)
    rng = np.random.default_rng(7)
    points, phase, angle = reach_by_chance(rng, 400_000)
    # On the sheets: uniform in coordinates, with the density of the prior as weight.
    count = 400_000
    z = np.empty((count, 1, 4))
    kinds = rng.choice([TIP, TANGENTIAL], count).astype(np.int8)
    tip = kinds == TIP
    log_force = rng.uniform(np.log(1e-6), np.log(1e3), count)
    z[:, 0, 0] = np.exp(log_force)
    z[:, 0, 1] = np.where(tip, rng.uniform(0.0, 0.5 * np.pi, count), 0.0)
    z[:, 0, 2] = np.where(tip, 1.0, rng.uniform(0.0, 1.0, count))
    z[:, 0, 3] = record.drive_angle.values[i] + 0.3 * rng.standard_normal(count)
    found = density.at(z, kinds[:, None])
    logs = found.log_density[:, 0] - stats.norm.logpdf(z[:, 0, 3], record.drive_angle.values[i], 0.3) + log_force
    places = found.contact[:3, :, 0].T
    weight = np.exp(logs - logs[np.isfinite(logs)].max())
    weight[~np.isfinite(weight)] = 0.0
    weight *= np.where(tip, 0.5 * np.pi, 1.0)
    far = np.hypot(places[:, 0], places[:, 1]) > 0.1
    weight[~far] = 0.0
    chance = stats.norm.pdf(angle, record.drive_angle.values[i], 0.3) * (np.hypot(*points.T[:2]) > 0.1)
    for value, other in (
        (tip, phase == TIP),
        (places[:, 0], points[:, 0]),
        (places[:, 1], points[:, 1]),
        (places[:, 2], points[:, 2]),
    ):
        value = np.where(weight > 0.0, value, 0.0)
        mean, expected = np.average(value, weights=weight), np.average(other, weights=chance)
        error = np.hypot(
            np.sqrt(weight**2 @ (value - mean) ** 2) / weight.sum(),
            np.sqrt(chance**2 @ (other - expected) ** 2) / chance.sum(),
        )
        assert abs(mean - expected) < 4.0 * error


@pytest.mark.slow
@pytest.mark.parametrize("i", [16, 101])
def test_polar_is_flat_over_distance(i):
    exact = posterior(Sample(measured(), i, CELL), log_prior=lambda x, y, slope: -0.5 * np.log(x**2 + y**2))
    (found,), weights = weighed_moments(density_of(measured(), CELL, i, prior="polar"))
    agree(found, weights, exact)


@pytest.mark.parametrize(("kind", "i"), [pytest.param("plain", 21, marks=pytest.mark.slow), ("SI", 102)])
def test_a_prior_of_ones_own_is_in_the_record_s_units_and_axes(kind, i):
    record, cell = measured(kind), CELLS[kind]
    about = posterior(Sample(record, i, cell), cells=16)
    middle = about.mean + about.sd

    def prior(x, y, slope):
        return stats.norm.logpdf(x, middle[0], about.sd[0]) + stats.norm.logpdf(slope, middle[2], 2.0 * about.sd[2])

    exact = posterior(Sample(record, i, cell), log_prior=prior, cells=16)
    (found,), weights = weighed_moments(density_of(record, cell, i, prior=prior))
    agree(found, weights, exact)


def test_an_unknown_prior_is_refused():
    with refused(ParameterError, prior="round"):
        density_of(measured(), CELL, 21, prior="round")


@pytest.mark.parametrize("prior", [lambda x, y, slope: 0.0, lambda x, y, slope: x[0]])
def test_a_prior_of_the_wrong_shape_is_refused(prior):
    with refused(ParameterError, "prior", "shape"):
        weighed_moments(density_of(measured(), CELL, [21, 61], prior=prior))

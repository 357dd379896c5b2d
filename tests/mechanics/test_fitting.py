"""The most likely contact against a search of its own: both phases and the edge, through `wrench_from_contact`."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.special import ellipkinc

from tactile_bayes.mechanics.contacts.contact_coordinates import ARCLENGTH, FORCE, PSI1, contact_states
from tactile_bayes.mechanics.contacts.fits import ContactFit, Reading
from tactile_bayes.mechanics.elastica import tangential_arclength, wrench_from_contact
from tactile_bayes.mechanics.fitting import fit_contacts, fit_sheet
from tactile_bayes.mechanics.phases import TANGENTIAL, TIP

NOISES = (0.005, 0.02, 0.06, 0.3)  # standard deviations of the forces; of the moment 0.4 times as much


class Case(NamedTuple):
    reading: Reading
    delta: np.ndarray
    true: np.ndarray  # coordinates

    def take(self, where):
        return Case(self.reading.take(where), self.delta[where], self.true[where])


def fit(case: Case) -> ContactFit:
    return fit_contacts(case.reading, case.delta)


def misfit_of(z, case: Case):
    """Sums of squares of contacts with the coordinates z."""
    turned = z[:, 3] - case.reading.drive_angle
    off = contact_states(z, case.delta).loads.T - case.reading.loads - case.reading.leaning * turned[:, None]
    misfit = (off * np.linalg.solve(case.reading.covariance, off[..., None])[..., 0]).sum(axis=1)
    if np.any(case.reading.angle_deviation):
        return misfit + (turned / case.reading.angle_deviation) ** 2
    np.testing.assert_array_equal(turned, 0.0)
    return misfit


def some_coordinates(count, rng, delta):
    """Contacts of both phases, a third of them close to the edge; the contour's slope is between −1 and 1."""
    tip = rng.random(count) < 0.5
    near = rng.random(count) < 0.33
    psi1 = np.where(tip, -delta + np.where(near, 0.1, 1.2) * rng.random(count), -delta)
    arclength = np.where(tip, 1.0, 1.0 - np.where(near, 0.05, 0.8) * rng.random(count))
    chi = rng.uniform(0.4, 2.9, count)
    force = (ellipkinc(chi, 0.5 * (1.0 - np.sin(psi1))) / arclength) ** 2
    z = np.stack([force, psi1, arclength, np.zeros(count)], axis=-1)
    z[:, 3] = rng.uniform(-1.0, 1.0, count) - contact_states(z, delta).place[2]
    return z


def some_case(count, *, seed, noises=NOISES, encoder=False, correlated=False, friction=False) -> Case:
    rng = np.random.default_rng(seed)
    delta = rng.uniform(0.05, 0.6, count) if friction else np.zeros(count)
    z = some_coordinates(count, rng, delta)
    spread = rng.choice(noises, count)[:, None] * np.array([0.4, 1.0, 1.0])
    between = np.eye(3)
    if correlated:
        between[[0, 0, 1], [1, 2, 2]] = between[[1, 2, 2], [0, 0, 1]] = (0.6, -0.3, 0.4)
    covariance = spread[:, :, None] * between * spread[:, None, :]
    sigma = rng.choice([0.003, 0.02], count) if encoder else np.zeros(count)
    leaning = rng.normal(0.0, 2.0, (count, 3)) if encoder and correlated else np.zeros((count, 3))
    off = sigma * rng.standard_normal(count)
    noise = (np.linalg.cholesky(covariance) @ rng.standard_normal((count, 3, 1)))[..., 0]
    loads = contact_states(z, delta).loads.T + leaning * off[:, None] + noise
    return Case(Reading(z[:, 3] + off, loads, sigma, leaning, covariance), delta, z)


# --- A search of its own ------------------------------------------------------------------------------------------


class Reference:
    """One sample's sum of squares over contacts at polar angle ϑ of a contour without slope, turned to fit the drive. A
    contact is told by ϑ and how it touches: tangentially at arc length s ≤ 1; or with the tip, at a distance r that has
    √(1 − r²) = t times what it is where the phases meet, t ≤ 1. With a noisy encoder the drive angle is the third."""

    def __init__(self, case: Case, k: int) -> None:
        reading = case.reading
        self.delta = float(case.delta[k])
        self.given = np.concatenate([[reading.drive_angle[k]], reading.loads[k]])
        self.sigma = float(reading.angle_deviation[k])
        lean = np.concatenate([[1.0], reading.leaning[k]])
        covariance = self.sigma**2 * np.outer(lean, lean)
        covariance[1:, 1:] += reading.covariance[k]
        self.root = np.linalg.cholesky(covariance if self.sigma else covariance[1:, 1:])
        self.widest = 0.5 * np.pi + self.delta

    def contact(self, phase, theta, how):
        """Distance and wrench of a contact."""
        edge = 1.0 / tangential_arclength(np.cos(theta), np.sin(theta), 0.0, self.delta)
        r = how * edge if phase == TANGENTIAL else np.sqrt(1.0 - how**2 * (1.0 - edge**2))
        return r, wrench_from_contact(r * np.cos(theta), r * np.sin(theta), 0.0, self.delta, phase=phase)

    def misses(self, phase, theta, how, angle):
        """Deviations in standard deviations, shape (3 or 4, n)."""
        _, w = self.contact(phase, theta, how)
        turn = angle - w.drive_angle
        fx = np.cos(turn) * w.force_x - np.sin(turn) * w.force_y
        fy = np.sin(turn) * w.force_x + np.cos(turn) * w.force_y
        rows = [w.holding_moment - self.given[1], fx - self.given[2], fy - self.given[3]]
        if self.sigma:
            rows.insert(0, angle - self.given[0] + 0.0 * theta)
        return np.linalg.solve(self.root, np.stack(rows))

    def best(self, starts=1):
        """The smallest sum of squares, with place."""
        found = [self._descend(phase, edge, starts) for phase, edge in ((TIP, 0), (TANGENTIAL, 0), (TANGENTIAL, 1))]
        return min(found, key=lambda pair: pair[0])

    def _descend(self, phase, edge, starts):
        theta = np.linspace(0.02, self.widest - 0.02, 20)
        how = np.ones(1) if edge else np.linspace(0.04, 0.999, 16)
        grid = np.stack([g.ravel() for g in np.meshgrid(theta, how, indexing="ij")])
        sums = np.nan_to_num((self.misses(phase, *grid, self.given[0]) ** 2).sum(axis=0), nan=np.inf)
        # A little beyond the edge for the sake of the slopes there; the edge itself has a descent of its own.
        free = [0] if edge else [0, 1]
        low, high = np.array([1e-6, 1e-6])[free], np.array([self.widest - 1e-6, 1.0 + 1e-6])[free]
        if self.sigma:
            low, high = np.append(low, -np.inf), np.append(high, np.inf)

        def all_of(values):
            """ϑ, how it touches, and drive angle, from columns of what is free."""
            how = np.ones_like(values[0]) if edge else values[1]
            return values[0], how, values[-1] if self.sigma else self.given[0]

        def miss(values):
            return self.misses(phase, *all_of(values[:, None]))[:, 0]

        def slopes(values):
            steps = 1e-7 * np.eye(values.size)
            ends = self.misses(phase, *all_of(values[:, None] + np.hstack([steps, -steps])))
            return (ends[:, : values.size] - ends[:, values.size :]) / 2e-7

        best = np.inf, None
        for start in grid[:, np.argsort(sums)[:starts]].T:
            first = start[free]
            if self.sigma:
                first = np.append(first, self.given[0])
            result = least_squares(miss, first, slopes, (low, high), xtol=1e-11, ftol=1e-12, gtol=1e-10)
            within = edge or result.x[1] <= 1.0
            if within and 2.0 * result.cost < best[0]:
                best = 2.0 * result.cost, self._place(phase, edge, result.x)
        return best

    def _place(self, phase, edge, values):
        theta, how = (values[0], 1.0) if edge else values[:2]
        angle = values[-1] if self.sigma else self.given[0]
        r, w = self.contact(phase, theta, how)
        turn = angle - float(w.drive_angle)
        return np.array([r * np.cos(theta + turn), r * np.sin(theta + turn), turn, float(w.contact_arclength)])


KINDS = {
    "exact drive": {},
    "encoder": {"encoder": True},
    "correlated, friction": {"correlated": True, "friction": True},
    "encoder, correlated, friction": {"encoder": True, "correlated": True, "friction": True},
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_other_contact_is_more_likely(kind):
    case = some_case(50, seed=6, **KINDS[kind])
    found = fit(case)
    place = contact_states(found.coordinates, case.delta).place.T
    for k in range(case.delta.size):
        least, right = Reference(case, k).best(starts=3)
        assert found.misfit[k] <= least + 1e-6 * (1.0 + least), k
        np.testing.assert_allclose(place[k], right, rtol=0.0, atol=1e-5)


# --- What is known of the best contact ----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_told_of_a_contact_is_true_of_it(kind):
    """Its misfit is that of its loads; it lies on a sheet, and only at the edge on both."""
    case = some_case(2000, seed=7, **KINDS[kind])
    found = fit(case)
    z, tip = found.coordinates, found.phase == TIP
    assert np.isfinite(z).all()
    np.testing.assert_allclose(found.misfit, misfit_of(z, case), rtol=1e-9, atol=1e-9)
    assert set(found.phase) == {TIP, TANGENTIAL}
    assert (z[tip, ARCLENGTH] == 1.0).all()
    assert (z[tip, PSI1] >= -case.delta[tip]).all()
    assert (z[~tip, PSI1] == -case.delta[~tip]).all()
    assert (z[~tip, ARCLENGTH] <= 1.0).all()
    assert (z[:, FORCE] > 0.0).all()
    edge = found.at_edge
    assert 0 < edge.sum() < 0.2 * edge.size
    np.testing.assert_array_equal(z[edge, ARCLENGTH], 1.0)
    np.testing.assert_array_equal(z[edge, PSI1], -case.delta[edge])
    np.testing.assert_array_equal(found.clearance[edge], 0.0)
    assert (found.clearance[~edge] >= 0.0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_the_truth_is_never_more_likely(kind):
    case = some_case(2000, seed=8, **KINDS[kind])
    assert (fit(case).misfit <= misfit_of(case.true, case) * (1.0 + 1e-9) + 1e-9).all()


@pytest.mark.parametrize("encoder", [False, True])
def test_exact_data_come_back(encoder):
    case = some_case(500, seed=9, encoder=encoder, friction=True)
    exact = case.reading._replace(drive_angle=case.true[:, 3], loads=contact_states(case.true, case.delta).loads.T)
    found = fit_contacts(exact, case.delta)
    assert (found.misfit < 1e-16).all()
    place = contact_states(found.coordinates, case.delta).place
    np.testing.assert_allclose(place, contact_states(case.true, case.delta).place, rtol=0.0, atol=1e-8)
    assert not found.at_edge.any()
    np.testing.assert_array_equal(found.phase == TIP, case.true[:, ARCLENGTH] == 1.0)


def test_the_edge_is_found_where_the_sheets_meet():
    """Data pushed away from both sheets come back to the edge: noise along what both leave out."""
    case = some_case(200, seed=10, noises=(0.02,))
    case.true[:, PSI1], case.true[:, ARCLENGTH] = 0.0, 1.0
    reading = case.reading._replace(drive_angle=case.true[:, 3])
    loads = contact_states(case.true, case.delta).loads.T
    ways = []
    for phase in (TIP, TANGENTIAL):
        tiny = case.true + np.where(np.arange(4) == (PSI1 if phase == TIP else ARCLENGTH), 1e-6, 0.0)
        way = (contact_states(tiny, case.delta).loads.T - loads) / 1e-6
        ways.append(way / np.linalg.norm(way, axis=1, keepdims=True) * (1.0 if phase == TIP else -1.0))
    against = reading._replace(loads=loads - 1e-3 * (ways[0] + ways[1]))
    found = fit_contacts(against, case.delta)
    edge = fit_sheet(against, case.delta, None)
    within = found.at_edge
    np.testing.assert_allclose(found.misfit[within], edge.misfit[within], rtol=1e-9)
    assert (found.misfit <= edge.misfit * (1.0 + 1e-9)).all()


# --- Samples do not know of one another ---------------------------------------------------------------------------


def assert_same(found, other, tolerance):
    np.testing.assert_array_equal(found.phase, other.phase)
    np.testing.assert_array_equal(found.at_edge, other.at_edge)
    for name in ("coordinates", "misfit", "covariance"):
        one, two = getattr(found, name), getattr(other, name)
        np.testing.assert_allclose(one, two, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("kind", KINDS)
def test_order_and_company_do_not_matter(kind):
    case = some_case(300, seed=11, **KINDS[kind])
    whole = fit(case)
    order = np.random.default_rng(1).permutation(300)
    shuffled = fit(case.take(order))
    assert_same(ContactFit(*(column[order] for column in whole)), shuffled, 1e-9)
    for k in (0, 17, 123):
        assert_same(ContactFit(*(column[[k]] for column in whole)), fit(case.take([k])), 1e-9)


def test_blocks_do_not_matter():
    case = some_case(100, seed=12)
    many = fit(case.take(np.tile(np.arange(100), 50)))
    assert_same(ContactFit(*(column[4900:] for column in many)), fit(case), 1e-9)


def test_there_may_be_no_samples():
    none = fit(some_case(5, seed=13).take(slice(0)))
    assert none.coordinates.shape == (0, 4)
    assert none.misfit.shape == (0,)


def test_samples_that_are_no_numbers_do_not_disturb_the_others():
    case = some_case(60, seed=14)
    loads = case.reading.loads.copy()
    loads[::10, 1] = np.nan
    bad = case.reading._replace(loads=loads)
    found = fit_contacts(bad, case.delta)
    wrong = np.arange(60) % 10 == 0
    assert np.isinf(found.misfit[wrong]).all()
    assert_same(*(ContactFit(*(column[~wrong] for column in one)) for one in (found, fit(case))), 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("push", [(3.0, 0.0, 0.0), (-3.0, 0.0, 0.0), (0.0, 5.0, 0.0), (0.0, 0.0, -4.0)])
def test_samples_far_off_any_contact_have_the_nearest(push):
    case = some_case(6, seed=15, noises=(0.02,))
    far = case._replace(reading=case.reading._replace(loads=case.reading.loads + push))
    found = fit(far)
    settled = np.isfinite(found.misfit)
    for k in np.flatnonzero(settled):
        least, _ = Reference(far, k).best(2)
        assert found.misfit[k] <= least * 1.01  # where the bounds of the possible are near
    assert (found.misfit > 10.0).any()


# --- Covariance and clearance -------------------------------------------------------------------------------------


def test_the_misfit_is_chi_square_far_from_the_edge_and_clearance_is_in_standard_deviations():
    """4000 small errors of one contact: standard deviations to 5 standard errors of 1.1 %."""
    rng = np.random.default_rng(16)
    for phase in (TIP, TANGENTIAL):
        psi1, arclength = (0.4, 1.0) if phase == TIP else (0.0, 0.8)
        z = np.array([[2.0, psi1, arclength, 1.3]])
        spread = 1e-4 * np.array([0.4, 1.0, 1.0])
        loads = contact_states(z).loads.T + spread * rng.standard_normal((4000, 3))
        covariance = np.broadcast_to(np.diag(spread**2), (4000, 3, 3))
        zero = np.zeros(4000)
        reading = Reading(np.full(4000, 1.3), loads, zero, np.zeros((4000, 3)), covariance)
        found = fit_contacts(reading, zero)
        assert (found.phase == phase).all()
        free = [FORCE, PSI1 if phase == TIP else ARCLENGTH]
        right = np.cov(found.coordinates[:, free].T)
        stated = found.covariance[0][np.ix_(free, free)]
        scale = np.sqrt(np.diag(stated))
        np.testing.assert_allclose(right / np.outer(scale, scale), stated / np.outer(scale, scale), atol=0.115)
        distance = psi1 if phase == TIP else 1.0 - arclength
        np.testing.assert_allclose(np.mean(found.clearance) / (distance / scale[1]), 1.0, atol=0.01)
        np.testing.assert_allclose(found.misfit.mean(), 1.0, atol=5.0 * np.sqrt(2.0 / 4000))

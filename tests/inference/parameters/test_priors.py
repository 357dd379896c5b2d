"""Priors of families that expect the same of a flank."""

import numpy as np
import pytest
from scipy import stats

from helpers.refusals import refused
from tactile_bayes.contours import Circle, Parabola
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.parameters.priors import matched_priors, mean_log_radius, widened


@pytest.mark.parametrize("name", ["parabola", "circle", "ellipse", "power-law", "parabola/ellipse", "shape-free"])
@pytest.mark.parametrize("length", [1.0, 0.08])
def test_flanks_are_expected_to_be_equally_bent(name, length):
    """By draws of its own: median and standard deviation within 4 standard errors, and 3 % for matching's draws."""
    family, rng, count = family_named(name), np.random.default_rng(3), 1000
    priors = matched_priors(name, length)
    values = {n: prior.rvs(count, random_state=rng) for n, prior in priors.items()}
    values = {n: np.clip(v, *family.bounds.get(n, (-np.inf, np.inf))) for n, v in values.items()}
    contours = family.build(*(values.get(n, np.zeros(count)) for n in family.parameters))
    logs = mean_log_radius(contours) - np.log(length)
    low, median, high = np.quantile(logs, stats.norm.cdf([-1.0, 0.0, 1.0]))
    assert median == pytest.approx(np.log(0.5), abs=0.03 + 4 * 1.25 / np.sqrt(count))
    assert 0.5 * (high - low) == pytest.approx(1.0, abs=0.03 + 4 * 1.1 / np.sqrt(count))


def test_mean_radius_of_a_circle_and_a_parabola():
    assert mean_log_radius(Circle(np.array([0.3]), 0.0, 0.0))[0] == pytest.approx(np.log(0.3))
    exact = np.mean([-np.log(2.0 * 0.7) - 3.0 * np.log(np.cos(a)) for a in np.linspace(0.0, np.pi / 4.0, 4001)])
    assert mean_log_radius(Parabola(np.array([0.7]), 0.0, 0.0))[0] == pytest.approx(exact, abs=5e-3)


def test_priors_that_are_wider_have_the_same_median():
    wide = widened({"w": stats.lognorm(s=0.4, scale=2.0), "n": stats.lognorm(s=0.7, loc=1.0), "q": stats.norm()}, 2.0)
    assert wide["w"].median() == pytest.approx(2.0)
    assert np.std(np.log(wide["w"].ppf(stats.norm.cdf([-1.0, 1.0])))) == pytest.approx(0.8)
    assert wide["n"].median() == pytest.approx(2.0)
    assert wide["q"].std() == pytest.approx(1.0)


def test_there_is_no_such_family():
    with refused(ParameterError, "'square'"):
        matched_priors("square", 1.0)

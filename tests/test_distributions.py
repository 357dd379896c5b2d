from functools import partial

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from tactile_bayes.distributions import (
    KINDS,
    check_distribution,
    distribution_of_table,
    frozen,
    in_words,
    log_density_of,
    numbers_of,
    table_of_distribution,
)
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.parameters.priors import widened
from tactile_bayes.inference.point_load import infer_point_load

NAN = float("nan")


class Flat:
    """A prior of the user's own, with a log-density and draws as given."""

    def __init__(self, draw, density):
        self.draw, self.density = draw, density

    def logpdf(self, x):
        return np.full(np.shape(x), self.density)

    def rvs(self, size, random_state):
        return np.full(size, self.draw) + random_state.uniform(size=size)

    def std(self):
        return 1.0


WITHOUT_DENSITY = [
    (stats.norm(0.5, 0.0), "no width.*give the number, 0.5"),
    (stats.uniform(loc=0.0, scale=0), "no width.*give the number, 0"),
    (stats.norm(0.5, 1e-18), "no width"),
    (stats.norm(0.5, NAN), "scale nan"),
    (stats.norm(NAN, 1.0), "loc nan"),
    (stats.lognorm(NAN, scale=0.5), "s nan"),
    (stats.norm(0.5, -1.0), "numbers"),
    (stats.lognorm(-1.0, scale=0.5), "numbers"),
    (stats.norm(0.5, np.inf), "numbers"),
    (stats.norm(np.inf, 1.0), "numbers"),
    (stats.norm([0.4, 0.5], 1.0), "give a number"),
    (stats.norm(0.5, np.array("wide")), "give a number"),
    (stats.norm, "frozen"),
    (Flat(NAN, 0.0), "finite draws"),
    (Flat(0.5, NAN), "finite draws"),
    (Flat(0.5, -np.inf), "finite draws"),
]
STATING_NOTHING = [
    *({"normal": numbers} for numbers in ([0.1], [0.1, -1.0], [0.1, 0.0], 0.1)),
    *({"half_normal": [0.1, 0.2]}, {"normal": [0.0, 1.0], "uniform": [0.0, 1.0]}),
    *({"gauss": [0.0, 1.0]}, {"norm": {"mean": 0.1}}, {"beta": {"a": 1.0}}, {"kstest": {}}),
    *("wide", [0.1, 0.2], NAN, True),
]
HISTOGRAM = stats.rv_histogram((np.ones(4), np.linspace(0.3, 0.7, 5)))()
NO_WIDTH = stats.norm(0.5, 0.0)
POINTS = np.repeat([10.0, 20.0, 30.0], 4), np.repeat([1.0, 2.0, 3.0], 4), np.arange(12.0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        *((partial(check_distribution, "q", prior), f"prior of q.*{words}") for prior, words in WITHOUT_DENSITY),
        (partial(tb.Rig, unknown={"friction": NO_WIDTH}), "no width"),
        (partial(tb.Rig, unknown={"bias": NO_WIDTH}), "no width"),
        (partial(tb.Family, "parabola", q=NO_WIDTH), "no width"),
        (partial(infer_point_load, *POINTS, priors={"clamp_angle": stats.norm(0.0, 0.0)}, rng=1), "no width"),
        *((partial(distribution_of_table, table, "friction"), "friction") for table in STATING_NOTHING),
        *((partial(table_of_distribution, given), "cannot be written") for given in (Flat(0.5, 0.0), HISTOGRAM)),
    ],
)
def test_what_is_no_distribution_is_refused_by_its_parameter(call, words):
    with pytest.raises(ParameterError, match=f"(?s){words}"):
        call()


COMMON = [
    *(stats.norm(), stats.norm(0.3, 2.0), stats.norm(loc=-1.0, scale=1e-6)),
    *(stats.halfnorm(scale=0.3), stats.halfnorm(0.1, 0.5), stats.uniform(-1.0, 2.5), stats.uniform(loc=0.3)),
    *(stats.lognorm(s=0.4, scale=0.7), stats.lognorm(0.4, 0.2, 3.0)),
]
OTHERS = [
    *(stats.loguniform(1e-6, 10.0), stats.t(df=3, scale=0.2)),
    *(stats.truncnorm(-1, 1), stats.truncnorm(-1.0, np.inf, 0.1, 0.2)),
]


@pytest.mark.parametrize(
    "prior",
    [
        *(stats.norm(0.5, 1e-9), stats.norm(0.0, 1e-300), stats.cauchy(0.0, 0.1), stats.beta(0.5, 0.5)),
        *(HISTOGRAM, Flat(0.5, 0.0), *OTHERS),
    ],
    ids=lambda prior: getattr(getattr(prior, "dist", None), "name", None) or type(prior).__name__,
)
def test_any_prior_with_a_density_is_accepted(prior):
    check_distribution("q", prior)


@pytest.mark.parametrize("prior", [*COMMON, *OTHERS], ids=in_words)
def test_log_densities_are_those_of_scipy(prior):
    at = np.append(prior.rvs(60, random_state=1), [-100.0, -1e-9, 0.0, 0.3, 1.0, 1.3, 100.0])
    density = log_density_of(prior)
    np.testing.assert_allclose(density(at), prior.logpdf(at), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(density(at.reshape(1, -1)), prior.logpdf(at)[None], rtol=1e-13, atol=1e-13)


def test_common_ones_do_without_scipy_and_others_are_asked_themselves():
    assert all(log_density_of(prior) != prior.logpdf for prior in COMMON)
    several = stats.norm(np.zeros(3), 1.0)
    np.testing.assert_allclose(log_density_of(several)(np.zeros(3)), several.logpdf(np.zeros(3)), rtol=1e-13)
    np.testing.assert_array_equal(log_density_of(Flat(0.5, -1.0))(np.ones(2)), [-1.0, -1.0])


@pytest.mark.parametrize("kind", KINDS)
def test_quantiles_of_a_kind_are_those_of_scipy(kind):
    numbers = (0.3, 0.7)[: KINDS[kind].size]
    shares = np.array([1e-6, 0.01, 0.5, 0.99, 1.0 - 1e-6])
    at = KINDS[kind].at(*numbers, shares)
    np.testing.assert_allclose(at, KINDS[kind].frozen(*numbers).ppf(shares), rtol=1e-9)
    assert np.isfinite(KINDS[kind].at(*numbers, np.array([0.0, 1.0 - 2.0**-53]))).all()


@pytest.mark.parametrize(
    ("newer", "same"),
    [
        (stats.Normal(mu=0.5, sigma=0.1), stats.norm(0.5, 0.1)),
        (stats.Uniform(a=0.2, b=0.7), stats.uniform(0.2, 0.5)),
        (stats.exp(stats.Normal(mu=0.0, sigma=0.5)), stats.lognorm(s=0.5)),
        (stats.Mixture([stats.Normal(mu=0.5, sigma=0.1)], weights=[1.0]), stats.norm(0.5, 0.1)),
    ],
    ids=["normal", "uniform", "of another one", "mixture"],
)
def test_newer_distributions_of_scipy_are_taken(newer, same):
    found = frozen(newer)
    check_distribution("q", found)
    at = same.ppf([0.1, 0.5, 0.9])
    np.testing.assert_allclose(log_density_of(found)(at), same.logpdf(at), rtol=1e-9)
    draws = found.rvs(2000, random_state=np.random.default_rng(1))
    assert stats.kstest(draws, same.cdf).pvalue > 1e-4
    assert found.std() == pytest.approx(same.std())


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        (stats.norm(0.5, 0.1), stats.norm(scale=0.1, loc=0.5), "norm(0.5, 0.1)"),
        (stats.lognorm(0.6, 0, 0.9), stats.lognorm(s=0.6, scale=0.9), None),
        (stats.truncnorm(-1.0, 2.0, 0.3), stats.truncnorm(b=2.0, a=-1.0, loc=0.3), None),
    ],
    ids=["norm", "lognorm", "truncnorm"],
)
def test_numbers_and_words_do_not_depend_on_how_they_are_given(one, other, words):
    assert numbers_of(one) == numbers_of(other)
    assert list(numbers_of(one))[-2:] == ["loc", "scale"]
    assert in_words(one) == in_words(other) == (words or in_words(one))
    assert numbers_of(Flat(0.5, 0.0)) == {}


def test_a_log_normal_by_position_is_widened_like_one_by_name():
    priors = stats.lognorm(0.6, 0.1, 0.9), stats.lognorm(0.6, loc=0.1, scale=0.9)
    by_position, by_name = (widened({"a": prior}, 2.0)["a"] for prior in priors)
    assert by_position.std() == by_name.std()
    assert by_position.median() == pytest.approx(1.0)
    assert numbers_of(by_position)["s"] == 1.2


@pytest.mark.parametrize("prior", [*COMMON, *OTHERS], ids=in_words)
def test_the_table_determines_the_prior(prior):
    again = distribution_of_table(table_of_distribution(prior), "q")
    at = prior.ppf([0.1, 0.5, 0.9])
    np.testing.assert_array_equal(again.ppf([0.1, 0.5, 0.9]), at)
    assert in_words(again) == in_words(prior)


STATED = {
    "a number": (0.3, None),
    "normal": ({"normal": [0.1, 0.2]}, stats.norm(0.1, 0.2)),
    "uniform": ({"uniform": [0.1, 0.4]}, stats.uniform(0.1, 0.4 - 0.1)),
    "log-uniform": ({"log_uniform": [1e-3, 2.0]}, stats.loguniform(1e-3, 2.0)),
    "log-normal": ({"log_normal": [0.7, 0.5]}, stats.lognorm(s=0.5, scale=0.7)),
    "half-normal": ({"half_normal": 0.3}, stats.halfnorm(scale=0.3)),
    "of scipy": ({"truncnorm": {"a": -1.0, "b": 2.0, "loc": 0.5}}, stats.truncnorm(-1.0, 2.0, loc=0.5)),
}


@pytest.mark.parametrize(("table", "expected"), STATED.values(), ids=STATED)
def test_a_table_states_a_number_or_a_distribution_and_is_written_as_it_was(table, expected):
    found = distribution_of_table(table, "friction")
    if expected is None:
        assert found == table
    else:
        shares = [0.05, 0.5, 0.95]
        np.testing.assert_allclose(found.ppf(shares), expected.ppf(shares), rtol=1e-14)
    assert table_of_distribution(found) == table

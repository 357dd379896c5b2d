import numpy as np
import pytest
from scipy import stats

from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.parameters.prior_text import is_prior_in_words, prior_in_words, prior_of_words

PRIORS = [
    stats.norm(),
    stats.norm(loc=0.5),
    stats.uniform(0.4, scale=0.2),
    stats.halfnorm(scale=0.3),
    stats.lognorm(0.5, scale=0.7),
    stats.lognorm(s=0.5, loc=1.0, scale=0.7),
    stats.truncnorm(-1.0, np.inf, 0.1, 0.2),
    stats.loguniform(1e-6, 10.0),
]


@pytest.mark.parametrize("prior", PRIORS, ids=prior_in_words)
def test_the_text_determines_the_prior(prior):
    words = prior_in_words(prior)
    again = prior_of_words("q", words)
    at = prior.ppf([0.1, 0.5, 0.9])
    np.testing.assert_allclose(again.logpdf(at), prior.logpdf(at))
    assert prior_in_words(again) == words


def test_the_text_does_not_depend_on_how_numbers_are_given():
    assert prior_in_words(stats.norm(0.5, 0.1)) == prior_in_words(stats.norm(scale=0.1, loc=0.5)) == "norm(0.5, 0.1)"
    assert prior_in_words(stats.lognorm(0.6, 0, 0.9)) == prior_in_words(stats.lognorm(scale=0.9, s=0.6))


@pytest.mark.parametrize("words", ["halfnorm(scale=0.3)", "halfnorm(0, 0.3)", "halfnorm(loc=0, scale=0.3)"])
def test_texts_of_older_results_are_recognised(words):
    assert is_prior_in_words(stats.halfnorm(0.0, 0.3), words)
    assert not is_prior_in_words(stats.halfnorm(0.0, 0.31), words)


def test_a_histogram_is_recognised_but_not_read():
    prior = stats.rv_histogram((np.ones(4), np.linspace(0.3, 0.7, 5)))()
    words = prior_in_words(prior)
    assert is_prior_in_words(prior, words)
    assert not is_prior_in_words(stats.norm(), words)
    with pytest.raises(InferenceError, match="give priors="):
        prior_of_words("q", words)

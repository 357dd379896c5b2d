import numpy as np
import pytest
from scipy import stats

from tactile_bayes import (
    LoadCell,
    Stream,
    calibrate,
    compare_families,
    infer_contour,
    infer_point_load,
    scan,
    sensitivity,
)
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.parameters.matched_priors import widened
from tactile_bayes.inference.parameters.priors import check_prior, numbers_of
from tactile_bayes.planning.design import design

NAN = float("nan")
CELL = LoadCell(force_noise=0.05, moment_noise=0.02)
CONTOUR = paper_profile("II", q=0.5)


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


WITHOUT_DENSITY = {
    "no width": (stats.norm(0.5, 0.0), "no width.*norm\\(0.5, 5e-07\\)"),
    "no width, by name": (stats.uniform(loc=0.0, scale=0), "no width.*norm\\(0, 1e-06\\)"),
    "no width in floating point": (stats.norm(0.5, 1e-18), "no width"),
    "scale NaN": (stats.norm(0.5, NAN), "scale nan"),
    "mean NaN": (stats.norm(NAN, 1.0), "loc nan"),
    "shape NaN": (stats.lognorm(NAN, scale=0.5), "s nan"),
    "negative scale": (stats.norm(0.5, -1.0), "numbers"),
    "impossible shape": (stats.lognorm(-1.0, scale=0.5), "numbers"),
    "infinite scale": (stats.norm(0.5, np.inf), "numbers"),
    "infinite mean": (stats.norm(np.inf, 1.0), "numbers"),
    "several": (stats.norm([0.4, 0.5], 1.0), "give a number"),
    "text": (stats.norm(0.5, np.array("wide")), "give a number"),
    "class": (stats.norm, "frozen"),
    "own, draws NaN": (Flat(NAN, 0.0), "finite draws"),
    "own, density NaN": (Flat(0.5, NAN), "finite draws"),
    "own, no density": (Flat(0.5, -np.inf), "finite draws"),
}


@pytest.mark.parametrize(("prior", "words"), WITHOUT_DENSITY.values(), ids=WITHOUT_DENSITY)
def test_a_prior_without_density_is_refused_by_its_parameter(prior, words):
    with pytest.raises(ParameterError, match=f"(?s)prior of q.*{words}"):
        check_prior("q", prior)


@pytest.mark.parametrize(
    "prior",
    [
        stats.norm(0.5, 1e-9),
        stats.norm(0.0, 1e-300),
        stats.cauchy(0.0, 0.1),
        stats.beta(0.5, 0.5),
        stats.truncnorm(-1.0, np.inf, loc=0.1, scale=0.2),
        stats.loguniform(1e-6, 10.0),
        stats.rv_histogram((np.ones(4), np.linspace(0.3, 0.7, 5)))(),
        Flat(0.5, 0.0),
    ],
    ids=lambda prior: getattr(getattr(prior, "dist", None), "name", None) or type(prior).__name__,
)
def test_any_prior_with_a_density_is_accepted(prior):
    check_prior("q", prior)


NO_WIDTH = {"q": stats.norm(0.5, 0.0)}
POINTS = np.repeat([10.0, 20.0, 30.0], 4)
ASKED = {
    "infer_contour": lambda: infer_contour(CELL.measure(scan(CONTOUR).record, seed=1), priors=NO_WIDTH, seed=1),
    "Stream": lambda: Stream(priors=NO_WIDTH, seed=1),
    "compare_families": lambda: compare_families(
        CELL.measure(scan(CONTOUR).record, seed=1),
        families=["circle", "parabola"],
        priors={"parabola": NO_WIDTH},
        seed=1,
    ),
    "calibrate": lambda: calibrate(replicates=2, priors=NO_WIDTH, seed=1, workers=1),
    "sensitivity": lambda: sensitivity(CONTOUR, load_cell=CELL, priors=NO_WIDTH, seed=1),
    "design": lambda: design("parabola", priors=NO_WIDTH, seed=1),
    "infer_point_load": lambda: infer_point_load(
        POINTS, 0.1 * POINTS, np.arange(12.0), priors={"clamp_angle": stats.norm(0.0, 0.0)}, seed=1
    ),
}


@pytest.mark.parametrize("ask", ASKED.values(), ids=ASKED)
def test_every_function_that_takes_priors_refuses_it(ask):
    with pytest.raises(ParameterError, match="no width"):
        ask()


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (stats.norm(0.5, 0.1), stats.norm(scale=0.1, loc=0.5)),
        (stats.lognorm(0.6, 0.0, 0.9), stats.lognorm(s=0.6, scale=0.9)),
        (stats.truncnorm(-1.0, 2.0, 0.3), stats.truncnorm(b=2.0, a=-1.0, loc=0.3)),
    ],
    ids=["norm", "lognorm", "truncnorm"],
)
def test_numbers_do_not_depend_on_how_they_are_given(one, other):
    assert numbers_of(one) == numbers_of(other)
    assert list(numbers_of(one))[-2:] == ["loc", "scale"]


def test_what_is_no_distribution_of_scipy_has_no_numbers():
    assert numbers_of(Flat(0.5, 0.0)) == {}


def test_a_log_normal_by_position_is_widened_like_one_by_name():
    by_position, by_name = (
        widened({"a": prior}, 2.0)["a"]
        for prior in (stats.lognorm(0.6, 0.1, 0.9), stats.lognorm(0.6, loc=0.1, scale=0.9))
    )
    assert by_position.std() == by_name.std()
    assert by_position.median() == pytest.approx(1.0)
    assert numbers_of(by_position)["s"] == 1.2

"""A family of which some parameters are known: its posterior, and what follows from it."""

import copy
import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot as plt
from scipy import stats

from helpers.contour_posteriors import BRIEF, CELL, infer_as_stated, measured, without
from helpers.refusals import refused
from helpers.report_pages import analysed_quickly
from helpers.tasks import through_a_pipe
from tactile_bayes import Family, Rig, Rod, Stream, check, contour_band, gap, plotting, read_result, write_report
from tactile_bayes.contours import Ellipse
from tactile_bayes.diagnostics.predictive_check import predictive_check
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.family import family_of
from tactile_bayes.record import to_si
from tactile_bayes.uncertainty.band import normal_band
from tactile_bayes.uncertainty.implied_contacts import implied_contacts
from tactile_bayes.uncertainty.summary import summary

CENTRED = Family("parabola", x_c=0.0)


@pytest.fixture(scope="module")
def tree():
    """A posterior whose vertex is known to be above the pivot, of few draws."""
    return infer_as_stated(measured(), family=CENTRED, load_cell=CELL, rng=1, settings=BRIEF)


def test_a_number_is_known_and_a_distribution_unknown():
    family = Family("ellipse", a=0.3, q=stats.norm(0.5, 0.1))
    assert family.known == {"a": 0.3}
    assert list(family.priors) == ["q"]
    assert family.contours.parameters == ("b", "q", "x_c")
    one, other = Ellipse(0.3, 0.2, 0.5, 0.1), family.contours.build(*(np.array([v]) for v in (0.2, 0.5, 0.1)))
    np.testing.assert_array_equal(other.height(np.array([0.0, 0.15])), one.height(np.array([0.0, 0.15])))


@pytest.mark.parametrize(
    ("name", "said", "named"),
    [
        ("cube", {}, ["cube"]),
        ("circle", {"a": 0.5}, ["a", "Family('circle')", "r, q, x_c"]),
        ("circle", {"r": "wide"}, ["prior of r"]),
        ("circle", {"r": -0.1}, ["r is -0.1"]),
        ("circle", {"r": 0}, ["r is 0"]),
        ("circle", {"r": float("nan")}, ["r is nan"]),
        ("circle", {"r": stats.norm}, ["r", "frozen"]),
        ("circle", {"r": stats.norm(0.5, 0.0)}, ["the number, 0.5"]),
        ("circle", {"r": 0.1, "q": 0.5, "x_c": 0.0}, ["nothing unknown"]),
        ("shape-free", {"q": 0.5}, ["cannot be known"]),
    ],
)
def test_what_cannot_be_said_is_refused(name, said, named):
    with refused(ParameterError, *named):
        Family(name, **said)


def test_families_are_equal_if_they_say_the_same():
    one, other = (Family("circle", r=stats.norm(0.05, s), x_c=0.0) for s in (0.002, 0.002))
    assert one == other
    assert hash(one) == hash(other)
    assert one != Family("circle", r=stats.norm(0.05, 0.003), x_c=0.0)
    assert one != Family("circle", r=stats.norm(0.05, 0.002), x_c=0.1)
    assert one.only(x_c=0.1) == Family("circle", r=stats.norm(0.05, 0.002), x_c=0.1)
    assert family_of("circle") == Family("circle")
    assert family_of(one) is one


@pytest.mark.parametrize("travel", [copy.deepcopy, through_a_pipe])
def test_a_family_travels_to_another_process(travel):
    family = Family("parabola/power-law", q=stats.norm(0.5, 0.1), x_c=0.02)
    assert travel(family) == family
    assert travel(family).contours.parameters == family.contours.parameters


def test_known_is_as_a_very_narrow_prior():
    """Log-densities differ by the prior at its centre."""
    narrow = Family("parabola", x_c=stats.norm(0.0, 1e-7))
    known, wide = (Experiment(measured(), Rig(load_cell=CELL, unknown="nothing"), f).model for f in (CENTRED, narrow))
    point = np.array([[0.49, 0.501, 1.1], [0.52, 0.499, 0.9]])
    expected = wide.log_probability(np.insert(point, 2, 0.0, axis=1)) - stats.norm(0.0, 1e-7).logpdf(0.0)
    np.testing.assert_allclose(known.log_probability(point), expected, rtol=1e-9)


def test_known_parameters_are_constant_in_the_posterior(tree):
    draws = tree["posterior"].to_dataset()
    assert set(draws.data_vars) == {"a", "q", "x_c", "noise_scale"}
    assert np.all(draws.x_c == 0.0)
    assert draws.x_c.attrs["units"] == draws.q.attrs["units"]
    assert list(tree["sample_stats"]["parameter"].values) == ["a", "q", "noise_scale"]
    assert np.all(tree["prior"]["x_c"] == 0.0)
    assert json.loads(tree.attrs["known"]) == {"x_c": 0.0}
    assert tree.attrs["family"] == "parabola"
    assert Family.of(tree) == CENTRED


def test_known_parameters_have_the_units_of_the_others():
    record, brief = to_si(measured(), Rod(0.2, 2.4e-3)), replace(BRIEF, max_steps=2, block_steps=2)
    tree = infer_as_stated(record, family=Family("parabola", a=2.5), rng=1, settings=brief)
    units = {name: draws.attrs["units"] for name, draws in tree["posterior"].data_vars.items()}
    assert units == {"q": "m", "x_c": "m", "noise_scale": "1", "a": "1/m"}


def test_bands_and_summaries_of_it_are_numbers_and_figures_are_drawn(tree):
    x = np.linspace(-0.2, 0.2, 5)
    for made in (contour_band(tree, x), contour_band(tree, x, simultaneous=True), normal_band(tree, x)):
        assert all(np.isfinite(made[name]).all() for name in ("median", "lower", "upper"))
    assert np.isfinite(gap(tree)["width"]).all()
    found = summary(tree)
    assert list(found["quantity"].values) == ["a", "q", "noise_scale"]
    assert all(np.isfinite(found[name]).all() for name in ("median", "lower", "upper", "r_hat", "ess_bulk"))
    assert implied_contacts(tree, draws=10)["posterior"].sizes["draw"] >= 5
    assert 0.0 <= predictive_check(tree).overall_p_value <= 1.0
    assert not [words for words in check(tree).messages if "x_c" in words]
    for figure in (plotting.pairs, plotting.trace, plotting.posterior_contours, plotting.prior_contours):
        figure(tree)
    plt.close("all")


@pytest.mark.slow
def test_the_report_of_it_is_written(tmp_path):
    rig = Rig(load_cell=CELL, unknown="nothing")
    analysed_quickly(without(measured()), tmp_path, family=CENTRED, rig=rig, settings=BRIEF)
    assert "x_c" in write_report(tmp_path).read_text(encoding="utf-8")
    assert Family.of(read_result(tmp_path / "posterior.nc")) == CENTRED


@pytest.mark.slow
def test_a_stream_takes_known_numbers(tmp_path):
    given = {"family": CENTRED, "rig": Rig(load_cell=CELL, unknown="nothing"), "rng": 1, "particles": 200}
    stream = Stream(**given)
    for part in np.array_split(np.arange(measured().sizes["sample"]), 2):
        stream.update(measured().isel(sample=part))
    found = stream.posterior()
    assert np.all(found["posterior"].x_c == 0.0)
    assert contour_band(found, [0.0])["median"].values == pytest.approx([0.5], abs=0.005)
    stream.save(tmp_path / "stream.nc")
    again = Stream.resume(tmp_path / "stream.nc", **given)
    xr.testing.assert_equal(again.posterior()["posterior"].to_dataset(), found["posterior"].to_dataset())

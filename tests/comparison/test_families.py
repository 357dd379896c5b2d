"""Families compared: which shape it was, and that none of them is said where none is."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers.contour_posteriors import CELL, swept
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Ellipse, paper_profile

RIG = tb.Rig(load_cell=CELL, unknown="nothing")
BRIEF = tb.SamplerSettings(ensembles=2, walkers=20, min_ess=100, max_r_hat=1.1, max_steps=40)


@pytest.fixture(scope="module")
def circle():
    return CELL.measure(swept(Circle(0.8, 0.5, 0.0), step=0.1, direction="forward"), rng=1)


@pytest.fixture(scope="module")
def compared(circle):
    return tb.compare_families(circle, families=["circle", "ellipse"], rig=RIG, rng=1, settings=BRIEF)


@pytest.mark.slow
def test_the_simpler_of_two_shapes_that_fit_is_more_probable(compared):
    """An ellipse can be a circle, and is then one of many that it could have been."""
    probability = compared.probability.sel(family=["circle", "ellipse"]).values
    assert probability.sum() == pytest.approx(1.0)
    assert probability[0] > 0.7
    assert compared.fits.all()
    assert compared.attrs["most_probable"] == "circle"
    assert len(compared.attrs["data_sha256"]) == 64
    assert compared.attrs["verdict"].startswith("circle with probability 0.")
    assert abs(float(compared.elpd_difference.min())) < 5.0
    apart = np.diff(compared.log_density.dropna("sample").values, axis=0)[0]
    assert np.abs(compared.elpd_difference).max() == pytest.approx(abs(apart.sum()))
    assert compared.elpd_difference_error.max() == pytest.approx(np.sqrt(apart.size) * apart.std(ddof=1))
    assert compared.weight.sum() == pytest.approx(1.0)
    assert (compared.log_evidence_error < 0.2).all()
    wide = compared.probability_by_width  # of a prior: worse for more parameters
    np.testing.assert_allclose(wide.sum("family"), 1.0)
    assert float(wide.sel(family="circle", prior_width=2.0)) > float(wide.sel(family="circle", prior_width=0.5))
    band = tb.contour_band(compared, [-0.2, 0.0, 0.2], 0.9)
    assert band.attrs["averaged_by"] == "evidence"
    truth = Circle(0.8, 0.5, 0.0).height(band["x"].values)
    assert ((band["lower"] < truth) & (truth < band["upper"])).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("families", "rig", "step", "settings"),
    [
        # One is far off and given up, and the only one that is left fits as badly.
        (["circle", "ellipse"], RIG, 0.1, tb.SamplerSettings(ensembles=2, max_steps=150)),
        (["parabola", "circle", "ellipse", "power-law"], tb.Rig(load_cell=CELL), np.radians(1.0), None),
    ],
)
def test_what_is_none_of_the_shapes_comes_out_as_such(families, rig, step, settings):
    measured = CELL.measure(swept(paper_profile("IV", q=0.5), step=step), rng=1)
    found = tb.compare_families(measured, families, rig, rng=1, leave_one_out=False, settings=settings)
    assert found.attrs["none_fits"]
    assert found.attrs["verdict"].startswith("None fits")
    assert "elpd" not in found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("truth", "right"), [(Ellipse(0.9, 0.5, 0.5, 0.02), "ellipse"), (paper_profile("II", q=0.5), "parabola")]
)
def test_the_right_one_of_all(truth, right):
    measured = CELL.measure(swept(truth, step=np.radians(1.0)), rng=1)
    found = tb.compare_families(measured, rig=tb.Rig(load_cell=CELL), rng=1)
    assert found.attrs["most_probable"] == right
    assert float(found.probability.sel(family=right)) > 0.5
    assert bool(found.fits.sel(family=right))
    best = found.family.values[found.elpd.values.argmax()]
    behind = found.elpd_difference.sel(family=right)
    assert best == right or -float(behind) < 4.0


@pytest.mark.slow
def test_a_run_is_made_again_from_its_seed(circle, compared):
    again = tb.compare_families(circle, families=["circle", "ellipse"], rig=RIG, rng=1, settings=BRIEF)
    xr.testing.assert_identical(again.drop_vars("seconds"), compared.drop_vars("seconds"))


def test_an_interrupt_ends_the_comparison(circle):
    def interrupt(name, state):
        raise KeyboardInterrupt

    endless = tb.SamplerSettings(ensembles=2, min_ess=1e9)
    with refused(KeyboardInterrupt, "circle"):
        tb.compare_families(circle, ["circle", "ellipse"], RIG, rng=1, settings=endless, progress=interrupt)


def test_families_of_which_something_is_said(circle):
    """What is said replaces matched priors; what is known is a constant among the draws, in the family's order."""
    families = [tb.Family("circle", q=0.5), tb.Family("ellipse", a=stats.norm(0.8, 0.01), b=0.8)]
    found = tb.compare_families(circle, families, RIG, rng=1, settings=BRIEF, leave_one_out=False)
    assert found.family.values.tolist() == ["circle", "ellipse"]
    draws = found.contour_draws.values
    assert draws.shape[2] == 4
    np.testing.assert_array_equal(draws[0, :, 1], 0.5)  # r, q, x_c
    assert np.isnan(draws[0, :, 3]).all()
    np.testing.assert_array_equal(draws[1, :, 1], 0.8)  # a, b, q, x_c
    assert abs(np.mean(draws[1, :, 0]) - 0.8) < 0.05
    band = tb.contour_band(found, [0.0], 0.9)
    assert float(band["lower"][0]) < 0.51
    assert float(band["upper"][0]) > 0.49

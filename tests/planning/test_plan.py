"""A plan, the family of its contour, and the covariance of errors over a whole record."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import block_diag

import tactile_bayes as tb
from helpers.load_cells import CELL, moments
from helpers.refusals import refused
from tactile_bayes.contours import Circle, Ellipse, Joined, Parabola, PowerLaw, paper_profile
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.family import Family
from tactile_bayes.load_cell import OrnsteinUhlenbeck, RandomWalk
from tactile_bayes.planning.plan import Plan, enlarged, family_parameters
from tactile_bayes.planning.record_information import whitening
from tactile_bayes.record import loads_of
from tactile_bayes.rig import NOTHING, Rig

PROFILE = paper_profile("II", q=0.5)
X = np.linspace(-0.19, 0.19, 9)

CONTOURS = {
    "parabola": Parabola(0.7, 0.3, 0.1),
    "circle": Circle(0.4, 0.3, -0.1),
    "ellipse": Ellipse(0.5, 0.3, 0.4, 0.05),
    "power-law": PowerLaw(2.0, 3.0, 0.4, 0.1),
    "parabola/power-law": paper_profile("IV", q=0.5),
    "circle/ellipse": Joined(Circle(0.3, 0.4, 0.1), Ellipse(0.6, 0.2, 0.4, 0.1)),
}


@pytest.mark.parametrize("name", CONTOURS)
def test_the_family_builds_the_contour_back_and_an_enlarged_one_and_has_a_model(name):
    contour = CONTOURS[name]
    found, values = family_parameters(contour)
    assert found == name
    family = family_named(found)
    assert tuple(values) == family.parameters
    np.testing.assert_allclose(family.build(*values.values()).height(X), contour.height(X), rtol=1e-13)
    for factor in (0.2, 3.0):
        larger = enlarged(contour, factor)
        np.testing.assert_allclose(larger.height(factor * X), factor * contour.height(X), rtol=1e-12)
    if name != "circle/ellipse":  # which has no priors
        plan = Plan(contour, Rig(load_cell=CELL, unknown="nothing"), drive=tb.Rotation(drive_step=0.1))
        assert plan.experiment.own_family == Family(name)
        np.testing.assert_array_equal(plan.point[:-1], list(values.values()))


def test_the_record_has_errors_that_are_known_and_none_that_are_drawn():
    bias, gain = (0.1, -0.2, 0.3), ((1.1, 0.0, 0.0), (0.0, 0.9, 0.1), (0.0, 0.0, 1.0))
    encoder = {"drive_angle_offset": 0.05, "drive_angle_backlash": 0.02, "drive_angle_noise": 0.01}
    cell = replace(CELL, bias=bias, gain=gain, lever=(0.01, 0.02), bias_uncertainty=(1.0, 1.0, 1.0), **encoder)
    plan = Plan(PROFILE, Rig(load_cell=cell), drive=tb.Rotation(drive_step=0.05))
    scanned = tb.scan(PROFILE, drive_step=0.05).record
    loads, read = (loads_of(r).T for r in (scanned, plan.record))
    loads[0] += 0.02 * loads[1] - 0.01 * loads[2]
    np.testing.assert_allclose(read, np.array(gain) @ loads + np.array(bias)[:, None], rtol=0.0, atol=1e-12)
    misread = np.where(scanned.direction.values == "forward", 0.06, 0.04)
    np.testing.assert_allclose(plan.record.drive_angle, scanned.drive_angle.values + misread, rtol=0.0, atol=1e-12)


def test_the_model_shows_the_record_at_the_point():
    """Contour as it is, rig as stated."""
    several = ("gain", "friction", "suspension_compliance", "length", "taper", "rest_curvature", "moment_curve")
    for unknown in ({}, {**NOTHING, **dict.fromkeys(several, "default")}):
        rig = Rig(load_cell=replace(CELL, frame="turning"), unknown=unknown)
        plan = Plan(PROFILE, rig, drive=tb.Rotation(drive_step=0.05))
        values = dict(zip(plan.model.names, plan.point, strict=True))
        assert (values["a"], values["q"], values["x_c"], values["noise_scale"]) == (0.5, 0.5, 0.0, 1.0)
        loads = plan.model.loads(plan.point[None])[0]
        right = loads_of(plan.record)
        np.testing.assert_allclose(loads, right, rtol=0.0, atol=1e-6)


def test_what_is_given_of_family_and_rig_is_that_of_the_model():
    prior = stats.norm(0.5, 0.01)
    rig = Rig(unknown={**NOTHING, "friction": stats.halfnorm(scale=0.1), "length": 1.0, "noise_scale": 1.0})
    plan = Plan(PROFILE, rig, family=Family("parabola", q=prior))
    assert plan.model.priors["q"] is prior
    assert plan.model.names == ("a", "q", "x_c", "friction")
    plan = Plan(PROFILE, Rig(unknown="nothing"), drive=tb.Rotation(drive_step=0.1), family=Family("parabola", q=0.5))
    assert plan.model.names == ("a", "x_c", "noise_scale")
    np.testing.assert_array_equal(plan.point, [0.5, 0.0, 1.0])


def test_noise_grows_by_a_factor_and_nothing_else():
    cell = replace(CELL, drive_angle_noise=0.01, bias=(0.1, 0.0, 0.0))
    louder = Plan(PROFILE, Rig(load_cell=cell, unknown={"friction": 0.2})).with_noise(3.0)
    assert louder.cell == replace(cell, force_noise=3.0 * 0.05, moment_noise=3.0 * 0.02)
    assert (louder.friction, louder.contour) == (0.2, PROFILE)


def test_without_a_load_cell_there_is_the_usual_one():
    rod = tb.Rod(length=0.2, flexural_rigidity=2e-3)
    assert Plan(PROFILE).cell == CELL
    usual = Plan(Parabola(2.5, 0.1), Rig(rod=rod)).cell
    assert (usual.force_noise, usual.moment_noise) == pytest.approx((0.05 * 0.05, 0.02 * 0.01))
    assert usual.dimensionless(rod).entries() == pytest.approx({"force_noise": 0.05, "moment_noise": 0.02})


NO_FAMILY = tb.contours.from_points(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21) ** 2 + 0.5)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"contour": NO_FAMILY}, ["family", "power law"]),
        ({"contour": Parabola([0.5, 0.6], 0.5)}, ["one contour"]),
        ({"contour": "II"}, ["'II'"]),
        ({"rig": Rig(load_cell=tb.LoadCell(force_noise=0.05))}, ["holding_moment", "LoadCell"]),
        ({"rig": Rig(load_cell=tb.LoadCell())}, ["holding_moment, force_x, force_y", "LoadCell"]),
        ({"rig": Rig(load_cell=replace(CELL, degrees_of_freedom=2.0))}, ["holding_moment, force_x, force_y"]),
        ({"rig": CELL}, ["rig", "LoadCell"]),
        ({"family": "parabola"}, ["family", "'parabola'"]),
        ({"family": Family("circle")}, ["circle", "parabola"]),
        ({"family": Family("parabola", q=0.4)}, ["q", "0.4", "0.5"]),
    ],
    ids=lambda value: "" if isinstance(value, dict) else str(value[0]),
)
def test_what_does_not_go_together_is_refused(options, named):
    with refused(ParameterError, *named):
        _ = Plan(**({"contour": PROFILE} | options)).model


SAMPLES = 7
SHARED = {
    "none": CELL,
    "correlated": replace(CELL, correlation=(0.3, -0.2, 0.6)),
    "in proportion": replace(CELL, relative_noise=0.1),
    "outliers": replace(CELL, degrees_of_freedom=5.0),
    "bias": replace(CELL, bias_uncertainty=(0.03, 0.1, 0.0)),
    "walk": replace(CELL, drift=RandomWalk(moment=0.004, force=0.01)),
    "wandering": replace(CELL, drift=OrnsteinUhlenbeck(moment=0.02, force=0.03, time=3.0), correlation=(0.1, 0.2, 0.3)),
    "all": replace(CELL, drift=RandomWalk(moment=0.01), bias_uncertainty=(0.1, 0.0, 0.1), drive_angle_noise=0.02),
}


def dense(cell, loads, by_angle):
    """Covariance of all readings, shape (samples · 3,) twice; outliers are of a cell without errors that are shared."""
    nu = cell.degrees_of_freedom
    turned = cell.drive_angle_noise * by_angle
    return moments(cell, loads)[1] * (1.0 if np.isinf(nu) else nu / (nu - 2.0)) + block_diag(
        *(np.outer(each, each) for each in turned)
    )


@pytest.mark.parametrize("present", [(True, True, True), (True, False, True), (False, False, True)])
@pytest.mark.parametrize("name", SHARED)
def test_whitened_slopes_have_the_products_of_the_dense_covariance(name, present):
    cell, here, rng = SHARED[name], np.array(present), np.random.default_rng(1)
    loads, by_angle, slopes = (
        rng.normal(size=(SAMPLES, 3)),
        rng.normal(size=(SAMPLES, 3)),
        rng.normal(size=(SAMPLES, 3, 4)),
    )
    white = whitening(cell, loads, by_angle, here)(slopes)
    assert white.shape == (SAMPLES, here.sum(), 4)
    every = np.tile(here, SAMPLES)
    covariance = dense(cell, loads, by_angle)[np.ix_(every, every)]
    flat = slopes[:, here].reshape(-1, 4)
    right = flat.T @ np.linalg.solve(covariance, flat)
    found = np.einsum("nci,ncj->ij", white, white)
    np.testing.assert_allclose(found, right, rtol=1e-9, atol=1e-9 * np.abs(right).max())

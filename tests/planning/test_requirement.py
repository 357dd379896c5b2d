"""How good a load cell must be, and which rod: round trips, proportions, and what cannot be had."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from helpers.load_cells import CELL
from helpers.refusals import refused
from tactile_bayes.contours import Parabola, paper_profile
from tactile_bayes.errors import ParameterError
from tactile_bayes.load_cell import RandomWalk
from tactile_bayes.planning.information import information
from tactile_bayes.planning.plan import Plan
from tactile_bayes.planning.requirement import required_noise, required_rod

PROFILE = paper_profile("II", q=0.5)
PLAN = Plan(PROFILE, tb.Rig(load_cell=CELL), drive=tb.Rotation(drive_step=np.radians(9.0)))

CELLS = {
    "white": CELL,
    "encoder": replace(CELL, drive_angle_noise=0.01),
    "bias": replace(CELL, bias_uncertainty=(0.02, 0.1, 0.1)),
    "drift": replace(CELL, drift=RandomWalk(moment=0.002, force=0.005)),
    "in proportion": replace(CELL, relative_noise=0.01),
}


# Errors that samples share take seconds.
SHARED = [pytest.param(name, "gap", marks=pytest.mark.slow) for name in ("encoder", "bias", "drift")]


@pytest.mark.parametrize(("name", "where"), [("in proportion", "gap"), ("white", "touched"), *SHARED])
def test_a_load_cell_as_asked_for_gives_the_band_that_was_wanted(name, where):
    """Whatever else about it stays as it is."""
    plan = replace(PLAN, rig=tb.Rig(load_cell=CELLS[name]))
    present = float(information(plan)[f"{where}_width"])
    needed = required_noise(plan, 0.7 * present, where=where)
    assert float(needed.present_width) == pytest.approx(present, rel=1e-9)
    factor = float(needed.noise_factor[0])
    assert factor < 0.7 + 1e-6  # what stays takes its share
    better = replace(plan.cell, force_noise=float(needed.force_noise[0]), moment_noise=float(needed.moment_noise[0]))
    assert better.force_noise == pytest.approx(factor * 0.05)
    got = information(replace(plan, rig=tb.Rig(load_cell=better)))
    assert float(got[f"{where}_width"]) == pytest.approx(0.7 * present, rel=1e-4)
    everywhere = float(required_noise(plan, present).present_width)  # the mean of all places
    assert everywhere == pytest.approx(2.0 * 1.959963985 * float(information(plan).height_sd.mean()), rel=1e-6)


def test_noise_is_in_proportion_to_the_band_where_priors_say_little():
    plan = replace(PLAN, rig=PLAN.rig.with_unknown(lever=0.0, backlash=0.0, friction=0.0))
    needed = required_noise(plan, [1e-4, 2e-4, 4e-4], probability=0.9)
    np.testing.assert_allclose(needed.noise_factor / needed.noise_factor[0], [1.0, 2.0, 4.0], rtol=1e-3)
    wider = required_noise(plan, 1e-4, probability=0.5)
    ratio = stats.norm.ppf(0.95) / stats.norm.ppf(0.75)
    assert float(wider.noise_factor[0]) == pytest.approx(float(needed.noise_factor[0]) * ratio, rel=1e-3)


def test_a_rod_in_si_needs_the_same():
    rod = tb.Rod(length=0.2, flexural_rigidity=2e-3)
    cell = tb.LoadCell(force_noise=0.05 * rod.force_unit, moment_noise=0.02 * rod.moment_unit)
    si = required_noise(Plan(Parabola(2.5, 0.1), tb.Rig(load_cell=cell, rod=rod), drive=PLAN.drive), 0.2 * 0.003)
    plain = required_noise(PLAN, 0.003)
    for name, scale, units in (
        ("noise_factor", 1.0, ("1", "1")),
        ("force_noise", rod.force_unit, ("N", "EI/L²")),
        ("moment_noise", rod.moment_unit, ("N m", "EI/L")),
        ("prior_width", 0.2, ("m", "1")),
        ("band_width", 0.2, ("m", "1")),
    ):
        np.testing.assert_allclose(si[name], scale * plain[name], rtol=1e-5, err_msg=name)
        assert (si[name].attrs.get("units", "1"), plain[name].attrs.get("units", "1")) == units


def test_a_band_that_priors_give_needs_no_load_cell():
    family = tb.Family("parabola", a=stats.norm(0.5, 0.001), q=stats.norm(0.5, 0.002), x_c=stats.norm(0.0, 0.001))
    plan = replace(PLAN, family=family)
    needed = required_noise(plan, [0.001, 1.0], where="gap")
    assert np.isfinite(needed.noise_factor.values).tolist() == [True, False]
    # In the gap the height is q, and little else: 2 · 1.96 · 0.002.
    assert float(needed.prior_width) == pytest.approx(0.00784, rel=0.01)


def test_what_no_load_cell_gives_is_refused():
    for width in (0.0, np.inf, [0.1, 0.0], [[0.1]]):
        with refused(ParameterError, band_width=np.atleast_1d(width).tolist()):
            required_noise(PLAN, width)
    without_zero = replace(PLAN, rig=tb.Rig(load_cell=CELLS["bias"]))
    with refused(ParameterError, "1e-12", "unknowns"):
        required_noise(without_zero, [1e-3, 1e-12])
    with refused(ParameterError, "gap"):
        required_noise(replace(PLAN, drive=replace(PLAN.drive, direction="forward")), 0.01, where="gap")
    with refused(ParameterError, where="nowhere"):
        required_noise(PLAN, 0.01, where="nowhere")


ROD = tb.Rod.circular(length=0.2, diameter=0.7e-3, youngs_modulus=206e9)
SI_CELL = tb.LoadCell(force_noise=3e-3, moment_noise=0.25e-3)
METAL = Plan(Parabola(2.5, 0.1), tb.Rig(ROD, SI_CELL), drive=PLAN.drive)
LENGTHS, DIAMETERS = [0.09, 0.17, 0.2], [0.3e-3, 0.7e-3, 3e-3]


@cache
def rods():
    return required_rod(METAL, lengths=LENGTHS, diameters=DIAMETERS, youngs_modulus=206e9, elastic_strain=0.012)


def test_every_rod_has_the_band_and_the_strain_of_its_own_plan():
    """The band where the plan's own rod touches, or leaves a gap."""
    found = rods()
    x = information(METAL).x.values
    plan = replace(METAL, rig=replace(METAL.rig, rod=tb.Rod.circular(0.17, 0.3e-3, 206e9)))
    of = found.sel(length=0.17, diameter=0.3e-3)
    assert float(of.strain) == pytest.approx(max(sweep.largest_strain for sweep in plan.scan.sweeps))
    here = information(plan).sel(parameter=["a", "q", "x_c"], parameter_=["a", "q", "x_c"])
    covariance = here.correlation.values * np.outer(here.bound_with_priors, here.bound_with_priors)
    slopes = np.stack([x**2, np.ones_like(x), -5.0 * x], axis=1)
    sd = np.sqrt(np.einsum("ni,ij,nj->n", slopes, covariance, slopes))
    assert float(of.width) == pytest.approx(2.0 * 1.959963985 * sd.mean(), rel=1e-4)
    own = found.sel(length=0.2, diameter=0.7e-3)
    assert float(own.width) == pytest.approx(float(required_noise(METAL, 0.01).present_width), rel=1e-9)


def test_rods_are_told_apart_and_the_best_has_the_narrowest_band_of_those_that_bear_it():
    found = rods()
    status = found.status.values
    assert np.all((status == "does not reach") == np.isnan(found.width.values))
    assert (status[0] == "does not reach").all()
    np.testing.assert_array_equal(status[1:] == "ok", found.strain.values[1:] <= 0.012)
    assert set(status[1:].ravel()) == {"ok", "bent too far"}
    best = float(found.best_width)
    assert best == found.width.values[status == "ok"].min()
    assert best > np.nanmin(found.width.values)  # a thicker one would see more, and stay bent
    at = found.sel(length=float(found.best_length), diameter=float(found.best_diameter))
    assert (float(at.width), str(at.status.values)) == (best, "ok")


@pytest.mark.parametrize(
    ("length", "diameter", "elastic_strain", "status"),
    [(0.105, 0.3e-3, 0.012, "touches little"), (0.2, 1e-3, 1e-5, "bent too far")],
)
def test_where_no_rod_will_do_none_is_the_best_and_progress_is_reported(length, diameter, elastic_strain, status):
    """A band that the family makes out of a short arc is its affair, not the rod's."""
    reports, material = [], {"youngs_modulus": 206e9, "elastic_strain": elastic_strain}
    found = required_rod(METAL, lengths=[length], diameters=[diameter], **material, progress=reports.append)
    assert [(step.done, step.wanted) for step in reports] == [(1, 1)]
    assert found.status.values.tolist() == [[status]]
    assert np.isnan([found.best_length, found.best_diameter, found.best_width]).all()


MATERIAL = {"lengths": [0.2], "diameters": [1e-3], "youngs_modulus": 2e11, "elastic_strain": 0.01}
BARE = (PLAN, *(replace(METAL, rig=replace(METAL.rig, **{name: None})) for name in ("load_cell", "rod")))


@pytest.mark.parametrize(
    ("plan", "wrong", "named"),
    [
        *((plan, {}, ["rod", "SI", "load_cell"]) for plan in BARE),
        (METAL, {"lengths": []}, ["lengths"]),
        (METAL, {"lengths": [-0.1]}, ["lengths"]),
        (METAL, {"diameters": [0.0, np.nan]}, ["diameters"]),
        (METAL, {"elastic_strain": 0.0}, ["elastic_strain"]),
        (METAL, {"youngs_modulus": -1.0}, []),
    ],
)
def test_rods_that_cannot_be_tried_are_refused(plan, wrong, named):
    with refused(ParameterError, *named):
        required_rod(plan, **(MATERIAL | wrong))

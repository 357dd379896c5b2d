"""A number is known: each parameter of a rig as a number is as if it were inferred, at that value."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import xarray as xr

from helpers.contour_posteriors import BRIEF, infer_as_stated, only, swept
from helpers.known_numbers import scaled
from tactile_bayes import Rig
from tactile_bayes.inference.experiment import Experiment, found_rig
from tactile_bayes.inference.family import Gauge
from tactile_bayes.record import CHANNELS
from tactile_bayes.report.readings_figure import motion_of
from tactile_bayes.rig.parameters import GROUPS, PARAMETERS
from tactile_bayes.uncertainty.implied_contacts import implied_contacts

ROD, SENSOR, PIN, BASES, KNOWN = scaled(0.1, 2e-4)
NOISES = {"force_noise": 0.05 * ROD.force_unit, "moment_noise": 0.02 * ROD.moment_unit}
CELL = replace(SENSOR, **NOISES, drive_angle_offset=0.01, drive_angle_backlash=0.01)
# Parameters of which numbers are refused, with what is to be said in their place.
NEVER_KNOWN = {*GROUPS["discrepancy"], "moment_noise", "force_noise"}


@cache
def record() -> xr.Dataset:
    made = CELL.measure(swept(PIN, bases=BASES, rod=ROD, step=0.1), rng=1)
    times = np.cumsum(np.random.default_rng(1).uniform(0.02, 0.2, made.sizes["sample"]))
    return made.assign(clock=("sample", times, {"units": "s"}))


PLACED = Gauge(PIN)
FEW = replace(BRIEF, max_steps=2, block_steps=2)


def model_of(said, cell=CELL, **options):
    model = Experiment(record(), Rig(load_cell=cell, unknown=only(**said)), "circle", **options).model
    model.likelihood.exact = True  # tables of paths depend on which parameters vary
    return model


def points_of(model, **values):
    """A point at the truth, and one off it."""
    every = {"r": PIN.r, "q": PIN.q, "x_c": PIN.x_c, "noise_scale": 1.2, **values}
    off = [1.01 if name in ("r", "q") else 1.0 for name in model.names]
    return np.array([every[name] for name in model.names]) * np.array([np.ones(len(off)), off])


@cache
def as_stated(**options):
    model = model_of({}, **options)
    return model.log_likelihood(points_of(model), pointwise=True)


def test_numbers_of_all_parameters_are_tried():
    assert {name for name in KNOWN if not name.startswith("base")} == set(PARAMETERS) - NEVER_KNOWN


@pytest.mark.parametrize("name", KNOWN)
def test_a_known_number_is_as_one_that_is_inferred_at_that_value(name):
    """Beside other deviations, of contours at the truth and off it."""
    gauge = {"gauge": PLACED} if name in GROUPS["gauge"] else {}
    known, free = model_of({name: KNOWN[name]}, **gauge), model_of({name: "default"}, **gauge)
    assert name not in known.names
    assert name in free.names
    expected = free.log_likelihood(points_of(free, **{name: KNOWN[name]}), pointwise=True)
    found = known.log_likelihood(points_of(known), pointwise=True)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    assert np.abs(found - as_stated(**gauge)).max() > 1e-3


@pytest.mark.parametrize("seed", range(4))
def test_some_known_and_others_inferred_are_as_all_inferred(seed):
    rng = np.random.default_rng(seed)
    names = [name for name in KNOWN if name not in (*GROUPS["gauge"], "rigidity_scale", "taper_error")]
    chosen = rng.permutation(names)[: rng.integers(2, len(names))]
    known = {str(name): KNOWN[name] for name in chosen}
    one = model_of({**dict.fromkeys(names, "default"), **known})
    all_ = model_of(dict.fromkeys(names, "default"))
    found, expected = (m.log_likelihood(points_of(m, **{n: KNOWN[n] for n in names})) for m in (one, all_))
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize(
    "flaw",
    [
        {"relative_noise": 0.02},
        {"drive_angle_noise": 0.005},
        {"force_resolution": 0.002},
        {"bias_uncertainty": (0.0, 0.01 * ROD.force_unit, 0.0)},
    ],
    ids=lambda flaw: next(iter(flaw)),
)
def test_a_known_factor_of_the_noise_is_as_one_that_is_inferred(flaw):
    cell = replace(CELL, **flaw)
    known, free = model_of({"noise_scale": 1.7}, cell), model_of({}, cell)
    expected = free.log_likelihood(points_of(free, noise_scale=1.7))
    # With the noise goes the number of encoder errors over which the likelihood is a sum.
    off = {"rtol": 1e-4} if "drive_angle_noise" in flaw else {"rtol": 1e-9}
    np.testing.assert_allclose(known.log_likelihood(points_of(known)), expected, **off)


def test_a_curvature_that_is_known_as_stated_stays_so_beside_an_unknown_length():
    """Not known, it changes with the length, as the rod keeps its turn from base to tip."""
    stated = ROD.mean_rest_curvature
    known = model_of({"length": "default", "rest_curvature": stated})
    free = model_of({"length": "default", "rest_curvature": "default"})
    expected = free.log_likelihood(points_of(free, length=0.103, rest_curvature=stated))
    np.testing.assert_allclose(known.log_likelihood(points_of(known, length=0.103)), expected, rtol=1e-9)
    silent = model_of({"length": "default"})
    assert np.abs(silent.log_likelihood(points_of(silent, length=0.103)) - expected).max() > 1e-3


def test_the_place_of_a_gauge_is_no_number_of_a_record_without_one():
    plain, placed = model_of({}), model_of({"gauge_x": 0.001})
    np.testing.assert_array_equal(placed.log_likelihood(points_of(placed)), plain.log_likelihood(points_of(plain)))


@pytest.mark.slow
def test_what_follows_from_a_posterior_takes_known_numbers_as_found_ones():
    """Step 2, the contacts that contours imply, and the drawing of the rod, as if every draw had found the numbers."""
    given = {name: value for name, value in KNOWN.items() if name not in (*GROUPS["gauge"], "noise_scale")}
    known = infer_as_stated(record(), family="circle", load_cell=CELL, unknown=given, rng=1, settings=FEW)
    assert json.loads(known.attrs["known"]) == given
    draws = known["posterior"].to_dataset()
    draws = draws.assign({name: xr.full_like(draws["q"], value) for name, value in given.items()})
    groups = {name: group.to_dataset() for name, group in known.children.items()}
    found = xr.DataTree.from_dict({**groups, "posterior": draws})
    found.attrs = known.attrs | {"nuisances": json.dumps(list(given)), "known": "{}"}
    one, other = (found_rig(record(), tree, CELL) for tree in (known, found))
    xr.testing.assert_allclose(one.record, other.record, rtol=1e-12)
    assert one.load_cell == other.load_cell
    assert one[2:] == other[2:]
    implied = [implied_contacts(tree, draws=20)["posterior"].to_dataset() for tree in (known, found)]
    shared = [name for name in implied[0] if name in implied[1]]
    xr.testing.assert_allclose(implied[0][shared], implied[1][shared])
    drawn = [motion_of(tree) for tree in (known, found)]
    for each in ("rod_x", "rod_y", "contact_x", "loads", "drive_angle", "cell_angle", "pivots"):
        np.testing.assert_allclose(getattr(drawn[0], each), getattr(drawn[1], each), rtol=1e-12, err_msg=each)


def test_a_factor_of_the_noise_that_is_known_is_no_parameter():
    tree = infer_as_stated(record(), family="circle", load_cell=CELL, unknown={"noise_scale": 1.5}, rng=1, settings=FEW)
    assert list(tree["posterior"].data_vars) == ["r", "q", "x_c"]
    assert tree.attrs["load_cell_force_noise"] == pytest.approx(1.5 * CELL.force_noise)
    assert tree["posterior_predictive"].sizes["sample"] == record().sizes["sample"]
    assert set(CHANNELS) <= set(tree["posterior_predictive"].data_vars)

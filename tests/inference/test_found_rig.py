"""A rig that was found: Step 2 of a record with known faults, told by a posterior, gives the true contacts."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.contour_posteriors import CELL
from tactile_bayes import Rig
from tactile_bayes.inference.experiment import contact_points, found_rig
from tactile_bayes.reconstruction import contacts_of
from tactile_bayes.record import CHANNELS, loads_of, to_dimensionless, with_rod

CONTOUR = tb.contours.Parabola(0.5, q=0.5)

FAULTS = {
    "rigidity_scale": 1.07,
    "drive_angle_offset": 0.03,
    "lever_x": 0.02,
    "lever_y": -0.03,
    "backlash": 0.02,
    "moment_bias": 0.1,
    "force_x_bias": -0.2,
    "force_y_bias": 0.3,
    "moment_drift": 0.2,
    "force_x_drift": 0.1,
    "force_y_drift": -0.4,
    "force_x_gain": 1.03,
    "suspension_compliance": 0.04,
    "friction": 0.2,
    "base_2_x": 0.02,
    "base_2_y": -0.01,
}


def posterior_of(**values):
    """Draws whose medians are these."""
    draws = {name: (("chain", "draw"), value + np.array([[-1e-3, 0.0, 1e-3]])) for name, value in values.items()}
    tree = xr.DataTree.from_dict({"posterior": xr.Dataset(draws)})
    tree.attrs |= {"nuisances": json.dumps(list(values)), "known": "{}", "family": "parabola"}
    return tree


@cache
def swept(friction):
    """Loads without any other fault, and where the rod really touches."""
    return tb.scan(
        CONTOUR, base=[(0.0, 0.0), (0.25, 0.0)], drive_step=np.radians(8.0), rig=Rig(unknown={"friction": friction})
    ).record


def read_with(faults, *, stated=None, frame="fixed"):
    """What the rig reads, without noise, and where the rod really touches."""
    truth = swept(faults.get("friction", 0.0))
    loads = loads_of(truth) * faults.get("rigidity_scale", 1.0)
    slope = truth.drive_angle.values + faults.get("suspension_compliance", 0.0) * loads[:, 0]
    short = ("moment", "force_x", "force_y")
    if frame == "turning":
        cos, sin = np.cos(slope), np.sin(slope)
        loads[:, 1:] = np.stack([cos * loads[:, 1] + sin * loads[:, 2], cos * loads[:, 2] - sin * loads[:, 1]], axis=1)
    known = tb.LoadCell() if stated is None else stated
    x, y = (own + faults.get(f"lever_{axis}", 0.0) for own, axis in zip(known.lever, "xy", strict=True))
    loads[:, 0] += y * loads[:, 1] - x * loads[:, 2]
    loads = loads * [faults.get(f"{name}_gain", 1.0) for name in short]
    loads = loads @ np.array(known.gain).T + np.array(known.bias)
    loads += [faults.get(f"{name}_bias", 0.0) for name in short]
    way = np.linspace(-0.5, 0.5, len(loads))
    loads += way[:, None] * [faults.get(f"{name}_drift", 0.0) for name in short]
    columns = dict(zip(CHANNELS, loads.T, strict=True))
    backlash = faults.get("backlash", 0.0) + known.drive_angle_backlash
    offset = faults.get("drive_angle_offset", 0.0) + known.drive_angle_offset
    columns["drive_angle"] = slope + offset + np.where(truth.direction == "forward", 0.5, -0.5) * backlash
    second = truth.sweep.values >= 2
    for name in ("base_x", "base_y"):
        columns[name] = truth[name].values - second * faults.get(f"base_2_{name[-1]}", 0.0)
    read = truth.drop_vars([name for name in truth.data_vars if str(name).startswith("truth_")])
    read = read.assign({name: ("sample", values, read[name].attrs) for name, values in columns.items()})
    return read.assign_attrs(load_cell_frame=frame), truth


def off(read, truth, cell, posterior):
    """How far contacts of the loaded samples are off, and how much is left over."""
    rig = found_rig(read, posterior, cell)
    contacts = tb.reconstruct(
        rig.record,
        method="constrained",
        rig=Rig(
            load_cell=rig.load_cell,
            unknown={"friction": rig.friction, "suspension_compliance": rig.suspension_compliance},
        ),
    )
    loaded = np.hypot(truth.force_x, truth.force_y).values > 0.6
    x, y = (contacts[f"contact_{axis}"] - truth[f"truth_contact_{axis}"] for axis in "xy")
    return np.hypot(x, y).values[loaded].max(), np.nanmax(contacts.misfit.values[loaded])


def assert_true_if_found(read, truth, cell, **faults):
    """Without the faults contacts are not true: they show, in the contacts or in what is left over."""
    assert max(off(read, truth, cell, posterior_of(**faults))) < 1e-6
    distance, misfit = off(read, truth, cell, posterior_of())
    assert distance > 1e-3 or misfit > 0.1


TOGETHER = {"all faults": list(FAULTS), **{name: [name] for name in FAULTS}}


@pytest.mark.parametrize("frame", ["fixed", "turning"])
@pytest.mark.parametrize("names", TOGETHER.values(), ids=TOGETHER)
def test_contacts_are_true_if_the_faults_are_found(names, frame):
    faults = {name: FAULTS[name] for name in names}
    assert_true_if_found(*read_with(faults, frame=frame), CELL, **faults)


@pytest.mark.parametrize("bent", [0.0, 0.4, lambda s: 0.5 * s - 0.1], ids=["straight", "arc", "bent"])
@pytest.mark.parametrize("units", ["SI", "dimensionless"])
def test_the_length_of_the_rod_is_found(bent, units):
    """It keeps its proportions; a record in lengths of the stated rod has another rod's then."""
    stated = tb.Rod(1.0, 2.0, rest_curvature=bent)
    longer = stated.reshaped(stated.mean_rest_curvature / 1.03, 0.0, length=1.03)
    truth = tb.scan(CONTOUR, rig=Rig(rod=longer), drive_step=np.radians(8.0)).record
    read = truth.drop_vars([name for name in truth.data_vars if str(name).startswith("truth_")])
    read, cell = with_rod(read, stated), CELL
    if units == "dimensionless":
        read, cell = to_dimensionless(read), cell.dimensionless(stated)
    contacts = contacts_of(found_rig(read, posterior_of(length=1.03), cell), "constrained")
    assert contacts.attrs["units"] == units
    assert contacts.contact_x.attrs["units"] == {"SI": "m", "dimensionless": "1"}[units]
    assert_true_if_found(read, truth, cell, length=1.03)


def test_they_come_on_top_of_what_the_load_cell_states():
    stated = replace(
        CELL,
        bias=(0.05, 0.1, -0.1),
        gain=((1.0, 0.0, 0.02), (0.01, 1.1, 0.0), (0.0, 0.03, 0.95)),
        lever=(-0.01, 0.04),
        drive_angle_offset=-0.02,
        drive_angle_backlash=0.01,
    )
    names = ("rigidity_scale", "drive_angle_offset", "lever_x", "lever_y", "backlash", "force_x_gain", "force_y_bias")
    faults = {name: FAULTS[name] for name in names}
    assert_true_if_found(*read_with(faults, stated=stated), stated, **faults)


def test_what_was_not_inferred_stays_as_stated_and_noise_that_was_is_the_load_cells():
    read, _ = read_with({})
    rig = found_rig(read, posterior_of(noise_scale=1.3), CELL)
    assert rig.record.identical(read)
    assert rig.load_cell == CELL
    assert (rig.friction, rig.suspension_compliance) == (0.0, 0.0)
    cell = found_rig(read, posterior_of(moment_noise=0.03, force_noise=0.06)).load_cell
    assert (cell.moment_noise, cell.force_noise) == (0.03, 0.06)


@pytest.mark.slow
def test_a_stiffer_rod_that_was_inferred_raises_no_alarm():
    """Its single samples agree with one another once its stiffness is known."""
    read, _ = read_with({"rigidity_scale": 1.05})
    measured = CELL.measure(read, rng=1)
    settings = tb.SamplerSettings(ensembles=2, walkers=26, max_r_hat=1.1, min_ess=100.0, max_steps=400)
    posterior = tb.infer_contour(measured, rig=Rig(load_cell=CELL), rng=1, settings=settings)
    assert tb.reconstruct(measured, method="constrained", rig=Rig(load_cell=CELL)).attrs["misfit_probability"] < 1e-6
    contacts = contact_points(measured, posterior, CELL)
    assert contacts.attrs["misfit_probability"] > 1e-3
    assert tb.check(posterior, contacts).is_well

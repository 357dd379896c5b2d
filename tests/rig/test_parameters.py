"""The table of parameters: what it says is what a record's unknowns have."""

import numpy as np
import pytest

from helpers.contour_posteriors import only, swept
from tactile_bayes.contours import Circle
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.inference.family import Gauge
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.profile import MOST_MODES
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import NOTHING, Rig
from tactile_bayes.rig.parameters import GROUPS, MAY_VANISH, PARAMETERS, SENSOR, STANDARD, members, parameter_named

MODES = [lambda s, k=k: np.cos(5.0 * k * s) for k in range(MOST_MODES)]
ROD = Rod(0.2, 3e-4, rest_curvature=1.5, taper=0.3, stem=0.01, rest_shape_modes=MODES, taper_deviation=0.05)
STATED = {"rest_curvature": 1.5, "taper": 0.3, "stem": 0.01, "length": 0.2}
CELL = LoadCell(force_noise=0.05 * ROD.force_unit, moment_noise=0.02 * ROD.moment_unit, moment_curve=(2.0, 3.0))
STATED |= {**dict.fromkeys(SENSOR, 0.0), "moment_curve_quadratic": 2.0, "moment_curve_cubic": 3.0}
PIN = Circle(0.04, 0.1, 0.004)
RECORD = swept(PIN, bases=((0.0, 0.0), (0.02, 0.006)), rod=ROD, step=0.1)
RECORD["time_s"] = ("sample", np.arange(float(RECORD.sizes["sample"])))
NAMES = (*PARAMETERS, "base_2_x", "base_2_y")


def unit_of(row):
    """The unit of a parameter in calculations without dimensions, from the powers that its row states."""
    first = ROD.force_unit if row.name.startswith("force") else ROD.moment_unit
    of_load, of_length = row.powers
    return first**of_load * ROD.length**of_length


@pytest.mark.parametrize("name", NAMES)
def test_default_priors_bounds_and_units_are_those_of_the_table(name):
    cell = None if name in ("moment_noise", "force_noise") else CELL
    gauge = Gauge(PIN) if name in GROUPS["gauge"] else None
    experiment = Experiment(RECORD, Rig(load_cell=cell, unknown=only(name)), "circle", gauge=gauge)
    row, prior, unknowns = parameter_named(name), experiment.priors[name], experiment.unknowns
    centre = STATED.get(name, row.neutral)
    width = row.width * (unit_of(row) if row.default in ("normal", "half_normal") else 1.0)
    if row.default == "log_uniform":
        assert prior.support() == (pytest.approx(row.width * unit_of(row)), pytest.approx(10.0 * unit_of(row)))
    elif row.default == "half_normal":
        assert centre == 0.0
        assert prior.interval(0.9) == pytest.approx(np.array([0.0627068, 1.9599640]) * width, rel=1e-5)
    elif row.default == "log_normal":
        assert prior.median() == pytest.approx(centre)
        assert np.log(prior.ppf(0.8413447461) / centre) == pytest.approx(width)
    else:
        at = centre + width * np.array([-0.5, 0.0, 1.0])
        at = at[(at > row.low) & (at < row.high)]
        np.testing.assert_allclose(np.diff(prior.logpdf(at)), np.diff(-0.5 * ((at - centre) / width) ** 2), rtol=1e-9)
    low, high = prior.support()
    if row.default != "normal" or name in ("taper", "stem"):  # the bounds cut off the others
        assert low >= row.low - 1e-9
    if name == "taper":
        assert high <= row.high + 1e-9
    if name in unknowns.names:
        assert unknowns.bounds(name) == (row.low, row.high)
        if name not in (*GROUPS["gauge"], "base_2_x", "base_2_y"):
            assert unknowns.units[name] == pytest.approx(unit_of(row))


@pytest.mark.parametrize("name", PARAMETERS)
def test_a_neutral_number_is_a_rig_as_stated(name):
    row = PARAMETERS[name]
    if row.neutral is None or name in (*GROUPS["discrepancy"], "moment_noise", "force_noise"):
        return
    gauge = Gauge(PIN) if name in GROUPS["gauge"] else None
    rig = Rig(load_cell=CELL, unknown={**NOTHING, name: row.neutral})
    assert Experiment(RECORD, rig, "circle", gauge=gauge).unknowns.known == {}
    assert row.low <= row.neutral <= row.high


def test_groups_and_names_are_of_the_table():
    assert all(set(names) <= set(PARAMETERS) for names in GROUPS.values())
    assert {name for group in STANDARD for name in members(group)} <= set(PARAMETERS)
    assert set(MAY_VANISH) == {n for n, row in PARAMETERS.items() if row.low == 0.0} - {
        n for n, row in PARAMETERS.items() if row.default in ("log_normal", "log_uniform") or n.endswith("_gain")
    } - {"length"}
    assert parameter_named("base_12_y").unit == "m"
    assert parameter_named("base_x") is None
    assert parameter_named("rust") is None

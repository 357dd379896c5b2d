"""A rig: what is known and unknown of it, by one rule; names that are refused; and its way to other processes."""

import copy

import numpy as np
import pytest
from scipy import stats

from helpers.load_cells import CELL
from helpers.refusals import refused
from helpers.tasks import through_a_pipe
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.rig import NOTHING, Rig
from tactile_bayes.rig.file_format import FileFormat
from tactile_bayes.rig.parameters import GROUPS, STANDARD, members
from tactile_bayes.rig.rig import rig_of
from tactile_bayes.rig.rig_prior import RigPrior
from tactile_bayes.rig.stated import Stated
from tactile_bayes.rig.unknown import expanded
from tactile_bayes.sweep import scan

RECORD = scan(Parabola(0.5, q=0.5), drive_step=0.1).record
ALL = tuple(name for group in STANDARD if group not in ("rest_shape", "taper_error") for name in members(group))
TRACED = Rod(rest_shape_modes=(lambda s: 0.2 * (1.0 - s), lambda s: 0.1 * s))


def unknown_of(said, record=RECORD, **rig):
    """Unknown parameters of the rig, without those of the noise."""
    return Experiment(record, Rig(load_cell=CELL, unknown=said, **rig)).unknowns.names


# --- The rule -------------------------------------------------------------------------------------------------------


def test_what_is_not_named_is_unknown_if_it_is_unknown_of_a_real_rig():
    assert unknown_of({}) == ALL
    assert unknown_of({"drift": "default"}) == (*ALL, *GROUPS["drift"])


def test_the_course_of_the_curvature_is_unknown_of_a_traced_rod():
    record = scan(Parabola(0.5, q=0.5), Rig(TRACED), drive_step=0.1).record
    assert unknown_of({}, record) == (*ALL, *GROUPS["rest_shape"][:2])
    assert unknown_of({"rest_shape_1": 0.3}, record) == (*ALL, "rest_shape_2")
    drawn = Rig(TRACED).draw(rng=1)
    z = [drawn.known[name] for name in GROUPS["rest_shape"][:2]]
    s = np.linspace(0.0, 1.0, 7)
    np.testing.assert_allclose(drawn.known_rod.rest_curvature(s), 0.2 * (1.0 - s) * z[0] + 0.1 * s * z[1], atol=1e-12)
    assert GROUPS["rest_shape"][0] not in Rig().draw(rng=1).known


def test_the_error_of_a_measured_taper_is_unknown():
    measured = Rod(taper=0.4, taper_deviation=0.02)
    record = scan(Parabola(0.5, q=0.5), Rig(measured), drive_step=0.1).record
    assert unknown_of({}, record) == (*ALL, "taper_error")
    assert unknown_of({"taper_error": 0.0}, record) == ALL
    assert unknown_of({"taper": "default"}, record) == (*ALL, "taper")
    assert Stated.of(measured, CELL).default("taper").std() == pytest.approx(0.02, rel=1e-6)
    drawn = Rig(measured).draw(rng=1)
    assert drawn.known_rod.taper == pytest.approx(0.4 + 0.02 * drawn.known["taper_error"])
    with refused(ParameterError, "taper_error", "not measured"):
        unknown_of({"taper_error": 1.0})


@pytest.mark.parametrize("value", [0.3, stats.norm(0.0, 1.0)])
def test_a_mode_that_the_rod_does_not_have_is_refused(value):
    with refused(ParameterError, "rest_shape_3", "2 modes"):
        Rig(TRACED, unknown={"rest_shape_3": value}).draw(rng=1)
    with refused(ParameterError, "rest_shape_1", "0 modes"):
        unknown_of({"rest_shape_1": value})


def test_a_number_is_known_and_a_distribution_unknown():
    wide = stats.norm(0.0, 0.5)
    rig = Rig(load_cell=CELL, unknown={"friction": 0.2, "moment_bias": wide, "suspension_compliance": "default"})
    assert rig.known == {"friction": 0.2}
    assert rig.distributions == {"moment_bias": wide}
    experiment = Experiment(RECORD, rig)
    assert "friction" not in experiment.unknowns.names
    assert experiment.unknowns.known == {"friction": 0.2}
    assert experiment.priors["moment_bias"] is wide
    assert "suspension_compliance" in experiment.priors


def test_nothing_is_unknown_of_a_rig_that_is_as_stated():
    assert Rig(unknown="nothing").entries == Rig(unknown=NOTHING).entries == dict(NOTHING)
    assert unknown_of("nothing") == ()
    assert unknown_of({**NOTHING, "friction": "default"}) == ("friction",)
    assert set(NOTHING) == set(STANDARD)
    assert Experiment(RECORD, Rig(load_cell=CELL, unknown="nothing")).unknowns.known == {}


def test_a_group_stands_for_its_members_with_exceptions():
    assert expanded({"moment_bias": 0.1, "bias": "default"})["moment_bias"] == 0.1
    assert expanded({"bias": "default", "moment_bias": 0.1})["moment_bias"] == 0.1
    assert unknown_of({**NOTHING, "bias": "default", "moment_bias": 0.1}) == ("force_x_bias", "force_y_bias")
    assert unknown_of({**NOTHING, "moment_gain": stats.norm(1.0, 0.1)}) == ("moment_gain",)
    narrow = stats.norm(0.0, 0.01)
    priors = Experiment(RECORD, Rig(load_cell=CELL, unknown={"lever": narrow, "lever_y": "default"})).priors
    assert priors["lever_x"] is narrow
    assert priors["lever_y"].std() == pytest.approx(0.005)


def test_the_shifts_of_all_pivots_are_a_group():
    record = scan(Parabola(0.5, q=0.5), drive_step=0.1, base=[(0.0, 0.0), (0.2, 0.0), (-0.2, 0.0)]).record
    every = ("base_2_x", "base_2_y", "base_3_x", "base_3_y")
    assert unknown_of({**NOTHING, "base": "default"}, record) == every
    assert unknown_of({**NOTHING, "base": "default", "base_2_x": 0.01}, record) == every[1:]
    assert unknown_of({**NOTHING, "base": "default"}) == ()
    known = Experiment(record, Rig(load_cell=CELL, unknown={**NOTHING, "base_x": 0.01})).unknowns.known
    assert known == {"base_2_x": 0.01, "base_3_x": 0.01}


@pytest.mark.parametrize(
    ("missing", "names"),
    [
        ("holding_moment", {"moment_bias", "lever_x", "lever_y", "moment_gain"}),
        ("force_x", {"force_x_bias", "force_x_gain"}),
    ],
)
def test_an_unknown_that_the_record_does_not_show_is_left_out(missing, names):
    record = RECORD.assign({missing: np.nan * RECORD[missing]})
    said = {**NOTHING, **dict.fromkeys(names, "default"), "rest_curvature": stats.norm(0.0, 0.1), "gauge": "default"}
    assert unknown_of(said, record) == ("rest_curvature",)
    assert set(unknown_of(said)) == {*names, "rest_curvature"}


def test_a_rig_without_unknowns_of_noise_states_it():
    assert Experiment(RECORD, Rig(load_cell=CELL, unknown={"noise_scale": 1.0})).noise.names == ()
    assert Experiment(RECORD, Rig(load_cell=CELL)).noise.names == ("noise_scale",)
    assert Experiment(RECORD, Rig()).noise.names == ("moment_noise", "force_noise")
    with refused(ParameterError, "moment_noise", "LoadCell"):
        Experiment(RECORD, Rig(unknown={"moment_noise": 0.02})).noise  # noqa: B018


# --- What is refused ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"frictoin": 0.1}, "did you mean 'friction'"),
        ({"momentbias": 0.1}, "did you mean 'moment_bias'"),
        ({"bases": 0.1}, "did you mean 'base'"),
        ({"rust": 0.1}, "there are bias, drift, gain, lever"),
        ({"base_1_x": 0.1}, "base_1_x is never unknown"),
        ({3: 0.1}, "by name"),
        ({"friction": "wide"}, "'friction'.* 'wide': give a number, a distribution, or \"default\""),
        ({"friction": None}, "frozen distribution"),
        ({"friction": stats.halfnorm}, "frozen distribution"),
        ({"friction": stats.halfnorm(scale=0.0)}, "give the number, 0"),
        ({"friction": -0.1}, "from 0 to"),
        ({"friction": float("nan")}, "finite number"),
        ({"taper": 1.5}, "from 0 to 0.95"),
        ({"gain": -1.0}, "finite number from"),
        *(({name: 0.0}, "finite number from") for name in ("moment_gain", "rigidity_scale", "length", "noise_scale")),
        ("everything", "nothing"),
        (["bias"], "by name"),
        (None, "by name"),
    ],
)
def test_what_cannot_be_said_of_a_rig_is_refused(said, words):
    with pytest.raises(ParameterError, match=words):
        Rig(unknown=said)


def test_what_is_no_rig_is_refused():
    for part in ("rod", "load_cell", "file"):
        with refused(ParameterError, part):
            Rig(**{part: 0.2})
    with refused(ParameterError, "posterior", "0.2"):
        Rig.of(0.2)
    with refused(ParameterError, "rig", "0.2", "Rig("):
        rig_of(0.2)
    assert rig_of(None).entries == {}


def test_a_calibrated_parameter_is_not_unknown_as_well():
    found = RigPrior({"lever_x": stats.norm(0.001, 1e-4)}, np.eye(1), 0.01, "0")
    with pytest.raises(ParameterError, match="lever_x"):
        Rig(unknown={"lever": "default"}, calibration=found)
    assert Rig(unknown={"lever_y": 0.0}, calibration=found).known == {"lever_y": 0.0}


# --- Other rigs -----------------------------------------------------------------------------------------------------


def test_of_a_rig_something_else_can_be_said():
    rig = Rig(load_cell=CELL, unknown="nothing").with_unknown(friction="default", lever_x=0.01)
    assert rig.load_cell is CELL
    assert unknown_of(rig.unknown) == ("friction",)
    assert rig.known["lever_x"] == 0.01
    assert rig.with_unknown(friction=0.1).known["friction"] == 0.1


def test_a_rig_cannot_be_changed():
    given = {"friction": 0.2}
    rig = Rig(unknown=given)
    with pytest.raises(TypeError):
        rig.unknown["friction"] = 0.3
    given["friction"] = 0.5
    assert rig.known == {"friction": 0.2}


WHOLE = Rig(
    rod=Rod(0.1, 1e-5, rest_curvature=lambda s: 3.0 * s),
    load_cell=CELL,
    unknown={"friction": stats.halfnorm(scale=0.2), "lever": 0.0, "drift": "default"},
    calibration=RigPrior({"rigidity_scale": stats.lognorm(s=0.01)}, np.eye(1), 0.01, "0"),
    file=FileFormat({"force_x": "-Fx[mN]"}, True, ("force_y",)),
)


@pytest.mark.parametrize("travel", [copy.deepcopy, through_a_pipe])
def test_a_rig_travels(travel):
    found = travel(WHOLE)
    assert (found.text, found.file, list(found.entries)) == (WHOLE.text, WHOLE.file, list(WHOLE.entries))
    assert travel(Rig(unknown="nothing")).entries == dict(NOTHING)


def test_a_rig_shows_what_is_said_and_no_addresses():
    found = RigPrior({"friction": stats.norm(0.3, 0.1)}, np.eye(1), 0.0, "sha", posterior=None)
    file = {"force_x": "-Fx[mN]", "split_sweeps": True}
    said = {"lever": 0.0, "drift": "default", "backlash": stats.lognorm(0.5, scale=0.01)}
    rig = Rig(Rod(0.1, 1e-5), LoadCell(force_noise=0.05, moment_noise=0.02), said, found, file)
    assert repr(rig) == (
        "Rig(rod=Rod(length=0.1, flexural_rigidity=1e-05, diameter=0.0), load_cell=LoadCell(force_noise=0.05, "
        "moment_noise=0.02), unknown={'lever': 0.0, 'drift': 'default', 'backlash': lognorm(s=0.5, scale=0.01)}, "
        "calibration=RigPrior(friction=norm(0.3, 0.1)), file={'force_x': '-Fx[mN]', 'split_sweeps': True})"
    )
    assert repr(Rig()) == "Rig()"
    assert " at 0x" not in repr(Rig(unknown={"lever": stats.Mixture([stats.Normal(sigma=0.1)])}))

"""The rig of a data set: in the words of rig.toml, and its unknowns drawn, as inference takes them."""

import numpy as np
import pytest
from scipy import stats

from helpers.data_sets import PLAIN, changed
from helpers.expected_readings import assert_expected
from helpers.refusals import refused
from tactile_bayes import LoadCell, Rig, Rod
from tactile_bayes.datasets import generate, read_specification, record
from tactile_bayes.datasets.generation import generate_records
from tactile_bayes.datasets.shard import records_as_dataset
from tactile_bayes.errors import SpecificationError
from tactile_bayes.rig import NOTHING
from tactile_bayes.rig.parameters import GROUPS, MEMORY, PARAMETERS
from tactile_bayes.rig.rig_prior import RigPrior

FALSE_ALARM = 1e-4
CIRCLE = {"family": "circle", "r": {"uniform": [0.04, 0.06]}, "q": {"uniform": [0.05, 0.06]}}
WIRE = {"diameter": "0.2 mm", "youngs_modulus": "200 GPa"}
SI = {
    "records": 6,
    "seed": 5,
    "contours": [CIRCLE],
    "rod": {**WIRE, "length": {"uniform": ["100 mm", "110 mm"]}, "taper": 0.1, "stem": 0.004},
    "scan": {"samples": 40, "bases": [[0.0, 0.0], [0.01, 0.003]]},
    "load_cell": {
        "frame": "turning",
        "gain": [[1.02, 0.0, 0.0003], [0.0, 0.97, 0.01], [0.0, 0.0, 1.0]],
        "lever": ["1 mm", 0.002],
        "moment_curve": [2.0, 5.0],
        "drive_angle_offset": 0.01,
        "drive_angle_backlash": 0.01,
    },
}
NEVER_DRAWN = {
    *(name for group in ("gauge", "discrepancy", "rest_shape") for name in GROUPS[group]),
    *("taper_error", "noise_scale", "moment_noise", "force_noise", "lag_seconds", *MEMORY["lag_seconds"]),
}
EVERY = [name for name in PARAMETERS if name not in (*NEVER_DRAWN, "rigidity_scale")]


def unknown_but(name):
    """All but one: with friction, a rod that is curved toward the object sticks at first, which is no record."""
    return {**dict.fromkeys(EVERY, "default"), "base": "default", name: PARAMETERS[name].neutral or 0.0}


SAID = {"free": unknown_but("friction"), "straight": unknown_but("rest_curvature"), "usual": {}}


@pytest.mark.parametrize("said", SAID.values(), ids=SAID)
@pytest.mark.parametrize("frame", ["fixed", "turning"])
def test_readings_are_those_that_inference_expects_at_the_truth(said, frame):
    spec = changed(SI, unknown=said, load_cell__frame=frame)
    for number in (0, 3):
        one = record(spec, number)
        truth = {k.removeprefix("truth_").removeprefix("contour_"): v for k, v in one.attrs.items() if k[:5] == "truth"}
        assert {name for name, value in said.items() if value == "default" and name != "base"} <= set(truth)
        rig = Rig(load_cell=LoadCell.from_record(one) or LoadCell(), unknown=said)
        assert_expected(one, rig, truth, 1e-6)


def test_numbers_are_known_and_distributions_are_drawn():
    unknown = {
        **NOTHING,
        "friction": {"half_normal": 0.5},
        "lever": 0.01,
        "moment_gain": {"choice": [0.9, 1.1]},
        "noise_scale": {"gamma": {"a": 2.0}},
        "force_x_bias": "default",
    }
    spec = read_specification(changed(PLAIN, records=400, shard_records=400, unknown=unknown))
    data = records_as_dataset(spec, generate_records(spec, 0, 400))
    assert "friction" not in data.attrs
    assert {n for n in data if str(n).startswith("truth_") and n[6:] in PARAMETERS} == {
        f"truth_{n}" for n in ("friction", "lever_x", "lever_y", "moment_gain", "noise_scale", "force_x_bias")
    }
    assert set(np.unique(data.truth_lever_x)) == {0.01}
    assert set(np.unique(data.truth_moment_gain)) == {0.9, 1.1}
    assert data.truth_friction.max() < 0.84
    whole = stats.halfnorm(scale=0.5)
    for values, cdf in (
        (data.truth_friction, lambda x: whole.cdf(x) / whole.cdf(PARAMETERS["friction"].high)),
        (data.truth_noise_scale, stats.gamma(a=2.0).cdf),
        (data.truth_force_x_bias, stats.norm(0.0, 0.1).cdf),
    ):
        assert stats.kstest(values.values, cdf).pvalue > FALSE_ALARM


def test_a_named_rig_is_as_its_tables(tmp_path):
    rig = Rig(
        Rod(0.1, 1e-4, stem=0.002),
        LoadCell(force_noise=1e-3, moment_noise=4e-5, lever=(0.001, 0.0), frame="turning"),
        unknown={"friction": stats.halfnorm(scale=0.2), "lever": 0.0},
    )
    rig.write(tmp_path / "rig.toml")
    plain = {key: SI[key] for key in ("records", "seed", "contours")}
    (tmp_path / "set.toml").write_text(
        'rig = "rig.toml"\nrecords = 6\nseed = 5\ncontours = [{ family = "circle", r = { uniform = [0.04, 0.06] }, '
        "q = { uniform = [0.05, 0.06] } }]\n"
    )
    named, held = read_specification(tmp_path / "set.toml"), read_specification({**plain, "rig": rig})
    tables = {
        "rod": {"length": 0.1, "flexural_rigidity": 1e-4, "stem": 0.002},
        "load_cell": {"force_noise": 1e-3, "moment_noise": 4e-5, "lever_x": 0.001, "frame": "turning"},
        "unknown": {"friction": {"half_normal": 0.2}, "lever": 0.0},
    }
    assert named.sha256 == held.sha256 == read_specification({**plain, **tables}).sha256
    generate(tmp_path / "set.toml", tmp_path / "out", workers=1)
    (tmp_path / "rig.toml").unlink()
    assert record(tmp_path / "out", 2).identical(record(held, 2))
    assert read_specification({**plain, "rig": rig, "unknown": "nothing"}).unknown == {}
    Rig(Rod(0.1, 2e-4)).write(tmp_path / "rig.toml")
    assert read_specification(tmp_path / "set.toml").sha256 != named.sha256


def test_a_rig_that_says_nothing_of_unknowns_has_those_of_a_real_rig_and_tables_have_none():
    plain = {key: SI[key] for key in ("records", "seed", "contours")}
    assert len(read_specification({**plain, "rig": Rig(Rod(0.1, 1e-4), LoadCell())}).unknown) == 9
    assert read_specification(plain).unknown == {}


def test_a_calibrated_rig_is_drawn_jointly():
    priors = {"lever_x": stats.norm(0.001, 0.0002), "rigidity_scale": stats.lognorm(s=0.05)}
    found = RigPrior(priors, np.array([[1.0, 0.8], [0.8, 1.0]]), 0.1, "0" * 64)
    rig = Rig(Rod(0.1, 1e-4), LoadCell(), unknown={"friction": 0.0}, calibration=found)
    spec = read_specification({"records": 300, "seed": 1, "contours": [CIRCLE], "rig": rig})
    drawn = generate_records(spec, 0, 300).drawn
    lever, stiffer = (drawn[f"unknown.{name}"] for name in priors)
    assert stats.kstest(lever, priors["lever_x"].cdf).pvalue > FALSE_ALARM
    assert stats.kstest(stiffer, priors["rigidity_scale"].cdf).pvalue > FALSE_ALARM
    scores = np.arctanh(np.corrcoef(lever, np.log(stiffer))[0, 1]) - np.arctanh(0.8)
    assert abs(scores) < stats.norm.isf(FALSE_ALARM / 2) / np.sqrt(297)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"unknown": {"fricton": 0.1}}, ["unknown.fricton", "'friction'"]),
        ({"unknown": "everything"}, ["unknown is 'everything'", "nothing"]),
        ({"unknown": {"friction": {"choice": [0.1, 2.0]}}}, ["friction", "2.0"]),
        ({"unknown": {"friction": {"normal": [0.1, 0.0]}}}, ["friction", "no width"]),
        ({"unknown": {"gauge": "default"}}, ["gauge"]),
        ({"unknown": {"discrepancy": "default"}}, ["discrepancy", "not drawn"]),
        ({"unknown": {"force_noise": "default"}}, ["force_noise", "load cell"]),
        ({"unknown": {"lever": "2 mm"}}, ["unknown.lever", "dimensionless"]),
        ({"rod": {"length": "100 N", "flexural_rigidity": 1.0}}, ["rod.length", "100 N"]),
        ({"rod": {"length": 0.1, "flexural_rigidity": 1e-4, "shape": "a.csv"}}, ["rod.shape", "arcs"]),
        ({"rod": {"lenght": 0.1}}, ["rod.lenght", "'length'"]),
        ({"rig": 3, "load_cell": None}, ["rig is 3"]),
        ({"rig": Rig(Rod())}, ["rig", "[load_cell]"]),
    ],
    ids=lambda value: str(value)[:40],
)
def test_what_is_impossible_is_refused(change, named):
    with refused(SpecificationError, *named):
        read_specification({key: value for key, value in (PLAIN | change).items() if value is not None})

"""Specifications: what they may say, and how refusals name what is wrong."""

import tomllib

import numpy as np
import pytest

from helpers.data_sets import PLAIN, RICH, changed
from helpers.refusals import refused
from tactile_bayes.datasets import read_specification
from tactile_bayes.datasets.generation import generate_records
from tactile_bayes.datasets.specification import toml_of
from tactile_bayes.errors import SpecificationError
from tactile_bayes.load_cell import OrnsteinUhlenbeck

PARABOLA = {"family": "parabola", "a": 1.0, "q": 0.5}
SHAPE_FREE = {"family": "shape-free", "r": 0.5, "amplitude": 0.5, "length_scale": 1.0, "q": 0.5}


def contour(family=PARABOLA, **changes):
    return {"contours": [{**family, **changes}]}


def of(family, **values):
    return {"contours": [{"family": family, "q": 0.5, **values}]}


@pytest.mark.parametrize("spec", [PLAIN, RICH])
def test_a_mapping_and_its_toml_are_one(spec, tmp_path):
    path = tmp_path / "a b.toml"
    path.write_text(toml_of(spec), encoding="utf-8")
    assert tomllib.loads(path.read_text()) == spec
    assert vars(read_specification(path)) == vars(read_specification(spec))
    assert read_specification(str(path)).sha256 == read_specification(spec).sha256


@pytest.mark.parametrize(
    "change",
    [
        {"precision": "double", "each_contour": False, "description": "", "rod": {}},
        {"scan__margin": 0.1, "scan__bases": [[0, 0]], "scan__directions": ["forward", "backward"]},
        {"load_cell__frame": "fixed"},
        {"contours": [{**PLAIN["contours"][0], "weight": 1}]},
    ],
)
def test_defaults_that_are_written_out_do_not_count(change):
    assert read_specification(changed(PLAIN, **change)).sha256 == read_specification(PLAIN).sha256
    flat = {**PLAIN, "contours": [PARABOLA]}
    assert read_specification(changed(flat, **contour(x_c=0.0))).sha256 == read_specification(flat).sha256


def test_what_is_said_counts():
    changes = ({"seed": 8}, {"records": 32}, {"shard_records": 4}, {"name": "other"}, {"precision": "single"})
    for change in (*changes, {"scan__margin": 0.2}):
        assert read_specification(changed(PLAIN, **change)).sha256 != read_specification(PLAIN).sha256, change


def test_numpy_numbers_and_tuples_are_taken():
    spec = {
        "records": np.int64(3),
        "seed": 1,
        **contour(a={"uniform": (np.float64(0.5), 1.0)}, q={"choice": np.array([0.4, 0.5])}),
    }
    plain = {"records": 3, "seed": 1, **contour(a={"uniform": [0.5, 1.0]}, q={"choice": [0.4, 0.5]})}
    assert read_specification(spec).sha256 == read_specification(plain).sha256


REFUSED = [
    ({"record": 5}, ["there is no key 'record'", "'records'"]),
    ({"records": None}, ["records is missing"]),
    ({"seed": None}, ["seed is missing"]),
    ({"records": 0}, ["records is 0"]),
    ({"records": 8_000_001}, ["records is 8000001", "8000000"]),
    ({"name": 3}, ["name is 3"]),
    ({"precision": "half"}, ["precision is 'half'"]),
    ({"each_contour": "yes"}, ["each_contour is 'yes'"]),
    ({"contours": None}, ["there are no contours", "[[contours]]"]),
    ({"contours": {"family": "circle"}}, ["contours is one table", "[[contours]]"]),
    ({"contours": [{"a": 1.0}]}, ["contours[0].family is missing"]),
    (contour(a=-1.0), ["contours[0].a is -1"]),
    (contour(a={"uniform": [-0.5, 3.0]}), ["contours[0].a may be -0.5"]),
    (contour(a={"normal": [-1.0, 0.0]}), ["contours[0].a may be -1"]),
    ({"contours": [PARABOLA, {"family": "power-law", "w": 1.0, "n": 1.0, "q": 0.5}]}, ["contours[1].n is 1", "1.1"]),
    (of("power-law", w=1.0, n={"log_uniform": [1.5, 80.0]}), ["contours[0].n may be 80", "50"]),
    (of("ellipse/power-law", left_a=1, left_b=0, right_w=1, right_n=2), ["contours[0].left_b is 0"]),
    (contour(SHAPE_FREE, length_scale=0.01), ["contours[0].length_scale is 0.01", "0.15 to 4 rad"]),
    ({"contours": [PARABOLA, {"family": "square"}]}, ["contours[1].family is 'square'"]),
    ({"contours": [{"family": "parabola", "a": 1.0}]}, ["contours[0] is a parabola and has no q"]),
    (contour(r=1.0), ["there is no key 'contours[0].r'"]),
    (contour(weight=0), ["contours[0].weight is 0.0"]),
    ({**contour(weight=1), "each_contour": True}, ["contours[0].weight is 1.0", "each_contour"]),
    (contour(q="deep"), ["contours[0].q is 'deep'"]),
    (contour(q=10**400), ["contours[0].q", 10**400]),
    (contour(q={"uniform": [0.3, 0.5], "normal": [0, 1]}), ["contours[0].q is {"]),
    (contour(q={"gamma": [1, 2]}), ["contours[0].q has the distribution 'gamma'"]),
    (contour(q={"each": [1.0, "2"]}), ["contours[0].q.each is [1.0, '2']"]),
    (contour(q={"uniform": [0.3]}), ["contours[0].q.uniform is [0.3]", "2"]),
    (contour(q={"uniform": [0.5, 0.3]}), ["contours[0].q.uniform is [0.5, 0.3]"]),
    ({"rod": 3}, ["rod is 3"]),
    ({"rod": {"length": 0.1}}, ["rod needs length [m] and flexural_rigidity [N m²]"]),
    ({"rod": {"length": {"normal": [0.1, 0.01]}, "flexural_rigidity": 1.0}}, ["rod.length may be negative"]),
    ({"rod": {"rest_curvature": 4.0}}, ["rest_curvature", "half circle"]),
    ({"rod": {"taper": 1.0}}, ["rod.taper is 1", "0.95"]),
    ({"rod": {"taper": {"log_normal": [0.5, 0.1]}}}, ["rod.taper may be unbounded"]),
    ({"rod": {"length": 0.1, "flexural_rigidity": 0.0}}, ["rod.flexural_rigidity is 0"]),
    ({"scan__bases": []}, ["scan.bases is []"]),
    ({"scan__bases": [[0.0, "x"]]}, ["scan.bases[0][1] is 'x'"]),
    ({"scan__directions": "forward"}, ["scan.directions is 'forward'"]),
    ({"scan__margin": -0.1}, ["scan.margin is -0.1"]),
    ({"scan__from_degrees": 10}, ["scan.to_degrees is missing"]),
    ({"scan__seed": 10}, ["there is no key 'scan.seed'", "top"]),
    ({"scan": {"from_degrees": 10, "to_degrees": 90, "margin": 0.1}}, ["from_degrees and to_degrees, and a margin"]),
    ({"scan": {"from_degrees": 90, "to_degrees": 10}}, ["scan.from_degrees is 90", "to_degrees, 10"]),
    ({"unknown": {"friction": 2.0}}, ["friction", "2.0", "0.8423"]),
    ({"load_cell__frce_noise": 9}, ["there is no key 'load_cell.frce_noise'", "'force_noise'"]),
    ({"load_cell__frame": "loose"}, ["load_cell.frame is 'loose'"]),
    ({"load_cell__force_noise": -1.0}, ["load_cell", "force_noise is -1.0"]),
    ({"load_cell__force_noise": {"normal": [0.05, 0.001]}}, ["load_cell.force_noise may be negative"]),
    ({"load_cell__lag_seconds_force_x": 0.1}, ["lag_seconds_force_x", "times"]),
    ({"unknown": {"lag_seconds": "default"}}, ["lag_seconds", "times"]),
    ({"load_cell": {"force_resolution": 2.0, "force_range": 1.0}}, ["load_cell", "force_resolution is 2.0"]),
    ({**contour(q={"each": [0.3, 0.4, 0.5]}), "records": 25}, ["records is 25", "'each'", "3 combinations"]),
]


@pytest.mark.parametrize(("change", "named"), REFUSED, ids=[named[0] for _, named in REFUSED])
def test_what_is_impossible_is_refused_by_its_key(change, named):
    with refused(SpecificationError, "specification", *named):
        read_specification(changed(PLAIN, **change))


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (b"records = ", ["TOML"]),
        (b"records = 1\nrecords = 2", ["TOML", "overwrite"]),
        (b"name = '\xff'", ["UTF-8", "byte 8"]),
        (b"seed = 1979-05-27\nrecords = 1\n[[contours]]\nfamily='circle'\nr=1\nq=0.5", ["seed", "datetime.date"]),
        (b"", ["empty", "dataset example"]),
        (b"# nothing\n", ["empty"]),
    ],
)
def test_a_refusal_names_the_file(tmp_path, content, named):
    path = tmp_path / "spec.toml"
    path.write_bytes(content)
    with refused(SpecificationError, path, *named):
        read_specification(path)


def test_what_no_toml_holds_and_a_missing_file_are_refused():
    with refused(SpecificationError, "specification", "NoneType"):
        read_specification({"records": None})
    with pytest.raises(FileNotFoundError):
        read_specification("no such file.toml")


def test_the_time_of_a_drift_is_stated_though_it_is_left_out():
    distributions = read_specification(changed(PLAIN, load_cell={"ornstein_uhlenbeck_force": 0.1})).load_cell
    assert distributions["ornstein_uhlenbeck_time"].numbers == (OrnsteinUhlenbeck().time,)


def test_defaults():
    spec = read_specification({"records": 1, "seed": 0, "contours": [PARABOLA]})
    assert (spec.name, spec.description, spec.shard_records, spec.single) == ("unnamed", "", 500, False)
    assert spec.sweeps == ((0, "forward"), (0, "backward"))
    assert (spec.drive.samples, spec.drive.margin, spec.friction) == (180, 0.1, 0.0)
    assert (spec.frame, spec.units) == ("fixed", "dimensionless")
    weights = read_specification({"records": 1, "seed": 0, "contours": [SHAPE_FREE]}).groups[0].distributions
    assert (weights["z_1"].kind, weights["z_1"].numbers, weights["x_c"].numbers) == ("normal", (0.0, 1.0), (0.0,))


def test_lists_alone_say_how_many_records_there_are_and_on_one_axis_advance_in_step():
    table = {
        "seed": 1,
        **contour(q={"each": [0.3, 0.4]}),
        "load_cell": {
            "force_noise": {"each": [0.01, 0.02, 0.05], "axis": "noise"},
            "moment_noise": {"each": [0.1, 0.2, 0.5], "axis": "noise"},
        },
    }
    spec = read_specification(table)
    assert spec.lists == (("contours[0].q", 2), ("noise", 3))
    assert spec.records == 6
    drawn = generate_records(spec, 0, 6).drawn
    np.testing.assert_array_equal(drawn["contours[0].q"], np.repeat([0.3, 0.4], 3))
    np.testing.assert_array_equal(drawn["load_cell.force_noise"], np.tile([0.01, 0.02, 0.05], 2))
    np.testing.assert_array_equal(drawn["load_cell.moment_noise"], np.tile([0.1, 0.2, 0.5], 2))
    table["load_cell"]["force_noise"] = {"each": [0.01, 0.02], "axis": "noise"}
    with refused(SpecificationError, "load_cell.moment_noise", 3, "'noise'", 2):
        read_specification(table)
    with refused(SpecificationError, "load_cell.force_noise.axis", 3):
        read_specification({"seed": 1, **contour(), "load_cell": {"force_noise": {"each": [0.1], "axis": 3}}})

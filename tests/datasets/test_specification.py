"""Specifications: what they may say, and how refusals name what is wrong."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest

from helpers.data_sets import PLAIN, RICH, changed
from tactile_bayes.datasets import read_specification
from tactile_bayes.datasets.generation import generate_records
from tactile_bayes.datasets.specification_text import toml_of
from tactile_bayes.errors import SpecificationError
from tactile_bayes.load_cell import OrnsteinUhlenbeck

PARABOLA = {"family": "parabola", "a": 1.0, "q": 0.5}
WORDS = """
# what nobody reads
name = "parabolas"
records = 24
shard_records = 8   # files
seed = 7

[[contours]]
q.uniform = [0.30, 0.7]
family = 'parabola'
a = { log_uniform = [
    3e-1,
    3,
] }
x_c = { normal = [0.0, 5e-2] }

[load_cell]
force_noise = 0.05
moment_noise = { log_normal = [2e-2, 0.3] }

[scan]
samples = 24
"""


def contour(**changes):
    return {"contours": [{**PARABOLA, **changes}]}


@pytest.mark.parametrize("spec", [PLAIN, RICH])
def test_a_mapping_and_its_toml_are_one(spec, tmp_path):
    path = tmp_path / "a b.toml"
    path.write_text(toml_of(spec), encoding="utf-8")
    assert tomllib.loads(path.read_text()) == spec
    assert vars(read_specification(path)) == vars(read_specification(spec))
    assert read_specification(str(path)).sha256 == read_specification(spec).sha256


def test_comments_layout_and_kinds_of_number_do_not_count(tmp_path):
    path = tmp_path / "spec.toml"
    path.write_text(WORDS)
    assert read_specification(path).sha256 == read_specification(PLAIN).sha256


@pytest.mark.parametrize(
    "change",
    [
        {"precision": "double", "each_contour": False, "description": "", "rod": {}},
        {
            "scan__margin": 0.1,
            "scan__bases": [[0, 0]],
            "scan__directions": ["forward", "backward"],
            "scan__friction": 0,
        },
        {"load_cell__frame": "fixed"},
        {"contours": [{**PLAIN["contours"][0], "weight": 1}]},
    ],
)
def test_defaults_that_are_written_out_do_not_count(change):
    assert read_specification(changed(PLAIN, **change)).sha256 == read_specification(PLAIN).sha256
    flat = {**PLAIN, "contours": [PARABOLA]}
    assert read_specification(changed(flat, **contour(x_c=0.0))).sha256 == read_specification(flat).sha256


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 8},
        {"records": 32},
        {"shard_records": 4},
        {"name": "other"},
        {"scan__margin": 0.2},
        {"precision": "single"},
    ],
)
def test_what_is_said_counts(change):
    assert read_specification(changed(PLAIN, **change)).sha256 != read_specification(PLAIN).sha256


def test_numpy_numbers_and_tuples_are_taken():
    spec = {
        "records": np.int64(3),
        "seed": 1,
        **contour(a={"uniform": (np.float64(0.5), 1.0)}, q={"choice": np.array([0.4, 0.5])}),
    }
    plain = {"records": 3, "seed": 1, **contour(a={"uniform": [0.5, 1.0]}, q={"choice": [0.4, 0.5]})}
    assert read_specification(spec).sha256 == read_specification(plain).sha256


REFUSED = [
    ({"record": 5}, "there is no key 'record': did you mean 'records'?"),
    ({"no such": 5}, "there is no key 'no such': there are name, description"),
    ({"records": None}, "records is missing: give a whole number"),
    ({"seed": None}, "seed is missing: give a whole number"),
    ({"records": 0}, "records is 0: give a whole number from 1 to"),
    ({"records": 24.0}, "records is 24.0: give a whole number"),
    ({"records": True}, "records is True: give a whole number"),
    ({"records": 8_000_001}, "records is 8000001: give a whole number from 1 to 8000000"),
    ({"seed": -1}, "seed is -1: give a whole number from 0 to 2^63 - 1"),
    ({"seed": "x"}, "seed is 'x': give a whole number"),
    ({"shard_records": 0}, "shard_records is 0: give a whole number from 1 to 100000"),
    ({"name": 3}, "name is 3: give a text"),
    ({"description": [1]}, r"description is [1]: give a text"),
    ({"precision": "half"}, "precision is 'half': choose 'double' or 'single'"),
    ({"each_contour": "yes"}, "each_contour is 'yes': write true or false"),
    ({"contours": None}, "there are no contours: give at least one table [[contours]]"),
    ({"contours": []}, "there are no contours"),
    ({"contours": 5}, "there are no contours"),
    ({"contours": {"family": "circle"}}, "contours is one table: write [[contours]], in two pairs of brackets"),
    ({"contours": [{"a": 1.0}]}, "contours[0].family is missing: choose from parabola, circle"),
    (contour(a=-1.0), "contours[0].a is -1: a must be positive, else the object is not strictly convex"),
    (contour(a={"uniform": [-0.5, 3.0]}), "contours[0].a may be -0.5: a must be positive, else"),
    (contour(a={"choice": [1.0, 0.0]}), "contours[0].a may be 0: a must be positive, else"),
    (contour(a={"each": [1.0, -2.0]}), "contours[0].a may be -2: a must be positive, else"),
    (contour(a={"normal": [-1.0, 0.0]}), "contours[0].a may be -1: a must be positive, else"),
    ({"contours": [{"family": "circle", "r": -1, "q": 0.5}]}, "contours[0].r is -1: the radius r must be positive"),
    (
        {"contours": [PARABOLA, {"family": "power-law", "w": 1.0, "n": 1.0, "q": 0.5}]},
        "contours[1].n is 1: n must be at least 1.1: below, the vertex is as good as an edge",
    ),
    (
        {"contours": [{"family": "power-law", "w": 1.0, "n": {"log_uniform": [1.5, 80.0]}, "q": 0.5}]},
        "contours[0].n may be 80: n must be at most 50",
    ),
    (
        {"contours": [{"family": "power-law", "w": -1.0, "n": 3.0, "q": 0.5}]},
        "contours[0].w is -1: w must be positive and finite",
    ),
    (
        {"contours": [{"family": "power-law", "a": {"uniform": [1.0, 2.0]}, "n": 3.0, "q": 0.5}]},
        "contours[0].a was a parameter of the family power-law in earlier versions: write w in its place, the width at "
        "which it is as high as wide, a^(1/(1 − n))",
    ),
    (
        {"contours": [{"family": "parabola/power-law", "left_a": 5, "right_a": 1000, "right_n": 4, "q": 0.5}]},
        "contours[0].right_a was a parameter of the family power-law in earlier versions: write right_w in its place, "
        "the width at which it is as high as wide, a^(1/(1 − n)), here 0.1",
    ),
    (
        {"contours": [{"family": "shape-free", "radius": 0.5, "amplitude": 0.5, "length_scale": 1.0, "q": 0.5}]},
        "contours[0].radius was a parameter of the family shape-free in earlier versions: write r in its place, its ",
    ),
    (
        {"contours": [{"family": "ellipse/power-law", "left_a": 1, "left_b": 0, "right_w": 1, "right_n": 2, "q": 1}]},
        "contours[0].left_b is 0: the half-axis b must be positive and finite",
    ),
    (
        {"contours": [{"family": "shape-free", "r": 0.5, "amplitude": -0.1, "length_scale": 1.0, "q": 0.5}]},
        "contours[0].amplitude is -0.1: amplitude must be finite and not negative",
    ),
    (
        {"contours": [{"family": "shape-free", "r": 0.5, "amplitude": 0.5, "length_scale": 0.01, "q": 0.5}]},
        "contours[0].length_scale is 0.01: length_scale must be from 0.15 to 4 rad",
    ),
    ({"contours": [{"family": ["circle"]}]}, "contours[0].family is ['circle']: choose from parabola, circle"),
    ({"contours": [PARABOLA, {"family": "square"}]}, "contours[1].family is 'square': choose from parabola, circle"),
    (
        {"contours": [{"family": "parabola", "a": 1.0}]},
        "contours[0] is a parabola and has no q: give a number or a distribution",
    ),
    (contour(r=1.0), "there is no key 'contours[0].r'"),
    (contour(weight=0), "contours[0].weight is 0.0: it must be positive"),
    (contour(weight=float("inf")), "contours[0].weight is inf: give a number from 0 to 1e+09"),
    (contour(weight=10**400), "contours[0].weight is a int: give a number from 0"),
    (contour(weight=-1), "contours[0].weight is -1: give a number"),
    (
        {**contour(weight=1), "each_contour": True},
        "contours[0].weight is 1.0: with each_contour every family comes as often",
    ),
    (contour(q="deep"), "contours[0].q is 'deep': give a number, or a distribution such as"),
    (contour(q=float("nan")), "contours[0].q is nan: give a number, or a distribution"),
    (contour(q=10**400), "contours[0].q is 1"),
    (contour(q=True), "contours[0].q is True: give a number, or a distribution"),
    (contour(q={"uniform": [0.3, 0.5], "normal": [0, 1]}), "contours[0].q is {"),
    (
        contour(q={"gamma": [1, 2]}),
        "contours[0].q has the distribution 'gamma', which is unknown: give a number, or a distribution",
    ),
    (
        contour(q={"uniform, log_uniform": [1, 2]}),
        "contours[0].q has the distribution 'uniform, log_uniform', which is unknown",
    ),
    (contour(q={"uniform": 0.3}), "contours[0].q.uniform is 0.3: give a list of finite numbers"),
    (contour(q={"choice": []}), "contours[0].q.choice is []: give a list of finite numbers"),
    (contour(q={"each": [1.0, "2"]}), "contours[0].q.each is [1.0, '2']: give a list of finite numbers"),
    (contour(q={"uniform": [0.3]}), "contours[0].q.uniform has 1 numbers: give two"),
    (contour(q={"uniform": [0.5, 0.3]}), "contours[0].q.uniform is [0.5, 0.3]: the first must be below the second"),
    (contour(q={"log_uniform": [0, 1]}), "contours[0].q.log_uniform is [0, 1]: both must be positive"),
    (contour(q={"normal": [0, -1]}), "contours[0].q.normal is [0, -1]: they are mean and standard deviation"),
    (contour(q={"log_normal": [-1, 1]}), "contours[0].q.log_normal is [-1, 1]: they are the median, positive"),
    (
        {"contours": [{"family": "shape-free", "r": 0.0, "amplitude": 0.1, "length_scale": 1.0, "q": 0.5}]},
        "contours[0].r is 0: r must be positive and finite",
    ),
    ({"rod": 3}, "rod is 3: write it as a table, [rod]"),
    ({"rod": {"length": 0.1}}, "rod needs length [m] and flexural_rigidity [N m²]"),
    ({"rod": {"length": 0.1, "stiffness": 1.0}}, "there is no key 'rod.stiffness'"),
    (
        {"rod": {"length": {"normal": [0.1, 0.01]}, "flexural_rigidity": 1.0}},
        "rod.length may be negative: choose a distribution of positive",
    ),
    ({"rod": {"length": 0.1, "flexural_rigidity": 0.0}}, "rod.flexural_rigidity may be 0: choose a distribution"),
    ({"rod": {"length": 0.1, "flexural_rigidity": 1.0, "diameter": -1.0}}, "rod.diameter may be negative"),
    ({"scan": "all"}, "scan is 'all': write it as a table, [scan]"),
    ({"scan__speed": 1.0}, "there is no key 'scan.speed'"),
    ({"scan__bases": []}, "scan.bases is []: give a list of pivots, each [x, y]"),
    ({"scan__bases": [0.0, 0.0]}, "scan.bases is [0.0, 0.0]: give a list of pivots"),
    ({"scan__bases": [[0.0, "x"]]}, "scan.bases[0][1] is 'x': give a number, or a distribution"),
    ({"scan__directions": "forward"}, "scan.directions is 'forward': give 'forward', 'backward' or both"),
    ({"scan__directions": ["up"]}, "scan.directions is ['up']: give"),
    ({"scan__directions": [["forward"]]}, "scan.directions is [['forward']]: give"),
    ({"scan__directions": ["forward", "forward"]}, "scan.directions is ['forward', 'forward']: give"),
    ({"scan__samples": 1}, "scan.samples is 1: give a whole number from 2 to"),
    ({"scan__margin": -0.1}, "scan.margin is -0.1: give a number from 0 to 1"),
    ({"scan__margin": "wide"}, "scan.margin is 'wide': give a number"),
    ({"scan__from_degrees": 10}, "scan.to_degrees is missing: give it beside from_degrees, or neither"),
    ({"scan__to_degrees": 10}, "scan.from_degrees is missing: give it beside to_degrees, or neither"),
    ({"scan__seed": 10}, "there is no key 'scan.seed': its place is the top, above the first table"),
    (
        {"scan": {"from_degrees": 10, "to_degrees": 90, "margin": 0.1}},
        "scan has from_degrees and to_degrees, and a margin: leave the one or the others out",
    ),
    ({"scan": {"from_degrees": 90, "to_degrees": 10}}, "scan.from_degrees is 90, not below to_degrees, 10"),
    ({"scan": {"from_degrees": -400, "to_degrees": 10}}, "scan.from_degrees is -400: give a number from -360 to 360"),
    ({"scan__friction": 2.0}, "scan.friction is 2.0: give a number from 0 to 0.84"),
    ({"load_cell": [1]}, "load_cell is [1]: write it as a table, [load_cell]"),
    ({"load_cell__noise": 1.0}, "there is no key 'load_cell.noise'"),
    ({"load_cell__samples": 9}, "there is no key 'load_cell.samples': its place is the table [scan]"),
    ({"load_cell__frce_noise": 9}, "there is no key 'load_cell.frce_noise': did you mean 'force_noise'?"),
    ({"load_cell__frame": "loose"}, "load_cell.frame is 'loose': choose 'fixed' or 'turning'"),
    ({"load_cell__frame": ["fixed"]}, "load_cell.frame is ['fixed']: choose 'fixed' or 'turning'"),
    ({"load_cell__force_noise": -1.0}, "load_cell: the load cell's force_noise is -1.0"),
    (
        {"load_cell__force_noise": {"normal": [0.05, 0.001]}},
        "load_cell.force_noise may be negative: choose a distribution of positive",
    ),
    ({"load_cell__force_noise": "some"}, "load_cell.force_noise is 'some': give a number, or a distribution"),
    (
        {"load_cell": {"force_resolution": 2.0, "force_range": 1.0}},
        "load_cell: the load cell's force_resolution is 2.0",
    ),
    (
        {**contour(q={"each": [0.3, 0.4, 0.5]}), "records": 25},
        "records is 25, but the lists of 'each' make 3 combinations",
    ),
]


@pytest.mark.parametrize(("change", "message"), REFUSED, ids=[message[:50] for _, message in REFUSED])
def test_what_is_impossible_is_refused_by_its_key(change, message):
    with pytest.raises(SpecificationError, match="^specification: " + re.escape(message)):
        read_specification(changed(PLAIN, **change))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"records = ", "not TOML: Invalid value"),
        (b"records = 1\nrecords = 2", "not TOML: Cannot overwrite a value"),
        (b"name = '\xff'", "not a text in UTF-8: invalid start byte at byte 8"),
        (b"seed = 1979-05-27", "seed is datetime.date"),
        (b"", "it is empty: `tactile-bayes dataset example` prints one to start from"),
        (b"# nothing\n", "it is empty"),
    ],
)
def test_a_refusal_names_the_file(tmp_path, content, message):
    path = tmp_path / "spec.toml"
    path.write_bytes(content)
    if b"seed = 1979" in content:
        path.write_bytes(content + b"\nrecords = 1\n[[contours]]\nfamily='circle'\nr=1\nq=0.5")
    with pytest.raises(SpecificationError, match=f"^{re.escape(str(path))}: {message}"):
        read_specification(path)


def test_what_no_toml_holds_is_refused():
    with pytest.raises(
        SpecificationError, match="a specification holds numbers, words, lists and tables, and no NoneType"
    ):
        read_specification({"records": None})


def test_a_missing_file_is_that():
    with pytest.raises(FileNotFoundError):
        read_specification("no such file.toml")


def test_a_key_of_no_table_is_refused_without_all_there_are():
    with pytest.raises(SpecificationError, match=r"'load_cell\.xyz': there are frame(, \w+){7} and others: `tactile-b"):
        read_specification(changed(PLAIN, load_cell__xyz=1.0))


def test_the_time_of_a_drift_is_stated_though_it_is_left_out():
    distributions = read_specification(changed(PLAIN, load_cell={"ornstein_uhlenbeck_force": 0.1})).load_cell
    assert distributions["ornstein_uhlenbeck_time"].numbers == (OrnsteinUhlenbeck().time,)


def test_defaults():
    spec = read_specification({"records": 1, "seed": 0, "contours": [PARABOLA]})
    assert (spec.name, spec.description, spec.shard_records, spec.single) == ("unnamed", "", 500, False)
    assert spec.sweeps == ((0, "forward"), (0, "backward"))
    assert (spec.drive.samples, spec.drive.margin, spec.friction, spec.frame, spec.units) == (
        180,
        0.1,
        0.0,
        "fixed",
        "dimensionless",
    )


def test_lists_alone_say_how_many_records_there_are():
    each = contour(q={"each": [0.3, 0.4, 0.5]}, a={"each": [1.0, 2.0]})
    spec = read_specification({"seed": 1, **each})
    assert spec.records == 6
    assert spec.lists == (("contours[0].a", 2), ("contours[0].q", 3))


def test_lists_on_one_axis_advance_in_step():
    levels = {"each": [0.01, 0.02, 0.05], "axis": "noise"}
    table = {
        "seed": 1,
        **contour(q={"each": [0.3, 0.4]}),
        "load_cell": {"force_noise": levels, "moment_noise": {"each": [0.1, 0.2, 0.5], "axis": "noise"}},
    }
    spec = read_specification(table)
    assert spec.lists == (("contours[0].q", 2), ("noise", 3))
    assert spec.records == 6
    drawn = generate_records(spec, 0, 6).drawn
    np.testing.assert_array_equal(drawn["contours[0].q"], np.repeat([0.3, 0.4], 3))
    np.testing.assert_array_equal(drawn["load_cell.force_noise"], np.tile([0.01, 0.02, 0.05], 2))
    np.testing.assert_array_equal(drawn["load_cell.moment_noise"], np.tile([0.1, 0.2, 0.5], 2))


def test_lists_on_one_axis_are_equally_long():
    load_cell = {
        "force_noise": {"each": [0.01, 0.02], "axis": "noise"},
        "moment_noise": {"each": [0.1, 0.2, 0.5], "axis": "noise"},
    }
    with pytest.raises(SpecificationError, match=r"load_cell\.moment_noise has 3 numbers, .* axis 'noise' has 2"):
        read_specification({"seed": 1, **contour(), "load_cell": load_cell})
    with pytest.raises(SpecificationError, match=r"load_cell\.force_noise\.axis is 3: give a name"):
        read_specification({"seed": 1, **contour(), "load_cell": {"force_noise": {"each": [0.1], "axis": 3}}})

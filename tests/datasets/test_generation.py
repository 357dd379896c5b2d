"""The numbers of data sets: truth against scans, readings against the load cell, draws against their distributions."""

import warnings
from collections import Counter

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from helpers.data_sets import PLAIN, RICH, changed
from tactile_bayes.contours import Circle
from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.contours.shape_free_family import SHAPE_FREE
from tactile_bayes.datasets import contour_of, read_specification, record
from tactile_bayes.datasets.generation import generate_records
from tactile_bayes.datasets.shard import records_as_dataset
from tactile_bayes.datasets.specification import left_out
from tactile_bayes.errors import SpecificationError, StrainWarning
from tactile_bayes.record import loads_of
from tactile_bayes.rig import NOTHING, Rig
from tactile_bayes.sweep import scan_many

FALSE_ALARM = 1e-4  # of each statistical test here
RANGES = {
    "a": {"uniform": [0.5, 2.0]},
    "b": {"uniform": [0.3, 0.8]},
    "n": {"uniform": [2.0, 4.0]},
    "r": {"uniform": [0.4, 1.0]},
    "w": {"uniform": [0.6, 1.5]},
    "amplitude": 0.3,
    "length_scale": 1.0,
    "q": {"uniform": [0.3, 0.6]},
    "x_c": {"uniform": [-0.1, 0.1]},
}


def drawn_from(family, count=4, **more):
    group = {"family": family, "x_c": RANGES["x_c"]}
    for name in set(FAMILIES[family].parameters) - set(left_out(FAMILIES[family])):
        group[name] = RANGES[name.removeprefix("left_").removeprefix("right_")]
    return {"records": count, "seed": 3, "contours": [group], "scan": {"samples": 40}, **more}


def generated(spec):
    spec = read_specification(spec)
    return records_as_dataset(spec, generate_records(spec, 0, spec.records))


SI = {"length": 1.1, "flexural_rigidity": 1e-3}
ARCS = {"rest_curvature": {"uniform": [-0.5, 0.5]}}
DRAWN_BASE = [{"uniform": [-0.2, 0.2]}, {"uniform": [-0.1, 0.1]}]
TAPERED_SI = {"rest_curvature": {"normal": [0.0, 0.2]}, "diameter": 0.02, "taper": {"choice": [0.3, 0.7]}}
RIGS = {
    "rich": changed(RICH, precision=None, records=6, shard_records=6),
    "fixed grid": drawn_from("circle", scan={"samples": 50, "from_degrees": 20, "to_degrees": 190}),
    "backward alone": drawn_from("parabola", scan={"samples": 30, "directions": ["backward"], "margin": 0.0}),
    "random bases": drawn_from(
        "ellipse", scan={"samples": 30, "bases": [DRAWN_BASE, [0.1, -0.1]]}, unknown={**NOTHING, "friction": 0.3}
    ),
    "arcs": drawn_from("circle", rod=ARCS),
    "arcs in SI": drawn_from("circle", rod={**SI, "diameter": 1e-3, "rest_curvature": {"normal": [0.2, 0.1]}}),
    "tapered": drawn_from("circle", rod={**ARCS, "taper": {"each": [0.0, 0.9]}}),
    "tapered arcs in SI": drawn_from(
        "shape-free", scan={"samples": 30}, rod={**SI, **TAPERED_SI, "length": {"uniform": [1.0, 1.2]}}
    ),
}
FAMILIES_TRIED = ("parabola", "circle", "ellipse", "power-law", "shape-free", "power-law/circle", "parabola/parabola")


@pytest.mark.parametrize(
    "spec",
    [
        *(pytest.param(drawn_from(family), id=family, marks=pytest.mark.slow) for family in FAMILIES_TRIED),
        *(pytest.param(spec, id=name) for name, spec in RIGS.items()),
    ],
)
def test_the_truth_is_what_a_scan_of_the_contour_says(spec, assert_truths_are_those_of_scans):
    assert_truths_are_those_of_scans(spec, spec["records"])


def test_drive_angles_reach_from_before_contact_to_after_snap_off():
    data = generated(drawn_from("parabola", scan={"samples": 31, "margin": 0.25}))
    sign = np.array([1.0, -1.0])
    first, snap = sign * data.truth_first_contact_drive_angle, sign * data.truth_snap_off_drive_angle
    angles = sign[None, :, None] * data.drive_angle.values
    np.testing.assert_allclose(angles[:, :, 0], first - 0.25 * (snap - first), atol=1e-12)
    np.testing.assert_allclose(angles[:, :, -1], snap + 0.25 * (snap - first), atol=1e-12)
    np.testing.assert_allclose(np.diff(angles, n=2), 0.0, atol=1e-12)


def test_fixed_drive_angles_and_bases_are_those():
    data = generated(RIGS["fixed grid"])
    grid = np.radians(np.linspace(20.0, 190.0, 50))
    np.testing.assert_allclose(data.drive_angle[:, 0], np.tile(grid, (4, 1)), atol=1e-12)
    np.testing.assert_allclose(data.drive_angle[:, 1], np.tile(grid[::-1], (4, 1)), atol=1e-12)
    data = generated(RIGS["random bases"])
    np.testing.assert_array_equal(data.base_x[:, 2:], 0.1)
    np.testing.assert_array_equal(data.base_y[:, 2:], -0.1)


CELLS = {
    "white noise": {"moment_noise": {"log_normal": [0.02, 0.3]}, "force_noise": {"uniform": [0.02, 0.05]}},
    "everything": {
        "moment_noise": 0.02,
        "force_noise": {"choice": [0.02, 0.05]},
        "relative_noise": {"uniform": [0.01, 0.02]},
        "bias_holding_moment": {"normal": [0.0, 0.1]},
        "bias_uncertainty_force_y": {"log_normal": [0.01, 0.1]},
        "ornstein_uhlenbeck_force": 0.02,
        "ornstein_uhlenbeck_time": {"uniform": [10, 30]},
        "gain_force_x_force_y": {"normal": [0.0, 0.01]},
        "force_range": {"uniform": [1.0, 3.0]},
        "moment_resolution": 0.01,
        "drive_angle_noise": {"uniform": [1e-3, 2e-3]},
        "drive_angle_offset": {"normal": [0.0, 1e-2]},
        "drive_angle_backlash": {"normal": [0.0, 1e-3]},
        "lever_y": {"normal": [0.0, 1e-2]},
    },
    "slack": {
        "drive_angle_noise": 1e-3,
        "drive_angle_backlash": {"each": [0.0, 0.01]},
        "lever_x": {"each": [0.0, 0.1]},
    },
    "outliers": {"moment_noise": 0.02, "force_noise": 0.05, "degrees_of_freedom": {"uniform": [3, 8]}},
    "correlated": {"moment_noise": 0.02, "force_noise": {"each": [0.05, 0.1]}, "correlation_force_x_force_y": 0.5},
    "biased": {"bias_force_x": {"normal": [0.0, 0.1]}, "bias_uncertainty_force_x": {"uniform": [0.1, 0.2]}},
    "none": {},
}
MEASURED = {
    "fixed": ("everything", "slack", "outliers", "none"),
    "turning": ("white noise", "everything", "slack", "correlated", "biased"),
}


@pytest.mark.parametrize(("frame", "name"), [(frame, name) for frame, names in MEASURED.items() for name in names])
def test_readings_are_those_of_the_load_cell_that_the_record_states(frame, name):
    cell = CELLS[name]
    spec = drawn_from("parabola", load_cell={"frame": frame, **cell})
    for i in range(spec["records"]):
        one = record(spec, i)
        stated = tb.LoadCell.from_record(one) or tb.LoadCell()
        assert set(stated.entries()) <= set(cell)
        rng = np.random.default_rng(np.random.SeedSequence(spec["seed"], spawn_key=(i, 1)))
        truth = loads_of(one, "truth_")
        readings = loads_of(one)
        np.testing.assert_array_equal(readings, stated.simulate(truth, rng=rng))
        if "drive_angle_noise" in cell:
            wrong = one.drive_angle.values - one.truth_drive_angle.values - stated.misread(one.direction.values)
            expected = stated.drive_angle_noise * rng.standard_normal(wrong.reshape(2, -1).shape).ravel()
            np.testing.assert_allclose(wrong, expected, atol=1e-14)
        else:
            assert "truth_drive_angle" not in one


DISTRIBUTIONS = {
    "bias_force_x": ({"uniform": [-1.0, 3.0]}, stats.uniform(-1.0, 4.0)),
    "force_noise": ({"log_uniform": [0.1, 10.0]}, stats.loguniform(0.1, 10.0)),
    "bias_force_y": ({"normal": [2.0, 0.5]}, stats.norm(2.0, 0.5)),
    "moment_noise": ({"log_normal": [3.0, 0.5]}, stats.lognorm(0.5, scale=3.0)),
}


@pytest.mark.slow
def test_numbers_follow_their_distributions():
    """Those of the load cell decide nothing about reach, so that none is drawn again for their sake."""
    cell = {name: distribution for name, (distribution, _) in DISTRIBUTIONS.items()}
    cell |= {"relative_noise": {"choice": [0.0, 0.1, 0.2]}, "drive_angle_offset": 0.25}
    groups = [drawn_from(family)["contours"][0] for family in ("circle", "parabola")]
    spec = drawn_from("circle", 2000, load_cell=cell, contours=[{**groups[0], "weight": 3}, groups[1]])
    data = generated({**spec, "scan": {"samples": 2}})
    for name, (_, distribution) in DISTRIBUTIONS.items():
        assert stats.kstest(data[f"load_cell_{name}"].values, distribution.cdf).pvalue > FALSE_ALARM, name
    each = {name: data[f"load_cell_{name}"].values for name in DISTRIBUTIONS}
    shares = np.column_stack([distribution.cdf(each[name]) for name, (_, distribution) in DISTRIBUTIONS.items()])
    correlation = np.corrcoef(shares, rowvar=False)[np.triu_indices(len(DISTRIBUTIONS), 1)]
    assert np.abs(correlation).max() < stats.norm.isf(FALSE_ALARM / 12) / np.sqrt(2000)
    chosen = [np.count_nonzero(data.load_cell_relative_noise.values == value) for value in (0.0, 0.1, 0.2)]
    assert sum(chosen) == 2000
    assert stats.chisquare(chosen).pvalue > FALSE_ALARM
    assert np.all(data.load_cell_drive_angle_offset.values == 0.25)
    families = np.bincount(data.truth_family.values)
    assert stats.chisquare(families, [1500, 500]).pvalue > FALSE_ALARM
    circle = data.truth_family.values == 0
    np.testing.assert_array_equal(np.isnan(data.truth_contour_r.values), ~circle)
    np.testing.assert_array_equal(np.isnan(data.truth_contour_a.values), circle)
    assert stats.kstest(data.truth_contour_r.values[circle], stats.uniform(0.4, 0.6).cdf).pvalue > FALSE_ALARM


def test_a_weight_may_have_a_distribution_of_its_own():
    """Without weights the contour is a circle; a thousandth of a weight bends it as the family says."""
    plain = {"r": 0.8, "amplitude": 0.5, "length_scale": 1.0, "q": 0.5, **dict.fromkeys(SHAPE_FREE.directions, 0.0)}
    angles = [-1.0, 0.0, 1.0]
    for values in (plain, plain | {"z_2": 1e-3}):
        spec = {"records": 1, "seed": 1, "contours": [{"family": "shape-free", **values}]}
        found = contour_of(record(spec, 0)).radius_of_curvature(angles)
        np.testing.assert_array_equal(found, SHAPE_FREE.contour({"x_c": 0.0, **values}).radius_of_curvature(angles))
        assert np.allclose(found, 0.8, rtol=1e-12) == (values is plain)


def test_lists_are_gone_through_together():
    """Every entry with every other, the last list fastest, families in turn before all."""
    spec = {
        "seed": 1,
        "each_contour": True,
        "contours": [
            {"family": "circle", "r": {"each": [0.5, 0.7]}, "q": 0.4},
            {"family": "parabola", "a": 1.0, "q": {"each": [0.3, 0.4, 0.5]}},
        ],
        "scan": {"samples": 2, "bases": [[{"each": [0.0, 0.05]}, 0.0]]},
        "load_cell": {"force_noise": {"each": [0.01, 0.02]}},
    }
    assert read_specification(spec).records == 48
    data = generated({**spec, "records": 96, "shard_records": 96})
    lists = [0, 1], [0.5, 0.7], [0.3, 0.4, 0.5], [0.0, 0.05], [0.01, 0.02]
    family, r, q, base, noise = np.meshgrid(*lists, indexing="ij")
    expected = {
        "truth_family": family,
        "truth_contour_r": np.where(family == 0, r, np.nan),
        "truth_contour_q": np.where(family == 0, 0.4, q),
        "load_cell_force_noise": noise,
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(data[name].values, np.tile(values.ravel(), 2), err_msg=name)
    np.testing.assert_array_equal(data.base_x.values[:, 0], np.tile(base.ravel(), 2))


FAR = {
    "records": 60,
    "shard_records": 60,
    "seed": 5,
    "contours": [{"family": "circle", "r": {"uniform": [0.2, 0.8]}, "q": {"uniform": [-0.3, 1.7]}}],
    "scan": {"samples": 2},
}


@pytest.mark.slow
def test_draws_in_vain_are_counted_with_their_reasons():
    """Against a count of one's own: the same random numbers, judged one by one by scan_many."""
    shares = np.empty((60, 40, 4))  # family, r, q, x_c
    for i, draw in np.ndindex(60, 40):
        bits = np.random.PCG64(np.random.SeedSequence(5, spawn_key=(i, 0))).advance(draw * 2**20)
        shares[i, draw] = np.random.Generator(bits).random(4)
    circles = Circle((0.2 + 0.6 * shares[..., 1]).ravel(), (-0.3 + 2.0 * shares[..., 2]).ravel())
    many = [scan_many(circles, [1.0], direction=direction) for direction in ("forward", "backward")]
    assert np.all(many[0].status == many[1].status)  # the circles stand above the pivot
    clear = (many[0].clear & many[1].clear).values.reshape(60, 40)
    status = many[0].status.values.reshape(60, 40)
    status[(status == "ok") & ~clear] = "not clear after snap-off"
    first = np.argmax(status == "ok", axis=1)
    assert np.all(status[np.arange(60), first] == "ok")
    reasons = Counter(str(why) for row, end in zip(status, first, strict=True) for why in row[:end])
    kept = circles.q.reshape(60, 40)[np.arange(60), first]
    records = generate_records(read_specification(FAR), 0, 60)
    assert +records.redrawn == reasons
    assert set(reasons) >= {"out of reach", "cuts the pivot"}
    np.testing.assert_array_equal(records.drawn["contours[0].q"], kept)


def test_what_is_no_contour_is_drawn_again():
    wild = {"family": "shape-free", "r": 0.5, "amplitude": 0.5, "length_scale": {"log_normal": [0.15, 2.0]}, "q": 0.4}
    records = generate_records(read_specification({**FAR, "records": 10, "contours": [wild]}), 0, 10)
    (reason,) = (reason for reason in records.redrawn if "length_scale" in reason and "0.15 to 4 rad" in reason)
    assert records.redrawn[reason] > 0
    drawn = records.drawn["contours[0].length_scale"]
    assert np.all((drawn >= 0.15) & (drawn <= 4.0))


def circles(**parameters):
    return {"contours": [{**FAR["contours"][0], **parameters}]}


HOPELESS = {
    "out of reach": (
        {"records": 3, **circles(r=0.5, q={"uniform": [1.2, 1.7]})},
        r"record 0\b.* 1000 times.*\(1000 out of reach",
    ),
    "no contour": (
        {"records": 2, "contours": [{"family": "parabola", "a": {"normal": [-1.0, 1e-3]}, "q": 0.5}]},
        r"1000 times.*\(1000 no contour.*a must be positive",
    ),
    # Only the last record is hopeless, while others are often drawn again: the reasons are its own.
    "one of sixty": (
        circles(r={"uniform": [0.01, 0.8]}, q={"each": [0.7] * 59 + [-0.4]}),
        r"record 59 .* 1000 times.* \(1000 [^,]*pivot[^,]*\)",
    ),
    "load cell": (
        {"load_cell": {"force_resolution": {"uniform": [0.1, 1.0]}, "force_range": {"uniform": [0.1, 2.0]}}},
        r"load_cell.*force_resolution",
    ),
}


@pytest.mark.parametrize(("change", "message"), HOPELESS.values(), ids=HOPELESS)
def test_what_can_hardly_be_drawn_is_given_up_with_the_reason(change, message):
    spec = {**FAR, **change}
    with pytest.raises(SpecificationError, match=message):
        generate_records(read_specification(spec), 0, spec["records"])


@pytest.mark.slow
@pytest.mark.parametrize("diameter", [0.05, 0.01])
def test_records_whose_rod_is_strained_beyond_the_model_are_counted(diameter):
    """Against `scan`, which warns of them; strains agree to 1 %."""
    spec = drawn_from("circle", 12, rod={"length": 0.2, "flexural_rigidity": 0.0024, "diameter": diameter})
    spec["contours"] = [{"family": "circle", "r": {"uniform": [0.05, 0.3]}, "q": {"uniform": [0.06, 0.14]}}]
    said = read_specification(spec)
    records = generate_records(said, 0, 12)
    largest = np.zeros((12, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StrainWarning)
        for i in range(12):
            one = record(said, i)
            scan = tb.scan(contour_of(one), rig=Rig(rod=tb.Rod(0.2, 0.0024, diameter)))
            largest[i] = [scan.events[direction].largest_strain for direction in ("forward", "backward")]
    np.testing.assert_allclose(records.sweep["largest_strain"], largest, rtol=0.01)
    strained = records.counts["strained"]
    assert strained == np.count_nonzero(np.any(largest > 0.1, axis=1))
    assert (strained == 12) == (diameter == 0.05)
    stored = records_as_dataset(said, records).truth_largest_strain
    assert stored.dims == ("record", "sweep")


def test_records_depend_on_seed_and_index_alone():
    whole, half = (read_specification(changed(PLAIN, records=count)) for count in (24, 8))
    one, other = generate_records(whole, 0, 8), generate_records(half, 0, 8)
    np.testing.assert_array_equal(one.sample["force_x"], other.sample["force_x"])
    apart = generate_records(whole, 3, 5)
    for key, values in apart.drawn.items():
        np.testing.assert_array_equal(values, one.drawn[key][3:5], err_msg=key)
    np.testing.assert_allclose(apart.sample["force_x"], one.sample["force_x"][3:5], rtol=0, atol=1e-9)
    another = generate_records(read_specification(changed(PLAIN, seed=8)), 0, 8)
    assert not np.any(one.drawn["contours[0].q"] == another.drawn["contours[0].q"])
    assert not np.any(one.sample["force_x"] == another.sample["force_x"])


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        {"load_cell__relative_noise": 0.0},
        {"load_cell__bias_force_x": {"normal": [0.0, 0.1]}, "load_cell__force_noise": None},
        {"scan__samples": 5},
        {"unknown": "nothing", "scan__bases": [[0.0, 0.0], [0.0, 0.0]]},
    ],
)
def test_contours_do_not_depend_on_what_else_is_drawn(change):
    """Nor do those that are drawn again."""
    families = ("shape-free", "circle", "shape-free")
    groups = [{**drawn_from(family)["contours"][0], "q": {"uniform": [0.3, 1.5]}} for family in families]
    plain = changed(PLAIN, contours=groups)
    one, other = (generate_records(read_specification(spec), 0, 24) for spec in (plain, changed(plain, **change)))
    assert one.redrawn["out of reach"] > 5
    assert +one.redrawn == +other.redrawn
    np.testing.assert_array_equal(one.family, other.family)
    for key in one.drawn:
        if key.startswith("contours"):
            np.testing.assert_array_equal(one.drawn[key], other.drawn[key], err_msg=key)


STICKING = {"base": [0.7, 0.0], "heading": 3.14159265, "drive_angle": 1.5708, "travel": 1.4}
STUCK = {
    "curved toward the object": drawn_from(
        "circle", unknown={**NOTHING, "friction": 0.3}, rod={"rest_curvature": {"uniform": [0.2, 0.4]}}
    ),
    "upright and carried": {
        **drawn_from("circle", unknown={"friction": 0.3}),
        "contours": [{"family": "circle", "r": {"uniform": [0.3, 0.5]}, "q": {"uniform": [0.75, 0.8]}}],
        "scan": {"samples": 60, "translations": [STICKING, {**STICKING, "base": [-0.7, 0.0], "heading": 0.0}]},
    },
}


@pytest.mark.parametrize("spec", STUCK.values(), ids=STUCK)
def test_rods_that_stick_on_their_way_are_records_too(spec):
    for number in range(3):
        assert np.abs(record(spec, number).force_y.values).max() > 0.1

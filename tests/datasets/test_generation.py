"""The numbers of data sets: truth against scans, readings against the load cell, draws against their distributions."""

import warnings
from collections import Counter

import numpy as np
import pytest
from scipy import stats

import tactile_bayes as tb
from helpers.data_sets import PLAIN, RICH, changed
from helpers.refusals import refused
from tactile_bayes.contours import Circle
from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.contours.shape_free_family import SHAPE_FREE
from tactile_bayes.datasets import contour_of, read_specification, record
from tactile_bayes.datasets.generation import generate_records
from tactile_bayes.datasets.shard import records_as_dataset
from tactile_bayes.datasets.specification_text import left_out
from tactile_bayes.errors import ParameterError, SpecificationError, StrainWarning
from tactile_bayes.record import CHANNELS, in_frame, rod_of
from tactile_bayes.rig import NOTHING, Rig

CONTACT = ("contact_x", "contact_y", "slope_angle", "contact_arclength", "tip_angle")
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


RIGS = {
    "rich": changed(RICH, precision=None, records=6, shard_records=6),
    "fixed grid": drawn_from("circle", scan={"samples": 50, "from_degrees": 20, "to_degrees": 190}),
    "backward alone": drawn_from("parabola", scan={"samples": 30, "directions": ["backward"], "margin": 0.0}),
    "random bases": drawn_from(
        "ellipse",
        scan={
            "samples": 30,
            "bases": [[{"uniform": [-0.2, 0.2]}, {"uniform": [-0.1, 0.1]}], [0.1, -0.1]],
        },
        unknown={**NOTHING, "friction": 0.3},
    ),
    "arcs": drawn_from("circle", rod={"rest_curvature": {"uniform": [-0.5, 0.5]}}),
    "arcs in SI": drawn_from(
        "circle",
        rod={"length": 1.1, "flexural_rigidity": 1e-3, "diameter": 1e-3, "rest_curvature": {"normal": [0.2, 0.1]}},
    ),
    "tapered": drawn_from("circle", rod={"taper": {"uniform": [0.0, 0.95]}}, seed=1),
    "tapered arcs in SI": drawn_from(
        "shape-free",
        scan={"samples": 30},
        rod={
            "length": {"uniform": [1.0, 1.2]},
            "flexural_rigidity": 1e-3,
            "rest_curvature": {"normal": [0.0, 0.2]},
            "diameter": 0.02,
            "taper": {"choice": [0.3, 0.7]},
        },
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "spec",
    [
        *(pytest.param(drawn_from(family), id=family) for family in ("parabola", "circle", "ellipse", "power-law")),
        *(
            pytest.param(drawn_from(family), id=family)
            for family in ("shape-free", "power-law/circle", "parabola/parabola")
        ),
        *(pytest.param(spec, id=name) for name, spec in RIGS.items()),
    ],
)
def test_the_truth_is_what_a_scan_of_the_contour_says(spec):
    """Loads to 1e-6 of the largest, contacts to 2e-5 of the rod, events to rounding."""
    said = read_specification(spec)
    whole = generated(spec)
    for i in range(said.records):
        mine = record(said, i)
        contour = contour_of(mine)
        rod = rod_of(mine)
        for number, (base, direction) in enumerate(said.sweeps):
            row = whole.isel(record=i, sweep=number)
            one = mine.isel(sample=mine["sweep"].values == number)
            assert set(one.direction.values) == {direction}
            pivot = (float(one.base_x[0]), float(one.base_y[0]))
            distribution_x, distribution_y = said.bases[base]
            assert distribution_x.is_drawn or pivot[0] == distribution_x.numbers[0]
            assert distribution_y.is_drawn or pivot[1] == distribution_y.numbers[0]
            angles = (one["truth_drive_angle"] if "truth_drive_angle" in one else one["drive_angle"]).values
            assert np.all(np.diff(angles) * (1.0 if direction == "forward" else -1.0) > 0.0)
            scan = tb.scan(
                contour,
                direction=direction,
                base=pivot,
                rig=Rig(rod=rod, unknown={"friction": said.friction}),
                drive_angles=angles,
            )
            theirs, events = in_frame(scan.record, said.frame), scan.sweeps[0]
            # Whether a sample at the very snap-off is loaded, rounding decides.
            sure = np.abs(angles - events.snap_off.drive_angle) > 1e-9
            sure &= np.abs(angles - events.first_contact.drive_angle) > 1e-9
            largest = max(np.abs(theirs[name].values).max() for name in CHANNELS[1:])
            for name in CHANNELS:
                scale = np.abs(theirs[name].values).max() if name == "holding_moment" else largest
                np.testing.assert_allclose(
                    one[f"truth_{name}"].values[sure],
                    theirs[name].values[sure],
                    rtol=0,
                    atol=1e-6 * scale,
                    err_msg=name,
                )
            for name in CONTACT:
                scale = rod.length if name.startswith("contact") else 1.0
                np.testing.assert_allclose(
                    one[f"truth_{name}"].values[sure],
                    theirs[f"truth_{name}"].values[sure],
                    rtol=0,
                    atol=2e-5 * scale,
                    err_msg=name,
                )
            assert np.mean((one.truth_contact_phase.values == theirs.truth_contact_phase.values)[sure]) > 0.95
            for event in ("first_contact", "snap_off"):
                for name in ("drive_angle", "slope_angle", "contact_x", "contact_y"):
                    np.testing.assert_allclose(
                        float(row[f"truth_{event}_{name}"]), getattr(getattr(events, event), name), rtol=1e-7, atol=1e-9
                    )
            kinds = [events.first_contact.kind, *(change.kind.split(" → ")[1] for change in events.transitions)]
            words = row.truth_phases.attrs["flag_meanings"].split()
            assert words[int(row.truth_phases)] == "-".join("A" if kind == "tip" else "B" for kind in kinds)
            kinds = row.truth_snap_off_kind.attrs["flag_meanings"].split()
            assert kinds[int(row.truth_snap_off_kind)] == {"smooth": "fold"}.get(
                events.snap_off.kind, events.snap_off.kind
            )


def test_drive_angles_reach_from_before_contact_to_after_snap_off():
    data = generated(drawn_from("parabola", scan={"samples": 31, "margin": 0.25}))
    sign = np.array([1.0, -1.0])
    first, snap = sign * data.truth_first_contact_drive_angle, sign * data.truth_snap_off_drive_angle
    angles = sign[None, :, None] * data.drive_angle.values
    np.testing.assert_allclose(angles[:, :, 0], first - 0.25 * (snap - first), atol=1e-12)
    np.testing.assert_allclose(angles[:, :, -1], snap + 0.25 * (snap - first), atol=1e-12)
    np.testing.assert_allclose(np.diff(angles, n=2), 0.0, atol=1e-12)


def test_fixed_drive_angles_are_those():
    data = generated(RIGS["fixed grid"])
    grid = np.radians(np.linspace(20.0, 190.0, 50))
    np.testing.assert_allclose(data.drive_angle[:, 0], np.tile(grid, (4, 1)), atol=1e-12)
    np.testing.assert_allclose(data.drive_angle[:, 1], np.tile(grid[::-1], (4, 1)), atol=1e-12)


# ---- what is measured

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
        "drive_angle_backlash": {"each": [0.0, 1e-2]},
        "lever_x": {"each": [0.0, 0.1]},
    },
    "outliers": {"moment_noise": 0.02, "force_noise": 0.05, "degrees_of_freedom": {"uniform": [3, 8]}},
    "correlated": {"moment_noise": 0.02, "force_noise": {"each": [0.05, 0.1]}, "correlation_force_x_force_y": 0.5},
    "biased": {"bias_force_x": {"normal": [0.0, 0.1]}, "bias_uncertainty_force_x": {"uniform": [0.1, 0.2]}},
    "none": {},
}
# Told by the same load cell in the other frame.
ELSEWHERE = {
    ("turning", "none"),
    ("turning", "outliers"),
    ("fixed", "correlated"),
    ("fixed", "biased"),
    ("fixed", "white noise"),
}


@pytest.mark.parametrize(
    ("frame", "cell"),
    [
        pytest.param(frame, cell, id=f"{frame}-{name}", marks=pytest.mark.slow if (frame, name) in ELSEWHERE else [])
        for frame in ("fixed", "turning")
        for name, cell in CELLS.items()
    ],
)
def test_readings_are_those_of_the_load_cell_that_the_record_states(cell, frame):
    spec = drawn_from("parabola", load_cell={"frame": frame, **cell})
    for i in range(spec["records"]):
        one = record(spec, i)
        stated = tb.LoadCell.from_record(one) or tb.LoadCell()
        assert set(stated.entries()) <= set(cell)
        rng = np.random.default_rng(np.random.SeedSequence(spec["seed"], spawn_key=(i, 1)))
        truth = np.stack([one[f"truth_{name}"].values for name in CHANNELS], axis=-1)
        readings = np.stack([one[name].values for name in CHANNELS], axis=-1)
        np.testing.assert_array_equal(readings, stated.simulate(truth, rng=rng))
        if "drive_angle_noise" in cell:
            wrong = one.drive_angle.values - one.truth_drive_angle.values - stated.misread(one.direction.values)
            expected = stated.drive_angle_noise * rng.standard_normal(wrong.reshape(2, -1).shape).ravel()
            np.testing.assert_allclose(wrong, expected, atol=1e-14)
        else:
            assert "truth_drive_angle" not in one


def test_noise_has_the_size_that_is_stated():
    cell = {"moment_noise": {"log_normal": [0.02, 0.3]}, "force_noise": 0.05, "drive_angle_noise": 1e-3}
    data = generated(drawn_from("circle", 300, load_cell=cell))
    for name, noise in (("holding_moment", "moment"), ("force_x", "force"), ("drive_angle", "drive_angle")):
        error = (data[name] - data[f"truth_{name}"]) / data[f"load_cell_{noise}_noise"]
        assert stats.kstest(error.values.ravel(), "norm").pvalue > FALSE_ALARM, name
        apart = error.values.reshape(300, -1)[:, :2]
        assert abs(np.mean(apart[:, 0] * apart[:, 1])) < stats.norm.isf(FALSE_ALARM / 2) / np.sqrt(300)


def test_drift_goes_on_from_sweep_to_sweep():
    data = generated(drawn_from("circle", 400, load_cell={"random_walk_force": 0.01}))
    drift = (data.force_x - data.truth_force_x).values.reshape(400, -1)
    steps = np.array([1, 20, 40, drift.shape[1] - 1])  # the second sweep begins at 40
    tail = stats.chi2(400)
    of_size = np.sum(drift[:, steps] ** 2, axis=0) / (1e-4 * steps)
    assert np.all(of_size > tail.ppf(FALSE_ALARM / 8))
    assert np.all(of_size < tail.isf(FALSE_ALARM / 8))
    assert np.all(drift[:, 0] == 0.0)


# ---- what is drawn

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
    shares = np.column_stack(
        [distribution.cdf(data[f"load_cell_{name}"].values) for name, (_, distribution) in DISTRIBUTIONS.items()]
    )
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


@pytest.mark.slow
def test_weights_of_shape_free_radii_are_standard_normal():
    """And independent of one another; what they make of a radius is a matter of the family."""
    data = generated(drawn_from("shape-free", 500, scan={"samples": 2}, contours=[
        {"family": "shape-free", "r": 0.8, "amplitude": 0.1, "length_scale": 1.5, "q": 0.5},
    ]))  # fmt: skip
    weights = np.stack([data[f"truth_contour_{name}"].values for name in SHAPE_FREE.directions])
    assert min(stats.kstest(z, "norm").pvalue for z in weights) > FALSE_ALARM / len(weights)
    correlation = np.corrcoef(weights)[np.triu_indices(len(weights), 1)]
    assert np.abs(correlation).max() < stats.norm.isf(FALSE_ALARM / 2 / correlation.size) / np.sqrt(500)


def test_a_weight_may_have_a_distribution_of_its_own():
    """Without weights the contour is a circle; a thousandth of a weight bends it as the family says."""
    plain = {"family": "shape-free", "r": 0.8, "amplitude": 0.5, "length_scale": 1.0, "q": 0.5}
    flat = dict.fromkeys(SHAPE_FREE.directions, 0.0)
    circle, bent = (
        contour_of(record({"records": 1, "seed": 1, "contours": [{**plain, **flat, **more}]}, 0))
        for more in ({}, {"z_2": 1e-3})
    )
    np.testing.assert_allclose(circle.radius_of_curvature([-1.0, 0.0, 1.0]), 0.8, rtol=1e-12)
    values = dict(zip(SHAPE_FREE.parameters, np.zeros(len(SHAPE_FREE.parameters)), strict=True))
    values |= {"r": 0.8, "amplitude": 0.5, "length_scale": 1.0, "q": 0.5, "z_2": 1e-3}
    same = SHAPE_FREE.contour(values).radius_of_curvature([-1.0, 0.0, 1.0])
    np.testing.assert_array_equal(bent.radius_of_curvature([-1.0, 0.0, 1.0]), same)
    assert np.all(same != 0.8)


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
    family, r, q, base, noise = np.meshgrid(
        [0, 1], [0.5, 0.7], [0.3, 0.4, 0.5], [0.0, 0.05], [0.01, 0.02], indexing="ij"
    )
    expected = {
        "truth_family": family,
        "truth_contour_r": np.where(family == 0, r, np.nan),
        "truth_contour_q": np.where(family == 0, 0.4, q),
        "load_cell_force_noise": noise,
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(data[name].values, np.tile(values.ravel(), 2), err_msg=name)
    np.testing.assert_array_equal(data.base_x.values[:, 0], np.tile(base.ravel(), 2))


# ---- what is drawn again

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
    many = [tb.scan_many(circles, [1.0], direction=direction) for direction in ("forward", "backward")]
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


@pytest.mark.parametrize("count", [1, 3])
def test_what_cannot_be_reached_is_given_up_with_the_counts(count):
    spec = {**FAR, "records": count, "contours": [{"family": "circle", "r": 0.5, "q": {"uniform": [1.2, 1.7]}}]}
    with refused(SpecificationError, "record 0", "1000 times", "1000 out of reach"):
        generate_records(read_specification(spec), 0, count)


def test_what_is_no_contour_is_drawn_again():
    contour = {"family": "power-law", "w": 1.0, "n": {"normal": [1.5, 0.5]}, "q": 0.5}
    records = generate_records(read_specification({**FAR, "contours": [contour]}), 0, 60)
    (why,) = (reason for reason in records.redrawn if "(n must be at least 1.1" in reason)
    assert records.redrawn[why] > 0
    assert np.all(records.drawn["contours[0].n"] >= 1.1)


def test_what_is_hardly_ever_a_contour_is_given_up_with_the_familys_own_words():
    contour = {"family": "parabola", "a": {"normal": [-1.0, 1e-3]}, "q": 0.5}
    with refused(SpecificationError, "1000 times", "1000 no contour", "a must be positive"):
        generate_records(read_specification({**FAR, "contours": [contour]}), 0, 2)


def test_rods_that_slide_outward_and_stick_are_records_too():
    """In one of two directions the rod is curved toward the object."""
    spec = drawn_from("circle", unknown={**NOTHING, "friction": 0.3}, rod={"rest_curvature": {"uniform": [0.2, 0.4]}})
    assert generate_records(read_specification(spec), 0, 3).index.size == 3


def test_the_reasons_of_a_record_that_is_given_up_are_its_own():
    """Of sixty records only the last is hopeless, while others are often drawn again."""
    levels = {"each": [0.7] * 59 + [-0.4]}
    spec = {**FAR, "contours": [{"family": "circle", "r": {"uniform": [0.01, 0.8]}, "q": levels}]}
    with pytest.raises(SpecificationError, match=r"record 59 .* 1000 times.* \(1000 [^,]*pivot[^,]*\)"):
        generate_records(read_specification(spec), 0, 60)


def test_wild_shapes_are_drawn_again():
    wild = {"family": "shape-free", "r": 0.5, "amplitude": 0.5, "length_scale": {"log_normal": [0.15, 2.0]}, "q": 0.4}
    records = generate_records(read_specification({**FAR, "records": 10, "contours": [wild]}), 0, 10)
    (reason,) = (reason for reason in records.redrawn if "length_scale" in reason and "0.15 to 4 rad" in reason)
    assert records.redrawn[reason] > 0
    assert np.all(records.drawn["contours[0].length_scale"] >= 0.15)
    assert np.all(records.drawn["contours[0].length_scale"] <= 4.0)


# ---- what is not as one may wish


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
    assert records.strained == np.count_nonzero(np.any(largest > 0.1, axis=1))
    assert (records.strained == 12) == (diameter == 0.05)
    stored = records_as_dataset(said, records).truth_largest_strain
    assert stored.dims == ("record", "sweep")


def test_every_record_states_the_rest_curvature_that_was_drawn():
    spec = read_specification(RIGS["arcs"])
    drawn = generated(RIGS["arcs"])["rod_rest_curvature"].values
    assert np.unique(drawn).size == spec.records
    assert [rod_of(record(spec, i)).rest_curvature for i in range(spec.records)] == drawn.tolist()


@pytest.mark.parametrize("name", ["tapered", "tapered arcs in SI"])
def test_every_record_states_the_taper_that_was_drawn(name):
    spec = read_specification(RIGS[name])
    drawn = generated(RIGS[name])["rod_taper"].values
    assert np.unique(drawn).size > 1
    assert [rod_of(record(spec, i)).taper for i in range(spec.records)] == drawn.tolist()


def test_tapers_of_zero_beside_others_give_the_records_of_uniform_rods():
    """The same objects, to the accuracy of states from series: 1e-8."""
    rod, each = {"rest_curvature": {"uniform": [-0.5, 0.5]}}, {"each": [0.0, 0.6]}
    uniform, tapered = (generated(drawn_from("circle", rod=of)) for of in (rod, rod | {"taper": each}))
    for name in (*CHANNELS, *(f"truth_{name}" for name in CONTACT)):
        theirs, mine = (one[name].values[::2] for one in (uniform, tapered))
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-8 * np.nanmax(np.abs(theirs)))
    assert np.abs(tapered["holding_moment"] - uniform["holding_moment"]).values[1::2].max() > 0.1
    stated = generated(drawn_from("circle", rod=rod | {"taper": 0.0}))
    for name in CHANNELS:
        np.testing.assert_array_equal(stated[name], uniform[name])


def test_a_rod_without_thickness_is_not_strained():
    records = generate_records(read_specification(changed(PLAIN, rod={"length": 1.0, "flexural_rigidity": 1.0})), 0, 8)
    assert records.strained == 0
    assert "largest_strain" not in records.sweep


def test_sweeps_without_a_sample_in_contact_are_counted():
    spec = drawn_from("circle", scan={"samples": 50, "from_degrees": 5, "to_degrees": 20})
    records = generate_records(read_specification(spec), 0, 4)
    touched = (records.sample["truth_contact_phase"] != 0).any(axis=2)
    assert records.untouched == np.count_nonzero(~touched) > 0
    assert generate_records(read_specification(drawn_from("circle")), 0, 4).untouched == 0


def test_an_impossible_load_cell_names_itself():
    cell = {"force_resolution": {"uniform": [0.1, 1.0]}, "force_range": {"uniform": [0.9, 9.0]}}
    spec = {**PLAIN, "records": 400, "load_cell": cell}
    with refused(SpecificationError, "load_cell", "force_resolution"):
        generate_records(read_specification(spec), 0, 400)


# ---- what numbers follow from


def test_records_depend_on_seed_and_index_alone():
    whole, half = (read_specification(changed(PLAIN, records=count)) for count in (24, 8))
    one, other = generate_records(whole, 0, 8), generate_records(half, 0, 8)
    np.testing.assert_array_equal(one.sample["force_x"], other.sample["force_x"])
    apart = generate_records(whole, 3, 5)
    for key, values in apart.drawn.items():
        np.testing.assert_array_equal(values, one.drawn[key][3:5], err_msg=key)
    np.testing.assert_allclose(apart.sample["force_x"], one.sample["force_x"][3:5], rtol=0, atol=1e-9)


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


def test_another_seed_gives_other_numbers():
    one, other = (generate_records(read_specification(changed(PLAIN, seed=seed)), 0, 8) for seed in (1, 2))
    assert not np.any(one.drawn["contours[0].q"] == other.drawn["contours[0].q"])
    assert not np.any(one.sample["force_x"] == other.sample["force_x"])


def test_a_record_without_contour_is_refused():
    with refused(ParameterError, "contour", "truth=True"):
        contour_of(record(PLAIN, 0, truth=False))


def test_records_of_rods_that_stick_on_their_way():
    """Upright rods that are carried, with friction: phases are those of tip and tangential contact."""
    sweep = {"base": [0.7, 0.0], "heading": 3.14159265, "drive_angle": 1.5708, "travel": 1.4}
    spec = {
        "records": 4,
        "seed": 1,
        "contours": [{"family": "circle", "r": {"uniform": [0.3, 0.5]}, "q": {"uniform": [0.75, 0.8]}}],
        "unknown": {"friction": 0.3},
        "scan": {"samples": 60, "translations": [sweep, sweep | {"base": [-0.7, 0.0], "heading": 0.0}]},
    }
    for number in range(4):
        record = tb.datasets.record(spec, number)
        assert np.abs(record.force_y.values).max() > 0.1

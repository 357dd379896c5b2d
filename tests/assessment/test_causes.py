"""Causes of a misfit: of each kind that is simulated the one that is named first, and what is said of several."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from helpers.contour_posteriors import CELL, swept
from tactile_bayes import Rig, SamplerSettings, causes, check, infer_contour, read_result, scan, write_result
from tactile_bayes.assessment.causes import PLACES, LocalBends, causes_beside, with_bends
from tactile_bayes.calibration.simulated_experiment import Misspecification
from tactile_bayes.contours import Parabola
from tactile_bayes.contours.families import family_named
from tactile_bayes.diagnostics.findings import likely_causes
from tactile_bayes.inference.deadline import Deadline
from tactile_bayes.inference.experiment import Experiment, contour_problem
from tactile_bayes.inference.starts.contour_optimum import first_order, optimum_beside

BRIEF = SamplerSettings(ensembles=2, walkers=34, max_steps=50)
SHAPE = Parabola(0.5, 0.5)


def inferred(rig, seed=1, **assumed):
    """Posterior of a record of a rig, by one that is as stated."""
    record = rig.measure(scan(SHAPE, rig, drive_step=0.03).record, rng=seed)
    return infer_contour(record, rig=Rig(load_cell=CELL, **assumed), rng=seed, settings=BRIEF)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    ("cause", "size"),
    [
        *[("taper", 0.15), ("lag", 1.5), ("play", 0.03), ("drift", 0.3), ("suspension_compliance", 0.15)],
        *[("moment_lag", 1.5), ("force_y_play", 0.03)],
    ],
)
def test_what_is_wrong_is_named_first_and_describes_the_record(cause, size, seed):
    found = causes(inferred(Rig(load_cell=CELL, unknown={"noise_scale": 1.0, cause: size}), seed))
    assert found.cause.values[0] == cause
    assert found.describes.values[0] == 1
    assert found.log_evidence.values[0] > 5.0 + found.log_evidence.values[1]
    assert f'{cause} = "default"' in str(found.remedy.values[0])


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "size"), [("friction", 0.2), ("lever_y", 0.05), ("moment_lag", 1.5), ("lag", 1.5)])
def test_a_number_that_is_known_and_wrong_is_a_cause(cause, size):
    found = causes(inferred(Rig(load_cell=CELL, unknown={"noise_scale": 1.0}), unknown={cause: size}))
    assert found.cause.values[0] == cause
    assert found.describes.values[0] == 1
    assert f'{cause} = "default"' in str(found.remedy.values[0])


@pytest.mark.slow
def test_cut_off_readings_are_a_cause_of_which_the_range_is_the_cure():
    record = swept(SHAPE, step=0.03)
    largest = 0.6 * float(np.abs(record.force_y).max())
    cut = replace(CELL, force_range=largest).measure(record, rng=1)
    found = causes(infer_contour(cut, rig=Rig(load_cell=CELL), rng=1, settings=BRIEF))
    assert found.cause.values[0] == "range"
    assert f"force_range = {largest:.9g}" in str(found.remedy.values[0])


@pytest.mark.slow
def test_a_column_that_is_read_with_another_sign_is_named_and_nothing_else_is_tried(tmp_path):
    record = swept(SHAPE, step=0.03)
    record["force_x"] = -record["force_x"]
    posterior = infer_contour(CELL.measure(record, rng=1), rig=Rig(load_cell=CELL), rng=1, settings=BRIEF)
    posterior["causes"] = xr.DataTree(causes(posterior))
    write_result(posterior, tmp_path / "posterior.nc")
    read = read_result(tmp_path / "posterior.nc")
    assert read["causes"].sizes["cause"] == 0
    first = check(read).messages[0]
    assert first.kind == "not described"
    assert first.details["advice"].endswith(likely_causes(read))
    assert "force_x had the other sign" in likely_causes(read)


@pytest.mark.slow
def test_readings_that_stand_out_are_named_where_the_model_describes_all_others():
    record = replace(CELL, degrees_of_freedom=2.0).measure(swept(SHAPE, step=0.03), rng=1)
    record.attrs = {name: value for name, value in record.attrs.items() if not name.startswith("load_cell_")}
    posterior = infer_contour(record, rig=Rig(load_cell=CELL), rng=1, settings=BRIEF)
    posterior["causes"] = xr.DataTree(causes(posterior))
    assert "degrees_of_freedom = 4" in likely_causes(posterior)


def parabola(rig, **more):
    """An experiment with a record of the parabola, and the parameters of the truth."""
    record = CELL.measure(scan(SHAPE, Rig(), drive_step=0.03).record, rng=1)
    return Experiment(record, rig), {"a": SHAPE.a, "q": SHAPE.q, "x_c": 0.0, **more}


def test_a_spot_changes_the_radius_of_curvature_at_its_place_alone():
    family = LocalBends(family_named("parabola"), (0.4,))
    assert family.parameters == ("bend_1", "a", "q", "x_c")
    drawn, slopes = family.build(np.array([0.0, np.log(2.0)]), 0.5, 0.3, 0.1), np.array([[-0.6], [0.4]])
    radius = SHAPE.radius_of_curvature(slopes) * [[1.0, 1.0], [1.0, 2.0]]
    np.testing.assert_allclose(drawn.radius_of_curvature(slopes), radius, rtol=1e-3)  # a parabola has none upright
    np.testing.assert_allclose(drawn.point(0.0), [[0.1, 0.1], [0.3, 0.3]], atol=1e-12)


def test_of_a_right_record_no_unknown_explains_more_than_its_price():
    experiment, truth = parabola(Rig(load_cell=CELL, unknown="nothing"))
    model = contour_problem(experiment).model
    best = optimum_beside(model, [truth])
    start = dict(zip(model.names, best.point.tolist(), strict=True))
    bent = with_bends(model, PLACES)
    bends = bent.forward_parameters[: len(PLACES)]
    found = first_order(bent, start | dict.fromkeys(bends, 0.0), [[bend] for bend in bends])
    assert max(one.log_evidence for one in found) < np.log(len(PLACES))  # a false alarm of one in a thousand or less


@pytest.mark.slow
def test_of_a_right_record_no_cause_is_named():
    found = causes_beside(*parabola(Rig(load_cell=CELL, unknown="nothing")))
    assert found.attrs["described"] == 1
    assert likely_causes(xr.DataTree.from_dict({"causes": found})) == ""


def test_causes_for_which_there_was_no_time_are_named():
    found = causes_beside(*parabola(Rig(load_cell=CELL, unknown="nothing")), Deadline.after(0.0))
    assert {"friction", "lag", "family shape-free"} <= set(found.attrs["no_time_for"].split(", "))
    assert not found.sought.any()
    said = likely_causes(xr.DataTree.from_dict({"causes": found}))
    assert found.attrs["no_time_for"] in said


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "kind"), [(4.0, "flat spot"), (0.1, "corner")])
def test_a_spot_of_the_contour_is_named_with_its_place(factor, kind):
    contour = Misspecification(flat_spot=(0.2, factor)).contour(SHAPE.broadcast_to((1,)))
    record = CELL.measure(scan(contour.take(np.array(0)), Rig(), drive_step=0.03).record, rng=1)
    best = {"a": SHAPE.a, "q": SHAPE.q, "x_c": 0.0}
    found = causes_beside(Experiment(record, Rig(load_cell=CELL)), best)
    parted = [name.partition(" at x = ") for name in found.cause.values.tolist()]
    (k,) = [k for k, (of, *_) in enumerate(parted) if of == kind]
    place = parted[k][2]
    assert found.describes[k]
    assert found.log_evidence[k] > found.log_evidence[0] - 5.0  # two joined power laws make nearly the same spot
    begins, ends = contour.point(np.array([0.0, 0.4]))[0]
    assert begins <= float(place) <= ends
    assert str(found.remedy.values[k]) in ("--family shape-free", "--family flat-sided")


def group(*rows):
    names, gains, describes = map(list, zip(*rows, strict=True))
    columns = {"log_evidence": gains, "describes": describes, "remedy": [f"cure of {name}" for name in names]}
    return xr.Dataset({name: ("cause", column) for name, column in columns.items()}, coords={"cause": names})


SAID = {
    "one": ([("a", 900, 1), ("c", 20, 1), ("b", 400, 0)], ["cure of a", "Less likely", " c"], ["of b", "of c"]),
    "two alike": ([("a", 900, 1), ("b", 897, 1)], ["cure of a", "cure of b", "gauge"], []),
    "what describes": ([("a", 400, 1), ("b", 900, 0)], ["cure of a"], ["of b"]),
    "none describes": ([("b", 900, 0), ("a", 400, 0)], ["Nothing", "cure of b"], ["of a"]),
    "none is better": ([("b", 1, 1)], [], ["of b"]),
}


@pytest.mark.parametrize(("rows", "named", "unnamed"), SAID.values(), ids=SAID)
def test_what_is_said_of_causes(rows, named, unnamed):
    said = likely_causes(xr.DataTree.from_dict({"causes": group(*rows)}))
    assert all(word in said for word in named)
    assert not any(word in said for word in unnamed)
    assert likely_causes(xr.DataTree()) == ""


@pytest.mark.slow
def test_a_check_names_the_cause_in_place_of_a_list():
    posterior = inferred(Rig(load_cell=CELL, unknown={"friction": 0.5}), unknown="nothing")
    (finding,) = (one for one in check(posterior).messages if one.kind == "not described")
    posterior["causes"] = xr.DataTree(causes(posterior))
    (with_cause,) = (one for one in check(posterior).messages if one.kind == "not described")
    assert 'friction = "default"' in with_cause.details["advice"] != finding.details["advice"]

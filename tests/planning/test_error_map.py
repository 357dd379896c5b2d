"""Maps of errors: the same whoever makes them, resumed where they were left, and first order where noise is small."""

import json
from functools import cache

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tactile_bayes as tb
from helpers.refusals import refused
from tactile_bayes.contours import Parabola, paper_profile
from tactile_bayes.errors import ParameterError, StudyError
from tactile_bayes.planning.amplification import amplification
from tactile_bayes.planning.error_cell import CellOutcome
from tactile_bayes.planning.error_map import CELLS, Bands, _identity, error_map
from tactile_bayes.planning.information import information
from tactile_bayes.planning.plan import Plan
from tactile_bayes.rig import NOTHING, Rig
from tactile_bayes.tasks import Workers, open_results_store

SMALL = {
    "contours": ["II"],
    "over": {"noise_factor": [1.0], "distance": [0.4, 0.5]},
    "replicates": 2,
    "rng": 3,
    "drive": tb.Rotation(drive_step=0.1),
    "rig": Rig(unknown="nothing"),
    "workers": 1,
}


@cache
def small():
    return error_map(**SMALL)


@pytest.mark.slow
def test_cells_are_the_same_for_any_number_of_workers():
    xr.testing.assert_identical(error_map(**{**SMALL, "workers": 2}), small())


def test_another_seed_draws_other_noise_and_expects_the_same():
    over = {"noise_factor": [1.0], "distance": [0.4]}
    other, nearer = error_map(**{**SMALL, "rng": 4, "over": over}), small().sel(distance=[0.4])
    drawn = "rms_along"
    assert np.all(other[drawn].values != nearer[drawn].values)
    np.testing.assert_array_equal(other.expected_gap_width.values, nearer.expected_gap_width.values)


# ---- going on


class KilledError(Exception):
    pass


def test_a_map_that_was_killed_goes_on_where_it_was(tmp_path, monkeypatch):
    whole = small()

    def kill(progress):
        if progress.done == 1:
            raise KilledError

    with pytest.raises(KilledError):
        error_map(**{**SMALL, "workers": Workers(1, kill)}, out=tmp_path)
    rows = json.loads((tmp_path / "cells.json").read_text(encoding="utf-8"))["cells"]
    assert [row["number"] for row in rows] == [0]
    made, seen, original = [], [], error_map.__globals__["error_cell"]

    def counted(task):
        made.append(task[1])
        return original(task)

    monkeypatch.setitem(error_map.__globals__, "error_cell", counted)
    found = error_map(**{**SMALL, "workers": Workers(1, seen.append)}, out=tmp_path)
    assert made == [1]
    assert [(p.done, p.wanted, p.made) for p in seen] == [(2, 2, 1)]
    xr.testing.assert_identical(found, whole)
    again = error_map(**SMALL, out=tmp_path)
    assert made == [1]
    xr.testing.assert_identical(again, whole)


@pytest.mark.parametrize(
    "other",
    [
        {"rng": 4},
        {"replicates": 3},
        {"over": {**SMALL["over"], "noise_factor": [2.0]}},
        {"contours": {"II": Parabola(0.6, 0.5)}},
        {"rig": Rig(load_cell=tb.LoadCell(force_noise=0.1, moment_noise=0.02), unknown="nothing")},
        {"rig": Rig(unknown={**NOTHING, "friction": 0.1})},
        {"bands": Bands(family=tb.Family("parabola", a=stats.norm(0.5, 0.1)))},
        {"drive": tb.Rotation((0.1, 0.0), drive_step=0.1)},
        {"drive": tb.Rotation(direction="forward", drive_step=0.1)},
    ],
    ids=str,
)
def test_the_folder_of_another_study_is_refused(tmp_path_factory, other):
    folder = tmp_path_factory.mktemp("study")
    with open_results_store(_identity(task_of(SMALL)), folder, CELLS) as store:
        store.outcomes[0] = CellOutcome({"gap_width": 0.1}, "ok")
    before = (folder / "cells.json").read_bytes()
    with refused(StudyError, "another experiment", "there", "here"):
        error_map(**{**SMALL, **other}, out=folder)
    assert (folder / "cells.json").read_bytes() == before


def task_of(options):
    """What a study is made from, without making it."""
    kept = {}

    def keep(store, function, task, count, **others):
        kept["task"] = task
        return {number: CellOutcome({}, "not made") for number in range(count)}

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(error_map.__globals__, "keep_outcomes", keep)
        error_map(**options)
    return kept["task"]


def test_an_outcome_comes_back_from_its_row(tmp_path):
    outcome = CellOutcome({"gap_width": 0.1 + 0.2, "posterior_gap_width": np.nan}, "ok")
    with open_results_store({}, tmp_path, CELLS) as store:
        store.outcomes[0] = outcome
    with open_results_store({}, tmp_path, CELLS) as store:
        back = store.outcomes[0]
    assert back.message == "ok"
    assert back.numbers["gap_width"] == 0.1 + 0.2
    assert np.isnan(back.numbers["posterior_gap_width"])


# ---- numbers


def test_first_order_is_what_small_noise_gives():
    """At a hundredth of the noise, within 4.5 standard errors: of four numbers, false alarms in 1 of 30000 runs.

    A mean square of some samples has the variance 2 Σ σ⁴/(Σ σ²)², over the replicates.
    """
    replicates, step = 24, np.radians(6.0)
    found = error_map(
        ["II"],
        over={"noise_factor": [0.01]},
        replicates=replicates,
        drive=tb.Rotation(drive_step=step),
        rng=1,
        workers=1,
        rig=Rig(unknown="nothing"),
    ).squeeze()
    plan = Plan(paper_profile("II", q=0.5), drive=tb.Rotation(drive_step=step)).with_noise(0.01)
    angles = np.unique(plan.scan.record.drive_angle.values)
    grown = amplification(Plan(plan.contour, Rig(load_cell=plan.cell), drive=tb.Rotation(drive_angles=angles)))
    for method in ("raw", "constrained"):
        of = grown.sel(reconstruction=method)
        ok = of.holds.values
        for name in ("along", "across"):
            variance = of[f"sd_{name}"].values[ok] ** 2
            error = np.sqrt(2.0 * np.sum(variance**2) / replicates) / np.sum(variance)
            ratio = float(found[f"rms_{name}"].sel(reconstruction=method)) / float(
                found[f"first_order_{name}"].sel(reconstruction=method)
            )
            assert error < 0.2
            assert abs(ratio**2 - 1.0) < 4.5 * error, (method, name, ratio, error)


def test_first_order_is_not_what_large_noise_gives():
    found = error_map(
        ["II"],
        over={"noise_factor": [0.01, 100.0]},
        replicates=3,
        drive=tb.Rotation(drive_step=0.1),
        rng=1,
        workers=1,
        rig=Rig(unknown="nothing"),
    ).squeeze()
    quiet, loud = found.isel(noise_factor=0), found.isel(noise_factor=1)
    growth = (loud.median_error / quiet.median_error).sel(reconstruction="constrained")
    assert float(growth) < 0.8 * 1e4  # errors end where the rod does
    assert float(loud.ok.sel(reconstruction="raw")) < 0.5 < float(quiet.ok.sel(reconstruction="raw"))
    assert float(loud.without_answer.sel(reconstruction="raw")) > float(quiet.without_answer.sel(reconstruction="raw"))


def test_expected_widths_are_those_of_information():
    plan = Plan(paper_profile("II", q=0.5), Rig(unknown="nothing"), drive=tb.Rotation((0.0, 0.1), drive_step=0.1))
    right = information(plan)
    of = small().sel(distance=0.4, noise_factor=1.0, contour="II")
    for kind in ("touched", "gap"):
        width = float(of[f"expected_{kind}_width"])
        assert width == pytest.approx(float(right[f"{kind}_width"]), rel=1e-6), kind
    ends = [sweep.snap_off.contact_x for sweep in plan.scan.sweeps]
    assert float(of.gap_width) == pytest.approx(max(ends) - min(ends))


def test_a_map_of_a_rod_in_si_is_a_scaled_one():
    rod = tb.Rod(length=0.2, flexural_rigidity=2e-3)
    found = error_map(**{**SMALL, "rig": Rig(rod=rod, unknown="nothing")})
    np.testing.assert_array_equal(found.distance.values, small().distance.values)
    np.testing.assert_allclose(found.force_noise.values, rod.force_unit * small().force_noise.values)
    for name in ("rms_along", "rms_across", "expected_gap_width", "gap_width", "median_error"):
        np.testing.assert_allclose(found[name].values, 0.2 * small()[name].values, rtol=1e-4, err_msg=name)
        assert (found[name].attrs["units"], small()[name].attrs["units"]) == ("m", "1")


def test_shares_are_shares():
    for name in ("ok", "without_answer"):
        assert np.all((small()[name].values >= 0.0) & (small()[name].values <= 1.0))
    assert np.all(small().ok + small().without_answer <= 1.0 + 1e-12)
    assert np.isnan(small().posterior_gap_width.values).all()


@pytest.mark.parametrize("distance", [1.2, 0.005])
def test_a_rod_that_does_not_reach_leaves_a_message(distance):
    found = error_map(**{**SMALL, "over": {"distance": [distance, 0.5], "noise_factor": [1.0]}, "replicates": 1})
    lost, made = found.isel(distance=0), found.isel(distance=1)
    assert made.message.item() == "ok"
    assert lost.message.item().split(":")[0] in ("ReachError", "ContourError")
    names = [name for name in found.data_vars if name != "message"]
    assert all(np.isnan(lost[name].values).all() for name in names)


@pytest.mark.slow
def test_posteriors_are_inferred_in_some_cells():
    """Within a fifth of the widths that are to be expected; a record's own noise makes them differ by a tenth."""
    options = {**SMALL, "over": {**SMALL["over"], "noise_factor": [0.5, 1.0]}}
    found = error_map(**{**options, "bands": Bands(posterior_cells=2, posterior_replicates=2)})
    inferred = np.isfinite(found.posterior_gap_width.values).ravel()
    assert inferred.tolist() == [True, False, False, True]
    for kind in ("touched", "gap"):
        ratio = (found[f"posterior_{kind}_width"] / found[f"expected_{kind}_width"]).values.ravel()[inferred]
        np.testing.assert_allclose(ratio, 1.0, atol=0.2)
    assert np.all(found.posterior_failed.values.ravel()[inferred] == 0.0)
    for name in ("rms_along", "median_error"):
        np.testing.assert_array_equal(found[name].values, error_map(**options)[name].values)


# ---- what is refused


@pytest.mark.parametrize("axis", ["distance", "noise_factor"])
@pytest.mark.parametrize(
    "numbers", [[], 0.5, ["near"], [[0.5]], [0.5, -0.1], [0.0], [np.inf], [1.0, 2.0, 1.0]], ids=str
)
def test_bad_axes_are_refused(axis, numbers):
    with refused(ParameterError, **{axis: numbers}):
        error_map(**{**SMALL, "over": {axis: numbers}})


@pytest.mark.parametrize(
    "wrong",
    [
        {"over": [0.5]},
        {"contours": "II"},
        {"contours": []},
        {"replicates": 0},
        {"replicates": 2.0},
        {"rng": -1},
        {"rig": "bias"},
        {"drive": None},
        {"drive": tb.Rotation((0.0, 0.1))},
        {"bands": 0.9},
    ],
    ids=str,
)
def test_bad_arguments_are_refused(wrong):
    with refused(ParameterError, **wrong):
        error_map(**{**SMALL, **wrong})


@pytest.mark.parametrize("wrong", [{"posterior_cells": -1}, {"posterior_replicates": 0}, {"probability": 1.0}], ids=str)
def test_bad_bands_are_refused(wrong):
    with refused(ParameterError, **wrong):
        Bands(**wrong)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"contours": {"x": 5}}, "5"),
        ({"contours": {"x": tb.contours.from_points(np.arange(-3.0, 4.0), np.arange(-3.0, 4.0) ** 2)}}, "family"),
        ({"rig": Rig(load_cell=tb.LoadCell(force_noise=0.1))}, "holding_moment"),
        ({"contours": ["II", "III"], "bands": Bands(family=tb.Family("parabola"))}, "circle"),
        ({"bands": Bands(family="parabola")}, "family"),
        ({"over": {"nearness": [0.5]}}, "nearness"),
    ],
)
def test_what_cannot_be_studied_is_refused(wrong, named):
    with refused(ParameterError, named):
        error_map(**{**SMALL, **wrong})

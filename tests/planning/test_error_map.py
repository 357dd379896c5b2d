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
from tactile_bayes.planning.error_map import Bands, error_map
from tactile_bayes.planning.information import information
from tactile_bayes.planning.plan import Plan
from tactile_bayes.rig import NOTHING, Rig
from tactile_bayes.tasks import Workers

SMALL = {
    "contours": ["II"],
    "over": {"noise_factor": [1.0], "distance": [0.4, 0.5]},
    "replicates": 2,
    "rng": 3,
    "drive": tb.Rotation(drive_step=0.1),
    "rig": Rig(unknown="nothing"),
    "workers": 1,
}


def mapped(**options):
    return error_map(**(SMALL | options))


@cache
def small():
    return mapped()


@pytest.mark.slow
def test_cells_are_the_same_for_any_number_of_workers():
    xr.testing.assert_identical(mapped(workers=2), small())


def test_another_seed_draws_other_noise_and_expects_the_same():
    over = {"noise_factor": [1.0], "distance": [0.4]}
    other, nearer = mapped(rng=4, over=over), small().sel(distance=[0.4])
    assert np.all(other.rms_along.values != nearer.rms_along.values)
    np.testing.assert_array_equal(other.expected_gap_width.values, nearer.expected_gap_width.values)


class KilledError(Exception):
    pass


OTHERS = (
    {"rng": 4},
    {"replicates": 3},
    {"over": {**SMALL["over"], "noise_factor": [2.0]}},
    {"contours": {"II": Parabola(0.6, 0.5)}},
    {"rig": Rig(load_cell=tb.LoadCell(force_noise=0.1, moment_noise=0.02), unknown="nothing")},
    {"rig": Rig(unknown={**NOTHING, "friction": 0.1})},
    {"bands": Bands(family=tb.Family("parabola", a=stats.norm(0.5, 0.1)))},
    {"drive": tb.Rotation((0.1, 0.0), drive_step=0.1)},
    {"drive": tb.Rotation(direction="forward", drive_step=0.1)},
)


def test_a_map_that_was_killed_goes_on_where_it_was_and_another_is_refused_its_folder(tmp_path):
    def kill(progress):
        raise KilledError

    with pytest.raises(KilledError):
        mapped(workers=Workers(1, kill), out=tmp_path)
    rows = json.loads((tmp_path / "cells.json").read_text(encoding="utf-8"))["cells"]
    assert [row["number"] for row in rows] == [0]
    seen = []
    for _ in range(2):
        xr.testing.assert_identical(mapped(workers=Workers(1, seen.append), out=tmp_path), small())
    assert [(p.done, p.wanted, p.made) for p in seen] == [(2, 2, 1)]
    before = (tmp_path / "cells.json").read_bytes()
    for other in OTHERS:
        with refused(StudyError, "another experiment", "there", "here"):
            mapped(**other, out=tmp_path)
    assert (tmp_path / "cells.json").read_bytes() == before


def test_first_order_is_what_small_noise_gives():
    """At a hundredth of the noise, within 4.5 standard errors: of four numbers, false alarms in 1 of 30000 runs.

    A mean square of some samples has the variance 2 Σ σ⁴/(Σ σ²)², over the replicates.
    """
    replicates, drive = 24, tb.Rotation(drive_step=np.radians(6.0))
    found = mapped(over={"noise_factor": [0.01]}, replicates=replicates, drive=drive, rng=1).squeeze()
    plan = Plan(paper_profile("II", q=0.5), drive=drive).with_noise(0.01)
    grown = amplification(plan.at_angles(np.unique(plan.scan.record.drive_angle.values)))
    for method in ("raw", "constrained"):
        of = grown.sel(reconstruction=method)
        ok = of.holds.values
        for name in ("along", "across"):
            variance = of[f"sd_{name}"].values[ok] ** 2
            error = np.sqrt(2.0 * np.sum(variance**2) / replicates) / np.sum(variance)
            ratio = float((found[f"rms_{name}"] / found[f"first_order_{name}"]).sel(reconstruction=method))
            assert error < 0.2
            assert abs(ratio**2 - 1.0) < 4.5 * error, (method, name, ratio, error)


def test_first_order_is_not_what_large_noise_gives():
    found = mapped(over={"noise_factor": [0.01, 100.0]}, replicates=3, rng=1).squeeze()
    assert np.all(found.ok + found.without_answer <= 1.0 + 1e-12)
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
        assert float(of[f"expected_{kind}_width"]) == pytest.approx(float(right[f"{kind}_width"]), rel=1e-6), kind
    ends = [sweep.snap_off.contact_x for sweep in plan.scan.sweeps]
    assert float(of.gap_width) == pytest.approx(max(ends) - min(ends))
    assert np.isnan(small().posterior_gap_width.values).all()  # none was asked for


def test_a_map_of_a_rod_in_si_is_a_scaled_one():
    rod = tb.Rod(length=0.2, flexural_rigidity=2e-3)
    found = mapped(rig=Rig(rod=rod, unknown="nothing"))
    np.testing.assert_array_equal(found.distance.values, small().distance.values)
    np.testing.assert_allclose(found.force_noise.values, rod.force_unit * small().force_noise.values)
    for name in ("rms_along", "rms_across", "expected_gap_width", "gap_width", "median_error"):
        np.testing.assert_allclose(found[name].values, 0.2 * small()[name].values, rtol=1e-4, err_msg=name)
        assert (found[name].attrs["units"], small()[name].attrs["units"]) == ("m", "1")


@pytest.mark.parametrize("distance", [1.2, 0.005])
def test_a_rod_that_does_not_reach_leaves_a_message(distance):
    found = mapped(over={"distance": [distance, 0.5], "noise_factor": [1.0]}, replicates=1)
    lost, made = found.isel(distance=0), found.isel(distance=1)
    assert made.message.item() == "ok"
    assert lost.message.item().split(":")[0] in ("ReachError", "ContourError")
    assert all(np.isnan(values).all() for values in lost.drop_vars("message").data_vars.values())


@pytest.mark.slow
def test_posteriors_are_inferred_in_some_cells():
    """Within a fifth of the widths that are to be expected; a record's own noise makes them differ by a tenth."""
    over = {**SMALL["over"], "noise_factor": [0.5, 1.0]}
    found, plain = mapped(over=over, bands=Bands(posterior_cells=2, posterior_replicates=2)), mapped(over=over)
    inferred = np.isfinite(found.posterior_gap_width.values).ravel()
    assert inferred.tolist() == [True, False, False, True]
    for kind in ("touched", "gap"):
        ratio = (found[f"posterior_{kind}_width"] / found[f"expected_{kind}_width"]).values.ravel()[inferred]
        np.testing.assert_allclose(ratio, 1.0, atol=0.2)
    assert np.all(found.posterior_failed.values.ravel()[inferred] == 0.0)
    for name in ("rms_along", "median_error"):
        np.testing.assert_array_equal(found[name].values, plain[name].values)


AXES = ([], 0.5, ["near"], [[0.5]], [0.5, -0.1], [0.0], [np.inf], [1.0, 2.0, 1.0])


@pytest.mark.parametrize(
    ("call", "wrong"),
    [
        *((lambda **axis: mapped(over=axis), {name: v}) for name in ("distance", "noise_factor") for v in AXES),
        *((mapped, wrong) for wrong in ({"over": [[0.5]]}, {"contours": []}, {"replicates": 0})),
        *((Bands, wrong) for wrong in ({"posterior_cells": -1}, {"posterior_replicates": 0}, {"probability": 1.0})),
    ],
)
def test_bad_arguments_are_refused(call, wrong):
    with refused(ParameterError, **wrong):
        call(**wrong)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"contours": {"x": 5}}, "5"),
        ({"drive": tb.Rotation((0.0, 0.1))}, "drive"),
        ({"contours": {"x": tb.contours.from_points(np.arange(-3.0, 4.0), np.arange(-3.0, 4.0) ** 2)}}, "family"),
        ({"rig": Rig(load_cell=tb.LoadCell(force_noise=0.1))}, "holding_moment"),
        ({"contours": ["II", "III"], "bands": Bands(family=tb.Family("parabola"))}, "circle"),
        ({"bands": Bands(family="parabola")}, "family"),
        ({"over": {"nearness": [0.5]}}, "nearness"),
    ],
)
def test_what_cannot_be_studied_is_refused(wrong, named):
    with refused(ParameterError, named):
        mapped(**wrong)

"""Commands on a base that is carried: a translation, and a record that is turned here and carried there."""

from dataclasses import replace

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.commands import answered, call, succeed
from helpers.contour_posteriors import QUICK
from helpers.refusals import refused
from helpers.report_pages import quickly
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.result import read_result
from tactile_bayes.plotting.drive_axis import drive_axis
from tactile_bayes.report.findings import findings_of
from tactile_bayes.report.page import page_of
from tactile_bayes.report.readings_figure import motion_of

CIRCLE = ["--family", "circle", "--parameter", "r=0.3", "--parameter", "q=0.8"]
CARRY = ["--carry", "0.8,0,180,68.75,1.6", *CIRCLE]


pytestmark = pytest.mark.usefixtures("coarse_pictures")


def run_of(folder, rig, *options):
    """A run of commands from a scan to a posterior."""
    ideal, measured, run = folder / "ideal.csv", folder / "measured.csv", folder / "run"
    for arguments in (
        ("scan", *CARRY, *options, "--out", ideal),
        ("measure", ideal, "--force-noise", 0.05, "--moment-noise", 0.02, "--out", measured),
        ("infer", measured, "--family", "circle", "--rig", rig, "--out", run),
    ):
        with quickly(replace(QUICK, walkers=28)):
            succeed(*arguments)
    return measured, run


@pytest.fixture(scope="module")
def carried(tmp_path_factory, as_stated, coarse_pictures):
    return run_of(tmp_path_factory.mktemp("carried"), as_stated)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory, as_stated, coarse_pictures):
    return run_of(tmp_path_factory.mktemp("mixed"), as_stated, "--base", "0,0")


def test_a_scan_prints_travels_and_how_contact_ends(tmp_path):
    out, figure = tmp_path / "scan.csv", tmp_path / "scan.png"
    result = call("scan", *CARRY, "--out", out, "--figure", figure)
    assert "travel [L]" in result.stdout
    assert "snap-off (fold)" in result.stdout
    drive = tb.Translation((0.8, 0.0), np.pi, np.radians(68.75), 1.6)
    expected = tb.scan(tb.contours.Circle(0.3, 0.8), drive=drive)
    assert f"{expected.events['forward'].snap_off.travel:.4f}" in result.stdout
    np.testing.assert_allclose(tb.read_record(out).base_x, expected.record.base_x, atol=1e-15)
    short = call("scan", *CIRCLE, "--carry", "0.8,0,180,68.75,1.1", "--drive-step", 0.05, "--out", out)
    assert "still in contact" in short.stdout
    assert tb.read_record(out).sizes["sample"] == 23
    (sweep,) = answered("scan", *CARRY, "--out", out)["sweeps"]
    assert sweep["carried"]
    assert sweep["snap_off"]["travel"] == pytest.approx(expected.events["forward"].snap_off.travel)


def test_poses_are_read_from_a_file(tmp_path):
    poses, out = tmp_path / "poses.csv", tmp_path / "scan.csv"
    poses.write_text("x,y,drive_angle\n0.8,0,52\n-0.8,0,97\n")
    assert call("scan", *CIRCLE, "--carry", poses, "--out", out).exit_code == 0
    record = tb.read_record(out)
    assert np.degrees(record.drive_angle.values[[0, -1]]) == pytest.approx([52.0, 97.0])


@pytest.mark.slow
def test_an_inspection_and_contacts_of_a_carried_rod(carried, tmp_path):
    measured, _ = carried
    inspected = call("inspect", measured, "--out", tmp_path / "inspection")
    assert inspected.exit_code == 0, inspected.output
    assert "carried 1.6 L" in inspected.stdout
    assert "nan" not in inspected.stdout.lower()
    assert "onset_travel_before" in (tmp_path / "inspection" / "sweeps.csv").read_text()
    (sweep,) = answered("inspect", measured, "--out", tmp_path / "again")["sweeps"]
    assert sweep["snap_off_travel"][0] <= 1.4811 <= sweep["snap_off_travel"][1]
    assert call("reconstruct", measured, "--out", tmp_path / "contacts").exit_code == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "kind"), [("carried", "travel"), pytest.param("mixed", "sample", marks=pytest.mark.slow)]
)
def test_a_run_draws_every_figure_over_what_moves(request, name, kind):
    measured, run = request.getfixturevalue(name)
    assert drive_axis(tb.read_record(measured)).kind == kind
    for figure in ("predictive", "rods", "contour"):
        assert (run / f"{figure}.png").is_file(), figure


@pytest.mark.parametrize("name", ["carried", pytest.param("mixed", marks=pytest.mark.slow)])
def test_a_report_moves_the_rod_with_its_base(request, name):
    _, run = request.getfixturevalue(name)
    posterior = read_result(run / "posterior.nc")
    motion = motion_of(posterior)
    record = findings_of(run).record
    np.testing.assert_allclose(motion.rod_x[:, 0], record.base_x.values[motion.samples], atol=1e-12)
    np.testing.assert_allclose(motion.rod_y[:, 0], record.base_y.values[motion.samples], atol=1e-12)


def test_a_report_says_travels_and_that_one_carried_sweep_has_no_gap(carried):
    with refused(InferenceError, "one sweep", "first contact", "last contact"):
        tb.gap(read_result(carried[1] / "posterior.nc"))
    page = page_of(findings_of(carried[1]), "run")
    assert "carried 1.6\xa0L" in page["sweeps"].rows[0]
    assert page["all_readings"].heads[3] == "travel [L]"
    assert "without a gap" in page["gap"][0]
    frames = page["data"]["frames"]["said"]
    assert frames["travel"][-1].startswith(", travel 1.6")


@pytest.mark.slow
def test_a_report_says_which_sweep_is_carried(mixed):
    both = page_of(findings_of(mixed[1]), "run")
    assert [sweep["name"] for sweep in both["data"]["frames"]["sweeps"]][-1] == "sweep 2, forward, carried"
    assert both["data"]["frames"]["said"]["travel"][0] == ""
    assert both["gap"][0].startswith("No gap ")


def test_a_check_knows_where_a_carried_rod_is_loaded(carried):
    check = tb.check(read_result(carried[1] / "posterior.nc")).predictive
    assert np.all(check.worst_from_travel >= 0.85)
    assert np.all(check.worst_to_travel <= 1.5)
    assert np.isfinite(check.p_value.sel(discrepancy="loaded")).all()


@pytest.mark.slow
def test_a_misfit_of_a_carried_sweep_is_placed_by_its_travel(carried, as_stated, tmp_path):
    measured, _ = carried
    record = tb.read_record(measured)
    bent = tmp_path / "bent.csv"
    tb.write_record(record.assign(force_y=record.force_y + 0.15 * np.sin(40.0 * record.base_x)), bent)
    result = call("infer", bent, "--family", "circle", "--rig", as_stated, "--out", tmp_path / "run")
    assert "do not describe" in result.stdout
    assert " L of travel it is off" in result.stdout.replace("\n", " ")

"""The commands `scan` and `measure`: ideal records, and what a load cell makes of them."""

import math

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.commands import answered, assert_refused, call, succeed
from tactile_bayes.rig import Rig

COARSE = ["--drive-step", 10]
FLANKS = [f"--parameter={number}" for number in ("left_a=0.5", "right_w=1", "right_n=4", "q=0.5")]


@pytest.fixture(scope="module")
def ideal(tmp_path_factory):
    path = tmp_path_factory.mktemp("ideal") / "ideal.csv"
    return path, call("scan", "--profile", "II", "--distance", 0.5, "--drive-step", 2, "--out", path)


def test_a_scan_prints_its_events_and_writes_the_record(ideal):
    path, result = ideal
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert lines[0].startswith("Parabola(a=0.5, q=0.5, x_c=0.0): 2 sweeps, ")
    assert max(map(len, lines[2:])) <= 80
    rows = [line.split() for line in lines[3:9]]
    assert [row[:2] for row in rows] == [
        *(["0", "forward"], ["tip", "→"], ["snap-off", "(corner)"]),
        *(["1", "backward"], ["tip", "→"], ["snap-off", "(corner)"]),
    ]
    assert rows[2][2:] == ["180.727", "0.0609", "0.5019", "1.0544", "11.5448"]
    assert lines[-1].split() == ["record", str(path)]
    expected = tb.scan(tb.contours.Parabola(0.5, 0.5), drive_step=math.radians(2.0)).record
    xr.testing.assert_identical(tb.read_record(path), expected)


@pytest.mark.parametrize(
    ("options", "contour"),
    [
        ([], "Parabola(a=0.5, q=0.5, x_c=0.0)"),
        (["--family", "circle", "--parameter", "r=0.8", "--parameter", "q=0.4", "--parameter", "x_c=0.1"], "Circle("),
        (["--family", "parabola/power-law", *FLANKS], "Joined("),
    ],
)
def test_contours_are_chosen_by_options(tmp_path, options, contour):
    answer = answered("scan", *options, *COARSE, "--direction", "forward", "--out", tmp_path / "r.nc")
    assert answer["contour"].startswith(contour)
    assert [sweep["direction"] for sweep in answer["sweeps"]] == ["forward"]


def test_a_scan_in_si_is_of_a_contour_in_metres(tmp_path, rig_file):
    rod = ["--rig", rig_file('[rod]\nlength = "200 mm"\nflexural_rigidity = 1e-3\n')]
    of_profile = answered("scan", "--profile", "II", *rod, *COARSE, "--out", tmp_path / "1.csv")
    family = ["--family", "parabola", "--parameter", "a=2.5", "--parameter", "q=0.1"]
    of_family = answered("scan", *family, *rod, *COARSE, "--out", tmp_path / "2.csv")
    assert of_profile["sweeps"] == of_family["sweeps"]
    assert of_profile["units"] == "SI"
    assert of_profile["rod"]["length"] == 0.2


def test_a_rig_that_rubs_is_scanned_with_its_friction_and_shape(tmp_path, rig_file):
    rig = rig_file("[rod]\ntaper = 0.3\n[unknown]\nfriction = 0.2\nrest_curvature = 0.1\n")
    assert call("scan", "--rig", rig, *COARSE, "--out", tmp_path / "r.csv").exit_code == 0
    rod = tb.Rod(taper=0.3, rest_curvature=0.1)
    contour = tb.contours.paper_profile("II", q=0.5)
    expected = tb.scan(contour, rig=Rig(rod=rod, unknown={"friction": 0.2}), drive_step=math.radians(10.0)).record
    xr.testing.assert_allclose(tb.read_record(tmp_path / "r.csv"), expected, rtol=1e-12)


def test_measured_points_are_scanned(tmp_path):
    x = np.linspace(-0.9, 0.9, 40)
    lines = [f"{a:.6f};{b:.6f}".replace(".", ",") for a, b in zip(0.5 * x**2 + 0.5, x, strict=True)]
    points = tmp_path / "points.csv"
    points.write_text("\n".join(["# from a probe", "y [L];x [L]", *lines]), encoding="utf-8")
    forward = ["--direction", "forward", *COARSE]
    found = answered("scan", "--points", points, *forward, "--out", tmp_path / "r.csv")
    exact = answered("scan", "--profile", "II", *forward, "--out", tmp_path / "e.csv")
    one, other = (answer["sweeps"][0]["snap_off"]["drive_angle"] for answer in (found, exact))
    assert one == pytest.approx(other, abs=1e-4)


@pytest.mark.usefixtures("coarse_pictures")
def test_a_scan_from_two_pivots_is_drawn(tmp_path):
    """Into folders that are made for its files."""
    pivots = ["--base", "0,0", "--base", "0.2,0"]
    out, figure = tmp_path / "a" / "b" / "r.csv", tmp_path / "c" / "scan.png"
    answer = answered("scan", *pivots, *COARSE, "--out", out, "--figure", figure)
    assert [sweep["base"] for sweep in answer["sweeps"]] == [[0.0, 0.0], [0.0, 0.0], [0.2, 0.0], [0.2, 0.0]]
    assert figure.read_bytes().startswith(b"\x89PNG\r\n")
    assert out.is_file()


def test_a_load_cell_measures_an_ideal_record(ideal, tmp_path, rig_file):
    cell = tb.LoadCell(force_noise=0.05, moment_noise=0.02, bias=(0.0, 0.1, -0.1), drive_angle_noise=math.radians(0.1))
    rig = rig_file('[load_cell]\nforce_noise = 0.3\nbias = [0.0, 0.1, -0.1]\ndrive_angle_noise = "0.1 deg"\n')
    noise = ["--rig", rig, "--force-noise", 0.05, "--moment-noise", 0.02]
    result = succeed("measure", ideal[0], *noise, "--seed", 3, "--out", tmp_path / "m.csv")
    assert "without columns of the truth" in result.stdout
    expected = cell.measure(tb.read_record(ideal[0]), rng=3)
    found = tb.read_record(tmp_path / "m.csv")
    assert tb.LoadCell.from_record(found) == cell
    assert not [name for name in found.data_vars if name.startswith("truth_")]
    xr.testing.assert_equal(found, expected[list(found.data_vars)])
    call("measure", ideal[0], *noise, "--keep-truth", "--out", tmp_path / "d" / "m.nc")
    kept = tb.read_record(tmp_path / "d" / "m.nc")
    xr.testing.assert_equal(kept.truth_force_x.drop_attrs(), tb.read_record(ideal[0]).force_x.drop_attrs())


def test_a_record_is_not_measured_twice_unless_it_states_no_load_cell(ideal, tmp_path):
    """As the help says: what is not in the header cannot be known."""
    noise = ["--force-noise", 0.05, "--moment-noise", 0.02]
    call("measure", ideal[0], *noise, "--out", tmp_path / "m.csv")
    result = call("measure", tmp_path / "m.csv", *noise, "--out", tmp_path / "mm.csv")
    assert_refused(result, tmp_path / "m.csv", "measured already")
    assert not (tmp_path / "mm.csv").exists()
    noisy = tb.read_record(tmp_path / "m.csv")
    noisy.attrs = {name: value for name, value in noisy.attrs.items() if not name.startswith("load_cell_")}
    tb.write_record(noisy, tmp_path / "noisy.csv")
    answered("measure", tmp_path / "noisy.csv", *noise, "--out", tmp_path / "mm.csv")


def test_a_measured_scan_states_the_data_sheets_and_deviates_once(tmp_path, rig_file):
    """As `Rig.measure`: a rod that is stiffer than stated makes larger loads, and the file does not say so."""
    text = "[rod]\nlength = 0.2\nflexural_rigidity = 0.0024\n[load_cell]\nforce_noise = 1e-6\nmoment_noise = 1e-6\n"
    rig = rig_file(text + "[unknown]\nrigidity_scale = 1.1\nlever_x = 1e-3\n")
    ideal, file = tmp_path / "ideal.csv", tmp_path / "measured.csv"
    assert call("scan", "--rig", rig, "--drive-step", "6", "--out", ideal).exit_code == 0
    assert call("measure", ideal, "--rig", rig, "--out", file).exit_code == 0
    stated, exact, record = tb.Rig.read(rig), tb.read_record(ideal), tb.read_record(file)
    assert record.attrs["rod_flexural_rigidity"] == 0.0024
    stated_of_cell = {name for name in record.attrs if name.startswith("load_cell_")}
    assert stated_of_cell == {f"load_cell_{name}" for name in ("frame", "force_noise", "moment_noise")}
    np.testing.assert_allclose(record.force_y, exact.force_y, rtol=0, atol=1e-5)
    again = stated.measure(exact, rng=1)
    np.testing.assert_allclose(record.holding_moment, again.holding_moment, rtol=0, atol=1e-15)
    assert call("reconstruct", file, "--rig", rig, "--out", tmp_path / "contacts").exit_code == 0

"""The records that come with the package are what it makes today."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from tactile_bayes.runs.demonstration import measure_demo

FOLDER = Path(__file__).parents[1] / "data" / "synthetic"
REFERENCE = FOLDER / "reference"
LENGTH, RIGIDITIES, DISTANCES = 0.1, (0.0005, 0.0002, 0.0001), (0.3, 0.5, 0.7)


def test_the_demonstration_is_reproduced(tmp_path):
    stored, made = tb.read_record(FOLDER / "demonstration.csv"), tb.read_record(measure_demo(tmp_path, rng=1)[0])
    assert stored.attrs == made.attrs
    assert list(stored.data_vars) == list(made.data_vars)
    for name, column in stored.items():
        if column.dtype.kind == "f":
            np.testing.assert_allclose(made[name], column, rtol=1e-9, atol=1e-12)
        else:
            np.testing.assert_array_equal(made[name], column)


# --- The reference set ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stored():
    return tb.datasets.open(REFERENCE).load()


def test_the_reference_set_is_reproduced(stored, tmp_path):
    tb.datasets.generate(FOLDER / "reference.toml", tmp_path, workers=1)
    made = tb.datasets.open(tmp_path).load()
    assert list(made.variables) == list(stored.variables)
    assert made.attrs == stored.attrs
    for name, variable in stored.variables.items():
        if variable.dtype.kind == "f":
            size = np.nanmax(np.abs(variable.values), initial=0.0)
            np.testing.assert_allclose(made[name], variable, rtol=1e-9, atol=1e-9 * size, err_msg=str(name))
        else:
            np.testing.assert_array_equal(made[name], variable, err_msg=str(name))


def test_the_reference_set_is_as_it_was_written():
    manifest = tb.datasets.verify(REFERENCE)
    assert manifest.records == 36
    assert not manifest.redrawn
    spec = tb.datasets.read_specification(FOLDER / "reference.toml")
    assert manifest.specification_sha256 == spec.sha256
    assert sum(file.stat().st_size for file in FOLDER.rglob("*") if file.is_file()) < 2e6


def test_it_has_the_profiles_distances_and_levels_that_its_description_states(stored):
    combinations = [(p, ei, q) for p in ("I", "II", "III", "IV") for ei in RIGIDITIES for q in DISTANCES]
    families = stored.truth_family.attrs["flag_meanings"].split()
    assert [families[code] for code in stored.truth_family.values] == [
        {"III": "circle", "IV": "parabola/power-law"}.get(profile, "parabola") for profile, _, _ in combinations
    ]
    np.testing.assert_array_equal(stored.rod_flexural_rigidity, [ei for _, ei, _ in combinations])
    distance = (stored.truth_contour_q - stored.base_y.isel(sweep=0)) / LENGTH
    np.testing.assert_allclose(distance, [q for _, _, q in combinations], rtol=1e-12)
    levels = np.array([[0.001 * LENGTH**2], [0.00004 * LENGTH]]) / RIGIDITIES
    np.testing.assert_allclose(levels, [[0.02, 0.05, 0.1], [0.008, 0.02, 0.04]])


@pytest.mark.parametrize("profile", ["I", "II", "III", "IV"])
def test_its_truth_is_that_of_the_papers_profile_in_rod_lengths(stored, profile):
    """Against `scan`, which resolves paths to the last digits, and knows no data sets."""
    first = 9 * ["I", "II", "III", "IV"].index(profile)
    for index in (first, first + 4, first + 8):
        one = stored.isel(record=index)
        ei = float(one.rod_flexural_rigidity)
        scale = {"holding_moment": ei / LENGTH, "force_x": ei / LENGTH**2, "force_y": ei / LENGTH**2}
        contour = tb.contours.paper_profile(profile, q=DISTANCES[index % 3])
        for sweep, direction in enumerate(("forward", "backward")):
            of_sweep = one.isel(sweep=sweep)
            scan = tb.scan(contour, direction=direction, drive_angles=of_sweep.drive_angle.values)
            event = scan.events[direction].snap_off
            np.testing.assert_allclose(float(of_sweep.truth_snap_off_drive_angle), event.drive_angle, atol=1e-7)
            for name, unit in scale.items():
                exact = scan.record[name].values
                near = 1e-6 * np.abs(exact).max()  # as the data card promises
                np.testing.assert_allclose(of_sweep[f"truth_{name}"] / unit, exact, rtol=0.0, atol=near)


def test_its_readings_have_the_noise_of_the_load_cell(stored):
    """Standard deviations of 10800 independent readings: further than 5/√(2 · 10800) off once in 1.7 million times."""
    for name, deviation in {"holding_moment": 0.00004, "force_x": 0.001, "force_y": 0.001}.items():
        noise = (stored[name] - stored[f"truth_{name}"]).values / deviation
        assert noise.size == 10_800
        assert abs(noise.std() - 1.0) < 5.0 / np.sqrt(2.0 * noise.size)
        assert abs(noise.mean()) < 5.0 / np.sqrt(noise.size)


@pytest.mark.parametrize(
    ("name", "index", "truth"),
    [
        ("profile-I-with-truth.csv", 4, True),
        ("profile-II.csv", 13, False),
        ("profile-III.csv", 22, False),
        ("profile-IV-with-truth.csv", 31, True),
    ],
)
def test_the_examples_are_records_of_it(name, index, truth):
    example = tb.read_record(FOLDER / name)
    xr.testing.assert_equal(example, tb.datasets.record(REFERENCE, index, truth=truth))
    assert any(str(column).startswith("truth_") for column in example) == truth

"""The demonstration's record: what a stranger's own would look like."""

import numpy as np
import pytest

import tactile_bayes as tb
from tactile_bayes.errors import ParameterError
from tactile_bayes.record import MEASURED, rod_of, write_record
from tactile_bayes.runs.demonstration import CONTOUR, LOAD_CELL, ROD, measure_demo


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return measure_demo(tmp_path_factory.mktemp("demo") / "new", rng=1)[0]


def test_the_record_is_complete_and_holds_no_truth(path):
    assert path.name == "record.csv"
    record = tb.read_record(path)
    assert tuple(record.data_vars) == MEASURED
    assert "truth" not in path.read_text(encoding="utf-8")
    assert record.attrs["units"] == "SI"
    assert rod_of(record) == ROD
    assert tb.LoadCell.from_record(record) == LOAD_CELL


def test_it_is_the_scan_of_the_contour_with_the_noise_that_is_stated(path):
    """Mean square over 3 n normal numbers: within five standard deviations, √(2 / 3n) each."""
    record, true = tb.read_record(path), tb.scan(CONTOUR, rig=tb.Rig(rod=ROD)).record
    np.testing.assert_array_equal(record.drive_angle, true.drive_angle)
    deviations = LOAD_CELL.standard_deviations
    noise = np.concatenate([((record[name] - true[name]) / deviations[name]).values for name in deviations])
    assert abs(np.mean(noise**2) - 1.0) < 5.0 * np.sqrt(2.0 / noise.size)


def test_the_seed_decides_and_a_demonstration_is_replaced_by_another(path, tmp_path):
    assert measure_demo(tmp_path, rng=1)[0].read_bytes() == path.read_bytes()
    assert measure_demo(tmp_path, rng=2)[0].read_bytes() != path.read_bytes()


@pytest.mark.parametrize("what", ["another rod", "fewer samples", "", "notes\n1\n"])
def test_what_is_no_demonstration_is_not_replaced(path, tmp_path, what):
    own, beside = tmp_path / "record.csv", tmp_path / "posterior.nc"
    if what == "another rod":
        write_record(tb.read_record(path).assign_attrs(rod_length=2.0 * ROD.length), own)
    elif what == "fewer samples":
        write_record(tb.read_record(path).isel(sample=slice(0, -1)), own)
    else:
        own.write_text(what)
    before = own.read_bytes()
    beside.touch()
    with pytest.raises(ParameterError, match=r"record\.csv is no record"):
        measure_demo(tmp_path, rng=1)
    assert own.read_bytes() == before
    assert beside.exists()

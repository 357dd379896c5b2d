"""One record of a data set, read and made again."""

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.data_sets import PLAIN, RICH, SHAPES, changed
from helpers.refusals import refused
from tactile_bayes.checks import shown
from tactile_bayes.datasets import contour_of, generate, read_specification, record
from tactile_bayes.datasets.specification import toml_of
from tactile_bayes.errors import ParameterError
from tactile_bayes.record import loads_of


@pytest.fixture(scope="module", params=[PLAIN, RICH, SHAPES], ids=["plain", "rich", "shape-free"])
def made(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("set")
    generate(request.param, folder, workers=1)
    return request.param, folder


@pytest.mark.slow
def test_read_or_made_again_it_is_the_same_to_the_last_bit(made, tmp_path):
    spec, folder = made
    (tmp_path / "spec.toml").write_text(toml_of(spec), encoding="utf-8")
    sources = (spec, tmp_path / "spec.toml", read_specification(spec))
    for source, index in zip(sources, (0, np.int64(13), 19), strict=True):
        xr.testing.assert_identical(record(source, index), record(folder, index))
    xr.testing.assert_identical(record(spec, 6, truth=False), record(folder, 6, truth=False))


def test_it_is_the_row_of_the_whole(made):
    _, folder = made
    one, row = record(folder, 5), tb.datasets.open(folder).sel(record=5).load()
    for name in ("drive_angle", "holding_moment", "force_x", "truth_contact_x", "truth_force_y"):
        np.testing.assert_array_equal(one[name].values, row[name].values.ravel())
    assert one.attrs["truth_contour_q"] == float(row.truth_contour_q)


def test_without_truth_nothing_of_it_is_left(made):
    _, folder = made
    blind = record(folder, 5, truth=False)
    assert not [name for name in (*blind.variables, *blind.attrs) if str(name).startswith("truth")]
    assert tb.LoadCell.from_record(blind) == tb.LoadCell.from_record(record(folder, 5))


@pytest.mark.parametrize("limit", [0.15, 0.7, pytest.param(0.3, marks=pytest.mark.slow)])
def test_readings_at_the_end_of_the_range_are_there_also_from_32_bits(limit, tmp_path):
    """Which round 0.15 and 0.3 up, and 0.7 down."""
    spec = changed(PLAIN, load_cell__force_range=limit, load_cell__moment_range=limit)
    single = changed(spec, precision="single")
    generate(single, tmp_path, workers=1)
    for one in (record(tmp_path, 3), record(single, 3)):
        cell, exact = tb.LoadCell.from_record(one), record(spec, 3)
        for name in ("holding_moment", "force_x", "force_y"):
            at_limit = np.abs(exact[name].values) == limit
            assert np.any(at_limit)
            np.testing.assert_array_equal(one[name].values[at_limit], exact[name].values[at_limit])
        readings = loads_of(one)
        assert np.abs(readings).max() == limit
        assert np.count_nonzero(cell.cuts_off(readings)) == np.count_nonzero(np.abs(readings) == limit)


@pytest.mark.parametrize("index", [-1, 24, 10**9, 1.0, "1", None])
def test_a_number_that_there_is_not_is_refused(index, plain_set):
    for source in (PLAIN, plain_set):
        with refused(ParameterError, shown(index), "0 to 23"):
            record(source, index)


def test_what_is_not_there_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError):
        record(tmp_path / "nothing", 0)
    with refused(ParameterError, "contour", "truth=True"):
        contour_of(record(PLAIN, 0, truth=False))

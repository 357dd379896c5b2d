"""What the rest of a sweep is expected to add, against streams that measure it."""

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.load_cells import CELL
from tactile_bayes.errors import ParameterError
from tactile_bayes.rig import NOTHING, Rig

X = np.linspace(-0.2, 0.2, 5)
SO_FAR = 40


@pytest.fixture(scope="module")
def measured():
    scan = tb.scan(tb.contours.paper_profile("II", q=0.5), drive_step=0.05)
    return CELL.measure(scan.record, rng=1)


def streamed(measured, samples):
    rig = Rig(load_cell=CELL, unknown={**NOTHING, "force_x_bias": "default"})
    stream = tb.Stream(rig=rig, rng=1, particles=500, x=X)
    stream.update(measured.isel(sample=slice(0, samples)))
    return stream


@pytest.fixture(scope="module")
def stream(measured):
    return streamed(measured, SO_FAR)


def width(now):
    return (now.height.sel(level=0.975) - now.height.sel(level=0.025)).values


@pytest.mark.slow
def test_it_is_what_the_rest_then_adds(measured, stream):
    end = int((measured.direction == "forward").sum())
    rest = tb.planning.rest_of_sweep(stream.posterior(), measured.drive_angle[SO_FAR:end], X, rng=1)
    np.testing.assert_allclose(rest.present_width, width(stream.latest()), rtol=0.15)
    np.testing.assert_allclose(rest.width, width(streamed(measured, end).latest()), rtol=0.3)
    assert np.all(rest.width < 0.5 * rest.present_width)
    assert np.all(rest.width_error < 0.1 * rest.width)


@pytest.mark.slow
def test_no_more_draws_are_taken_than_there_are(measured, stream):
    angles = measured.drive_angle[SO_FAR:44]
    every, more = (tb.planning.rest_of_sweep(stream.posterior(), angles, X, rng=1, draws=count) for count in (500, 600))
    xr.testing.assert_allclose(more, every, rtol=1e-12)


@pytest.mark.parametrize("angles", [[0.1, 0.2], [np.nan], "all"])
def test_angles_that_cannot_come_are_refused(stream, angles):
    with pytest.raises(ParameterError):
        tb.planning.rest_of_sweep(stream.posterior(), angles, X, rng=1)

"""The picture of an inspection."""

import numpy as np
import pytest

import tactile_bayes as tb
from helpers.pictures import labels, own_axes, texts
from helpers.refusals import refused
from tactile_bayes.errors import ParameterError


@pytest.fixture(scope="module")
def inspected(measured):
    knocked = measured.force_x.values.copy()
    knocked[3] += 0.1
    return tb.inspect_record(measured.assign(force_x=("sample", knocked, measured.force_x.attrs)))


def lines(ax, label):
    return [line for line in ax.lines if line.get_label() == label]


def test_readings_events_and_what_stands_out_are_drawn(inspected):
    axes = tb.plotting.inspection(inspected)
    assert axes.shape == (3, 2)
    assert axes[0, 0].get_ylabel() == "holding moment $m_0$\n[mN m]"
    assert axes[2, 0].get_xlabel() == "drive angle $\\varphi_0$ [°]"
    (ring,) = lines(axes[1, 0], "stands out")
    record = inspected.record
    assert ring.get_xdata().tolist() == [np.degrees(float(record.drive_angle[3]))]
    assert ring.get_ydata().tolist() == [float(record.force_x[3])]
    assert not lines(axes[0, 0], "stands out")
    assert labels(axes[0, 0]) == ["forward", "backward", "first contact", "snap-off", "stands out"]
    upright = {round(float(line.get_xdata()[0]), 6) for line in axes[0, 0].lines if len(set(line.get_xdata())) == 1}
    between = np.degrees(inspected.sweeps.snap_off_drive_angle.mean("side").values)
    assert set(np.round(between, 6)) <= upright


def test_unloaded_samples_are_drawn_over_their_noise(inspected):
    axes = tb.plotting.inspection(inspected)
    drawn = next(line for line in axes[2, 1].lines if line.get_marker() == ".")
    assert drawn.get_xdata().tolist() == np.flatnonzero(inspected.samples.unloaded.values).tolist()
    low, high = axes[2, 1].patches[0].get_extents().transformed(axes[2, 1].transData.inverted()).intervaly
    row = inspected.channels.sel(channel="force_y")
    assert (low, high) == pytest.approx((float(row.bias - 2 * row.noise), float(row.bias + 2 * row.noise)))


def test_a_missing_channel_is_said_to_be_so_and_too_few_axes_are_refused(measured, inspected):
    none = ("sample", np.full(measured.sizes["sample"], np.nan), measured.force_x.attrs)
    axes = tb.plotting.inspection(tb.inspect_record(measured.assign(force_x=none)))
    assert texts(axes[1, 0]) == ["not measured"]
    with refused(ParameterError, "axes", "(3,)", "(3, 2)"):
        tb.plotting.inspection(inspected, axes=own_axes(3))

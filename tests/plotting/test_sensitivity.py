"""The figures of a plan: what they draw, and what they say."""

import re

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import same_color

from helpers.pictures import labels, texts
from tactile_bayes import LoadCell, Rig, Rod, plotting, sensitivity
from tactile_bayes.planning import error_map
from tactile_bayes.plotting.sweep_plans import METHOD_COLOURS, READING_COLOURS
from tactile_bayes.sweep import Rotation

ROD = Rod(0.1, 1e-5)


@pytest.fixture(scope="module")
def found():
    return sensitivity(rng=1, drive=Rotation(drive_step=0.1), samples=8)


@pytest.fixture(scope="module")
def in_si():
    rig = Rig(rod=ROD, load_cell=LoadCell(force_noise=2e-5, moment_noise=1e-6), unknown="nothing")
    return sensitivity(rng=1, rig=rig, drive=Rotation(drive_step=0.2), parts=["required_noise"])


@pytest.fixture(scope="module")
def study():
    """Profile II at three distances, of which the last is out of reach."""
    options = {"replicates": 1, "rng": 1, "workers": 1, "drive": Rotation(drive_step=0.2)}
    over = {"noise_factor": [1.0, 0.1], "distance": [0.4, 0.8, 1.5]}
    return error_map(["II"], over=over, rig=Rig(unknown="nothing"), **options)


STATUS = [["ok", "ok", "bent too far"], ["does not reach", "ok", "cannot be swept"]]
WIDTH = [[4e-4, 2e-4, 1e-4], [np.nan, 3e-4, np.nan]]


def rods(status=STATUS, width=WIDTH, best=(0.1, 4e-4, 2e-4)):
    """Of 2 lengths and 3 diameters, with length, diameter and width of the best."""
    metres, dims = {"units": "m"}, ("length", "diameter")
    columns = {"width": (dims, np.array(width, dtype=float), metres), "status": (dims, status)}
    columns |= {f"best_{name}": ((), v, metres) for name, v in zip((*dims, "width"), best, strict=True)}
    sizes = {"length": ("length", [0.1, 0.2], metres), "diameter": ("diameter", [2e-4, 4e-4, 8e-4], metres)}
    return xr.Dataset(columns, sizes, {"probability": 0.95, "where": "gap"})


def lines_of(ax, style, colour=None):
    """Lines that have data."""
    drawn = [line for line in ax.lines if line.get_linestyle() == style and len(line.get_xdata()) > 1]
    return [line for line in drawn if colour is None or same_color(line.get_color(), colour)]


def are_apart(*things):
    boxes = [thing.get_window_extent() for thing in things]
    return not any(box.overlaps(other) for i, box in enumerate(boxes) for other in boxes[:i])


def is_inside_its_figure(ax):
    ax.figure.canvas.draw()
    box, whole = ax.get_tightbbox(), ax.figure.bbox
    return box.x0 >= whole.x0 and box.x1 <= whole.x1 and box.y0 >= whole.y0 and box.y1 <= whole.y1


# --- Every figure ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["amplification", "information", "noise_shares", "required_noise"])
def test_groups_are_taken_alone_and_in_their_tree(found, name):
    draw, group = getattr(plotting, name), found[name]
    drawn = [draw(of) for of in (found, group, group.to_dataset())]
    assert len({(ax.get_xlabel(), ax.get_ylabel(), ax.get_ylim(), len(ax.lines)) for ax in drawn}) == 1
    assert is_inside_its_figure(drawn[0])


# --- Amplification --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sweep", [0, 1])
def test_curves_are_the_standard_deviations_thick_where_first_order_holds(found, sweep):
    grown = found["amplification"].to_dataset()
    grown = grown.isel(sample=grown.sweep.values == sweep).sortby("drive_angle")
    ax = plotting.amplification(found, sweep=sweep)
    for method, colour in METHOD_COLOURS.items():
        of = grown.sel(reconstruction=method)
        for side, style in (("along", "-"), ("across", "--")):
            expected = dict(zip(np.degrees(of.drive_angle.values), of[f"sd_{side}"].values, strict=True))
            thin, thick = lines_of(ax, style, colour)
            assert thin.get_linewidth() < thick.get_linewidth()
            seen = {}
            for line in (thin, thick):
                good = np.isfinite(line.get_ydata())
                seen |= dict(zip(line.get_xdata()[good], line.get_ydata()[good], strict=True))
            assert seen == expected
            held = np.degrees(of.drive_angle.values[of.holds.values])
            good = np.isfinite(thick.get_ydata())
            assert set(held) <= set(thick.get_xdata()[good])
    assert ax.get_xlabel().endswith("forward sweep" if sweep == 0 else "backward sweep")
    assert ax.get_yscale() == "log"


def test_no_line_goes_over_a_change_of_phase_where_errors_jump(found):
    grown = found["amplification"].to_dataset()
    of = grown.isel(sample=grown.sweep.values == 0).sortby("drive_angle")
    (change,) = np.flatnonzero(of.contact_phase.values[1:] != of.contact_phase.values[:-1])
    before, after = np.degrees(of.drive_angle.values[change : change + 2])
    for line in plotting.amplification(found).lines:
        angle, value = np.array(line.get_xdata()), np.array(line.get_ydata())
        if not same_color(line.get_color(), METHOD_COLOURS["constrained"]):
            continue
        near = value[(angle >= before) & (angle <= after)]
        assert near.size == 0 or np.isnan(near[1:-1]).any()


def test_events_are_marked_and_strips_tell_where_first_order_does_not_hold(found):
    ax = plotting.amplification(found)
    grown = found["amplification"].to_dataset()
    of = grown.isel(sample=grown.sweep.values == 0)
    first = np.degrees(of.drive_angle.values - of.after_first_contact.values)
    last = np.degrees(of.drive_angle.values + of.before_snap_off.values)
    marked = sorted(line.get_xdata()[0] for line in ax.lines if line.get_linestyle() == ":")
    np.testing.assert_allclose(marked, [first.mean(), last.mean()], rtol=1e-12)
    assert texts(ax) == ["first contact", "snap-off"]
    assert any(label.startswith("strip: ") for label in labels(ax))
    for method, colour in METHOD_COLOURS.items():
        strips = [patch for patch in ax.patches if same_color(patch.get_facecolor()[:3], colour)]
        holds = of.holds.sel(reconstruction=method).values
        assert len(strips) == np.count_nonzero(np.diff(np.concatenate([[0], ~holds, [0]]).astype(int)) == 1)
        for angle, held in zip(np.degrees(of.drive_angle.values), holds, strict=True):
            inside = any(s.get_x() <= angle <= s.get_x() + s.get_width() for s in strips)
            assert inside is not held
    ax.figure.canvas.draw()
    assert are_apart(*ax.texts, ax.get_legend())


# --- Information ----------------------------------------------------------------------------------------------------


def test_leverage_is_drawn_by_channel_and_direction(found):
    told = found["information"].to_dataset()
    ax = plotting.information(found)
    for sweep, style in ((0, "-"), (1, "--")):
        of = told.isel(sample=told.sweep.values == sweep).sortby("drive_angle")
        for name in told.channel.values:
            (line,) = lines_of(ax, style, READING_COLOURS[str(name)])
            np.testing.assert_array_equal(line.get_xdata(), np.degrees(of.drive_angle.values))
            np.testing.assert_array_equal(line.get_ydata(), of.leverage.sel(channel=name).values)
    moment = float(told.leverage.sel(channel="holding_moment").sum())
    assert labels(ax)[0] == f"holding moment $m_0$: {moment:.3g}"
    assert labels(ax)[3:] == ["forward", "backward"]
    assert ax.get_legend().get_title().get_text().endswith(f"readings together: {told.attrs['leverage_sum']:.3g}")


# --- Shares ---------------------------------------------------------------------------------------------------------


def test_bars_are_the_shares_and_what_is_missing_of_one(found):
    ax = plotting.noise_shares(found, reconstruction="constrained", error="along", sweep=1)
    shares = found["noise_shares"].to_dataset().sel(reconstruction="constrained", error="along")
    shares = shares.isel(sample=shares.sweep.values == 1).sortby("drive_angle")
    angle = np.degrees(shares.drive_angle.values)
    stacked = np.maximum(shares.share.values, 0.0)
    is_answered = np.isfinite(stacked).all(axis=1)
    expected = np.column_stack([stacked, np.maximum(1.0 - stacked.sum(axis=1), 0.0)])[is_answered]
    drawn = np.array([[bar.get_height() for bar in bars] for bars in ax.containers[:4]]).T[is_answered]
    np.testing.assert_allclose(drawn, expected, atol=1e-12)
    for bars in ax.containers[:4]:
        np.testing.assert_allclose([bar.get_x() + 0.5 * bar.get_width() for bar in bars], angle)
    top = [max(bar.get_y() + bar.get_height() for bar in bars) for bars in zip(*ax.containers[:4], strict=True)]
    np.testing.assert_allclose(np.array(top)[is_answered], np.maximum(stacked.sum(axis=1), 1.0)[is_answered])
    assert labels(ax)[3] == "together"
    assert re.search("constrained .*along", ax.get_legend().get_title().get_text())


def test_places_without_an_answer_are_hatched(found):
    shares = found["noise_shares"].to_dataset().copy(deep=True)
    shares.share[0, 3] = np.nan
    ax = plotting.noise_shares(shares)
    assert labels(ax)[-1].startswith("no result")
    centres = [bar.get_x() + 0.5 * bar.get_width() for bar in ax.containers[-1]]
    assert np.degrees(shares.drive_angle.values[3]) == pytest.approx(centres[-1])


# --- Noise that is required -----------------------------------------------------------------------------------------


def test_widths_are_drawn_over_noise_and_the_present_cell_is_on_the_line(found):
    needed = found["required_noise"].to_dataset()
    ax = plotting.required_noise(found)
    line, asked, present = ax.lines[:3]
    np.testing.assert_array_equal(asked.get_xdata(), needed.force_noise.values)
    np.testing.assert_array_equal(asked.get_ydata(), needed.band_width.values)
    np.testing.assert_allclose(present.get_xdata(), [0.05], rtol=1e-12)
    assert list(present.get_ydata()) == [float(needed.present_width)]
    assert np.all(np.diff(line.get_xdata()) > 0.0)
    assert np.all(np.diff(line.get_ydata()) > 0.0)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert re.search(r"width .* 95 % .*\[\$L\$\]$", ax.get_ylabel())
    asked_for, as_it_is = labels(ax)
    assert (asked_for, "load cell" in as_it_is) == ("asked for", True)
    ax.figure.canvas.draw()
    (above,) = ax.child_axes
    np.testing.assert_allclose(above.get_xlim(), np.array(ax.get_xlim()) * 0.02 / 0.05)
    assert above.get_xlabel() == "noise of the moment [$EI$/$L$]"


def test_si_has_prefixes(in_si):
    ax = plotting.required_noise(in_si)
    assert ax.get_xlabel() == "noise of the forces [µN]"
    assert re.search(r"width .* 95 % .*\[mm\]$", ax.get_ylabel())
    ax.figure.canvas.draw()
    assert "0.1" in [tick.get_text() for tick in ax.get_yticklabels()]
    assert "20" in [tick.get_text() for tick in ax.get_xticklabels()]
    (present,) = (line for line in ax.lines if line.get_marker() == "D")
    assert present.get_xdata()[0] == pytest.approx(2e-5)


def test_bands_that_priors_give_are_left_out(found):
    needed = found["required_noise"].to_dataset().copy(deep=True)
    for name in ("noise_factor", "force_noise", "moment_noise"):
        needed[name][-1] = np.inf
    needed["prior_width"] = 0.009
    ax = plotting.required_noise(needed)
    assert len(ax.lines[1].get_xdata()) == needed.sizes["band_width"] - 1
    (prior,) = (line for line in ax.lines if line.get_label() == "priors alone")
    assert list(prior.get_ydata()) == [0.009, 0.009]
    for name in ("noise_factor", "force_noise", "moment_noise"):
        needed[name][:] = np.inf
    ax = plotting.required_noise(needed)
    (said,) = texts(ax)
    assert "priors alone" in said
    assert not ax.axison


# --- Error map ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["raw", "constrained"])
def test_errors_are_solid_and_first_order_is_dashed(study, method):
    ax = plotting.error_map(study, quantity="along", reconstruction=method)
    of = study.sel(contour="II", reconstruction=method).sortby("noise_factor")
    for style, name in (("-", "rms_along"), ("--", "first_order_along")):
        for line, distance in zip(lines_of(ax, style), (0.4, 0.8), strict=True):
            assert list(line.get_xdata()) == [0.1, 1.0]
            np.testing.assert_array_equal(line.get_ydata(), of[name].sel(distance=distance).values)
    assert labels(ax) == ["II", "at 0.4 L", "at 0.8 L", "first order"]
    assert texts(ax) == ["no result: II at 1.5 L"]
    assert ax.get_xlabel().endswith(" (1 is 0.05 $EI$/$L^2$ and 0.02 $EI$/$L$)")
    assert is_inside_its_figure(ax)


def test_bands_are_dashed_and_posteriors_are_filled(study):
    seen = study.copy(deep=True)
    seen["posterior_touched_width"][0, 0, 1] = 0.003
    ax = plotting.error_map(seen, quantity="touched")
    assert "touched: filled markers" in ax.get_legend().get_title().get_text()
    filled, dashed = lines_of(ax, "None"), lines_of(ax, "--")
    np.testing.assert_array_equal(filled[0].get_ydata(), [0.003, np.nan])
    expected = study.expected_touched_width.sel(contour="II", distance=0.4).sortby("noise_factor")
    np.testing.assert_array_equal(dashed[0].get_ydata(), expected.values)
    assert same_color(dashed[0].get_markerfacecolor(), "white")
    assert not same_color(filled[0].get_markerfacecolor(), "white")
    assert plotting.error_map(study, quantity="touched").get_legend().get_title().get_text().endswith("touched")


def test_where_nothing_is_known_the_map_says_so(study):
    nothing = study.sel(distance=[1.5])
    assert texts(plotting.error_map(nothing))[0].startswith("no cell")
    assert texts(plotting.error_map(nothing, quantity="gap")) == ["there is no gap"]


# --- Rods -----------------------------------------------------------------------------------------------------------


def test_rods_are_coloured_by_width_the_best_is_marked_and_the_refused_are_hatched():
    ax = plotting.required_rod(rods())
    (mesh,) = ax.collections
    np.testing.assert_array_equal(np.ma.filled(mesh.get_array(), np.nan), np.transpose(WIDTH))
    (star,) = (line for line in ax.lines if line.get_marker() == "*")
    assert (star.get_xdata()[0], star.get_ydata()[0]) == (0.1, 4e-4)
    assert labels(ax) == ["bent too far", "does not reach", "cannot be swept", "best: 200 µm"]
    assert ax.get_xlabel() == "length of the rod [mm]"
    assert ax.get_ylabel() == "diameter of the rod [µm]"
    assert re.search(r"width .* 95 % .* gap \[µm\]$", ax.figure.axes[-1].get_ylabel())
    assert is_inside_its_figure(ax)
    hatched = {patch.get_hatch(): patch.get_path().contains_point((0.1, 8e-4)) for patch in ax.patches}
    assert len(ax.patches) == 3
    assert list(hatched.values()) == [True, False, False]


def test_where_no_rod_is_good_none_is_marked():
    none = (np.nan, np.nan, np.nan)
    ax = plotting.required_rod(rods([["bent too far"] * 3] * 2, [[1e-4] * 3] * 2, none))
    assert labels(ax) == ["bent too far"]
    empty = plotting.required_rod(rods([["does not reach"] * 3] * 2, [[np.nan] * 3] * 2, none))
    assert labels(empty) == ["does not reach"]
    assert not empty.collections


def test_one_rod_alone_is_a_cell_about_itself():
    ax = plotting.required_rod(rods().isel(length=[0], diameter=[1]))
    assert ax.get_xlim()[0] < 0.1 < ax.get_xlim()[1]
    assert ax.get_ylim()[0] < 4e-4 < ax.get_ylim()[1]

"""Figures: what they take, return, draw and leave alone."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib import colors
from matplotlib import pyplot as plt

from helpers.pictures import labels, own_axes, texts
from helpers.refusals import refused
from tactile_bayes import plotting
from tactile_bayes.checks import shown
from tactile_bayes.contours import Circle, Joined, Parabola, paper_profile
from tactile_bayes.errors import ParameterError, RecordError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.mechanics.rods.rod import Rod
from tactile_bayes.plotting import posteriors
from tactile_bayes.plotting.maps import set_below
from tactile_bayes.record import CHANNELS, in_frame, turned
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import Motion, Rotation, Translation, scan
from tactile_bayes.uncertainty.predictive_interval import predictive_interval

ROD = Rod(length=0.1, flexural_rigidity=1.2e-5)
STEP = np.radians(4.0)
PHASES = ("tip", "tangential")


@pytest.fixture(scope="module")
def plain():
    return scan(paper_profile("II", q=0.5), drive_step=STEP)


@pytest.fixture(scope="module")
def si():
    return scan(Parabola(5.0, q=0.05), drive_step=STEP, rig=Rig(rod=ROD))


@pytest.fixture(scope="module")
def noisy(plain):
    return LoadCell(force_noise=0.05, moment_noise=0.02).measure(plain.record, rng=1)


@pytest.fixture(scope="module")
def contacts(plain):
    """Contacts as Step 2 gives them, one of them with a status that is not to be drawn."""
    record = plain.record
    phase = record["truth_contact_phase"].values
    status = np.where(phase == "none", "no contact", "ok").astype(object)
    status[np.flatnonzero(phase == "tip")[0]] = "beyond the tip"
    columns = {name: record[f"truth_{name}"] for name in ("contact_x", "contact_y", "contact_phase")}
    return xr.Dataset(columns).assign(status=("sample", status))


@pytest.fixture(scope="module")
def band():
    x = np.linspace(-1.0, 1.0, 201)
    y, width = 0.5 * x**2 + 0.5, 0.01 + 0.03 * np.exp(-100.0 * x**2)
    columns = {"lower": ("x", y - width), "upper": ("x", y + width), "median": ("x", y)}
    return xr.Dataset(columns, coords={"x": x}, attrs={"probability": 0.95})


@pytest.fixture(scope="module")
def posterior():
    rng = np.random.default_rng(1)
    draws = ("chain", "draw")
    columns = {
        "a": (draws, rng.normal(0.5, 0.002, (4, 3000))),
        "x_c": (draws, rng.normal(0.0, 0.001, (4, 3000))),
        "flexural_rigidity": (draws, rng.normal(1.2e-5, 6e-7, (4, 3000)), {"units": "N m²"}),
        "log_radius": ((*draws, "knot"), rng.normal(size=(4, 3000, 2))),
    }
    return xr.DataTree.from_dict({"posterior": xr.Dataset(columns)})


def lines_of(ax, phase):
    """Lines with data in the colour of a phase."""
    colour = plotting.PALETTE[phase]
    return [line for line in ax.lines if colors.same_color(line.get_color(), colour) and len(line.get_xdata())]


def test_every_function_draws_where_it_is_told_and_nowhere_else(calls):
    """And where it is told nothing, in one figure of its own."""
    for name, (draw, arguments) in calls.items():
        if name.startswith("plotting.") and name != "plotting.style":
            made = draw(**arguments)
            assert len(plt.get_fignums()) == 1, name
            plt.close("all")
            given = np.reshape([own_axes() for _ in range(np.size(made))], np.shape(made))
            told = {"axes": given} if given.ndim else {"ax": given.item()}
            assert np.all(draw(**{**arguments, **told}) == given), name
            assert plt.get_fignums() == [], name


@pytest.mark.parametrize("unit", ["plain", "si"])
def test_observables_are_labelled_with_units(unit, request):
    result = request.getfixturevalue(unit)
    axes = plotting.observables(result.record, events=result.events)
    expected = {"plain": ("$EI$/$L$", "$EI$/$L^2$", "$EI$/$L^2$"), "si": ("µN m", "mN", "mN")}[unit]
    for ax, name in zip(axes, expected, strict=True):
        assert ax.get_ylabel().endswith(f"[{name}]")
    assert axes[-1].get_xlabel() == r"drive angle $\varphi_0$ [°]"
    axes[0].figure.canvas.draw()
    ticks = {text.get_text() for text in axes[0].get_yticklabels()}
    assert ("−250" if unit == "si" else "−2.5") in ticks


def test_lines_of_a_scan_run_from_event_to_event(plain):
    axes = plotting.observables(plain.record, events=plain.events)
    for ax, name in zip(axes, CHANNELS, strict=True):
        forward = plain.events["forward"]
        tip, tangential = ([line for line in lines_of(ax, p) if line.get_linestyle() == "-"] for p in PHASES)
        (change,) = forward.transitions
        for line, first, last in ((tip[0], forward.first_contact, change), (tangential[0], change, forward.snap_off)):
            x, y = line.get_data()
            np.testing.assert_allclose(x[[0, -1]], np.degrees([first.drive_angle, last.drive_angle]), rtol=1e-12)
            np.testing.assert_allclose(y[[0, -1]], [getattr(first, name), getattr(last, name)], atol=1e-12)
    assert labels(axes[0])[:4] == ["forward", "backward", "tip contact", "tangential contact"]
    assert set(labels(axes[0])[4:]) == {"first contact", "phase change", "snap-off"}


def test_forces_of_a_load_cell_that_turns_are_axial_and_transversal(plain):
    """Also those of the events, which a scan has in the frame that is fixed."""
    axes = plotting.observables(in_frame(plain.record, "turning"), events=plain.events)
    first_lines = [ax.get_ylabel().splitlines()[0] for ax in axes]
    assert first_lines[0] == plotting.observables(plain.record)[0].get_ylabel().splitlines()[0]
    assert first_lines[1].startswith("axial force ")
    assert first_lines[2].startswith("transversal force ")
    forward = plain.events["forward"]
    (change,) = forward.transitions
    for component, ax in enumerate(axes[1:]):
        (tip,) = (line for line in lines_of(ax, "tip") if line.get_linestyle() == "-")
        markers = [line for line in lines_of(ax, "change") if line.get_marker() == "X"]
        for drawn, event in ((tip.get_ydata()[-1], change), (markers[0].get_ydata()[0], forward.snap_off)):
            expected = turned(event.force_x, event.force_y, event.drive_angle)[component]
            assert drawn == pytest.approx(expected, abs=1e-12)


def test_a_channel_that_is_missing_says_so_in_its_frame_and_the_legend_stays(noisy):
    turning = in_frame(noisy, "turning").drop_vars("truth_force_x")
    for record, row, label in ((noisy, 0, "holding moment "), (turning, 1, "axial force ")):
        axes = plotting.observables(record.assign({CHANNELS[row]: np.nan * record[CHANNELS[row]]}))
        assert texts(axes[row]) == ["not measured"]
        assert axes[row].get_ylabel().startswith(label)
        assert "measured forward" in labels(axes[0])


def test_noise_is_drawn_as_points_over_the_truth(noisy, plain):
    axes = plotting.observables(noisy, events=plain.events)
    for ax, name in zip(axes, CHANNELS, strict=True):
        points = lines_of(ax, "sample")
        assert [line.get_marker() for line in points] == ["o", "^"]
        for line, number in zip(points, (0, 1), strict=True):
            assert line.get_linestyle() == "None"
            np.testing.assert_array_equal(line.get_ydata(), noisy[name].values[noisy["sweep"].values == number])
        assert lines_of(ax, "tip")
    assert "true tip contact" in labels(axes[0])


def test_a_single_sweep_has_a_single_style_and_a_record_of_a_rig_points_only(si):
    record = si.record.isel(sample=si.record["direction"].values == "forward")
    assert labels(plotting.observables(record, events=si.events)[0])[0] == "forward"
    assert "backward" not in labels(plotting.observables(record)[0])
    of_rig = si.record.isel(sample=si.record["direction"].values == "backward")
    of_rig = of_rig.drop_vars([name for name in of_rig.data_vars if name.startswith("truth_")])
    assert labels(plotting.observables(of_rig)[0]) == ["measured backward"]


def test_residuals_are_within_one_where_readings_are_in_their_interval(noisy):
    """Which is filled on the channels that are predicted alone."""
    ends = {"lower": -0.03, "upper": 0.05}
    predicted = xr.Dataset({f"force_x_{end}": noisy["truth_force_x"] + off for end, off in ends.items()})
    channels = plotting.predictive(noisy, predicted)
    everything = channels[0].figure.axes
    assert list(channels) == everything[::2]
    below = everything[1::2]
    assert [len(ax.collections) for ax in channels] == [0, 2, 0]
    assert [len(ax.lines) > 0 for ax in below] == [False, True, False]
    drawn = [line for line in below[1].lines if str(line.get_label()).startswith("residual")]
    assert [line.get_label() for line in drawn] == ["residual forward", "residual backward"]
    for number, line in enumerate(drawn):
        sweep = noisy.isel(sample=noisy["sweep"].values == number).sortby("drive_angle")
        np.testing.assert_allclose(line.get_xdata(), np.degrees(sweep["drive_angle"]))
        off = (sweep["force_x"] - sweep["truth_force_x"]).values
        np.testing.assert_allclose(line.get_ydata(), (off - 0.01) / 0.04, atol=1e-9)
        np.testing.assert_array_equal(np.abs(line.get_ydata()) <= 1.0, (off >= -0.03) & (off <= 0.05))
    assert {"residual forward", "residual backward", "predicted"} < set(labels(channels[0]))
    assert below[1].get_ylabel().startswith("residual\n")
    assert [ax.get_xlabel() for ax in everything] == [""] * 5 + [r"drive angle $\varphi_0$ [°]"]
    axes, residuals = own_axes(3), own_axes(3)
    plotting.predictive(noisy, predicted, axes=axes, residuals=residuals)
    assert residuals[1].lines
    with refused(ParameterError, "every sample"):
        plotting.predictive(noisy, predicted.isel(sample=slice(3)))
    with refused(ParameterError, "axes", "residuals"):
        plotting.predictive(noisy, predicted, residuals=residuals)


@pytest.mark.parametrize("half", [0.2, 1.0])
def test_a_panel_below_a_map_is_as_wide_as_that(band, half):
    figure = mpl.figure.Figure(figsize=(7.0, 6.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    inside = band.sel(x=slice(-half, half))
    plotting.contour(inside.x.values, band=inside, base=(0, 0), ax=upper)
    plotting.band_detail(inside, ax=lower)
    set_below(upper, lower)
    figure.draw_without_rendering()
    for x in (-half, 0.0, half):
        at = [ax.transData.transform((x, 0.0))[0] for ax in (upper, lower)]
        assert at[0] == pytest.approx(at[1], abs=0.01)


def test_a_low_map_takes_no_more_height_than_it_needs(calls):
    draw, arguments = calls["plotting.tightening"]
    above, detail, *_ = draw(**arguments)
    above.figure.draw_without_rendering()
    boxes = [ax.get_tightbbox() for ax in (above, detail)]
    assert above.figure.get_size_inches()[1] < 7.6
    assert 0.0 < boxes[0].y0 - boxes[1].y1 < 0.4 * above.figure.dpi


def test_an_interval_goes_with_records_of_its_frame_only(noisy):
    draws = xr.Dataset({"force_x": (("chain", "draw", "sample"), np.zeros((1, 2, noisy.sizes["sample"])))})
    tree = xr.DataTree.from_dict({"posterior_predictive": draws})
    assert "load_cell_frame" not in predictive_interval(tree).attrs
    tree.attrs["load_cell_frame"] = "turning"
    interval = predictive_interval(tree)
    assert interval.attrs["load_cell_frame"] == "turning"
    assert len(plotting.predictive(in_frame(noisy, "turning"), interval)[1].collections) == 2
    with refused(ParameterError, "turning", "in_frame(record, 'turning')"):
        plotting.predictive(noisy, interval)


@pytest.mark.parametrize("direction", ["forward", "backward"])
@pytest.mark.parametrize("unit", ["plain", "si"])
def test_rods_are_coloured_by_phase_and_end_at_their_contacts(unit, direction, request):
    result = request.getfixturevalue(unit)
    ax = plotting.rods(result, direction=direction, count=9)
    length = 0.1 if unit == "si" else 1.0
    drawn = {phase: [line for line in lines_of(ax, phase) if len(line.get_xdata()) > 50] for phase in PHASES}
    assert len(drawn["tip"]) + len(drawn["tangential"]) == 9
    for line in drawn["tip"]:
        x, y = line.get_data()
        np.testing.assert_allclose(y[-1], result.contour.height(x[-1]), atol=1e-9 * length)
    for line in [*drawn["tip"], *drawn["tangential"]]:
        x, y = line.get_data()
        # The rod's clearance is nowhere negative.
        assert (y <= result.contour.height(x) + 1e-9 * length).all()
        assert np.hypot(np.diff(x), np.diff(y)).sum() == pytest.approx(length, rel=1e-3)
    assert ax.get_aspect() == 1.0
    assert ax.get_xlabel() == ("$x$ [mm]" if unit == "si" else "$x$ [$L$]")
    assert {"phase change", "snap-off", "first contact", "pivot", "contour"} <= set(labels(ax))


def test_rods_are_the_true_forward_ones_unless_told_otherwise(plain, noisy):
    """Also of a scan whose record has been through a load cell."""

    def drawn(scanned, **which):
        return [line.get_xydata() for line in plotting.rods(scanned, count=5, **which).lines]

    expected = drawn(plain)
    for found in (drawn(plain, direction="forward"), drawn(plain, sweep=0), drawn(replace(plain, record=noisy))):
        for line, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(line, other)
    assert not np.array_equal(drawn(plain, sweep=1)[0], expected[0])


def test_rods_of_one_of_several_bases_start_there_as_in_a_scan_from_it_alone(plain):
    several = scan(plain.contour, base=[(0.0, 0.0), (0.25, -0.05)], drive_step=3.0 * STEP)
    alone = scan(plain.contour, base=(0.25, -0.05), drive_step=3.0 * STEP)
    for sweep, direction in ((2, "forward"), (3, "backward")):
        ax = plotting.rods(several, sweep=sweep, count=5)
        expected = plotting.rods(alone, direction=direction, count=5).lines
        for line, other in zip(ax.lines, expected, strict=True):
            np.testing.assert_array_equal(line.get_xydata(), other.get_xydata())
        rods = [line for phase in PHASES for line in lines_of(ax, phase) if len(line.get_xdata()) > 50]
        assert len(rods) == 5
        np.testing.assert_allclose([line.get_xydata()[0] for line in rods], [(0.25, -0.05)] * 5, atol=1e-12)


THREE = [(0.0, 0.0), (-0.25, 0.0), (0.25, 0.0)]


def arcs(ax, scanned):
    """What `touched` has drawn for each sweep."""
    drawn = [line for line in ax.lines if line.get_solid_capstyle() == "butt" and len(line.get_xdata())]
    return drawn[: len(scanned.sweeps)]


def drawn_gaps(ax):
    return [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in ax.patches]


@pytest.mark.parametrize(
    ("contour", "further", "size"),
    [
        (paper_profile("IV", q=0.5), {"base": THREE}, 1.0),
        (Circle(1.0, q=0.4), {"base": [(0, 0), (0.3, 0)], "rig": Rig(unknown={"friction": 0.4})}, 1.0),
        (Parabola(5.0, q=0.05), {"rig": Rig(rod=replace(ROD, diameter=0.002))}, 0.1),
    ],
    ids=["several bases", "friction", "a thick rod in SI"],
)
def test_touched_arcs_run_along_the_contour_from_first_contact_to_snap_off(contour, further, size):
    result = scan(contour, drive_step=STEP, **further)
    drawn = arcs(plotting.touched(result), result)
    for line, sweep in zip(drawn, result.sweeps, strict=True):
        x, y = line.get_data()
        ends = sorted((event.contact_x, event.contact_y) for event in (sweep.first_contact, sweep.snap_off))
        np.testing.assert_array_equal(line.get_xydata()[[0, -1]], ends)
        assert line.get_marker() == "None"
        assert (np.diff(x) > 0.0).all()
        np.testing.assert_allclose(y, contour.height(x), rtol=0, atol=1e-12 * size)


def test_every_gap_is_what_no_sweep_touched():
    """Bases so far apart that each leaves its own gap, and one more lies between two of them."""
    result = scan(Parabola(0.3, 0.6), base=[(1.2, 0.0), (0.0, 0.0), (-1.2, 0.0), (-2.2, 1.4)], drive_step=STEP)
    gaps = drawn_gaps(plotting.touched(result))
    ends = [sorted((sweep.first_contact.contact_x, sweep.snap_off.contact_x)) for sweep in result.sweeps]
    reached, expected = -np.inf, []
    for left, right in sorted(ends):
        expected += [(reached, left)] if np.isfinite(reached) and left > reached else []
        reached = max(reached, right)
    assert len(gaps) > 3
    np.testing.assert_allclose(sorted(gaps), expected, rtol=0, atol=1e-15)


def test_bases_have_colours_of_their_own_and_pivots_the_same(plain):
    result = scan(plain.contour, base=[*THREE, (0.0, 0.0)], drive_step=STEP)
    ax = plotting.touched(result)
    drawn = arcs(ax, result)
    colour_of = {sweep.base: line.get_color() for line, sweep in zip(drawn, result.sweeps, strict=True)}
    assert len(set(colour_of.values())) == 3
    assert [line.get_color() for line in drawn] == [colour_of[sweep.base] for sweep in result.sweeps]
    points = [line for line in ax.lines if len(line.get_xdata()) == 1]
    assert {tuple(line.get_xydata()[0]): line.get_markeredgecolor() for line in points} == colour_of
    assert labels(ax) == ["contour", "base (0, 0) $L$", "base (−0.25, 0) $L$", "base (0.25, 0) $L$"]
    # Arcs that cover one another stay visible: those of a base are drawn lower than those of the base before.
    across, heights = zip(*(line.get_transform().transform((0.0, 0.5)) for line in drawn), strict=True)
    assert heights[0] == heights[1] == heights[6] == heights[7] > heights[2] == heights[3] > heights[4]
    assert len(set(across)) == 1


def test_the_seventh_base_has_the_first_colour_and_another_line(plain):
    result = scan(plain.contour, base=[(0.05 * k, 0.0) for k in range(7)], direction="forward", drive_step=STEP)
    ax = plotting.touched(result)
    looks = [(line.get_color(), line.get_linestyle()) for line in arcs(ax, result)]
    assert len(set(looks)) == 7
    assert looks[0][0] == looks[6][0]
    assert [style for _, style in looks[:6]] == ["-"] * 6
    shown = [(handle.get_color(), handle.get_linestyle()) for handle in ax.get_legend().legend_handles]
    assert set(looks) <= set(shown)


def test_rods_refuse_what_is_not_there(plain):
    backward = scan(plain.contour, direction="backward", drive_step=STEP)
    several = scan(plain.contour, base=[(0, 0), (0.25, 0)], drive_step=STEP)
    for scanned, options, *named in (
        (backward, {}, "forward", "backward"),
        (plain, {"count": 0}, "rod"),
        *((plain, {"sweep": k}, f"sweep {k}", "0: forward from (0, 0)", "1: backward") for k in (2, -1, 0.5)),
        (plain, {"direction": "forward", "sweep": 1}, "direction='forward'", "sweep=1"),
        (several, {"direction": "backward"}, "2 backward sweeps", "sweep=1", "(0.25, 0)"),
        (several, {}, "2 forward sweeps"),
    ):
        with refused(ParameterError, *named):
            plotting.rods(scanned, **options)


def test_what_is_no_scan_or_no_record_is_refused(plain):
    for draw, given, error, *named in (
        (plotting.touched, plain.record, ParameterError, "touched", "scan("),
        (plotting.observables, plain, RecordError, "Scan", "record"),
        (plotting.observables, xr.DataTree(), RecordError, "DataTree", "make_record"),
        (lambda record: plotting.predictive(record, record), xr.Dataset(), RecordError, "units"),
        (lambda record: plotting.observables(record, axes=own_axes(2)), plain.record, ParameterError, "axes", "three"),
    ):
        with refused(error, *named):
            draw(given)


def of(*names, **coordinates):
    """A dataset with these variables and coordinates, as far as a check looks at them."""
    return xr.Dataset(dict.fromkeys(names, 0.0), coordinates)


RANKS = of("ranks", "rank_p_value", quantity=["q"]).assign_attrs(level=0.001)
SHARES = of("coverage", "coverage_error", "coverage_replicates", claim=["snap_off"])
ERRORS = of("rms_across", "contour", "distance", "noise_factor", reconstruction=["raw"])
NOISE = of("share", "source", "direction", "drive_angle", reconstruction=["raw"], error=["across", "along"])
GROWTH = of("sd_along", "sd_across", "holds", "contact_phase", "after_first_contact", "before_snap_off")
SWEPT = NOISE.merge(GROWTH).assign_coords(sweep=("sample", [0, 1]))
ROOT = xr.Dataset(attrs={"family": "parabola", "rod_length": 1.0})
TREE = xr.DataTree.from_dict({"/": ROOT, "prior": ROOT, "posterior": ROOT, "constant_data": ROOT})
GROUPS = (plotting.amplification, plotting.information, plotting.noise_shares, plotting.required_noise)
CHANCES = [0.0, 1.0, 90.0, np.nan]
REFUSED = {
    "assumptions": (plotting.assumptions, ["trust"], [of("moved_in_gap", "moved_beside")]),
    "ranks": (plotting.calibration_ranks, ["calibration"], [RANKS.drop_vars("rank_p_value"), RANKS.drop_attrs()]),
    "no ranks": (plotting.calibration_ranks, ["calibration"], [RANKS["ranks"], None]),
    "design": (plotting.design, ["design"], [xr.Dataset()]),
    "coverage": (plotting.coverage, ["calibration"], [RANKS, SHARES, None]),
    "range": (plotting.contour, ["x", "range"], [0.5, [0.5, 0.5], [0.0, np.nan]]),
    "error map": (plotting.error_map, ["error map"], [of("width", "status")]),
    "families": (plotting.families, ["comparison"], [of("probability", "sampled")]),
    "posterior": (plotting.posterior_contours, ["posterior", "contour"], [ROOT, TREE["prior"]]),
    "prior": (plotting.prior_contours, ["prior"], [ROOT]),
    "rods": (plotting.required_rod, ["rods"], [of("band_width"), None]),
    **{draw.__name__: (draw, [draw.__name__], [SWEPT[["direction"]], None, SWEPT["share"]]) for draw in GROUPS},
    "ellipses": (lambda p: plotting.contact_ellipses(SWEPT, probability=p), ["probability", "{}"], CHANCES),
    "regions": (lambda p: plotting.contact_regions(TREE, probability=p), ["probability", "{}"], CHANCES),
    "quantity": (lambda name: plotting.error_map(ERRORS, quantity=name), ["quantity", "{}"], ["size"]),
    "method": (lambda by: plotting.error_map(ERRORS, reconstruction=by), ["reconstruction", "{}", "raw"], ["best"]),
    "error": (lambda side: plotting.noise_shares(SWEPT, error=side), ["error", "{}", "across, along"], ["up"]),
    "by": (lambda by: plotting.noise_shares(SWEPT, reconstruction=by), ["reconstruction", "{}", "raw"], ["best"]),
    "sweep of shares": (lambda number: plotting.noise_shares(SWEPT, sweep=number), ["sweep", "{}", "0, 1"], [2]),
    "sweep": (lambda number: plotting.amplification(SWEPT, sweep=number), ["sweep", "{}", "0, 1"], [2]),
    "contours": (lambda n: plotting.posterior_contours(TREE, contours=n), ["contours", "{}"], [0, True, 2.5]),
    "contours of the prior": (lambda n: plotting.prior_contours(TREE, contours=n), ["contours", "{}"], [0]),
}


@pytest.mark.parametrize(("draw", "named", "values"), REFUSED.values(), ids=REFUSED)
def test_wrong_data_and_options_are_refused(draw, named, values):
    for value in values:
        with refused(ParameterError, *(name.format(shown(value)) for name in named)):
            draw(value)


def test_touched_is_labelled_in_the_units_of_the_record(si):
    ax = plotting.touched(si)
    width = si.events["forward"].snap_off.contact_x - si.events["backward"].snap_off.contact_x
    assert texts(ax) == [f"gap\n{1e3 * width:.3g} mm"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$ [mm]", "$y$ [mm]")
    moved = scan(si.contour, base=[(-0.0125, 0.0), (0.02, -0.005)], rig=Rig(rod=ROD), drive_step=STEP)
    assert labels(plotting.touched(moved)) == ["contour", "base (−12.5, 0) mm", "base (20, −5) mm"]


def test_sweeps_leave_no_gap_where_there_is_one_alone_or_they_meet_in_an_edge():
    circle, forward = Circle(1.0, 0.4), {"direction": "forward", "drive_step": STEP}
    roof = Joined(Parabola(0.2, q=0.3, x_c=1.0), Parabola(0.2, q=0.3, x_c=-1.0), x=0.0)
    edge = scan(roof, base=(0.05, 0.1), drive_step=STEP)
    assert {round(sweep.snap_off.contact_x, 7) for sweep in edge.sweeps} == {0.0}
    for result, said in (
        (scan(circle, **forward), []),
        (scan(circle, base=[(-0.2, 0), (0.3, 0)], **forward), ["no gap"]),
        (edge, ["no gap"]),
    ):
        ax = plotting.touched(result)
        assert (drawn_gaps(ax), texts(ax)) == ([], said)


def test_a_sweep_that_touches_an_edge_only_is_a_point():
    wedge = Joined(Parabola(0.05, q=-11.25, x_c=15.0), Parabola(0.05, q=-5.618, x_c=-10.6), x=0.0)
    result = scan(wedge, base=(-0.5, -0.4), direction="forward", drive_step=STEP)
    (sweep,) = result.sweeps
    assert sweep.first_contact.contact_x == pytest.approx(sweep.snap_off.contact_x, abs=1e-7)
    ax = plotting.touched(result)
    (arc,) = arcs(ax, result)
    assert arc.get_marker() == "o"
    np.testing.assert_allclose(arc.get_xydata(), np.zeros((len(arc.get_xdata()), 2)), atol=1e-7)


@pytest.mark.parametrize(("width", "written"), [(7.0, 3), (1.5, 1), (0.3, 0)])
def test_widths_are_written_where_there_is_room(width, written):
    """The widest first; none runs into another or out of the Axes, and the gaps are drawn all the same."""
    result = scan(Parabola(0.3, 0.6), base=[(-1.2, 0.0), (0.0, 0.0), (1.2, 0.0)], drive_step=STEP)
    widths = ["gap\n0.184 $L$", "gap\n0.0971 $L$", "gap\n0.0971 $L$"]
    ax = mpl.figure.Figure(figsize=(width, width)).add_axes((0.0, 0.0, 1.0, 1.0), xlim=(-2.0, 2.0))
    plotting.touched(result, ax=ax)
    assert texts(ax) == widths[:written]
    assert len(ax.patches) == 3


def test_the_object_fills_a_map_whose_limits_are_set(plain):
    ax = own_axes()
    ax.set(xlim=(-0.9, 0.9), ylim=(-0.2, 0.8))
    plotting.touched(plain, ax=ax)
    assert (ax.get_xlim(), ax.get_ylim()) == ((-0.9, 0.9), (-0.2, 0.8))
    (contour,) = (line for line in ax.lines if line.get_label() == "contour")
    x, y = contour.get_xydata()[np.isfinite(contour.get_xdata())].T
    assert y.max() == pytest.approx(0.8, abs=0.01)
    (filled,) = ax.collections
    box = filled.get_datalim(ax.transData)
    np.testing.assert_allclose(box.extents, [x.min(), plain.contour.q, x.max(), 0.8], atol=1e-5)


def test_contour_draws_the_contacts_that_are_ok_and_in_range(contacts, band, plain):
    ax = plotting.contour((0.0, 0.8), truth=plain.contour, contacts=contacts, band=band, gap=(-0.05, 0.05), base=(0, 0))
    drawn = np.concatenate([line.get_xdata() for p in PHASES for line in lines_of(ax, p) if line.get_alpha()])
    x = contacts["contact_x"].values
    expected = x[(contacts["status"].values == "ok") & (x >= 0.0) & (x <= 0.8)]
    np.testing.assert_array_equal(np.sort(drawn), np.sort(expected))
    assert expected.size > 5
    assert texts(ax) == ["gap"]
    assert set(labels(ax)) == {"95 % band", "median", "true contour", "tip contact", "tangential contact", "pivot"}
    assert ax.get_aspect() == 1.0
    assert ax.get_xlim() == pytest.approx((-0.024, 0.824))
    bare = plotting.contour((-1.0, 1.0), contacts=contacts[["contact_x", "contact_y"]])
    assert labels(bare) == ["contact"]  # without phase or status all are drawn


def test_contour_takes_units_from_what_it_is_given(contacts, band):
    for name in ("contact_x", "contact_y"):
        contacts = contacts.assign({name: (0.1 * contacts[name]).assign_attrs(units="m")})
    assert plotting.contour((-0.1, 0.1), contacts=contacts).get_xlabel() == "$x$ [mm]"
    in_metres = band.assign(lower=band["lower"].assign_attrs(units="m"))
    assert plotting.contour((-1.0, 1.0), band=in_metres).get_ylabel() == "$y$ [m]"
    assert plotting.contour((-1.0, 1.0), band=band).get_ylabel() == "$y$ [$L$]"


def test_true_contour_ends_where_it_ends():
    ax = plotting.contour((-2.0, 2.0), truth=Circle(1.0, q=0.3))
    x, y = ax.lines[0].get_data()
    assert (x.min(), x.max()) == (-1.0, 1.0)
    assert np.isfinite(y).all()


def test_trace_thins_and_shows_every_chain(posterior):
    grid = plotting.trace(posterior)
    assert grid.shape == (5, 2)
    for left, right in grid:
        assert len(left.lines) == len(right.patches) == 4
        assert all(250 <= len(line.get_xdata()) <= 500 for line in left.lines)
        for patch in right.patches:
            values, edges, _ = patch.get_data()
            assert (values * np.diff(edges)).sum() == pytest.approx(1.0)
    names = ["$a$", r"$x_{\mathrm{c}}$", "flexural rigidity [$10^{-6}$ N m²]", "log radius[0]", "log radius[1]"]
    assert [ax.get_xlabel() for ax in grid[:, 1]] == names


def test_pairs_shows_truth_and_regions(posterior):
    grid = plotting.pairs(posterior["posterior"].to_dataset(), names=["a", "x_c"], truth={"a": 0.6})
    assert grid.shape == (2, 2)
    assert not grid[0, 1].axison
    assert [line.get_xdata()[0] for line in grid[0, 0].lines] == [0.6]
    assert grid[1, 0].get_xlim()[1] > 0.6
    assert grid[1, 0].get_xlabel() == "$a$"


def test_regions_of_highest_density_hold_what_they_say():
    """Analytic: a Gaussian's region of probability p ends where its density is 1 − p of the greatest."""
    x = np.linspace(-6.0, 6.0, 401)
    density = np.exp(-0.5 * (x[:, None] ** 2 + x**2))
    np.testing.assert_allclose(posteriors._highest_density(density, (0.95, 0.5)), [0.05, 0.5], rtol=1e-2)
    low, high = posteriors._highest_density(np.diag([0.0, 1.0]), (0.95, 0.5))  # all draws are in one cell
    assert low < high


def test_odd_posteriors_are_drawn():
    draws = np.random.default_rng(2).exponential(size=(2, 40))
    draws[0, 0] = np.nan
    columns = {"fixed": (("chain", "draw"), np.full((2, 40), 2.0)), "q": (("chain", "draw"), draws)}
    for function in (plotting.trace, plotting.pairs):
        function(xr.Dataset(columns))[0, 0].figure.canvas.draw()


def test_unknown_names_are_refused(posterior):
    for function in (plotting.trace, plotting.pairs):
        with refused(ParameterError, "b", "a, x_c"):
            function(posterior, names=["b"])
        with refused(ParameterError, "axes"):
            function(posterior, names=["a"], axes=own_axes(2, 2))
    for names in (None, ["a"]):
        with refused(ParameterError, "truth", "b"):
            plotting.pairs(posterior, names=names, truth={"b": 0.5})
    plotting.pairs(posterior, names=["a"], truth={"a": 0.5, "x_c": 0.1})


def test_a_gap_is_taken_as_it_comes_and_an_overlap_is_called_so():
    bounds = xr.Dataset(
        {"left": ("bound", [-0.12, -0.1, -0.08]), "right": ("bound", [0.08, 0.1, 0.12])},
        coords={"bound": ["lower", "median", "upper"]},
    )
    patch = plotting.contour((-1.0, 1.0), gap=bounds).patches[0]
    assert (patch.get_x(), patch.get_width()) == (-0.1, pytest.approx(0.2))
    assert texts(plotting.contour((-1.0, 1.0), gap=(0.1, -0.1))) == ["overlap"]


def test_the_way_of_a_base_that_is_carried_is_drawn_to_the_end_of_contact():
    there = Translation(base=(0.8, 0.0), heading=np.pi, drive_angle=1.2, travel=1.6)
    carried = scan(Circle(0.3, 0.8), drive=[there, Rotation()])
    ax = plotting.touched(carried)
    way = next(line for line in ax.lines if line.get_xdata()[0] == 0.8 and len(line.get_xdata()) == 2)
    assert way.get_xdata()[1] == pytest.approx(carried.sweeps[0].snap_off.base_x)
    assert {"base from (0.8, 0) $L$", "base (0, 0) $L$"} <= set(labels(ax))


def test_a_rod_that_is_carried_back_is_released_and_does_not_snap_off():
    there_and_back = Motion([1.0, 0.3, 1.0], [-0.5, -0.2, -0.5], 1.5, 0.05)
    carried = scan(paper_profile("II", q=0.5), drive=there_and_back)
    (ax, *_) = plotting.observables(carried.record, events=carried.events)
    assert "release" in labels(ax)
    assert "snap-off" not in labels(ax)
    (mark,) = (line for line in ax.lines if line.get_label() == "release")
    assert mark.get_xdata()[0] == pytest.approx(carried.events["forward"].snap_off.travel)

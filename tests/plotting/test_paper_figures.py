"""Figures 2 to 11 of Merker et al. 2018: what they show agrees with what is computed, and looks as it did."""

import io
import itertools
import re

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import same_color

import tactile_bayes as tb
from helpers.pictures import difference, differs
from helpers.refusals import refused
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import ContourError, ParameterError, ReachError
from tactile_bayes.paper_figures import caption, draw_all, figure
from tactile_bayes.plotting import PALETTE, style
from tactile_bayes.record import CHANNELS

COARSE = np.radians(4.0)
COARSER = np.radians(12.0)


def made(number, **options):
    with style("print"):
        return figure(number, **{"drive_step": COARSE, "rods": 5} | options)


@pytest.fixture(scope="module")
def observables():
    return made(4, distances=[0.4, 0.6], drive_step=COARSER)


@pytest.fixture(scope="module")
def sweeps():
    """Profile II, as in Figures 4 and 8."""
    return {q: tb.scan(paper_profile("II", q=q), drive_step=COARSER) for q in (0.4, 0.6)}


@pytest.fixture(scope="module")
def rods():
    return made(8, distances=[0.4, 0.6])


@pytest.fixture(scope="module")
def points():
    return made(11, distances=[0.5], drive_step=COARSER)


def curves(ax):
    """Lines with data, without markers."""
    return [line for line in ax.lines if len(line.get_xdata()) > 1 and line.get_linestyle() != "None"]


def with_marker(ax, marker):
    return [line for line in ax.lines if line.get_marker() == marker and len(line.get_xdata())]


def legend_of(figure):
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts() if text.get_text()]


# --- What is drawn --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("width", "columns"), [(7.0, 2), (3.5, 1)])
def test_in_a_column_panels_are_below_one_another(width, columns):
    drawn = made(2, width=width)
    assert drawn.get_size_inches()[0] == width
    assert drawn.axes[0].get_gridspec().ncols == columns
    with style("print"):
        made(4, distances=[0.5], drive_step=COARSER, width=width).savefig(io.BytesIO(), format="png", dpi=50)


@pytest.mark.parametrize(
    ("number", "options", "error", "named"),
    [
        (1, {}, ParameterError, ["figure 1", "2 to 11"]),
        (True, {}, ParameterError, ["figure True"]),
        (3, {"distances": []}, ParameterError, ["distances", "[]"]),
        (3, {"distances": [0.3, -0.1]}, ParameterError, ["distances", -0.1]),
        (3, {"distances": ["near"]}, ParameterError, ["distances", "near"]),
        (3, {"distances": [0.5, 1.2]}, ReachError, ["profile I", "q = 1.2", "out of reach"]),
        (3, {"distances": [1e-9]}, ContourError, ["profile I", "q = 1e-09"]),
        (7, {"rods": 0}, ParameterError, ["rods", 0]),
        (7, {"width": 1.0}, ParameterError, ["width", 1.0, "3 to 12"]),
        (11, {"load_cell": 0.05}, ParameterError, ["load_cell", 0.05]),
        (3, {"drive_step": 2.0}, ParameterError, ["drive_step", 2.0]),
        (2, {"distances": [0.3]}, ParameterError, ["figure 2", "profile II", "q = 0.3"]),
    ],
)
def test_what_cannot_be_drawn_is_refused(number, options, error, named):
    with refused(error, *named):
        figure(number, **options)


# --- Figure 2 -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("panel", "phase"), [(0, "tip"), (1, "tangential")])
def test_the_rod_that_explains_a_contact_is_one_of_the_sweep(panel, phase):
    ax = made(2).axes[panel]
    (rod,) = (line for line in ax.lines if same_color(line.get_color(), PALETTE[phase]))
    (dot,) = (line for line in with_marker(ax, "o") if line.get_markersize() == 4.5)
    x, y = float(dot.get_xdata()[0]), float(dot.get_ydata()[0])
    state = tb.equilibria(paper_profile("II", q=0.5), [np.arctan(x)])
    assert state.contact_phase.item() == phase
    np.testing.assert_allclose([state.contact_x.item(), state.contact_y.item()], [x, y], atol=1e-12)
    drawn = np.diff([rod.get_xdata(), rod.get_ydata()], axis=1)
    assert np.arctan2(drawn[1, 0], drawn[0, 0]) == pytest.approx(state.drive_angle.item(), abs=0.02)  # a chord of it
    nearest = np.min(np.hypot(rod.get_xdata() - x, rod.get_ydata() - y))
    assert nearest < (1e-9 if phase == "tip" else 2e-3)  # points of the rod are 1/300 apart


def test_its_words_are_those_of_the_paper_and_its_arrows_point_as_the_numbers_do():
    for ax in made(2).axes:
        words = {text.get_text() for text in ax.texts}
        expected = {r"$\varphi_0$", r"$\alpha$", "$f$", r"$f_{\mathrm{A}x}$", r"$f_{\mathrm{A}y}$", "$m_0$"}
        assert expected <= words
        assert any("pivot" in text for text in words)
        assert any(r"\xi" in text for text in words)
        arrows = [text for text in ax.texts if getattr(text, "arrowprops", None)]
        assert len({tuple(np.round(arrow.xyann, 9)) for arrow in arrows}) >= 3
        from_pivot = [arrow.xy for arrow in arrows if arrow.xyann == (0.0, 0.0)]
        along, up = sorted(from_pivot, key=lambda tip: abs(tip[1]))
        assert along[0] < 0.0 < up[1]  # −f sin α and f cos α at α > 0


# --- Figures 3 to 6 -------------------------------------------------------------------------------------------------


def test_curves_are_those_of_the_sweep(observables, sweeps):
    for ax, channel in zip(observables.axes, CHANNELS, strict=True):
        drawn = np.concatenate([line.get_xydata() for line in curves(ax)])
        for made_here in sweeps.values():
            touching = made_here.record.isel(sample=made_here.record.truth_contact_phase.values != "none")
            expected = np.stack([np.degrees(touching.drive_angle), touching[channel]], axis=1)
            off = np.linalg.norm(expected[:, None] - drawn, axis=-1)
            assert off.min(axis=1).max() < 1e-12


def test_curves_bend_without_kinks_up_to_snap_off(observables):
    """In the figure's own scale; but where the phase changes, which may be a corner."""
    for ax in observables.axes:
        size = np.ptp([ax.get_xlim(), ax.get_ylim()], axis=1)
        for line in curves(ax):
            if same_color(line.get_color(), "0.85"):  # zero
                continue
            x, y = np.diff(line.get_xydata() / size * [7.0, 1.5], axis=0).T
            turns = np.abs(np.diff(np.unwrap(np.arctan2(y, x))))
            assert np.degrees(turns.max()) < 15.0


def test_events_are_marked_where_they_happen(observables, sweeps):
    expected = {"first contact": [], "phase change": [], "snap-off": []}
    for sweep in itertools.chain.from_iterable(each.sweeps for each in sweeps.values()):
        expected["first contact"].append(sweep.first_contact)
        expected["phase change"] += sweep.transitions
        expected["snap-off"].append(sweep.snap_off)
    for ax, channel in zip(observables.axes, CHANNELS, strict=True):
        for label, events in expected.items():
            drawn = [np.stack(line.get_data()) for line in ax.lines if line.get_label() == label]
            at = {(round(x, 9), round(y, 9)) for x, y in np.concatenate(drawn, axis=1).T.tolist()}
            assert at == {(round(np.degrees(e.drive_angle), 9), round(getattr(e, channel), 9)) for e in events}


def test_tip_contact_is_thin_and_backward_sweeps_are_dashed():
    (ax, *_) = made(4, distances=[0.6]).axes
    result = tb.scan(paper_profile("II", q=0.6), drive_step=COARSE)
    seen = set()
    for line in curves(ax):
        x, y = (np.asarray(values) for values in line.get_data())
        if same_color(line.get_color(), "0.85"):  # zero
            continue
        backward = bool(np.mean(y) < 0.0)
        assert line.is_dashed() == backward
        of_sweep = result.record.isel(sample=np.flatnonzero(result.record.sweep.values == int(backward)))
        inside = np.isin(np.degrees(of_sweep.drive_angle.values), x)
        phases = set(of_sweep.truth_contact_phase.values[inside])
        assert phases == {"tip" if line.get_linewidth() == 0.8 else "tangential"}
        seen |= {(backward, *phases)}
    assert seen == set(itertools.product((False, True), ("tip", "tangential")))


def test_distances_have_colours_of_their_own_and_are_named(observables):
    labels = legend_of(observables)
    assert [label for label in labels if label.startswith("$q$")] == ["$q$ = 0.4 $L$", "$q$ = 0.6 $L$"]
    assert {"forward", "backward", "tip contact", "tangential contact", "snap-off"} <= set(labels)


def test_profile_one_is_swept_forward_alone():
    drawn = made(3, distances=[0.5])
    assert "backward" not in legend_of(drawn)
    (ax, *_) = drawn.axes
    assert min(np.min(line.get_ydata()) for line in curves(ax)) >= -1e-12


# --- Figures 7 to 10 ------------------------------------------------------------------------------------------------


def test_as_many_rods_as_asked_for_have_the_colours_of_their_phases_and_changes_are_black(rods, sweeps):
    assert [ax.get_title() for ax in rods.axes] == [
        f"{way}, $q$ = {q} $L$" for q in (0.4, 0.6) for way in ("forward", "backward")
    ]
    for ax, (q, way) in zip(rods.axes, itertools.product((0.4, 0.6), ("forward", "backward")), strict=True):
        drawn = [line for line in ax.lines if len(line.get_xdata()) > 50 and line.get_label() != "contour"]
        black, tip, tangential = (
            [line for line in drawn if same_color(line.get_color(), colour)]
            for colour in ("black", PALETTE["tip"], PALETTE["tangential"])
        )
        assert len(black) == 2 + len(sweeps[q].events[way].transitions)
        assert len(tip) + len(tangential) == 5
        assert tip
        assert tangential


def test_panels_share_a_scale_that_holds_every_rod(rods):
    limits = {(ax.get_xlim(), ax.get_ylim()) for ax in rods.axes}
    assert len(limits) == 1
    ((left, right), (bottom, top)) = limits.pop()
    for ax in rods.axes:
        for line in ax.lines:
            if line.get_label() != "contour" and len(line.get_xdata()) > 9:
                x, y = line.get_data()
                assert left < x.min() < x.max() < right
                assert bottom < y.min() < y.max() < top


# --- Figure 11 ------------------------------------------------------------------------------------------------------


def points_of(ax, marker):
    return with_marker(ax, marker)[0].get_xydata().T


def test_points_without_noise_lie_on_the_contour_beside_the_gap(points):
    for ax, profile in zip(points.axes, ("I", "II", "III", "IV"), strict=True):
        contour = paper_profile(profile, q=0.5)
        events = tb.scan(contour, drive_step=COARSER).events
        assert ax.get_title() == f"profile {profile}"
        for marker, sweep, side in (("o", "forward", 1.0), ("^", "backward", -1.0)):
            x, y = points_of(ax, marker)
            np.testing.assert_allclose(y, contour.height(x), atol=1e-9)
            assert np.min(side * x) >= side * events[sweep].snap_off.contact_x - 1e-9
        (gap,) = (line for line in ax.lines if line.get_label() == "gap")
        ends = [events["backward"].snap_off.contact_x, events["forward"].snap_off.contact_x]
        np.testing.assert_allclose(gap.get_xdata()[[0, -1]], ends, atol=1e-12)


def test_points_with_noise_are_those_of_step_two():
    cell = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
    ax = made(11, distances=[0.5], load_cell=cell, rng=3, drive_step=COARSER).axes[1]
    measured = cell.measure(tb.scan(paper_profile("II", q=0.5), drive_step=COARSER).record, rng=3)
    contacts = tb.reconstruct(measured, rig=tb.Rig(load_cell=cell))
    forward = (contacts.direction.values == "forward") & np.isfinite(contacts.contact_x.values)
    x, y = points_of(ax, "o")
    np.testing.assert_array_equal(x, contacts.contact_x.values[forward])
    np.testing.assert_array_equal(y, contacts.contact_y.values[forward])


# --- Captions and files ---------------------------------------------------------------------------------------------


def test_captions_say_what_was_chosen():
    for part in ("Holding moment", " profile III, ", "forward and backward", " q = 0.3, 0.4, 0.5, 0.6 L."):
        assert part in caption(5)
    assert "without noise" in caption(11)
    assert "noise (seed 7)" in caption(11, load_cell=tb.LoadCell(force_noise=0.1, moment_noise=0.1), rng=7)


def test_files_are_named_by_number_and_carry_their_caption(tmp_path):
    told: list[int] = []
    options = {"distances": [0.5], "drive_step": COARSER}
    files = draw_all(tmp_path / "new", only=[3, 2, 3], formats=["svg"], progress=told.append, **options)
    assert told == [1, 2]
    assert list(files) == [3, 2]
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["figure_02.svg", "figure_03.svg"]
    svg = files[3]["svg"].read_text(encoding="utf-8")
    assert caption(3, distances=[0.5]) in svg
    assert re.search(r"<text[^>]*>first contact</text>", svg)  # letters, no outlines


def test_letters_in_pdf_are_truetype(tmp_path):
    pdf = draw_all(tmp_path, only=[7], formats=["pdf"], distances=[0.5], drive_step=COARSER)[7]["pdf"].read_bytes()
    assert b"/FontFile2" in pdf
    assert b"/Subtype /Type3" not in pdf


@pytest.mark.parametrize("name", ["svg", *(pytest.param(name, marks=pytest.mark.slow) for name in ("pdf", "png"))])
def test_the_same_figure_is_the_same_file(tmp_path, name):
    options = {"only": [7], "formats": [name], "distances": [0.5], "drive_step": COARSER, "rods": 3}
    first, second = (draw_all(tmp_path / folder, **options)[7][name] for folder in ("a", "b"))
    assert first.read_bytes() == second.read_bytes()


def test_nothing_is_written_where_something_is_wrong(tmp_path):
    for options, named in (
        ({"formats": ["gif"]}, "pdf, svg, png"),
        ({"formats": []}, "pdf, svg, png"),
        ({"only": [3, 12]}, "figure 12"),
        ({"style": "poster"}, "'poster'"),
    ):
        with refused(ParameterError, named):
            draw_all(tmp_path / "out", **options)
        assert not (tmp_path / "out").exists()


def test_what_was_there_stays_when_a_figure_fails(tmp_path, monkeypatch):
    path = draw_all(tmp_path, only=[3], formats=["svg"], distances=[0.5], drive_step=COARSER)[3]["svg"]
    before = path.read_bytes()
    monkeypatch.setattr(tb.paper_figures, "_save", lambda made, path, *rest: path.write_text("half") and 1 / 0)
    with pytest.raises(ZeroDivisionError):
        draw_all(tmp_path, only=[3], formats=["svg"], distances=[0.4], drive_step=COARSER)
    assert [found.name for found in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == before


# --- Pictures -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [2, 4, 7, pytest.param(10, marks=pytest.mark.slow), 11])
def test_it_looks_as_it_did(number, tmp_path):
    assert difference(made(number), f"figure_{number:02d}", tmp_path) is None
    assert plt.get_fignums() == []


def test_pictures_of_other_distances_differ(tmp_path):
    """So the comparison above can fail."""
    assert differs(made(4, distances=[0.3, 0.4, 0.5, 0.7]), "figure_04", tmp_path) is not None

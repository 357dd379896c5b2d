"""The paper's figures for a base that is carried: what they show agrees with what is computed, and looks as it did."""

import numpy as np
import pytest
from matplotlib.colors import same_color

from helpers.pictures import difference
from helpers.refusals import refused
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import ContourError, ParameterError, ReachError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.paper_figures import caption, draw_all, figure
from tactile_bayes.plotting import PALETTE, style
from tactile_bayes.reconstruction import reconstruct
from tactile_bayes.record import CHANNELS, travels_of
from tactile_bayes.rig import Rig
from tactile_bayes.sweep import Motion, Rotation, Translation, scan

STEP = 0.05
AHEAD = Translation(base=(1.4, 0.0), heading=np.pi, drive_angle=0.5 * np.pi, travel=2.8, drive_step=STEP)
BACK = Translation(base=(-1.4, 0.0), heading=0.0, drive_angle=0.5 * np.pi, travel=2.8, drive_step=STEP)
RETURN = Motion([1.0, 0.3, 1.0], [-0.5, -0.2, -0.5], 1.5, STEP)
TURNED = Motion([1.4, 0.2, -1.4], [0.0, -0.05, 0.0], np.radians([70.0, 90.0, 110.0]), STEP)
WORDS = "base carried from (1.4, 0) to (-1.4, 0) L, drive angle 90°"

pytestmark = pytest.mark.usefixtures("settings_left_alone")


def made(number, drive=AHEAD, **options):
    with style("print"):
        return figure(number, **{"drive": drive, "rods": 5} | options)


def swept(profile, q, drive=AHEAD):
    return scan(paper_profile(profile, q=q), drive=drive)


@pytest.fixture(scope="module")
def observables():
    return made(4, distances=[0.3, 0.5])


def curves(ax):
    """Lines of loads, without markers."""
    lines = [line for line in ax.lines if len(line.get_xdata()) > 1 and line.get_linestyle() != "None"]
    return [line for line in lines if not same_color(line.get_color(), "0.85")]  # zero


def labelled(ax, label):
    return [line for line in ax.lines if line.get_label() == label]


def legend_of(figure):
    (legend,) = figure.legends
    return [text.get_text() for text in legend.get_texts() if text.get_text()]


# --- Figures 3 to 6 -------------------------------------------------------------------------------------------------


def test_loads_are_those_of_the_sweep_over_the_travel_of_the_base(observables):
    assert observables.axes[-1].get_xlabel() == "travel of the base [$L$]"
    for ax, channel in zip(observables.axes, CHANNELS, strict=True):
        drawn = np.concatenate([np.stack(line.get_data()) for line in curves(ax)], axis=1)
        for q in (0.3, 0.5):
            record = swept("II", q).record
            touching = record.truth_contact_phase.values != "none"
            of_record = travels_of(record)[touching], record[channel].values[touching]
            for travel, value in zip(*of_record, strict=True):
                assert np.min(np.hypot(drawn[0] - travel, drawn[1] - value)) < 1e-9


@pytest.mark.parametrize(("profile", "drive"), [("II", AHEAD), ("II", TURNED), ("III", RETURN)])
def test_events_are_marked_at_their_travel_and_the_end_of_contact_by_its_kind(profile, drive):
    number = {"II": 4, "III": 5}[profile]
    drawn = made(number, drive, distances=[0.3, 0.5])
    expected = {"first contact": [], "phase change": [], "snap-off": [], "release": []}
    for q in (0.3, 0.5):
        (events,) = swept(profile, q, drive).sweeps
        expected["first contact"].append(events.first_contact)
        expected["phase change"] += events.transitions
        ending = {"release": "release", "never": None}.get(events.snap_off.kind, "snap-off")
        expected.get(ending, []).append(events.snap_off)
    assert bool(expected["release"]) == (drive is RETURN)
    assert len(expected["snap-off"]) == (1 if drive is AHEAD else 0 if drive is RETURN else 2)
    for ax, channel in zip(drawn.axes, CHANNELS, strict=True):
        for label, events in expected.items():
            at = {(round(x, 9), round(y, 9)) for line in labelled(ax, label) for x, y in line.get_xydata().tolist()}
            assert at == {(round(event.travel, 9), round(getattr(event, channel), 9)) for event in events}
    assert {label for label, events in expected.items() if events} == set(expected) & set(legend_of(drawn))


def test_a_line_ends_where_contact_does(observables):
    for q, last in ((0.3, 2.8), (0.5, swept("II", 0.5).sweeps[0].snap_off.travel)):
        (ax, *_) = made(4, distances=[q]).axes
        assert max(line.get_xdata().max() for line in curves(ax)) == pytest.approx(last, abs=1e-12)
    ends = [max(line.get_xdata().max() for line in curves(ax)) for ax in observables.axes]
    assert ends == pytest.approx([2.8] * 3, abs=1e-12)


def test_lines_bend_without_kinks_up_to_snap_off():
    """In the figure's own scale; but where the phase changes, which may be a corner."""
    for ax in made(4, distances=[0.4, 0.6]).axes:
        size = np.ptp([ax.get_xlim(), ax.get_ylim()], axis=1)
        for line in curves(ax):
            x, y = np.diff(line.get_xydata() / size * [7.0, 1.5], axis=0).T
            turns = np.abs(np.diff(np.unwrap(np.arctan2(y, x))))
            assert np.degrees(turns.max()) < 15.0


def test_a_motion_along_the_line_draws_what_the_translation_does():
    along = Motion([1.4, 0.6, -1.4], 0.0, 0.5 * np.pi)
    for ax, same in zip(made(3, distances=[0.5]).axes, made(3, along, distances=[0.5]).axes, strict=True):
        for line, other in zip(curves(ax), curves(same), strict=True):
            x, y = other.get_data()
            np.testing.assert_allclose(line.get_ydata(), np.interp(line.get_xdata(), x, y), atol=2e-4)


def test_a_drive_from_the_left_mirrors_loads_and_its_lines_are_dashed():
    drawn, mirrored = made(4, distances=[0.5]), made(4, BACK, distances=[0.5])
    assert "backward" in legend_of(mirrored)
    assert not {"forward", "backward"} & set(legend_of(drawn))
    for ax, other, sign in zip(drawn.axes, mirrored.axes, (-1.0, -1.0, 1.0), strict=True):
        for line, of_other in zip(curves(ax), curves(other), strict=True):
            assert of_other.is_dashed()
            assert not line.is_dashed()
            np.testing.assert_allclose(of_other.get_xydata(), line.get_xydata() * [1.0, sign], atol=1e-9)


# --- Figures 7 to 10 ------------------------------------------------------------------------------------------------


def test_rods_stand_on_the_path_of_the_base_which_is_drawn():
    drawn = made(8, distances=[0.4, 0.6])
    assert [ax.get_title() for ax in drawn.axes] == ["carried, $q$ = 0.4 $L$", "carried, $q$ = 0.6 $L$"]
    assert {"base path", "base at start", "snap-off"} <= set(legend_of(drawn))
    for ax, q in zip(drawn.axes, (0.4, 0.6), strict=True):
        (path,) = labelled(ax, "base path")
        np.testing.assert_allclose(path.get_xydata()[[0, -1]], [[1.4, 0.0], [-1.4, 0.0]], atol=1e-12)
        (start,) = labelled(ax, "base at start")
        assert start.get_xydata().tolist() == [[1.4, 0.0]]
        rods = [line for line in ax.lines if len(line.get_xdata()) == 101]
        events = swept("II", q).sweeps[0]
        black = [line for line in rods if same_color(line.get_color(), PALETTE["change"])]
        places = [events.first_contact, *events.transitions, events.snap_off]
        assert [line.get_xdata()[0] for line in black] == pytest.approx([1.4 - event.travel for event in places])
        ((left, right), (bottom, top)) = ax.get_xlim(), ax.get_ylim()
        for line in [*rods, path]:
            x, y = line.get_data()
            assert left < x.min() <= x.max() < right
            assert bottom < y.min() <= y.max() < top


@pytest.mark.parametrize(
    ("drive", "q", "ending"), [(RETURN, 0.5, "release"), (AHEAD, 0.3, "end of the drive"), (TURNED, 0.5, "snap-off")]
)
def test_the_legend_says_how_contact_ends(drive, q, ending):
    drawn = legend_of(made(8, drive, distances=[q]))
    assert {"snap-off", "release", "end of the drive"} & set(drawn) == {ending}


# --- Figure 11 ------------------------------------------------------------------------------------------------------


def test_points_without_noise_lie_on_the_arc_that_the_sweep_touched():
    drawn = made(11, distances=[0.5])
    for ax, profile in zip(drawn.axes, ("I", "II", "III", "IV"), strict=True):
        made_here = swept(profile, 0.5)
        (events,) = made_here.sweeps
        (line,) = (each for each in ax.lines if each.get_marker() == "o" and len(each.get_xdata()) > 9)
        x, y = line.get_data()
        np.testing.assert_allclose(y, made_here.contour.height(x), atol=1e-8)
        assert events.snap_off.contact_x - 1e-9 < x.min() < x.max() < events.first_contact.contact_x + 1e-9
        assert not labelled(ax, "gap")
        assert [path.get_xdata().tolist() for path in labelled(ax, "base path")] == [AHEAD.poses[:, 0].tolist()]
    assert {"forward sweep", "base path", "base at start"} <= set(legend_of(drawn))
    assert "backward sweep" not in legend_of(drawn)


def test_points_with_noise_are_those_of_step_two():
    cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    ax = made(11, BACK, distances=[0.5], load_cell=cell, rng=3).axes[1]
    measured = cell.measure(swept("II", 0.5, BACK).record, rng=3)
    contacts = reconstruct(measured, rig=Rig(load_cell=cell))
    found = np.isfinite(contacts.contact_x.values)
    (line,) = (each for each in ax.lines if each.get_marker() == "^" and len(each.get_xdata()))
    np.testing.assert_array_equal(line.get_xdata(), contacts.contact_x.values[found])
    np.testing.assert_array_equal(line.get_ydata(), contacts.contact_y.values[found])


@pytest.mark.parametrize("drive", [AHEAD, RETURN])
def test_every_panel_shows_bases_contacts_and_the_words_below_the_vertex(drive):
    drawn = made(11, drive, distances=[0.3, 0.6])
    drawn.draw_without_rendering()
    for ax in drawn.axes:
        ((left, right), (bottom, top)) = ax.get_xlim(), ax.get_ylim()
        for x, y in drive.poses[:, :2]:
            assert left < x < right
            assert bottom < y < top
        for text in ax.texts:
            box = text.get_window_extent()
            assert ax.bbox.x0 < box.x0 < box.x1 < ax.bbox.x1


# --- Figure 2 -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("drive", [AHEAD, BACK, TURNED])
@pytest.mark.parametrize(("panel", "phase"), [(0, "tip"), (1, "tangential")])
def test_the_rod_that_explains_a_contact_is_one_of_the_sweep(panel, phase, drive):
    ax = made(2, drive).axes[panel]
    (rod,) = (line for line in ax.lines if same_color(line.get_color(), PALETTE[phase]))
    (dot,) = (line for line in ax.lines if line.get_marker() == "o" and line.get_markersize() == 4.5)
    record = swept("II", 0.5, drive).record
    truth = np.stack([record.truth_contact_x.values, record.truth_contact_y.values], axis=1)
    (at,) = np.flatnonzero(np.all(np.abs(truth - dot.get_xydata()) < 1e-12, axis=1))
    assert record.truth_contact_phase.values[at] == phase
    np.testing.assert_allclose(rod.get_xydata()[0], [record.base_x.values[at], record.base_y.values[at]], atol=1e-12)
    assert np.min(np.hypot(*(rod.get_xydata() - truth[at]).T)) < (1e-9 if phase == "tip" else 2e-3)


@pytest.mark.parametrize("drive", [AHEAD, BACK, TURNED])
@pytest.mark.parametrize("width", [7.0, 3.5])
def test_its_words_are_inside_the_panels_and_apart(drive, width):
    drawn = made(2, drive, width=width)
    drawn.draw_without_rendering()
    for ax in drawn.axes:
        assert any("base" in text.get_text() for text in ax.texts)
        assert not any("pivot" in text.get_text() for text in ax.texts)
        boxes = [text.get_window_extent() for text in ax.texts if text.get_text()]
        for number, box in enumerate(boxes):
            assert ax.bbox.x0 < box.x0 < box.x1 < ax.bbox.x1
            assert ax.bbox.y0 < box.y0 < box.y1 < ax.bbox.y1
            assert not box.count_overlaps(boxes[:number])


# --- Captions, files and refusals -----------------------------------------------------------------------------------


def test_captions_say_what_carries_the_base():
    assert caption(4, drive=AHEAD, distances=[0.5]) == (
        f"Holding moment and support reaction over the travel of the base, profile II, {WORDS}, q = 0.5 L."
    )
    assert caption(7, drive=AHEAD, distances=[0.5]) == f"Deformed rods, profile I, {WORDS}, q = 0.5 L."
    assert caption(11, drive=TURNED, distances=[0.5]) == (
        "Reconstructed contact points, profiles I to IV, base carried along 3 poses from (1.4, 0) to (-1.4, 0) L, "
        "drive angle 70° to 110°, without noise, q = 0.5 L."
    )


@pytest.mark.parametrize(("drive", "name"), [(AHEAD, "translation"), (TURNED, "motion")])
def test_files_are_named_by_the_drive_too(tmp_path, drive, name):
    options = {"distances": [0.5]}
    draw_all(tmp_path, only=[3], formats=["svg"], **options)
    files = draw_all(tmp_path, only=[3], formats=["svg"], drive=drive, **options)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["figure_03.svg", f"figure_03_{name}.svg"]
    assert caption(3, drive=drive, distances=[0.5]) in files[3]["svg"].read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("options", "kind", "named"),
    [
        ({"drive": Rotation()}, ParameterError, ["drive", "Translation", "Motion"]),
        ({"drive": Motion(0.5, 0.0, [0.8, 1.6])}, ParameterError, ["drive", "does not move"]),
        ({"drive": AHEAD, "drive_step": 0.1}, ParameterError, ["drive_step", "Translation"]),
        ({"drive": AHEAD, "distances": [0.5, 1.2]}, ReachError, ["profile I", "q = 1.2", "does not touch"]),
        ({"drive": Translation((0.6, 0.0), np.pi, 1.6, 1.0)}, ContourError, ["profile I", "q = 0.3", "beginning"]),
    ],
)
def test_what_cannot_be_drawn_is_refused(options, kind, named):
    with refused(kind, *named):
        figure(3, **options)


def test_figure_two_without_a_kind_of_contact_is_refused():
    with refused(ParameterError, "figure 2", "tangential contact", "profile II", "q = 0.6", "another distance"):
        figure(2, drive=AHEAD, distances=[0.6])


# --- Pictures -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("number", "drive"), [(2, BACK), (8, AHEAD)])
def test_it_looks_as_it_did(number, drive, tmp_path):
    assert difference(made(number, drive), f"figure_{number:02d}_carried", tmp_path) is None

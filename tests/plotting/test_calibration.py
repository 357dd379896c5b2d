"""The figures of a calibration: what they draw, and what they say."""

import re

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot as plt
from matplotlib.colors import same_color

from helpers.pictures import row_labels, texts
from helpers.refusals import refused
from tactile_bayes import plotting
from tactile_bayes.calibration.ranks import simultaneous_band, uniformity_p_value
from tactile_bayes.calibration.replicate import DRAWS
from tactile_bayes.calibration.summary import CLAIMS
from tactile_bayes.errors import ParameterError

COUNT = 100  # replicates in most tests: as many as there are ranks, and bands are made once
UNIFORM = np.arange(COUNT)
LOW = (DRAWS * np.linspace(0.0, 1.0, COUNT) ** 2).astype(int)  # ranks of truths that lie low among draws
LEVEL = 0.001


def calibration_of(p_values=None, **ranks):
    """Ranks by quantity, and p values where they are not to be those of the ranks."""
    tested = [uniformity_p_value(r[r >= 0], DRAWS) if r.max() >= 0 else np.nan for r in ranks.values()]
    columns = {"ranks": (("quantity", "replicate"), list(ranks.values()))}
    columns["rank_p_value"] = "quantity", tested if p_values is None else p_values
    return xr.Dataset(columns, {"quantity": list(ranks)}, {"level": LEVEL})


def covering(shares, errors, counts, probability=0.9, claims=None):
    columns = {"coverage": shares, "coverage_error": errors, "coverage_replicates": counts}
    labels = {"claim": list(CLAIMS)[: len(shares)] if claims is None else claims}
    return xr.Dataset({k: ("claim", v) for k, v in columns.items()}, labels, {"probability": probability})


def curve(ax):
    """The step line; the other one is that at zero."""
    (found,) = (line for line in ax.lines if line.get_drawstyle() == "steps-post")
    return found


def band(ax):
    """Lowest and highest value of the shaded band."""
    (found,) = ax.collections
    inside = found.get_paths()[0].vertices[:, 1]
    return inside.min(), inside.max()


def heading(panels):
    return panels[0].figure.get_suptitle().splitlines()


# --- Ranks ----------------------------------------------------------------------------------------------------------


def test_each_quantity_has_a_panel_and_uniform_ranks_are_unmarked():
    panels = plotting.calibration_ranks(calibration_of(q=UNIFORM, a=UNIFORM[::-1]))
    assert [ax.get_title() for ax in panels] == ["q", "a"]
    for ax in panels:
        np.testing.assert_allclose(curve(ax).get_ydata(), 0.0, atol=1e-12)
        assert texts(ax) == ["p = 1"]
        assert same_color(curve(ax).get_color(), plotting.PALETTE["median"])
    verdict, band_line = heading(panels)
    assert re.fullmatch("Uniform, .* 100 replicates .* 2 quantities", verdict)
    assert " 1 line in 20 " in band_line


def test_the_line_is_what_ranks_have_more_than_uniform_ones_and_the_band_is_the_simultaneous_one():
    (ax,) = plotting.calibration_ranks(calibration_of(q=LOW))
    np.testing.assert_allclose(curve(ax).get_xdata(), np.arange(DRAWS + 1) / DRAWS)
    ranks = np.arange(DRAWS + 1)
    expected = (LOW[:, None] <= ranks).mean(axis=0) - (ranks + 1) / (DRAWS + 1)
    np.testing.assert_allclose(curve(ax).get_ydata(), expected, rtol=0, atol=1e-12)
    assert curve(ax).get_ydata().min() >= 0.0  # truths are low where posteriors are high
    low, high = simultaneous_band(COUNT, DRAWS, 0.95)
    uniform = np.arange(1, DRAWS + 1) / (DRAWS + 1)
    np.testing.assert_allclose(band(ax), [(low - uniform).min(), (high - uniform).max()], atol=1e-12)


def test_skewed_ranks_are_marked_in_colour_and_in_words():
    panels = plotting.calibration_ranks(calibration_of(a=UNIFORM, rigidity_scale=LOW))
    fine, skewed = panels
    assert curve(skewed).get_ydata().max() > band(skewed)[1]
    assert texts(skewed) == ["not uniform", "p < 0.001"]
    assert not same_color(curve(skewed).get_color(), curve(fine).get_color())
    assert re.fullmatch("Not uniform, .* 100 replicates: .* rigidity_scale", heading(panels)[0])
    assert "not uniform" not in texts(fine)


def test_a_line_that_leaves_the_band_is_less_than_one_that_is_not_uniform():
    panels = plotting.calibration_ranks(calibration_of([1.0, 0.02], a=UNIFORM, q=LOW))
    assert texts(panels[1]) == ["leaves the band", "p = 0.02"]
    assert heading(panels)[0].startswith("Uniform, ")
    colours = {curve(ax).get_color() for ax in (*panels, *plotting.calibration_ranks(calibration_of(q=LOW)))}
    assert len(colours) == 3


@pytest.mark.parametrize(("p_value", "is_marked"), [(0.99 * LEVEL, True), (1.01 * LEVEL, False)])
def test_the_level_is_that_of_the_verdict(p_value, is_marked):
    found = calibration_of([p_value, 0.5, np.nan], a=UNIFORM, q=UNIFORM, x_c=UNIFORM)
    first = plotting.calibration_ranks(found)[0]
    assert ("not uniform" in texts(first)) is is_marked


def test_replicates_without_ranks_are_left_out():
    some = np.where(np.arange(2 * COUNT) < COUNT, np.tile(UNIFORM, 2), -1)
    panels = plotting.calibration_ranks(calibration_of(a=some, q=some, x_c=np.full(2 * COUNT, -1)))
    np.testing.assert_allclose(curve(panels[0]).get_ydata(), 0.0, atol=1e-12)
    assert texts(panels[2]) == ["no ranks"]
    assert re.fullmatch("Uniform, .* 100 of 200 replicates .* 2 quantities", heading(panels)[0])


def test_where_a_quantity_has_fewer_ranks_its_panel_says_so():
    few = np.where(np.arange(2 * COUNT) < COUNT, np.tile(UNIFORM, 2), -1)
    panels = plotting.calibration_ranks(calibration_of(a=np.tile(UNIFORM, 2), snap_off_forward=few))
    assert [texts(ax) for ax in panels] == [["p = 1"], ["p = 1 (of 100)"]]
    assert band(panels[1])[1] > band(panels[0])[1]
    untested = plotting.calibration_ranks(calibration_of([np.nan], a=UNIFORM))
    assert texts(untested[0]) == ["too few to test"]
    assert re.fullmatch("Too few .* 100 replicates", heading(untested)[0])


def test_panels_share_their_axes_and_labels_do_not_overlap():
    names = [*"abcdefghijklm", "drive_angle_offset"]
    panels = plotting.calibration_ranks(calibration_of(**dict.fromkeys(names, UNIFORM), suspension_compliance=LOW))
    figure = panels[0].figure
    assert len(figure.axes) == len(panels) == 15
    assert len({ax.get_ylim() for ax in panels}) == 1
    assert panels[0].get_ylim()[1] > curve(panels[-1]).get_ydata().max()
    figure.canvas.draw()
    whole, boxes = figure.bbox, [ax.get_tightbbox() for ax in panels]
    for i, box in enumerate(boxes):
        assert whole.x0 <= box.x0
        assert box.x1 <= whole.x1
        assert not any(box.overlaps(other) for other in boxes[:i])
    labels = [figure._suptitle, figure._supxlabel, figure._supylabel]
    assert not any(label.get_window_extent().overlaps(box) for label in labels for box in boxes)
    word, p_value = (text.get_window_extent() for text in panels[-1].texts)
    line = panels[-1].transData.transform(curve(panels[-1]).get_xydata())
    assert p_value.y1 < line[:, 1].min()
    assert line[:, 1].max() < word.y0


@pytest.mark.parametrize("count", [1, 3, 5])
def test_small_figures_hold_their_labels(count):
    panels = plotting.calibration_ranks(calibration_of(**dict.fromkeys("abcde"[:count], UNIFORM)))
    figure = panels[0].figure
    figure.canvas.draw()
    above, beside = (label.get_window_extent() for label in (figure._suptitle, figure._supylabel))
    assert beside.y1 < above.y0
    assert beside.y0 > 0.0
    assert above.x1 < figure.bbox.x1


def test_ranks_in_axes_given_have_labels_of_their_own_and_no_title():
    figure, axes = plt.subplots(1, 2)
    plotting.calibration_ranks(calibration_of(a=UNIFORM, q=LOW), axes=axes)
    assert axes[0].get_xlabel() == "rank of the truth / 99"
    assert figure.get_suptitle() == ""


def test_ranks_that_cannot_be_drawn_are_refused():
    for calibration, options, *named in (
        (calibration_of(a=UNIFORM, q=LOW), {"axes": [None]}, "axes", "(1,)", "(2,)"),
        (calibration_of(q=np.full(7, -1)), {}, "7 replicates"),
        (calibration_of(q=UNIFORM).isel(quantity=[]), {}, "100 replicates"),
    ):
        with refused(ParameterError, *named):
            plotting.calibration_ranks(calibration, **options)


# --- Coverage -------------------------------------------------------------------------------------------------------


def dots(ax):
    return [float(line.get_xdata()[0]) for line in ax.lines if line.get_marker() == "o"]


def bars(ax):
    """Ends of the bars by row."""
    drawn = [line for line in ax.lines if line.get_linestyle() == "-" and line.get_marker() == "None"]
    return {int(line.get_ydata()[0]): list(line.get_xdata()) for line in drawn}


def test_claims_have_rows_in_their_order():
    ax = plotting.coverage(covering([0.88, 0.91, 0.85], [0.02, 0.01, 0.03], [200, 200, 150]))
    assert row_labels(ax) == list(CLAIMS.values())[:3]
    assert row_labels(plotting.coverage(covering([0.9], [0.02], [20], claims=["friction"]))) == ["friction"]
    assert ax.get_ylim()[0] > ax.get_ylim()[1]  # the first claim is on top
    assert dots(ax) == [0.88, 0.91, 0.85]
    assert {"88.0 % of 200", "91.0 % of 200", "85.0 % of 150"} <= set(texts(ax))
    np.testing.assert_allclose([bars(ax)[i] for i in range(3)], [[0.84, 0.92], [0.89, 0.93], [0.79, 0.91]])
    without_error = plotting.coverage(covering([0.9, 1.0], [np.nan, 0.01], [200, 200]))
    assert dots(without_error) == [0.9, 1.0]
    assert list(bars(without_error)) == [1]
    np.testing.assert_allclose(bars(without_error)[1], [0.98, 1.0])  # shares go no further
    without_error.figure.canvas.draw()


@pytest.mark.parametrize("probability", [0.5, 0.9])
def test_the_line_is_at_the_probability_stated(probability):
    ax = plotting.coverage(covering([0.88], [0.02], [200], probability))
    (stated,) = (line for line in ax.lines if line.get_linestyle() == "--")
    assert list(stated.get_xdata()) == [probability, probability]
    assert f"stated: {100.0 * probability:.0f} %" in texts(ax)
    assert ax.get_xlim()[0] < min(probability, 0.84)
    assert ax.get_xlim()[1] >= 1.0


def test_claims_of_too_few_replicates_are_named_below():
    ax = plotting.coverage(covering([0.9, 1.0, np.nan, 0.5], [0.02, np.nan, np.nan, 0.5], [200, 1, 0, 2]))
    names = list(CLAIMS.values())
    assert row_labels(ax) == [names[0], names[3]]
    note = ax.texts[-1]
    assert " ".join(note.get_text().split()).endswith(f" 2 replicates: {names[1]}; {names[2]}")
    ax.figure.canvas.draw()
    box = note.get_window_extent()
    assert not box.overlaps(ax.xaxis.label.get_window_extent())
    assert ax.figure.bbox.y0 <= box.y0
    none = plotting.coverage(covering([np.nan, 1.0], [np.nan, np.nan], [0, 1]))
    (said,) = texts(none)
    assert " 2 replicates" in said
    assert not none.axison

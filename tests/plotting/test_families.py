"""The figures of families compared, of assumptions, and of what a prior expects: what they draw, and what they say."""

import numpy as np
import pytest
import xarray as xr

import tactile_bayes as tb
from helpers.comparisons import made_up
from helpers.pictures import labels, row_labels, texts
from tactile_bayes.comparison.families import NONE_FITS
from tactile_bayes.contours import Parabola
from tactile_bayes.runs.demonstration import CONTOUR, ROD

BRIEF = tb.SamplerSettings(ensembles=2, max_steps=20)


@pytest.fixture(scope="module")
def posterior(measured):
    return tb.infer_contour(measured, family="parabola", rig=tb.Rig(unknown="nothing"), rng=1, settings=BRIEF)


def title(ax):
    return " ".join(ax.get_title(loc="left").split())


def line(ax, label):
    (found,) = (line for line in ax.lines if line.get_label() == label)
    return found


# --- Families compared ----------------------------------------------------------------------------------------------


def test_bars_are_probabilities_and_markers_those_of_other_priors():
    half, twice = [0.2, 0.5, 0.3], [0.05, 0.9, 0.05]
    found = made_up([0.1, 0.7, 0.2], half=half, twice=twice)
    (ax,) = tb.plotting.families(found)
    assert title(ax) == found.attrs["verdict"]
    np.testing.assert_allclose([bar.get_width() for bar in ax.patches], [0.1, 0.7, 0.2])
    np.testing.assert_array_equal(line(ax, "priors half as wide").get_xdata(), half)
    np.testing.assert_array_equal(line(ax, "priors twice as wide").get_xdata(), twice)
    assert row_labels(ax) == ["parabola", "circle", "ellipse"]
    assert texts(ax) == ["0.1", "0.7", "0.2"]
    assert ax.get_ylim()[0] > ax.get_ylim()[1]  # the first family is on top
    (none,) = tb.plotting.families(made_up([np.nan, np.nan]))
    assert (texts(none), len(none.patches)) == (["no probabilities"], 0)


def test_what_is_wrong_with_a_family_stands_beside_it():
    flags = {"fits": [False, True, False, True], "sampled": [True, True, False, True]}
    found = made_up([0.3, 0.5, 0.0, 0.2], **flags, converged=[False, True, True, False])
    (ax,) = tb.plotting.families(found)
    names, flags = zip(*(label.partition("\n")[::2] for label in row_labels(ax)), strict=True)
    assert names == ("parabola", "circle", "ellipse", "power-law")
    assert [flag.split(", ") for flag in flags][::3] == [["does not fit", "not converged"], ["not converged"]]
    assert (flags[1], flags[2][:11]) == ("", "not sampled")
    assert [bool(bar.get_hatch()) for bar in ax.patches] == [True, False, True, False]
    assert len(line(ax, "priors half as wide").get_xdata()) == 3


def test_where_none_fits_that_is_what_the_figure_says_first():
    fitting, none = (tb.plotting.families(made_up([0.6, 0.4], fits=fits))[0] for fits in (True, False))
    assert title(none).replace("\n", " ") == NONE_FITS
    sizes = [ax.title.axes._left_title.get_fontsize() for ax in (none, fitting)]
    assert sizes[0] > sizes[1]
    assert none.get_xlabel() == "probability: the least wrong"


def test_elpd_differences_have_a_panel_of_their_own():
    found = made_up([0.1, 0.7, 0.2], elpd=[-12.0, 0.0, -1.0])
    panels = tb.plotting.families(found)
    assert panels.shape == (2,)
    (bars,) = (bars for bars in panels[1].containers if len(bars.lines[0].get_xdata()))
    np.testing.assert_array_equal(bars.lines[0].get_xdata(), found.elpd_difference)
    ends = np.array([bar[:, 0] for bar in bars.lines[2][0].get_segments()])
    np.testing.assert_allclose(np.diff(ends)[:, 0], 2.0 * found.elpd_difference_error)
    assert panels[1].get_xscale() == "linear"
    panels = tb.plotting.families(made_up([0.0, 0.7, 0.3], sampled=[False, True, True], elpd=[0.0, -1.0, 0.0]))
    drawn = [bars.lines[0].get_xdata() for bars in panels[1].containers]
    assert np.isfinite(np.concatenate(drawn)).sum() == 2  # of families that were sampled
    panels[0].figure.canvas.draw()


@pytest.mark.parametrize("worst", [-140.0, -3e5])
def test_differences_that_are_large_do_not_hide_small_ones(worst):
    panels = tb.plotting.families(made_up([0.1, 0.7, 0.2], elpd=[worst, 0.0, -1.0]))
    assert panels[1].get_xscale() == "symlog"
    assert panels[1].get_xlim()[0] < worst
    assert 3 <= len(panels[1].get_xticks()) <= 5


# --- Assumptions ------------------------------------------------------------------------------------------------------


def test_marks_lie_at_their_distances_and_rejected_ones_say_so():
    columns = {"moved_in_gap": [0.1, 2.0, np.nan], "moved_beside": [0.05, 3.0, 0.2], "fits": [1, 0, 1]}
    names = ["friction as stated", "family circle", "drift inferred"]
    ax = tb.plotting.assumptions(
        xr.Dataset({name: ("assumption", of) for name, of in columns.items()}, {"assumption": names})
    )
    drawn = {line.get_label(): line.get_xdata() for line in ax.lines}
    assert drawn["in the gap"][0] == 0.1
    assert drawn["beside it"].tolist() == [0.05, 0.2]
    assert row_labels(ax)[1] == "family circle (rejected)"


# --- Contours from the prior ----------------------------------------------------------------------------------------


def test_contours_of_the_prior_are_drawn_within_the_rods_reach(posterior):
    ax = tb.plotting.prior_contours(posterior, contours=3)
    draws = posterior["prior"].to_dataset().isel(chain=0, draw=[0, 499, 999])
    pale = [line for line in ax.lines if line.get_alpha() == 0.2]
    dark = [line for line in ax.lines if line.get_alpha() == 0.7]
    assert len(pale) == len(dark) == 3
    for i, drawn in enumerate(pale):
        expected = Parabola(*(float(draws[name][i]) for name in ("a", "q", "x_c")))
        np.testing.assert_allclose(drawn.get_ydata(), expected.height(drawn.get_xdata()), rtol=1e-12)
    (circle,) = ax.patches
    assert (circle.center, circle.radius) == ((0.0, 0.0), ROD.length)
    share = posterior["prior"].attrs["share_within_reach"]
    assert f"parabola, from the prior\n({100.0 * share:.2g} % of it is within reach)" in labels(ax)
    assert {"rod's reach", "posterior median, where touched", "pivot"} < set(labels(ax))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$ [mm]", "$y$ [mm]")


@pytest.mark.slow
def test_the_median_is_drawn_where_the_rod_touched(posterior):
    drawn = line(tb.plotting.prior_contours(posterior, truth=CONTOUR), "posterior median, where touched")
    assert np.ptp(drawn.get_xdata()) < 2.0 * ROD.length
    np.testing.assert_allclose(drawn.get_ydata(), CONTOUR.height(drawn.get_xdata()), atol=0.02 * ROD.length)
    without = tb.plotting.prior_contours(posterior, median=False)
    assert not any("median" in label for label in labels(without))


# --- Contours from the posterior ------------------------------------------------------------------------------------


def coloured(ax, colour, alpha):
    return [drawn for drawn in ax.lines if drawn.get_color() == colour and drawn.get_alpha() == alpha]


@pytest.mark.parametrize(
    ("draw", "group"), [(tb.plotting.prior_contours, "posterior"), (tb.plotting.posterior_contours, "prior")]
)
def test_one_is_drawn_without_the_other(posterior, draw, group):
    ax = draw(posterior.filter(lambda node: node.name != group))
    assert not any(group in label for label in labels(ax))


def test_contours_of_the_posterior_are_drawn_over_those_of_the_prior(posterior):
    ax = tb.plotting.posterior_contours(posterior, contours=3, truth=CONTOUR)
    parabolas = ["parabola, from the prior", "parabola, from the posterior"]
    assert labels(ax) == ["rod's reach", *parabolas, "true contour", "pivot"]
    group, prior = posterior["posterior"].to_dataset(), posterior["prior"].to_dataset()
    colours = {"prior": "#E69F00", "posterior": tb.plotting.PALETTE["median"]}
    for name, draws in (("prior", prior), ("posterior", group)):
        values = np.stack([draws[of].values.ravel() for of in ("a", "q", "x_c")], axis=1)
        chosen = values[np.linspace(0, len(values) - 1, 3).astype(int)]
        drawn = coloured(ax, colours[name], 0.2)
        for line_drawn, parameters in zip(drawn, chosen, strict=True):
            expected = Parabola(*parameters).height(line_drawn.get_xdata())
            np.testing.assert_allclose(line_drawn.get_ydata(), expected, rtol=1e-12)
    below, above = (coloured(ax, colours[name], 0.7) for name in colours)
    assert max(drawn.get_zorder() for drawn in below) < min(drawn.get_zorder() for drawn in above)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$ [mm]", "$y$ [mm]")

"""The figures of families compared, and of what a prior expects: what they draw, and what they say."""

import numpy as np
import pytest
from matplotlib import pyplot as plt

from helpers.comparisons import made_up
from helpers.pictures import row_labels
from helpers.refusals import refused
from tactile_bayes import plotting
from tactile_bayes.comparison.verdict import NONE_FITS
from tactile_bayes.contours import Parabola
from tactile_bayes.errors import ParameterError
from tactile_bayes.inference.contour import infer_contour
from tactile_bayes.inference.ensembles import SamplerSettings
from tactile_bayes.rig import Rig
from tactile_bayes.runs.demonstration import CONTOUR, ROD

BRIEF = SamplerSettings(ensembles=2, max_steps=20)


@pytest.fixture(scope="module")
def posterior(measured):
    return infer_contour(measured, family="parabola", rig=Rig(unknown="nothing"), rng=1, settings=BRIEF)


def title(ax):
    return " ".join(ax.get_title(loc="left").split())


def line(ax, label):
    (found,) = (line for line in ax.lines if line.get_label() == label)
    return found


# --- Families compared ----------------------------------------------------------------------------------------------


def test_bars_are_probabilities_and_markers_those_of_other_priors():
    half, twice = [0.2, 0.5, 0.3], [0.05, 0.9, 0.05]
    (ax,) = plotting.families(made_up([0.1, 0.7, 0.2], half=half, twice=twice))
    np.testing.assert_allclose([bar.get_width() for bar in ax.patches], [0.1, 0.7, 0.2])
    np.testing.assert_array_equal(line(ax, "priors half as wide").get_xdata(), half)
    np.testing.assert_array_equal(line(ax, "priors twice as wide").get_xdata(), twice)
    assert row_labels(ax) == ["parabola", "circle", "ellipse"]
    assert [text.get_text() for text in ax.texts] == ["0.1", "0.7", "0.2"]
    assert ax.get_ylim()[0] > ax.get_ylim()[1]  # the first family is on top


def test_the_verdict_stands_above():
    found = made_up([0.1, 0.7, 0.2])
    assert title(plotting.families(found)[0]) == found.attrs["verdict"]


def test_what_is_wrong_with_a_family_stands_beside_it():
    flags = {"fits": [False, True, False, True], "sampled": [True, True, False, True]}
    found = made_up([0.3, 0.5, 0.0, 0.2], **flags, converged=[False, True, True, False])
    (ax,) = plotting.families(found)
    names, flags = zip(*(label.partition("\n")[::2] for label in row_labels(ax)), strict=True)
    assert names == ("parabola", "circle", "ellipse", "power-law")
    assert [flag.split(", ") for flag in flags][::3] == [["does not fit", "not converged"], ["not converged"]]
    assert (flags[1], flags[2][:11]) == ("", "not sampled")
    assert [bool(bar.get_hatch()) for bar in ax.patches] == [True, False, True, False]
    assert len(line(ax, "priors half as wide").get_xdata()) == 3


def test_where_none_fits_that_is_what_the_figure_says_first():
    fitting, none = (plotting.families(made_up([0.6, 0.4], fits=fits))[0] for fits in (True, False))
    assert title(none).replace("\n", " ") == NONE_FITS
    sizes = [ax.title.axes._left_title.get_fontsize() for ax in (none, fitting)]
    assert sizes[0] > sizes[1]
    assert none.get_xlabel() == "probability: the least wrong"


def test_where_there_are_no_probabilities_the_axes_say_so():
    (ax,) = plotting.families(made_up([np.nan, np.nan]))
    assert [text.get_text() for text in ax.texts] == ["no probabilities"]
    assert not ax.patches


def test_elpd_differences_have_a_panel_of_their_own():
    found = made_up([0.1, 0.7, 0.2], elpd=[-12.0, 0.0, -1.0])
    panels = plotting.families(found)
    assert panels.shape == (2,)
    (bars,) = (bars for bars in panels[1].containers if len(bars.lines[0].get_xdata()))
    np.testing.assert_array_equal(bars.lines[0].get_xdata(), found.elpd_difference)
    ends = np.array([bar[:, 0] for bar in bars.lines[2][0].get_segments()])
    np.testing.assert_allclose(np.diff(ends)[:, 0], 2.0 * found.elpd_difference_error)
    assert panels[1].get_xscale() == "linear"


@pytest.mark.parametrize("worst", [-140.0, -3e5])
def test_differences_that_are_large_do_not_hide_small_ones(worst):
    panels = plotting.families(made_up([0.1, 0.7, 0.2], elpd=[worst, 0.0, -1.0]))
    assert panels[1].get_xscale() == "symlog"
    assert panels[1].get_xlim()[0] < worst
    assert 3 <= len(panels[1].get_xticks()) <= 5


def test_families_that_were_not_sampled_have_no_difference():
    found = made_up([0.0, 0.7, 0.3], sampled=[False, True, True], elpd=[0.0, -1.0, 0.0])
    panels = plotting.families(found)
    drawn = [bars.lines[0].get_xdata() for bars in panels[1].containers]
    assert np.isfinite(np.concatenate(drawn)).sum() == 2
    panels[0].figure.canvas.draw()


def test_axes_given_are_those_that_return():
    _, axes = plt.subplots(1, 2)
    assert list(plotting.families(made_up([0.5, 0.5], elpd=[0.0, -1.0]), axes=axes)) == list(axes)
    with refused(ParameterError, "axes", "(2,)", "(1,)"):
        plotting.families(made_up([0.5, 0.5]), axes=axes)
    with refused(ParameterError, "axes", "(2,)", "elpd"):
        plotting.families(made_up([0.5, 0.5], elpd=[0.0, -1.0]), axes=axes[0])


# --- Contours from the prior ----------------------------------------------------------------------------------------


def test_contours_of_the_prior_are_drawn_within_the_rods_reach(posterior):
    ax = plotting.prior_contours(posterior, contours=3)
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
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert f"parabola, from the prior\n({100.0 * share:.2g} % of it is within reach)" in labels
    assert {"rod's reach", "posterior median, where touched", "pivot"} < set(labels)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$ [mm]", "$y$ [mm]")


@pytest.mark.slow
def test_the_median_is_drawn_where_the_rod_touched(posterior):
    drawn = line(plotting.prior_contours(posterior, truth=CONTOUR), "posterior median, where touched")
    assert np.ptp(drawn.get_xdata()) < 2.0 * ROD.length
    np.testing.assert_allclose(drawn.get_ydata(), CONTOUR.height(drawn.get_xdata()), atol=0.02 * ROD.length)
    without = plotting.prior_contours(posterior, median=False)
    assert not any("median" in text.get_text() for text in without.get_legend().get_texts())


def test_a_prior_is_drawn_without_a_posterior_and_into_axes_given(posterior):
    _, ax = plt.subplots()
    assert plotting.prior_contours(posterior.filter(lambda node: node.name != "posterior"), ax=ax) is ax


# --- Contours from the posterior ------------------------------------------------------------------------------------


def coloured(ax, colour, alpha):
    return [drawn for drawn in ax.lines if drawn.get_color() == colour and drawn.get_alpha() == alpha]


def test_contours_of_the_posterior_are_drawn_over_those_of_the_prior(posterior):
    ax = plotting.posterior_contours(posterior, contours=3, truth=CONTOUR)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == [
        "rod's reach",
        "parabola, from the prior",
        "parabola, from the posterior",
        "true contour",
        "pivot",
    ]
    group, prior = posterior["posterior"].to_dataset(), posterior["prior"].to_dataset()
    colours = {"prior": "#E69F00", "posterior": plotting.PALETTE["median"]}
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


def test_a_posterior_is_drawn_without_its_prior_and_into_axes_given(posterior):
    _, ax = plt.subplots()
    assert plotting.posterior_contours(posterior.filter(lambda node: node.name != "prior"), ax=ax) is ax
    assert not any("prior" in text.get_text() for text in ax.get_legend().get_texts())

"""Figures of a calibration: ranks of the truth, and coverage of intervals and bands."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import (
    AxesArray,
    axes_for,
    check_dataset,
    check_panels,
    label_rows,
    new_panels,
    plot,
    write_instead,
)
from tactile_bayes.plotting.labels import number, percent
from tactile_bayes.plotting.style import PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_COLUMNS = 4
_BAND = 0.95
_ROOM = 1.55  # limits of the panels over the largest value drawn, with room for text above and below
_LETTERS = 82  # letters in a line of the heading
_FEWEST = 2  # number of replicates below which a claim is left out
# Colour of a line, by the label of its panel.
_COLOURS = {"": PALETTE["median"], "leaves the band": "#E69F00", "not uniform": "#D55E00"}


class _Ranks(NamedTuple):
    """Curves of one quantity over the ranks 0, 1, …, with the label of its panel."""

    name: str
    replicates: int
    p_value: float
    excess: Floats
    low: Floats
    high: Floats
    word: str = ""


@plot("the argument is not a calibration, none of its replicates has a posterior, or the axes have another shape")
def calibration_ranks(calibration: xr.Dataset, *, axes: Any = None) -> AxesArray:
    """Draw the ranks of the truth among draws of the posterior, which are uniform for correct posteriors.

    Each quantity has a panel with the empirical distribution function of its ranks less that of uniform ranks
    (Säilynoja, Bürkner & Vehtari 2022, doi 10.1007/s11222-022-10090-6). Uniform ranks stay in the shaded band, all
    along the line, with a probability of 95 %: one line in twenty leaves it, and its panel is labelled "leaves the
    band". The label "not uniform" is stronger: the p-value is at most ``attrs["level"]``, as in the verdict. The
    heading of a new figure summarises the panels.

    A line above 0 means that posteriors lie too high, a line below 0 that they lie too low; a line above 0 on the left
    and below 0 on the right means that they are too narrow, the reverse that they are too wide.

    Parameters
    ----------
    calibration : xr.Dataset
        From `tactile_bayes.calibrate`.
    axes : array_like of Axes, shape (quantities,), optional
        One for each quantity, in their order.

    Examples
    --------
    >>> ranks = np.random.default_rng(1).integers(0, 100, (50, 2))
    >>> found = xr.Dataset({"ranks": (("replicate", "quantity"), ranks), "rank_p_value": ("quantity", [0.4, 0.8])})
    >>> [ax.get_title() for ax in calibration_ranks(found.assign_coords(quantity=["a", "q"]).assign_attrs(level=0.001))]
    ['a', 'q']
    """
    check_dataset(calibration, {"ranks", "rank_p_value", "quantity"}, "calibration", "calibrate", ["level"])
    if not np.any(calibration["ranks"].values >= 0):
        raise ParameterError(
            f"none of {calibration.sizes['replicate']} replicates has a posterior: see message, which says why"
        )
    ranks = calibration["ranks"].transpose("quantity", "replicate").values
    drawn = [_ranks(of_one, calibration.isel(quantity=k)) for k, of_one in enumerate(ranks)]
    if axes is None:
        panels = _new_panels(calibration, drawn)
    else:
        panels = check_panels(axes, (len(drawn),), "one for each quantity")
        for ax in panels:
            ax.set_xlabel(_across(), fontsize="small")
            ax.set_ylabel("share up to there\n− expected share", fontsize="small")
    limit = _ROOM * max(float(np.max(np.abs([each.excess, each.low, each.high]))) for each in drawn)
    usual = max(each.replicates for each in drawn)
    for ax, each in zip(panels, drawn, strict=True):
        _draw_ranks(ax, each, usual)
        ax.set(xlim=(0.0, 1.0), ylim=(-limit, limit), xticks=[0.0, 0.5, 1.0], xticklabels=["0", "0.5", "1"])
        ax.locator_params(axis="y", nbins=5)
        ax.tick_params(labelsize="small")
    return panels


@plot("the argument is not a calibration")
def coverage(calibration: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw the coverage of each claim: the share of replicates in which it holds, and its standard error.

    A dot is the share, its bar reaches two standard errors to either side, within 0 and 1; the vertical line is the
    stated probability. The share and the number of replicates are written at the right. Claims judged in fewer than 2
    replicates are left out, and named below.

    Parameters
    ----------
    calibration : xr.Dataset
        From `tactile_bayes.calibrate`.

    Examples
    --------
    >>> shares = {"coverage": [0.89, 0.93], "coverage_error": [0.02, 0.018], "coverage_replicates": [200, 198]}
    >>> found = xr.Dataset({name: ("claim", values) for name, values in shares.items()}, attrs={"probability": 0.9})
    >>> ax = coverage(found.assign_coords(claim=["pointwise_in_gap", "snap_off"]))
    >>> [label.get_text() for label in ax.get_yticklabels()]
    ['band, in the gap', 'angle of snap-off']
    """
    from tactile_bayes.calibration.summary import CLAIMS

    names = {"coverage", "coverage_error", "coverage_replicates", "claim"}
    check_dataset(calibration, names, "calibration", "calibrate", ["probability"])
    is_shown = (calibration["coverage_replicates"].values >= _FEWEST) & np.isfinite(calibration["coverage"].values)
    claims = np.array([CLAIMS.get(str(name), str(name)) for name in calibration["claim"].values], dtype=object)
    labels, left_out = claims[is_shown].tolist(), claims[~is_shown].tolist()
    ax = axes_for(ax, height=1.4 + 0.36 * max(len(labels), 2))
    if not labels:
        return write_instead(ax, f"no claim was judged in {_FEWEST} replicates or more")
    probability = float(calibration.attrs["probability"])
    label_rows(ax, labels, above=0.6, below=0.9)
    _draw_shares(ax, calibration.isel(claim=is_shown), probability)
    ax.locator_params(axis="x", nbins=7, steps=[1, 2, 5, 10])
    ax.xaxis.set_major_formatter(lambda share, _: percent(share))
    ax.set_xlabel("share in which it holds ± 2 standard errors")
    ax.set_title(f"Coverage of statements with {percent(probability)} probability", loc="left", fontsize="medium")
    if left_out:
        words = f"left out, with fewer than {_FEWEST} replicates: {'; '.join(left_out)}"
        wrapped = textwrap.fill(words, max(20, int(10.0 * ax.figure.bbox.width / ax.figure.dpi)))  # letters in a line
        style: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": "small", "color": "0.35"}
        ax.annotate(wrapped, (0.5, -0.4), xycoords=ax.xaxis.label, **style)
    return ax


def _new_panels(calibration: xr.Dataset, drawn: list[_Ranks]) -> AxesArray:
    """Return panels in rows of about equal length, below a heading that summarises them."""
    wanted = len(drawn)
    rows = -(-wanted // _MOST_COLUMNS)
    columns = -(-wanted // rows)
    grid = new_panels(rows, columns, max(3.0, 1.3 + 1.35 * rows), sharex=True, sharey=True).ravel()
    panels, figure = grid[:wanted], grid[0].figure
    for ax in grid[wanted:]:
        ax.remove()
    for ax in panels[-columns:]:
        ax.tick_params(labelbottom=True)
    figure.supxlabel(f"{_across()}: share of the draws that lie below it", fontsize="medium")
    gap = " " if rows > 2 else "\n"
    figure.supylabel(f"share of ranks up to there{gap}− expected share", fontsize="medium")
    figure.suptitle(_heading(calibration, drawn), x=0.01, ha="left", fontsize="medium")
    return panels


def _across() -> str:
    from tactile_bayes.calibration.replicate import DRAWS

    return f"rank of the truth / {DRAWS}"


def _ranks(ranks: Any, quantity: xr.Dataset) -> _Ranks:
    from tactile_bayes.calibration.ranks import expected_shares, simultaneous_band  # loads the sampler
    from tactile_bayes.calibration.replicate import DRAWS

    name, p_value = str(quantity["quantity"].values), float(quantity["rank_p_value"])
    ranks = ranks[ranks >= 0]
    if not ranks.size:
        nothing = np.zeros(DRAWS + 1)
        return _Ranks(name, 0, p_value, nothing, nothing, nothing)
    shares = np.cumsum(np.bincount(ranks, minlength=DRAWS + 1))[:DRAWS] / ranks.size
    low, high = simultaneous_band(ranks.size, DRAWS, _BAND)
    leaves = np.any((shares < low) | (shares > high))
    word = "not uniform" if p_value <= quantity.attrs["level"] else "leaves the band" if leaves else ""
    # At the last rank both distribution functions are 1.
    excess, low, high = (np.append(each - expected_shares(DRAWS), 0.0) for each in (shares, low, high))
    return _Ranks(name, ranks.size, p_value, excess, low, high, word)


def _draw_ranks(ax: Axes, drawn: _Ranks, usual: int) -> None:
    colour = _COLOURS[drawn.word]
    ax.set_title(drawn.name, fontsize="small", fontweight="bold" if drawn.word else "normal", pad=3.0)
    words: dict[str, Any] = {"fontsize": "small", "transform": ax.transAxes, "ha": "center"}
    if not drawn.replicates:
        ax.text(0.5, 0.5, "no ranks", va="center", **words)
        return
    at = np.linspace(0.0, 1.0, drawn.excess.size)
    style: dict[str, Any] = {"step": "post", "color": PALETTE["band"], "alpha": 0.6, "linewidth": 0.0}
    ax.fill_between(at, drawn.low, drawn.high, **style)
    ax.axhline(0.0, color="0.45", linewidth=0.7, zorder=1.5)
    ax.step(at, drawn.excess, where="post", color=colour, linewidth=1.8 if drawn.word else 1.1, zorder=2.5)
    if drawn.word == "not uniform":
        ax.spines[:].set(color=colour, linewidth=1.6)
    if drawn.word:
        ax.text(0.5, 0.97, drawn.word, va="top", fontweight="bold", **words)
    of = f" (of {drawn.replicates})" if drawn.replicates != usual else ""
    tested = "p < 0.001" if drawn.p_value < 1e-3 else f"p = {number(drawn.p_value, digits=2)}"
    ax.text(0.5, 0.03, ("too few to test" if np.isnan(drawn.p_value) else tested) + of, va="bottom", **words)


def _heading(calibration: xr.Dataset, drawn: list[_Ranks]) -> str:
    with_ranks, count = int((calibration["ranks"] >= 0).any("quantity").sum()), calibration.sizes["replicate"]
    replicates = f"{count} replicates" if with_ranks == count else f"{with_ranks} of {count} replicates"
    wrong = [each.name for each in drawn if each.word == "not uniform"]
    tested = np.count_nonzero(np.isfinite([each.p_value for each in drawn]))
    if wrong:
        words = f"Not uniform, over {replicates}: ranks of {', '.join(wrong)}"
    elif tested:
        words = f"Uniform, as far as {replicates} show: ranks of {tested} quantities"
    else:
        words = f"Too few to judge whether ranks are uniform: {replicates}"
    lines = [words, f"Where ranks are uniform, 1 line in {round(1.0 / (1.0 - _BAND))} leaves the shaded band."]
    return "\n".join(textwrap.fill(line, _LETTERS, break_on_hyphens=False) for line in lines)


def _draw_shares(ax: Axes, shown: xr.Dataset, probability: float) -> None:
    shares, errors = shown["coverage"].values, 2.0 * shown["coverage_error"].values
    low, high = (np.clip(shares + side * errors, 0.0, 1.0) for side in (-1.0, 1.0))
    least = float(np.nanmin([*low, *shares, probability]))
    margin = 0.05 * (1.0 - least)
    ax.set_xlim(least - 2.0 * margin, 1.0 + margin)
    is_left = probability < np.mean(ax.get_xlim())
    ax.axvline(probability, color="black", linewidth=1.0, linestyle="--", zorder=1)
    place: dict[str, Any] = {"xycoords": ax.get_xaxis_transform(), "textcoords": "offset points", "va": "bottom"}
    place |= {"xytext": (4.0, 3.0), "ha": "left"} if is_left else {"xytext": (-4.0, 3.0), "ha": "right"}
    ax.annotate(f"stated: {percent(probability)}", (probability, 0.0), fontsize="small", **place)
    for row, (share, count) in enumerate(zip(shares, shown["coverage_replicates"].values, strict=True)):
        if np.isfinite(errors[row]):
            ax.plot([low[row], high[row]], [row, row], color=PALETTE["median"], linewidth=2.0, zorder=2)
        ax.plot(share, row, "o", color=PALETTE["median"], markersize=6.0, zorder=3)
        words = f"{100.0 * share:.1f} % of {count}"
        ax.text(1.02, row, words, transform=ax.get_yaxis_transform(), ha="left", va="center", fontsize="small")

"""Alternatives side by side: families of contours, and other assumptions."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.plotting.axes import AxesArray, axes_for, check_dataset, check_panels, label_rows, new_panels, plot
from tactile_bayes.plotting.labels import legend, number, show_numbers
from tactile_bayes.plotting.style import PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Marker, distance from the bar's middle, and label.
_WIDTHS = {0.5: ("v", -0.26, "priors half as wide"), 2.0: ("^", 0.26, "priors twice as wide")}
_LITTLE = 4.0  # difference of elpd below which it is inconclusive
_FAR = -100.0  # difference beyond which the axis is logarithmic
_LEGEND_BELOW = 34.0  # distance of the legend from the panel, with room for ticks and label [points]
_WARNING = "#D55E00"
_DOTS: dict[str, Any] = {"linestyle": "none", "markersize": 5.0, "zorder": 3}
# Label, marker, and distance from the middle of the row.
_REGIONS = {"in_gap": ("in the gap", "o", -0.12), "beside": ("beside it", "s", 0.12)}
_TICKS = (0.0, 0.25, 0.5, 0.75, 1.0, 2.0, 5.0, *(10.0**k for k in range(1, 9)))


@plot("the argument is not a comparison, or the axes have another shape")
def families(comparison: xr.Dataset, *, axes: Any = None) -> AxesArray:
    """Draw a comparison of families: the probability of each, and its elpd difference where there is one.

    The title is the verdict. A family whose check fails has a grey, hatched bar and the label "does not fit"; a family
    that was not sampled, being far from fitting, has the label "not sampled".

    Parameters
    ----------
    comparison : xr.Dataset
        From `tactile_bayes.compare_families`.
    axes : array_like of Axes, shape (2,), optional
        Axes for probabilities and elpd differences; shape (1,) if the comparison has no leave-one-out densities.

    Examples
    --------
    >>> found = xr.Dataset({"probability": ("family", [0.9, 0.1])}, {"family": ["circle", "ellipse"]})
    >>> found = found.assign(dict.fromkeys(("fits", "sampled", "converged"), ("family", [True, True])))
    >>> by_width = [[0.85, 0.15], [0.9, 0.1], [0.95, 0.05]]
    >>> found["probability_by_width"] = xr.DataArray(by_width, {"prior_width": [0.5, 1, 2]}, ("prior_width", "family"))
    >>> families(found.assign_attrs(verdict="circle with probability 0.9, ellipse with probability 0.1")).shape
    (1,)
    """
    check_dataset(comparison, {"probability", "fits", "sampled"}, "comparison of families", "compare_families")
    count, wanted = comparison.sizes["family"], 2 if "elpd_difference" in comparison else 1
    if axes is None:
        panels = new_panels(1, wanted, 1.9 + 0.48 * count, sharey=True)[0]
    else:
        others = " and elpd differences" if wanted == 2 else "; there are no leave-one-out densities"
        panels = check_panels(axes, (wanted,), f"for probabilities{others}")
    places = np.arange(count, dtype=float)
    _draw_probabilities(panels[0], comparison, places)
    if len(panels) == 2:
        _draw_differences(panels[1], comparison, places)
    for ax in panels:
        ax.set_ylim(places[-1] + 0.6, places[0] - 0.6)
        ax.tick_params(axis="y", length=0.0)
        ax.spines[["top", "right"]].set_visible(False)
    _write_verdict(panels, comparison)
    return panels


def _draw_probabilities(ax: Axes, comparison: xr.Dataset, places: Any) -> None:
    from matplotlib.transforms import ScaledTranslation

    probability, sampled = comparison["probability"].values, comparison["sampled"].values
    for place, share, fits, is_sampled in zip(places, probability, comparison["fits"].values, sampled, strict=True):
        style: dict[str, Any] = {"color": PALETTE["median"]}
        if not fits:
            style = {"facecolor": "0.9", "edgecolor": "0.55", "hatch": "////", "linewidth": 0.8}
        if np.isfinite(share):
            ax.barh(place, share, height=0.5, **style)
        if np.isfinite(share) and is_sampled:
            _write_share(ax, place, share, inside_colour="white" if fits else "black")
    if np.isnan(probability).any():
        ax.text(0.5, 0.5, "no probabilities", transform=ax.transAxes, ha="center", va="center")
    else:
        for width, (marker, beside, label) in _WIDTHS.items():
            shares = comparison["probability_by_width"].sel(prior_width=width).values
            style = {"marker": marker, "color": "black", "markerfacecolor": "white", "clip_on": False, **_DOTS}
            ax.plot(shares[sampled], places[sampled] + beside, label=label, **style)
        below = ax.transAxes + ScaledTranslation(0.0, -_LEGEND_BELOW / 72.0, ax.figure.dpi_scale_trans)
        place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "bbox_transform": below}
        legend(ax, ncols=2, columnspacing=1.0, handletextpad=0.2, **place)
    ax.set_xlim(0.0, 1.0)
    ax.set_xlabel("probability" if comparison["fits"].any() else "probability: the least wrong")
    labels = [_family_label(comparison.sel(family=name)) for name in comparison["family"].values]
    ax.set_yticks(places, labels)
    for tick, fits in zip(ax.yaxis.get_major_ticks(), comparison["fits"].values, strict=True):
        tick.label1.set_color("black" if fits else "0.4")


def _family_label(family: xr.Dataset) -> str:
    """Return the family's name and, below it, what is wrong."""
    name = str(family["family"].values)
    if not family["sampled"]:
        return f"{name}\nnot sampled: far off"
    flags = {"does not fit": family["fits"], "not converged": family["converged"]}
    wrong = ", ".join(words for words, is_good in flags.items() if not is_good)
    return f"{name}\n{wrong}" if wrong else name


def _write_share(ax: Axes, place: float, share: float, *, inside_colour: str) -> None:
    words = "<0.001" if share < 1e-3 else ">0.999" if share > 0.999 else number(share, digits=2)
    style: dict[str, Any] = {"xytext": (8.0, 0.0), "ha": "left", "color": "black"}
    if share > 0.75:
        style = {"xytext": (-8.0, 0.0), "ha": "right", "color": inside_colour}
        if inside_colour == "black":
            style["bbox"] = {"facecolor": "0.9", "edgecolor": "none", "pad": 1.0}
    ax.annotate(words, (share, place), textcoords="offset points", va="center", fontsize="small", **style)


def _draw_differences(ax: Axes, comparison: xr.Dataset, places: Any) -> None:
    difference, error = (comparison[f"elpd_difference{end}"].values for end in ("", "_error"))
    ax.axvspan(-_LITTLE, 0.0, color="0.92", linewidth=0.0, zorder=0)
    ax.axvline(0.0, color="0.4", linewidth=0.8, zorder=1)
    fits = comparison["fits"].values
    for chosen, colour, filling in ((fits, PALETTE["median"], PALETTE["median"]), (~fits, "0.55", "white")):
        style = {"marker": "o", "color": colour, "markerfacecolor": filling, "capsize": 2.5, "linewidth": 1.2, **_DOTS}
        ax.errorbar(difference[chosen], places[chosen], xerr=error[chosen], **style)
    place: dict[str, Any] = {"xycoords": ax.get_xaxis_transform(), "textcoords": "offset points", "ha": "center"}
    ax.annotate("little", (-0.5 * _LITTLE, 0.0), (0.0, 2.0), va="bottom", fontsize="small", color="0.35", **place)
    least = float(np.min((difference - error)[np.isfinite(difference - error)], initial=0.0))
    if least < _FAR:
        ax.set_xscale("symlog", linthresh=10.0)
        decades = int(np.log10(-least))
        ax.set_xticks([0.0, *(-(10.0**k) for k in range(1, decades + 1) if k % 2 or decades < 4)])
        ax.set_xlim(1.5 * least, 3.0)
        show_numbers(ax.xaxis)
    ax.set_xlabel("prediction of left-out samples:\nelpd difference ± standard error")


def _write_verdict(panels: AxesArray, comparison: xr.Dataset) -> None:
    """Write the verdict above the panels, from the left edge of the first one."""
    words, style, letters = str(comparison.attrs["verdict"]), {"fontsize": "medium"}, 10.5
    if not comparison["fits"].any():
        from tactile_bayes.comparison.families import NONE_FITS  # loads the sampler

        words, letters = NONE_FITS, 6.5
        style = {"fontsize": "x-large", "fontweight": "bold", "color": _WARNING}
    width = float(panels[0].figure.get_figwidth())
    wrapped = textwrap.fill(words, max(20, int(letters * width)), break_on_hyphens=False)
    panels[0].set_title(wrapped, loc="left", **style)


@plot("the argument is not such a result, or assumptions were left out of it")
def assumptions(found: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw how far each other assumption moves the median of a band, in widths of the band.

    Within the grey half width the median stays in the band. Assumptions that the record rejects have open grey marks.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.trust`.

    Examples
    --------
    >>> columns = {"moved_in_gap": [0.1, 2.0], "moved_beside": [0.05, 3.0], "fits": [1, 0]}
    >>> found = xr.Dataset({name: ("assumption", values) for name, values in columns.items()})
    >>> assumptions(found.assign_coords(assumption=["friction as stated", "family circle"])).get_xlabel()
    'distance of the medians [widths of the band]'
    """
    check_dataset(found, {"moved_in_gap", "moved_beside", "fits"}, "result with assumptions", "trust")
    count = found.sizes["assumption"]
    ax = axes_for(ax, height=1.2 + 0.28 * count)
    places, fits = np.arange(count, dtype=float), found["fits"].values.astype(bool)
    ax.axvspan(0.0, 0.5, color="0.92", linewidth=0.0, zorder=0)
    for region, (label, marker, beside) in _REGIONS.items():
        moved = found[f"moved_{region}"].values
        colour = PALETTE["tangential" if region == "in_gap" else "tip"]
        ax.plot(moved[fits], places[fits] + beside, marker, color=colour, label=label, clip_on=False)
        ax.plot(moved[~fits], places[~fits] + beside, marker, color="0.55", markerfacecolor="white")
    ax.set_xscale("symlog", linthresh=1.0)
    farthest = max(float(np.nanmax(found[f"moved_{region}"].values, initial=0.0)) for region in _REGIONS)
    end = max(1.0, 1.3 * farthest)
    ax.set_xlim(0.0, end)
    ax.set_xticks([tick for tick in _TICKS if tick <= end])
    show_numbers(ax.xaxis)
    names = found["assumption"].values
    label_rows(ax, [str(name) if ok else f"{name} (rejected)" for name, ok in zip(names, fits, strict=True)])
    ax.set_xlabel("distance of the medians [widths of the band]")
    legend(ax, loc="best")
    return ax

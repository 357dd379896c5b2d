"""Coverage in a calibration: whether what is stated with a probability holds as often."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.plotting.axes import PALETTE
from tactile_bayes.plotting.calibration_panels import refuse_another

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["coverage"]

_FEWEST = 2
"""Replicates below which a claim is left out."""

_LETTERS = 10.0
"""In a line of the note, for each inch of the figure."""


def coverage(calibration: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """How often what is stated with a probability holds: each claim's share of replicates, and its standard error.

    A dot is the share, its bar reaches two standard errors to both sides, as far as shares go; the vertical line is
    the probability that is stated. At the right stands the share, and of how many replicates.

    Parameters
    ----------
    calibration : xr.Dataset
        From `tactile_bayes.calibrate`.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes
        Claims judged in fewer than 2 replicates are left out, and named below.

    Raises
    ------
    ParameterError
        If this is no calibration.

    Examples
    --------
    >>> found = xr.Dataset(
    ...     {
    ...         "coverage": ("claim", [0.89, 0.93]),
    ...         "coverage_error": ("claim", [0.02, 0.018]),
    ...         "coverage_replicates": ("claim", [200, 198]),
    ...     },
    ...     coords={"claim": ["pointwise_in_gap", "snap_off"]},
    ...     attrs={"probability": 0.9},
    ... )
    >>> [label.get_text() for label in coverage(found).get_yticklabels()]
    ['band, in the gap', 'angle of snap-off']
    """
    from tactile_bayes.calibration.summary import CLAIMS

    refuse_another(calibration, {"coverage", "coverage_error", "coverage_replicates", "claim"}, "probability")
    is_enough = calibration["coverage_replicates"].values >= _FEWEST
    is_shown = is_enough & np.isfinite(calibration["coverage"].values)
    shown = calibration.isel(claim=is_shown)
    labels, left_out = (
        [CLAIMS.get(str(name), str(name)) for name in calibration["claim"].values[chosen]]
        for chosen in (is_shown, ~is_shown)
    )
    if ax is None:
        from matplotlib import pyplot as plt

        ax = plt.subplots(figsize=(7.0, 1.4 + 0.36 * max(len(labels), 2)), layout="constrained")[1]
    if not labels:
        ax.set_axis_off()
        words = f"no claim was judged in {_FEWEST} replicates or more"
        ax.text(0.5, 0.5, words, transform=ax.transAxes, ha="center", va="center")
        return ax
    probability = float(calibration.attrs["probability"])
    ax.set_ylim(len(labels) - 0.1, -0.6)
    ax.set_yticks(np.arange(len(labels)), labels)
    _draw_shares(ax, shown, probability)
    ax.tick_params(axis="y", length=0.0)
    ax.spines[["top", "right"]].set_visible(False)
    ax.locator_params(axis="x", nbins=7, steps=[1, 2, 5, 10])
    ax.xaxis.set_major_formatter(lambda share, _: _percent(share))
    ax.set_xlabel("share in which it holds ± 2 standard errors")
    ax.set_title(
        f"How often what is stated with {_percent(probability)} probability holds", loc="left", fontsize="medium"
    )
    if left_out:
        words = f"left out, with fewer than {_FEWEST} replicates: {'; '.join(left_out)}"
        wrapped = textwrap.fill(words, max(20, int(_LETTERS * ax.figure.bbox.width / ax.figure.dpi)))
        style: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": "small", "color": "0.35"}
        ax.annotate(wrapped, (0.5, -0.4), xycoords=ax.xaxis.label, **style)
    return ax


def _draw_shares(ax: Axes, shown: xr.Dataset, probability: float) -> None:
    shares, errors = shown["coverage"].values, 2.0 * shown["coverage_error"].values
    low, high = (np.clip(shares + side * errors, 0.0, 1.0) for side in (-1.0, 1.0))
    least = float(np.nanmin([*low, *shares, probability]))
    margin = 0.05 * (1.0 - least)
    ax.set_xlim(least - 2.0 * margin, 1.0 + margin)
    is_left = probability < np.mean(ax.get_xlim())
    ax.axvline(probability, color="black", linewidth=1.0, linestyle="--", zorder=1)
    ax.annotate(
        f"stated: {_percent(probability)}",
        (probability, 0.0),
        (4.0 if is_left else -4.0, 3.0),
        xycoords=ax.get_xaxis_transform(),
        textcoords="offset points",
        ha="left" if is_left else "right",
        va="bottom",
        fontsize="small",
    )
    for place, (share, count) in enumerate(zip(shares, shown["coverage_replicates"].values, strict=True)):
        if np.isfinite(errors[place]):
            ax.plot([low[place], high[place]], [place, place], color=PALETTE["median"], linewidth=2.0, zorder=2)
        ax.plot(share, place, "o", color=PALETTE["median"], markersize=6.0, zorder=3)
        words = f"{100.0 * share:.1f} % of {count}"
        ax.text(1.02, place, words, transform=ax.get_yaxis_transform(), ha="left", va="center", fontsize="small")


def _percent(share: float) -> str:
    return f"{100.0 * share:.6g} %"

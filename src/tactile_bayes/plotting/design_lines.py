"""What is to be expected of pivots at a few heights: a line for each height and drive step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.plotting.axes import BASES, PALETTE, Floats, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_design_lines", "kind_of"]

_KINDS = {
    "band": ("width", "width of the band to be expected", True),
    "gap": ("gap", "width that no sweep touches", True),
    "information": ("information", "information to be expected [nat]", False),
}
_MARKS = "osD^vP"


def kind_of(found: xr.Dataset) -> tuple[str, str, bool]:
    """Name of the criterion's variable, the criterion in words, and whether it is a length, of which less is better."""
    return _KINDS[str(found.attrs["criterion"])]


def draw_design_lines(ax: Axes, found: xr.Dataset, pivots: Floats) -> None:
    """Draw the lines, and where pivots are already, which are of shape (pivots, 2)."""
    name, words_of_it, is_length = kind_of(found)
    si = found.base_x.attrs.get("units") == "m"
    scale = 1e3 if si and is_length else 1.0
    x = found.base_x.values * (1e3 if si else 1.0)
    y, step = found.base_y.values, found.drive_step.values
    values, errors = scale * found[name].values, scale * found[f"{name}_error"].values
    lines = sorted(set(zip(y.tolist(), step.tolist(), strict=True)))
    several = len(set(y.tolist())) > 1, len(set(step.tolist())) > 1
    for k, (height, of_step) in enumerate(lines):
        here = np.flatnonzero((y == height) & (step == of_step))
        here = here[np.argsort(x[here])]
        words = []
        if several[0]:
            words.append(f"$y$ = {number(height, -3, digits=4)} mm" if si else f"$y$ = {number(height, digits=3)} $L$")
        if several[1]:
            words.append(f"steps of {np.degrees(of_step):.3g}°")
        colour = BASES[k % len(BASES)]
        ax.errorbar(
            x[here],
            values[here],
            2.0 * np.nan_to_num(errors[here]),
            color=colour,
            marker=_MARKS[k % len(_MARKS)],
            markersize=4.0,
            linewidth=1.2,
            elinewidth=0.8,
            capsize=2.0,
            label=", ".join(words) or "Laplace's approximation",
        )
        if f"nested_{name}" in found:
            nested = scale * found[f"nested_{name}"].values[here]
            if np.isfinite(nested).any():
                ax.plot(
                    x[here], nested, "x", color=colour, markersize=7.0, label="sampled posteriors" if not k else None
                )
    best = int(found.best)
    ax.plot(x[best], values[best], "o", markersize=12.0, markerfacecolor="none", color=PALETTE["change"], label="best")
    if name == "width":
        present = scale * float(found.present_width)
        if present < 3.0 * np.nanmax(values):
            ax.axhline(present, color=PALETTE["none"], linestyle="--", linewidth=1.0, label="without a further record")
    for k, place in enumerate(pivots[:, 0] * (1e3 if si else 1.0)):
        style: dict[str, Any] = {"color": "0.6", "linestyle": ":", "linewidth": 1.2, "zorder": 0.5}
        ax.axvline(place, label=None if k else "pivot so far", **style)
    ax.set_xlabel(f"place of the pivot $x$ [{'mm' if si else '$L$'}]")
    ax.set_ylabel(f"{words_of_it} [{'mm' if si else '$L$'}]" if is_length else words_of_it)
    ax.set_ylim(bottom=0.0 if is_length else None)
    ax.spines[["top", "right"]].set_visible(False)
    if len(ax.get_legend_handles_labels()[1]) > 1:
        ax.legend(fontsize="small", frameon=False)

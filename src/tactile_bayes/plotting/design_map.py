"""Where to put the next pivot: what is to be expected from every place that it could have."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import BASES, PALETTE, single_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["design"]

_KINDS = {
    "band": ("width", "width of the band to be expected", True),
    "gap": ("gap", "width that no sweep touches", True),
    "information": ("information", "information to be expected [nat]", False),
}
_MARKS = "osD^vP"


def design(found: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """The criterion over the place of the pivot, a line for each height and drive step, and the best of all.

    Bars are two standard errors over the objects drawn. Where posteriors were sampled as well, crosses show what these
    gave.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.design`.
    ax : Axes, optional
        Where to draw.

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If this is no design.

    Examples
    --------
    >>> from tactile_bayes import design as design_of
    >>> from scipy import stats
    >>> priors = {"a": stats.lognorm(0.3, scale=0.6), "q": stats.uniform(0.4, 0.2), "x_c": stats.norm(0.0, 0.05)}
    >>> from matplotlib.figure import Figure
    >>> found = design_of("parabola", priors=priors, bases=[(0.0, 0.0), (0.2, 0.0)], draws=2, seed=1)
    >>> design(found, ax=Figure().subplots()).get_xlabel()
    'place of the pivot $x$ [$L$]'
    """
    if not (isinstance(found, xr.Dataset) and {"base_x", "drive_step", "best"} <= set(found)):
        raise ParameterError("this is no design: give what tactile_bayes.design has returned")
    ax = single_axes() if ax is None else ax
    name, words_of_it, is_length = _KINDS[str(found.attrs["criterion"])]
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
            words.append(f"$y$ = {1e3 * height:.4g} mm" if si else f"$y$ = {height:.3g} $L$")
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
    ax.set_xlabel(f"place of the pivot $x$ [{'mm' if si else '$L$'}]")
    ax.set_ylabel(f"{words_of_it} [{'mm' if si else '$L$'}]" if is_length else words_of_it)
    ax.set_ylim(bottom=0.0 if is_length else None)
    ax.spines[["top", "right"]].set_visible(False)
    if len(ax.get_legend_handles_labels()[1]) > 1:
        ax.legend(fontsize="small", frameon=False)
    return ax

"""The distances by which other assumptions move a band."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from tactile_bayes.plotting.axes import axes_for, check_dataset, label_rows
from tactile_bayes.plotting.labels import show_numbers
from tactile_bayes.plotting.legends import legend
from tactile_bayes.plotting.marks import PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Label, marker, and distance from the middle of the row.
_REGIONS = {"in_gap": ("in the gap", "o", -0.12), "beside": ("beside it", "s", 0.12)}
_TICKS = (0.0, 0.25, 0.5, 0.75, 1.0, 2.0, 5.0, *(10.0**k for k in range(1, 9)))


def assumptions(found: xr.Dataset, *, ax: Axes | None = None) -> Axes:
    """Draw how far each other assumption moves the median of a band, in widths of the band.

    Within the grey half width the median stays in the band. Assumptions that the record rejects have open grey marks.

    Parameters
    ----------
    found : xr.Dataset
        From `tactile_bayes.trust`.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If the argument is not such a result, or assumptions were left out of it.

    Examples
    --------
    >>> found = xr.Dataset(
    ...     {
    ...         "moved_in_gap": ("assumption", [0.1, 2.0]),
    ...         "moved_beside": ("assumption", [0.05, 3.0]),
    ...         "fits": ("assumption", [1, 0]),
    ...     },
    ...     coords={"assumption": ["friction as stated", "family circle"]},
    ... )
    >>> assumptions(found).get_xlabel()
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

"""The rod's reach on a map, and many contours in it, paler beyond."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_whole_number
from tactile_bayes.plotting.axes import PALETTE, Floats, legend_entry
from tactile_bayes.plotting.maps import draw_pivot, outline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tactile_bayes.contours.base import Contour

__all__ = ["Reach", "refuse_count"]

_ROOM = 0.06
"""What the map shows beside the rod's reach, in rod lengths."""

_BELOW = 0.2
"""What it shows below the pivot at least, likewise."""

_DASHED: dict[str, Any] = {"linestyle": (0, (6.0, 3.0)), "linewidth": 1.0}


@dataclass(frozen=True)
class Reach:
    """Circles around the pivots of a record.

    Attributes
    ----------
    pivots : ndarray, shape (pivots, 2)
        [length].
    length : float
        Of the rod [length].
    """

    pivots: Floats
    length: float

    @classmethod
    def of(cls, posterior: xr.DataTree) -> Reach:
        """That of the record from which a posterior is."""
        record = posterior["constant_data"].to_dataset()
        pivots = np.unique(np.stack([record["base_x"].values, record["base_y"].values], axis=1), axis=0)
        return cls(pivots, float(posterior.attrs["rod_length"]))

    @property
    def span(self) -> tuple[float, float]:
        """The range in x that the map shows."""
        room = (1.0 + _ROOM) * self.length
        return float(self.pivots[:, 0].min() - room), float(self.pivots[:, 0].max() + room)

    def draw(self, ax: Axes) -> None:
        """A dashed circle around each pivot, and its entry in the legend."""
        from matplotlib.patches import Circle

        for pivot in self.pivots:
            ax.add_patch(Circle(tuple(pivot), self.length, fill=False, edgecolor="0.4", **_DASHED))
        legend_entry(ax, "rod's reach", color="0.4", **_DASHED)

    def draw_contours(
        self, ax: Axes, drawn: Contour, most: int, *, pale: float, strong: float, zorder: float = 1.5, **style: Any
    ) -> float:
        """Some of many contours, evenly picked; the lowest y within reach, or what is shown at least, is returned."""
        from matplotlib.patches import Circle

        left, right = self.span
        lowest = float(self.pivots[:, 1].min()) - _BELOW * self.length
        count = drawn.shape[0]
        for i in np.unique(np.linspace(0, count - 1, min(most, count)).astype(np.intp)):
            x, y = outline(drawn.take(i), left, right)
            ax.plot(x, y, alpha=pale, zorder=zorder, **style)
            for pivot in self.pivots:
                within = Circle(tuple(pivot), self.length, transform=ax.transData)
                ax.plot(x, y, alpha=strong, zorder=zorder + 0.1, clip_path=within, **style)
                is_near = np.hypot(x - pivot[0], y - pivot[1]) < self.length
                lowest = min(lowest, float(np.min(y[is_near], initial=lowest)))
        return lowest

    def limit(self, ax: Axes, lowest: float) -> None:
        """Show what is within reach, and what is between the lowest contour and it."""
        room = _ROOM * self.length
        ax.set_xlim(*self.span)
        ax.set_ylim(lowest - 2.0 * room, float(self.pivots[:, 1].max()) + self.length + room)

    def draw_truth(self, ax: Axes, truth: Contour) -> None:
        """The true contour, dashed, as far as the map goes."""
        ax.plot(
            *outline(truth, *self.span),
            color=PALETTE["change"],
            linestyle="--",
            linewidth=1.0,
            zorder=3,
            label="true contour",
        )

    def draw_pivots(self, ax: Axes) -> None:
        """A mark on each pivot, of which the first is in the legend."""
        for k, (x, y) in enumerate(self.pivots.tolist()):
            draw_pivot(ax, (x, y), label="" if k else "pivot")


def refuse_count(contours: int) -> None:
    """Refuse what is no number of contours to be drawn.

    Raises
    ------
    ParameterError
    """
    check_whole_number("contours", contours, 1, "give a whole number from 1 up, like 40")

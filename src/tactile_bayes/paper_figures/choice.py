"""What can be chosen of a figure, and the scans that it is drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Literal

import numpy as np

from tactile_bayes.checks import check_whole_number
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import ContourError, ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.plotting.style import COLUMN_WIDTH, PAGE_WIDTH
from tactile_bayes.scanning import Scan, scan

__all__ = ["Choice", "Direction", "Profile", "choice_of"]

Profile = Literal["I", "II", "III", "IV"]
Direction = Literal["both", "forward", "backward"]


@dataclass(frozen=True)
class Choice:
    """What a figure is drawn with.

    Attributes
    ----------
    distances : tuple of float
        Of the vertex above the pivot, increasing [L].
    drive_step : float
        [rad].
    rods : int
        Drawn at most in one sweep.
    load_cell : LoadCell or None
        Whose noise reconstructed points show.
    seed : int
        Of that noise.
    width : float
        Of the figure [inches].
    """

    distances: tuple[float, ...]
    drive_step: float
    rods: int
    load_cell: LoadCell | None
    seed: int
    width: float

    @property
    def is_column(self) -> bool:
        """Whether panels have to stand below one another."""
        return self.width < 0.5 * (COLUMN_WIDTH + PAGE_WIDTH)

    def scan(self, profile: Profile, distance: float, direction: Direction = "both") -> Scan:
        """Of a profile of the paper at a distance.

        Raises
        ------
        ContourError
            If it is too near, or out of reach.
        """
        try:
            return scan(paper_profile(profile, q=distance), direction=direction, drive_step=self.drive_step)
        except ContourError as error:
            raise type(error)(f"profile {profile} at the distance q = {distance:g}: {error}") from None


def choice_of(
    distances: Sequence[float],
    *,
    drive_step: float,
    rods: int,
    load_cell: LoadCell | None,
    seed: int,
    width: float,
) -> Choice:
    """The same, if it can be drawn.

    Raises
    ------
    ParameterError
        If it cannot.
    """
    try:
        q = np.asarray(distances, dtype=float)
    except (TypeError, ValueError):
        q = np.empty(0)
    if q.ndim != 1 or not q.size or not np.all(np.isfinite(q) & (q > 0.0)):
        raise ParameterError(f"distances are {distances!r}: give rod lengths above 0, like [0.3, 0.5]")
    check_whole_number("rods", rods, 1, "give a whole number from 1 up, like 15")
    if not (isinstance(width, Real) and 3.0 <= width <= 12.0):
        raise ParameterError(f"width is {width!r}: give inches from 3 to 12, like {COLUMN_WIDTH} or {PAGE_WIDTH}")
    if load_cell is not None and not isinstance(load_cell, LoadCell):
        raise ParameterError(f"load_cell is {load_cell!r}: give a LoadCell, or None for records without noise")
    return Choice(tuple(np.unique(q).tolist()), drive_step, int(rods), load_cell, seed, float(width))

"""The options of a figure, and the scans from which it is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tactile_bayes.checks import (
    as_numbers,
    check_number,
    check_optional,
    check_whole_number,
)
from tactile_bayes.contours import paper_profile
from tactile_bayes.errors import ContourError, ParameterError
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence
from tactile_bayes.plotting.axes import AxesArray
from tactile_bayes.plotting.style import COLUMN_WIDTH, PAGE_WIDTH
from tactile_bayes.sweep import Carried, Rotation, Scan, scan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Profile = Literal["I", "II", "III", "IV"]
Direction = Literal["both", "forward", "backward"]
Limits = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Choice:
    """Options of a figure."""

    distances: tuple[float, ...]  # of the vertex above the origin, increasing [L]
    drive: Carried | None  # that carries the base; None for rotations about the origin
    drive_step: float | None  # of rotations [rad]; None for that of `scan`
    rods: int  # largest number drawn in one sweep
    load_cell: LoadCell | None  # that measures the records of reconstructed points
    seed: np.random.SeedSequence | None  # of its noise
    width: float  # of the figure [inches]

    @property
    def is_column(self) -> bool:
        """True if panels must stand below one another."""
        return self.width < 0.5 * (COLUMN_WIDTH + PAGE_WIDTH)

    def map_panels(
        self, count: int, limits: Limits, *, beside: float, between: float, above: float, widest: float = np.inf
    ) -> tuple[Figure, AxesArray]:
        """Return a figure of maps at one scale, shape (rows, columns), with margins for labels and legend [inches]."""
        from matplotlib.figure import Figure

        columns = 1 if self.is_column else min(2, count)
        rows = -(-count // columns)
        (left, right), (bottom, top) = limits
        high = min(self.width / columns - beside, widest) * (top - bottom) / (right - left) + between
        figure = Figure(figsize=(self.width, rows * high + above), layout="compressed")
        options: dict[str, Any] = {"xlim": limits[0], "ylim": limits[1], "aspect": "equal"}
        return figure, figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False, subplot_kw=options)

    def scan(self, profile: Profile, distance: float, direction: Direction = "both") -> Scan:
        """Return the scan of a profile of the paper at a distance; the direction is that of rotations."""
        drive = self.drive or Rotation(direction=direction, drive_step=self.drive_step)
        try:
            return scan(paper_profile(profile, q=distance), drive=drive)
        except ContourError as error:
            raise type(error)(f"profile {profile} at the distance q = {distance:g}: {error}") from None


def choice_of(
    distances: Sequence[float],
    *,
    drive: Carried | None,
    drive_step: float | None,
    rods: int,
    load_cell: LoadCell | None,
    rng: Rng | None,
    width: float,
) -> Choice:
    """Return the checked options of a figure."""
    q = as_numbers(distances)
    if q is None or q.ndim != 1 or not q.size or not np.all(np.isfinite(q) & (q > 0.0)):
        raise ParameterError(f"distances are {distances!r}: give rod lengths above 0, like [0.3, 0.5]")
    rods = check_whole_number("rods", rods, 1, "give a whole number from 1 up, like 15")
    inches = f"give inches from 3 to 12, like {COLUMN_WIDTH} or {PAGE_WIDTH}"
    width = check_number("width", width, inches, least=3.0, most=12.0)
    check_optional("load_cell", load_cell, LoadCell, "give a LoadCell")
    if load_cell is not None and rng is None:
        raise ParameterError("the load cell has noise: give rng, like rng=1")
    seed = None if rng is None else seed_sequence(rng)
    Rotation(drive_step=drive_step)  # refuses an impossible step
    check_optional("drive", drive, Carried, "the paper's rotations have none: give a Translation or a Motion")
    if drive is not None and not np.ptp(drive.poses[:, :2], axis=0).any():
        raise ParameterError("drive is a motion that does not move the base: give one that does, or no drive")
    if drive is not None and drive_step is not None:
        raise ParameterError("drive_step is for rotations: give it to the drive, as in Translation(…, drive_step=…)")
    return Choice(tuple(np.unique(q).tolist()), drive, drive_step, rods, load_cell, seed, width)

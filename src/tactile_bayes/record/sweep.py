"""A sweep: one stroke of the drive, with one direction and one pivot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.record.schema import DIRECTIONS
from tactile_bayes.record.table import Source

__all__ = ["refuse_impossible_sweeps"]


def refuse_impossible_sweeps(values: Mapping[str, NDArray[Any]], source: Source) -> None:
    """Refuse sweeps of several directions or pivots, or whose drive angle is in degrees or runs the wrong way."""
    direction, angle = values["direction"], values["drive_angle"]
    for sample in np.flatnonzero(~np.isin(direction, DIRECTIONS)).tolist():
        raise source.cell_error(
            sample, "direction", f"{str(direction[sample])!r} is no direction: write 'forward' or 'backward'"
        )
    for sample in np.flatnonzero(np.abs(angle) > 2 * math.pi).tolist():
        raise source.cell_error(
            sample,
            "drive_angle",
            f"{float(angle[sample])!r} is more than a turn (2π), so the angles look like degrees: convert the column "
            "to radians, with numpy.radians or times 0.017453292519943295",
        )
    for rows in _sweeps(values["sweep"]):
        sweep = int(values["sweep"][rows[0]])
        for name, part in (
            ("direction", "stroke of the drive"),
            ("base_x", "position of the pivot"),
            ("base_y", "position of the pivot"),
        ):
            column = values[name]
            for other in rows[column[rows] != column[rows[0]]]:
                raise source.error(
                    f"sweep {sweep} mixes two values of {name!r}, {column[rows[0]].item()!r} ({source.row(rows[0])}) "
                    f"and {column[other].item()!r} ({source.row(other)}): "
                    f"give each {part} a sweep number of its own"
                )
        sense = 1 if direction[rows[0]] == "forward" else -1
        if _runs_backwards(sense * angle[rows]):
            first, last = rows[0], rows[-1]
            raise source.error(
                f"sweep {sweep} is labelled {DIRECTIONS[sense < 0]!r}, but its drive angle "
                f"{'decreases' if sense > 0 else 'increases'}, from {float(angle[first])!r} rad ({source.row(first)}) "
                f"to {float(angle[last])!r} rad ({source.row(last)}): label it {DIRECTIONS[sense > 0]!r}, or put its "
                "samples in the order in which they were measured"
            )


def _sweeps(sweep: NDArray[np.int64]) -> list[NDArray[np.intp]]:
    """The rows of each sweep, in the order of measurement."""
    order = np.argsort(sweep, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(sweep[order])) + 1)


def _runs_backwards(angle: NDArray[np.float64]) -> bool:
    """Whether a sequence decreases, and not only by the noise of the encoder (see the notes of `validate`)."""
    if angle.size < 2:
        return False
    if (np.diff(angle) < 0).all():
        return True
    angle = angle - angle[0]  # so that a drive at rest has exactly no trend
    time = np.arange(angle.size) - (angle.size - 1) / 2
    slope = float(time @ angle / (time @ time))
    residual = angle - angle.mean() - slope * time
    variance_of_slope = float(residual @ residual / max(angle.size - 2, 1) / (time @ time))
    return slope < -6 * math.sqrt(variance_of_slope)

"""A sweep: one motion of the drive, with one direction and one pivot."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.record.schema import DIRECTIONS
from tactile_bayes.record.table import Source

__all__ = ["refuse_impossible_sweeps"]


def refuse_impossible_sweeps(values: Mapping[str, NDArray[Any]], source: Source) -> None:
    """Refuse sweeps with several directions or pivots, or with a drive angle in degrees or against the direction."""
    direction, angle = values["direction"], values["drive_angle"]
    forward = direction == "forward"
    impossible = ~(forward | (direction == "backward"))
    if impossible.any():
        sample = int(np.argmax(impossible))
        raise source.cell_error(
            sample, "direction", f"{str(direction[sample])!r} is no direction: write 'forward' or 'backward'"
        )
    beyond = (angle > 2 * math.pi) | (angle < -2 * math.pi)
    if beyond.any():
        sample = int(np.argmax(beyond))
        what = (
            f"{float(angle[sample])!r} is more than a turn (2π), so the angles look like degrees: convert the column "
            "to radians, with numpy.radians or times 0.017453292519943295"
        )
        if source.names:
            origin = f"{source.origins.get('drive_angle', 'drive_angle')}[deg]"
            what += (
                f", or state its unit, as in columns={{'drive_angle': {origin!r}}} of read_record, on the command line "
                f"--column {shlex.quote(f'drive_angle={origin}')}"
            )
        raise source.cell_error(sample, "drive_angle", what)
    for rows in _sweeps(values["sweep"]):
        first, last = _ends(rows)
        sweep = int(values["sweep"][first])
        for name, column, part in (
            ("direction", forward, "motion of the drive"),
            ("base_x", values["base_x"], "position of the pivot"),
            ("base_y", values["base_y"], "position of the pivot"),
        ):
            differs = column[rows] != column[first]
            if differs.any():
                other = first + int(np.argmax(differs)) if isinstance(rows, slice) else int(rows[np.argmax(differs)])
                one, two = values[name][first].item(), values[name][other].item()
                raise source.error(
                    f"sweep {sweep} mixes two values of {name!r}, {one!r} ({source.row(first)}) and {two!r} "
                    f"({source.row(other)}): give each {part} a sweep number of its own"
                )
        sense = 1 if forward[first] else -1
        if _runs_backwards(angle[rows], sense):
            raise source.error(
                f"sweep {sweep} is labelled {DIRECTIONS[sense < 0]!r}, but its drive angle "
                f"{'decreases' if sense > 0 else 'increases'}, from {float(angle[first])!r} rad ({source.row(first)}) "
                f"to {float(angle[last])!r} rad ({source.row(last)}): label it {DIRECTIONS[sense > 0]!r}, or put its "
                "samples in the order in which they were measured"
            )


def _sweeps(sweep: NDArray[np.int64]) -> Iterator[slice | Index]:
    """Yield the rows of each sweep in the order of measurement, as slices if sweeps are contiguous."""
    steps = np.flatnonzero(sweep[1:] != sweep[:-1]) + 1
    numbers = sweep[np.concatenate(([0], steps))]
    if np.unique(numbers).size == numbers.size:
        ends = [0, *steps.tolist(), sweep.size]
        yield from (slice(begin, end) for begin, end in pairwise(ends))
    else:
        order = np.argsort(sweep, kind="stable")
        yield from np.split(order, np.flatnonzero(np.diff(sweep[order])) + 1)


def _ends(rows: slice | Index) -> tuple[int, int]:
    """Return the first and the last row of a sweep."""
    return (rows.start, rows.stop - 1) if isinstance(rows, slice) else (int(rows[0]), int(rows[-1]))


def _runs_backwards(angle: Floats, sense: int) -> bool:
    """Return whether a sequence runs against its sense by more than the noise of the encoder (see `validate`)."""
    if angle.size < 2:
        return False
    angle = angle - angle[0]  # so that a drive at rest has exactly no trend
    time = np.arange(angle.size) - (angle.size - 1) / 2
    squares = _product(time, time)
    slope = sense * _product(time, angle) / squares
    if slope >= 0:
        return False
    if (sense * angle[1:] < sense * angle[:-1]).all():
        return True
    residual = angle - angle.mean() - sense * slope * time
    variance_of_slope = _product(residual, residual) / max(angle.size - 2, 1) / squares
    return slope < -6 * math.sqrt(variance_of_slope)


def _product(one: NDArray[np.floating[Any]], other: NDArray[np.floating[Any]]) -> float:
    """Scalar product without the threads of BLAS, for many short sweeps."""
    return float(np.einsum("i,i->", one, other))

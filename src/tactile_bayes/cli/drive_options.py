"""Options of drives: how they carry the base, and their steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from tactile_bayes.cli.command import Reads
from tactile_bayes.cli.numbers import numbers_asked
from tactile_bayes.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tactile_bayes.sweep import Carried, Drive

_STEPS = (0.001, 28.0)  # smallest and largest step of rotations [degrees]
Directions = Literal["both", "forward", "backward"]

Pivots = Annotated[
    list[str] | None, "A pivot, X,Y [m, or L]; may be repeated. By default one at 0,0.", typer.Option("--base")
]


def pivots_in(texts: Sequence[str] | None) -> list[tuple[float, float]]:
    """Return the coordinates of pivots."""
    return [(x, y) for x, y in (numbers_asked(text, "--base", 2) for text in texts or ["0,0"])]


@dataclass(frozen=True)
class CarryOptions:
    """Drives that carry the base."""

    carry: Annotated[
        list[str] | None,
        "Carry the base along a line, the rod clamped: X,Y,HEADING,DRIVE_ANGLE,TRAVEL, where it begins, its direction "
        "and the slope of the rod [degrees], and how far it moves, with lengths as of --base; or along any path: a CSV "
        "file with columns x, y [m, or L] and drive_angle [degrees], a line for each pose. May be repeated; there are "
        "rotations beside it only about each --base that is given.",
        Reads(),
    ] = None

    def carried(self, step: float | None = None) -> list[Carried]:
        """Return translations along lines, and motions along paths, of a step [length]."""
        return [_motion(Path(text), step) if _is_file(text) else _translation(text, step) for text in self.carry or []]


@dataclass(frozen=True)
class DriveOptions(CarryOptions):
    """Drives that are simulated, and their steps."""

    drive_step: Annotated[
        float | None,
        "Step of rotations [degrees], by default 1; of --carry [m, or L], by default a hundredth of the rod's length, "
        "or the poses if they are more than 8.",
    ] = None

    def drives(self, base: Sequence[str] | None, direction: Directions = "both") -> list[Drive]:
        """Return rotations about pivots, the origin if there is no drive, then the drives that carry the base."""
        from tactile_bayes.sweep import Rotation

        if self.carry and not base:
            if direction != "both":
                raise ParameterError("--direction is for rotations, and --carry says where the base goes: leave it out")
            return [*self.carried(self.drive_step)]
        if self.carry and self.drive_step is not None:
            raise ParameterError(
                "--drive-step: rotations and drives that carry the base have their default steps in one record; leave "
                "it out, or scan them one by one"
            )
        step = rotation_step(self.drive_step)
        return [*(Rotation(pivot, direction, step) for pivot in pivots_in(base)), *self.carried()]


def rotation_step(step: float | None) -> float | None:
    """Return the step of rotations [rad] that is asked for in degrees; ParameterError if no rotation has it."""
    low, high = _STEPS
    if step is not None and not low <= step <= high:
        raise ParameterError(f"--drive-step is {step:g}: give a step of rotations from {low:g} to {high:g} degrees")
    return None if step is None else math.radians(step)


def _is_file(text: str) -> bool:
    """Return True for the name of a file, which has no comma unless there is one of that name."""
    return "," not in text or Path(text).is_file()


def _translation(text: str, step: float | None) -> Carried:
    from tactile_bayes.sweep import Translation

    x, y, heading, angle, travel = numbers_asked(text, "--carry", 5)
    return Translation((x, y), math.radians(heading), math.radians(angle), travel, step)


def _motion(path: Path, step: float | None) -> Carried:
    from tactile_bayes.record.points import columns_in
    from tactile_bayes.sweep import Motion

    x, y, angles = columns_in(path, ("x", "y", "drive_angle"), "pose")
    return Motion(x, y, [math.radians(angle) for angle in angles], step)

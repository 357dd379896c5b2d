"""Options of drives: how they carry the base, and their steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tactile_bayes.cli.numbers import columns_in, numbers_asked

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tactile_bayes.sweep import Carried, Drive

__all__ = ["CarryOptions", "DriveOptions"]

_USUAL_STEP = 1.0
"""Step of rotations if no option gives one [degrees]."""


@dataclass(frozen=True)
class CarryOptions:
    """Drives that carry the base."""

    carry: Annotated[
        list[str] | None,
        typer.Option(
            help="Carry the base along a line, the rod clamped: X,Y,HEADING,DRIVE_ANGLE,TRAVEL, where it begins, its "
            "direction and the slope of the rod [degrees], and how far it moves, with lengths as of --base; may be "
            "repeated. There are rotations beside it only about each --base that is given."
        ),
    ] = None
    poses: Annotated[
        list[Path] | None,
        typer.Option(
            help="Carry the base along any path: a CSV file with columns x, y [m, or L] and drive_angle [degrees], a "
            "line for each pose; may be repeated.",
            dir_okay=False,
        ),
    ] = None

    @property
    def carries(self) -> bool:
        """True if an option carries the base."""
        return bool(self.carry or self.poses)

    @property
    def carried(self) -> list[Carried]:
        """Translations, then motions.

        Raises
        ------
        ParameterError
            If an option is no drive.
        """
        from tactile_bayes.sweep import Motion, Translation

        drives: list[Carried] = []
        for text in self.carry or []:
            x, y, heading, angle, travel = numbers_asked(text, "--carry", 5)
            drives.append(Translation((x, y), math.radians(heading), math.radians(angle), travel))
        for path in self.poses or []:
            x_of, y_of, angle_of = columns_in(path, ("x", "y", "drive_angle"), "pose")
            drives.append(Motion(x_of, y_of, [math.radians(angle) for angle in angle_of]))
        return drives


@dataclass(frozen=True)
class DriveOptions(CarryOptions):
    """Drives that are simulated, and their steps."""

    drive_step: Annotated[
        float | None,
        typer.Option(help="Step of rotations [degrees]; by default 1.", min=0.001, max=28.0),
    ] = None
    travel_step: Annotated[
        float | None,
        typer.Option(
            help="Step along --carry and --poses [m, or L]; by default a hundredth of the rod's length, or the poses "
            "if they are more than 8."
        ),
    ] = None

    def drives(self, pivots: Sequence[Sequence[float]]) -> list[Drive]:
        """Return rotations about pivots, then the drives that carry the base.

        Raises
        ------
        ParameterError
            If an option is no drive.
        """
        from tactile_bayes.sweep import Rotation

        return [*(Rotation((x, y)) for x, y in pivots), *self.carried]

    def step(self, drives: Sequence[Drive]) -> float | None:
        """Return the step of the drives [rad or length] if all of them have one.

        Raises
        ------
        ParameterError
            If the step is for other drives than there are, or there are drives of both kinds.
        """
        from tactile_bayes.errors import ParameterError
        from tactile_bayes.sweep import Rotation

        turns = [isinstance(drive, Rotation) for drive in drives]
        given = [name for name in ("drive_step", "travel_step") if getattr(self, name) is not None]
        for name, is_for, what in (("drive_step", any(turns), "rotations"), ("travel_step", not all(turns), "--carry")):
            option = f"--{name.replace('_', '-')}"
            if name in given and not is_for:
                raise ParameterError(f"{option} is for {what}, and there is none: leave it out")
            if name in given and any(turns) != all(turns):
                raise ParameterError(
                    f"{option}: rotations and drives that carry the base have their default steps in one record; leave "
                    "it out, or scan them one by one"
                )
        if all(turns):
            return math.radians(_USUAL_STEP if self.drive_step is None else self.drive_step)
        return self.travel_step

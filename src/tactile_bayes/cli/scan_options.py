"""Options of a scan: its contour, and its drives with their steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

import tactile_bayes as tb
from tactile_bayes.cli.command import Reads
from tactile_bayes.cli.numbers import assigned, numbers_asked
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
        return [_carried(text, step) for text in self.carry or []]


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
        return [*(tb.Rotation(pivot, direction, step) for pivot in pivots_in(base)), *self.carried()]


def rotation_step(step: float | None) -> float | None:
    """Return the step of rotations [rad] that is asked for in degrees; ParameterError if no rotation has it."""
    low, high = _STEPS
    if step is not None and not low <= step <= high:
        raise ParameterError(f"--drive-step is {step:g}: give a step of rotations from {low:g} to {high:g} degrees")
    return None if step is None else math.radians(step)


def _carried(text: str, step: float | None) -> Carried:
    """Return a motion along the poses of a file, whose name has no comma unless it is there, or a translation."""
    from tactile_bayes.record.points import columns_in

    if "," not in text or Path(text).is_file():
        x, y, angles = columns_in(Path(text), ("x", "y", "drive_angle"), "pose")
        return tb.Motion(x, y, [math.radians(angle) for angle in angles], step)
    left, height, heading, angle, travel = numbers_asked(text, "--carry", 5)
    return tb.Translation((left, height), math.radians(heading), math.radians(angle), travel, step)


@dataclass(frozen=True)
class ContourOptions:
    """A contour: a profile, one of a family, or measured points."""

    profile: Annotated[
        Literal["I", "II", "III", "IV"] | None, "Profile of Merker et al. 2018, scaled to the rod; by default II."
    ] = None
    distance: Annotated[float | None, "Height of the profile's vertex [rod lengths]; by default 0.5."] = None
    family: Annotated[
        str | None,
        "In place of a profile: parabola, circle, ellipse, power-law, or one for each flank: parabola/power-law.",
    ] = None
    parameter: Annotated[
        list[str] | None,
        "Parameter of the family, by the name and in the unit that infer prints: a=0.7, q=0.5; may be repeated. x_c is "
        "0 if it is left out.",
    ] = None
    points: Annotated[
        Path | None,
        "In place of both, measured points of a contour, which may scatter: a CSV file of x and y, with units in their "
        "names, like x [mm], or in m, or L; or a DXF drawing.",
        typer.Option(dir_okay=False),
    ] = None

    def contour(self, rod: tb.Rod) -> tb.contours.Contour:
        """Return the contour that the options choose, in the unit of the rod and scaled to its length."""
        import numpy as np

        from tactile_bayes.planning.plan import enlarged

        of_profile = self.profile is not None or self.distance is not None
        if of_profile + (self.family is not None) + (self.points is not None) > 1:
            raise ParameterError(
                "--profile with --distance, --family and --points exclude each other: give one of them"
            )
        if self.parameter and self.family is None:
            raise ParameterError("--parameter is for a --family: give one, like --family parabola")
        if self.points is not None:
            points = tb.record.read_points(self.points).in_unit("1" if rod.is_dimensionless else "m", str(self.points))
            return tb.contours.from_points(*np.concatenate(points).T)
        if self.family is not None:
            return _of_family(self.family, self.parameter)
        return enlarged(
            tb.contours.paper_profile(self.profile or "II", q=0.5 if self.distance is None else self.distance),
            rod.length,
        )


@dataclass(frozen=True)
class GaugeOptions:
    """A gauge: a known contour of a family."""

    family: Annotated[str, "Shape of the gauge, as for scan: circle, parabola, ellipse, power-law, or two with /."]
    parameter: Annotated[
        list[str] | None,
        "Parameter of the gauge in the record's coordinates, exactly known [m, or L]: r=0.01, q=0.05; may be repeated. "
        "x_c is 0 if it is left out.",
    ] = None

    @property
    def contour(self) -> tb.contours.Contour:
        """The contour of the gauge."""
        return _of_family(self.family, self.parameter)


def _of_family(name: str, options: Sequence[str] | None) -> tb.contours.Contour:
    from tactile_bayes.contours.families import family_named

    family = family_named(name)
    if family.roughness:
        raise ParameterError(f"--family {name}: a few parameters do not define such a contour, so give --points")
    values = {"x_c": 0.0}
    for parameter, value in assigned("--parameter", options, known=family.parameters).items():
        (values[parameter],) = numbers_asked(value, f"--parameter {parameter}", 1)
    absent = [parameter for parameter in family.parameters if parameter not in values]
    if absent:
        like = " ".join(f"--parameter {parameter}=..." for parameter in absent)
        raise ParameterError(f"--family {name} takes {', '.join(family.parameters)}: give {like} as well")
    return family.contour(values)

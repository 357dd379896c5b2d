"""Options that choose the contour that is scanned."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from tactile_bayes.cli.numbers import assigned, numbers_asked
from tactile_bayes.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tactile_bayes.contours import Contour
    from tactile_bayes.mechanics.rods.rod import Rod


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

    def contour(self, rod: Rod) -> Contour:
        """Return the contour that the options choose, in the unit of the rod and scaled to its length."""
        import numpy as np

        from tactile_bayes.contours import from_points, paper_profile
        from tactile_bayes.planning.family_parameters import enlarged
        from tactile_bayes.record.points import read_points

        of_profile = self.profile is not None or self.distance is not None
        if of_profile + (self.family is not None) + (self.points is not None) > 1:
            raise ParameterError(
                "--profile with --distance, --family and --points exclude each other: give one of them"
            )
        if self.parameter and self.family is None:
            raise ParameterError("--parameter is for a --family: give one, like --family parabola")
        if self.points is not None:
            points = read_points(self.points).in_unit("1" if rod.is_dimensionless else "m", str(self.points))
            return from_points(*np.concatenate(points).T)
        if self.family is not None:
            return _of_family(self.family, self.parameter)
        return enlarged(
            paper_profile(self.profile or "II", q=0.5 if self.distance is None else self.distance), rod.length
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
    def contour(self) -> Contour:
        """The contour of the gauge."""
        return _of_family(self.family, self.parameter)


def _of_family(name: str, options: Sequence[str] | None) -> Contour:
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

"""Options that choose the contour that is scanned."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tactile_bayes.cli.numbers import assigned, numbers_asked

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tactile_bayes.contours import Contour

__all__ = ["ContourOptions", "GaugeOptions"]


@dataclass(frozen=True)
class ContourOptions:
    """A contour: a profile, one of a family, or measured points."""

    profile: Annotated[
        Literal["I", "II", "III", "IV"] | None,
        typer.Option(help="Profile of Merker et al. 2018, scaled to the rod; by default II."),
    ] = None
    distance: Annotated[
        float | None, typer.Option(help="Height of the profile's vertex [rod lengths]; by default 0.5.")
    ] = None
    family: Annotated[
        str | None,
        typer.Option(
            help="In place of a profile: parabola, circle, ellipse, power-law, or one for each flank: "
            "parabola/power-law."
        ),
    ] = None
    parameter: Annotated[
        list[str] | None,
        typer.Option(
            help="Parameter of the family, by the name and in the unit that infer prints: a=0.7, q=0.5; may be "
            "repeated. x_c is 0 if it is left out."
        ),
    ] = None
    points: Annotated[
        Path | None,
        typer.Option(
            help="In place of both, measured points of a contour: a CSV file of x and y [m, or L], which may scatter.",
            dir_okay=False,
        ),
    ] = None

    def contour(self, rod_length: float) -> Contour:
        """Return the contour that the options choose, scaled to the rod's length.

        Raises
        ------
        ParameterError
            If the options choose more than one contour, or lack a parameter.
        ContourError
            If there is no such contour.
        """
        from tactile_bayes.contours import from_points, paper_profile
        from tactile_bayes.errors import ParameterError
        from tactile_bayes.planning.family_parameters import enlarged

        of_profile = self.profile is not None or self.distance is not None
        if of_profile + (self.family is not None) + (self.points is not None) > 1:
            raise ParameterError(
                "--profile with --distance, --family and --points exclude each other: give one of them"
            )
        if self.parameter and self.family is None:
            raise ParameterError("--parameter is for a --family: give one, like --family parabola")
        if self.points is not None:
            return from_points(*_read_points(self.points))
        if self.family is not None:
            return _of_family(self.family, self.parameter)
        return enlarged(
            paper_profile(self.profile or "II", q=0.5 if self.distance is None else self.distance), rod_length
        )


@dataclass(frozen=True)
class GaugeOptions:
    """A gauge: a known contour of a family."""

    family: Annotated[
        str,
        typer.Option(help="Shape of the gauge, as for scan: circle, parabola, ellipse, power-law, or two with /."),
    ]
    parameter: Annotated[
        list[str] | None,
        typer.Option(
            help="Parameter of the gauge in the record's coordinates, exactly known [m, or L]: r=0.01, q=0.05; may be "
            "repeated. x_c is 0 if it is left out."
        ),
    ] = None

    @property
    def contour(self) -> Contour:
        """The contour of the gauge.

        Raises
        ------
        ParameterError
            If the family is unknown, or lacks a parameter.
        ContourError
            If there is no such contour.
        """
        return _of_family(self.family, self.parameter)


def _of_family(name: str, options: Sequence[str] | None) -> Contour:
    from tactile_bayes.contours.families import family_named
    from tactile_bayes.errors import ParameterError

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


def _read_points(path: Path) -> tuple[list[float], list[float]]:
    """Read the columns x and y of a file, or its first two; the first line may hold their names."""
    import csv

    from tactile_bayes.errors import ParameterError

    with open(path, encoding="utf-8-sig", newline="") as file:
        lines = [line for line in file if line.strip() and not line.lstrip().startswith("#")]
    sample = "".join(lines[:2])
    delimiter = next((mark for mark in ";\t," if mark in sample), " ")
    rows = [
        [cell.strip() for cell in row]
        for row in csv.reader(lines, delimiter=delimiter, skipinitialspace=delimiter == " ")
    ]
    places = (0, 1)
    if rows and _pair(rows[0], places, delimiter) is None:
        names = [name.lower().partition("[")[0].strip() for name in rows[0]]
        if "x" in names and "y" in names:
            places = (names.index("x"), names.index("y"))
        rows = rows[1:]
    pairs: list[Any] = [_pair(row, places, delimiter) for row in rows]
    if not pairs:
        raise ParameterError(f"{path}: there are no points in it: give lines of x and y, like 0.1,0.52")
    if None in pairs:
        bad = rows[pairs.index(None)]
        raise ParameterError(f"{path}: {delimiter.join(bad)!r} is no point: give x and y, like 0.1,0.52")
    return [x for x, _ in pairs], [y for _, y in pairs]


def _pair(row: Sequence[str], places: tuple[int, int], delimiter: str) -> tuple[float, float] | None:
    cells = [row[place] if place < len(row) else "" for place in places]
    try:
        one, two = (float(cell if delimiter == "," else cell.replace(",", ".")) for cell in cells)
    except ValueError:
        return None
    return one, two

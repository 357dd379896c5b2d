"""Options that choose the contour that is scanned."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tactile_bayes.contours import Contour

__all__ = ["Distance", "Family", "Parameters", "Points", "Profile", "contour_asked"]

Profile = Annotated[
    Literal["I", "II", "III", "IV"] | None,
    typer.Option(help="Profile of Merker et al. 2018, scaled to the rod; by default II."),
]
Distance = Annotated[
    float | None, typer.Option(help="Of the profile's vertex above the x axis [rod lengths]; by default 0.5.")
]
Family = Annotated[
    str | None,
    typer.Option(
        help="In place of a profile: parabola, circle, ellipse, power-law, or one for each flank: parabola/power-law."
    ),
]
Parameters = Annotated[
    list[str] | None,
    typer.Option(
        help="Of the family, by the names and in the units that infer prints: a=0.7, q=0.5; give it again for another. "
        "x_c is 0 if it is left out."
    ),
]
Points = Annotated[
    Path | None,
    typer.Option(
        help="In place of both, measured points of a contour: a CSV file of x and y [m, or L], which may scatter.",
        dir_okay=False,
    ),
]


def contour_asked(
    profile: Literal["I", "II", "III", "IV"] | None,
    distance: float | None,
    family: str | None,
    parameters: Sequence[str] | None,
    points: Path | None,
    *,
    rod_length: float,
) -> Contour:
    """The contour that the options choose.

    Raises
    ------
    ParameterError
        If they choose more than one, or not all of it.
    ContourError
        If there is no such contour.
    """
    from tactile_bayes.contours import from_points, paper_profile
    from tactile_bayes.errors import ParameterError
    from tactile_bayes.planning.family_parameters import enlarged

    of_profile = profile is not None or distance is not None
    if of_profile + (family is not None) + (points is not None) > 1:
        raise ParameterError("--profile with --distance, --family and --points exclude each other: give one of them")
    if parameters and family is None:
        raise ParameterError("--parameter is for a --family: give one, like --family parabola")
    if points is not None:
        return from_points(*_read_points(points))
    if family is not None:
        return _of_family(family, parameters or [])
    return enlarged(paper_profile(profile or "II", q=0.5 if distance is None else distance), rod_length)


def _of_family(name: str, options: Sequence[str]) -> Contour:
    from tactile_bayes.contours.families import family_named
    from tactile_bayes.errors import ParameterError

    family = family_named(name)
    if family.roughness:
        raise ParameterError(f"--family {name}: such a contour is no few numbers, so give --points")
    values = {"x_c": 0.0, **_numbers(options, family.parameters)}
    absent = [parameter for parameter in family.parameters if parameter not in values]
    if absent:
        like = " ".join(f"--parameter {parameter}=..." for parameter in absent)
        raise ParameterError(f"--family {name} takes {', '.join(family.parameters)}: give {like} as well")
    return family.contour(values)


def _numbers(options: Sequence[str], known: Sequence[str]) -> Mapping[str, float]:
    from tactile_bayes.cli.numbers import numbers_asked
    from tactile_bayes.errors import ParameterError

    values: dict[str, float] = {}
    for option in options:
        name, equals, value = (part.strip() for part in option.partition("="))
        if not equals or name not in known:
            raise ParameterError(f"--parameter {option}: write NAME=VALUE, with one of {', '.join(known)}")
        if name in values:
            raise ParameterError(f"--parameter {name}= is given twice: keep one of them")
        (values[name],) = numbers_asked(value, f"--parameter {name}", 1)
    return values


def _read_points(path: Path) -> tuple[list[float], list[float]]:
    """The columns x and y of a file, or its first two; a line without numbers in them may be the head."""
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

"""Files of points and of poses: polylines in CSV or DXF with their unit of length, and plain columns of numbers."""

from __future__ import annotations

import csv
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_kind, check_path
from tactile_bayes.errors import ParameterError
from tactile_bayes.record.csv_header import column_described
from tactile_bayes.record.encoding import not_utf8
from tactile_bayes.record.origin import stem_and_unit
from tactile_bayes.record.parsing import number_in
from tactile_bayes.record.quantity import accepted_units, same_quantity

_CALLED = {"m": "a unit of length", "1": "rod lengths"}
_CURVES = "LINE LWPOLYLINE POLYLINE ARC CIRCLE ELLIPSE SPLINE"
# Size of a unit of the drawing, by its number in $INSUNITS; 0 is none.
_METRES = {1: 0.0254, 2: 0.3048, 4: 1e-3, 5: 1e-2, 6: 1.0, 13: 1e-6, 14: 0.1}
_COARSENESS = 1e-5  # largest distance of a curve from its segments, as a share of its size
_BEZIERS = 64  # number of Bézier curves for an arc, which then is off by 1e-9 of its radius; a single one by 3e-4


class Points(NamedTuple):
    """Points of a file."""

    pieces: list[Floats]  # shape (n, 2) each, or (n, 3) with a column beside x and y, in metres if a unit is stated
    unit: str  # "m", "1" for rod lengths, or "" if the file states none

    def in_unit(self, unit: str, name: str) -> list[Floats]:
        """Return the pieces in "m" or "1", as which numbers without a unit are taken; the name is for the message."""
        if self.unit not in ("", unit):
            raise ParameterError(f"{name} is in {_CALLED[self.unit]}, and {_CALLED[unit]} are wanted: convert it")
        return self.pieces


def read_points(path: str | os.PathLike[str], *, beside: str = "") -> Points:
    """Read the points of a contour.

    Parameters
    ----------
    path : path-like
        A CSV file with columns x and y, or with two columns, and a line for each point. A unit is stated in the names,
        "x [mm]", or in lines "# column x: number [mm]"; "L" stands for rod lengths. Or a DXF drawing, of which the
        lines, polylines, arcs, circles, ellipses and splines in model space are read, on layers that are shown; this
        takes the package ezdxf.
    beside : str
        Name of a further column of lengths, which is read if a CSV file has it.

    Returns
    -------
    Points

    Raises
    ------
    ParameterError
        If there are no points, a line is no point, or a unit is none of length.
    OSError
        If the file cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "points.csv"
    ...     written = path.write_text("x [mm],y [mm]\\n0,100\\n50,106\\n", encoding="utf-8")
    ...     points = read_points(path)
    >>> points.unit, points.pieces[0].tolist()
    ('m', [[0.0, 0.1], [0.05, 0.106]])
    """
    check_kind("beside", beside, str, 'give the name of a column, or ""')
    file = check_path("path", path, "give a path, like 'points.csv' or 'part.dxf'")
    if file.suffix.lower() == ".dxf":
        pieces, scale = curves_in(file)
        return Points([scale * piece for piece in pieces], "m") if scale else Points(pieces, "")
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise ParameterError(f"{path}: {not_utf8(error)}") from error
    described = dict(filter(None, map(column_described, lines)))
    wanted = ("x", "y", beside) if beside else ("x", "y")
    rows_of_file = [line for line in lines if line.strip() and not line.lstrip().startswith("#")]
    names, rows = _table_of(rows_of_file, path, wanted)
    scales = [_scale(described.get(name) or stem_and_unit(name)[1] or "", path) for name in names]
    if len({unit for _, unit in scales}) > 1:
        raise ParameterError(f"{path}: {', '.join(map(repr, names))} state different units: write x [mm],y [mm]")
    return Points([rows * [scale for scale, _ in scales]], scales[0][1])


def columns_in(path: Path, names: Sequence[str], what: str) -> list[Floats]:
    """Return columns of numbers of a CSV file, a line for each of what they are, or refuse it."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ParameterError(f"{path}: the {what}s cannot be read ({error})") from error
    columns = []
    for name in names:
        values = [number_in(row.get(name) or "") for row in rows]
        if not values or None in values:
            wrong = f"{what} {values.index(None) + 1 if values else 0} has no number in column {name!r}"
            way = f"write a line '{','.join(names)}', then a {what} in each line, with decimal points"
            raise ParameterError(f"{path}: {wrong}: {way}")
        columns.append(np.array(values, dtype=float))
    return columns


def _scale(unit: str, path: object) -> tuple[float, str]:
    """Return the size of a unit of length, and the unit of what is multiplied by it."""
    if unit in ("", "1", "L"):
        return 1.0, "1" if unit else ""
    pair = same_quantity(unit, "m")
    if pair is None:
        raise ParameterError(f"{path}: points are in [{unit}]: give {accepted_units('m')}, or L for rod lengths")
    return float(pair[0].scale), "m"


def _table_of(lines: Sequence[str], path: object, wanted: Sequence[str]) -> tuple[list[str], Floats]:
    """Return the names of the wanted columns that there are, and their numbers; the first line may hold names."""
    delimiter = next((mark for mark in ";\t," if mark in "".join(lines[:2])), " ")
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=delimiter == " ")
    rows = [[cell.strip() for cell in row] for row in reader]
    names, places = ["x", "y"], [0, 1]
    if rows and _point(rows[0], places, delimiter) is None:
        stems = [stem_and_unit(name)[0].lower() for name in rows[0]]
        if "x" in stems and "y" in stems:
            places = [stems.index(name) for name in wanted if name in stems]
        elif len(stems) > 2:
            raise ParameterError(f"{path}: none of its columns are x and y ({', '.join(rows[0])}): name them so")
        names = [rows[0][place] if place < len(rows[0]) else "" for place in places]
        rows = rows[1:]
    points = [_point(row, places, delimiter) for row in rows]
    if None in points:
        bad = rows[points.index(None)]
        raise ParameterError(f"{path}: {delimiter.join(bad)!r} is no point: give x and y, like 0.1,0.52")
    if not points:
        raise ParameterError(f"{path}: there are no points in it: give lines of x and y, like 0.1,0.52")
    return names, np.array(points, dtype=float)


def _point(row: Sequence[str], places: Sequence[int], delimiter: str) -> list[float] | None:
    cells = [row[place] if place < len(row) else "" for place in places]
    found = [number_in(cell if delimiter == "," else cell.replace(",", ".")) for cell in cells]
    numbers = [number for number in found if number is not None and np.isfinite(number)]
    return numbers if len(numbers) == len(cells) else None


# ---- drawings in DXF, by the package ezdxf


def curves_in(path: Path) -> tuple[list[Floats], float]:
    """Return the curves of a drawing as polylines, shape (n, 2) each, and its unit [m], 0 for none."""
    try:
        import ezdxf
    except ImportError as error:
        what = "drawings are read by the package ezdxf, which is not installed: pip install 'tactile-bayes[dxf]'"
        raise ParameterError(f"{path}: {what}") from error
    try:
        drawing: Any = ezdxf.readfile(path)  # type: ignore[attr-defined]
    except (ezdxf.DXFError, UnicodeDecodeError) as error:  # type: ignore[attr-defined]
        raise ParameterError(f"{path}: this is no drawing in DXF, or it is damaged ({error})") from error
    except OSError as error:
        if error.errno is not None:
            raise
        raise ParameterError(f"{path}: this is no drawing in DXF ({error})") from error
    unit = int(drawing.header.get("$INSUNITS", 0))
    if unit and unit not in _METRES:
        raise ParameterError(f"{path}: its unit is number {unit} of $INSUNITS: draw in mm, or without a unit")
    pieces = [piece for curve in drawing.modelspace().query(_CURVES) if (piece := _points_of(curve)) is not None]
    if not pieces:
        found = Counter(each.dxftype() for each in drawing.modelspace())
        there = ", ".join(f"{count} {kind}" for kind, count in found.items()) or "nothing"
        what = f"no curve is shown in its model space ({there}): draw a polyline, and explode blocks"
        raise ParameterError(f"{path}: {what}")
    return pieces, _METRES.get(unit, 0.0)


def _points_of(curve: Any) -> Floats | None:
    """Return the points of a curve; None if it is hidden, or a mesh."""
    from ezdxf import path

    layers, layer = curve.doc.layers, curve.dxf.layer
    if layer in layers and (layers.get(layer).is_off() or layers.get(layer).is_frozen()):
        return None
    if curve.dxftype() == "POLYLINE" and not (curve.is_2d_polyline or curve.is_3d_polyline):
        return None
    way = path.make_path(curve, segments=_BEZIERS)
    size = float(np.ptp([(point.x, point.y) for point in way.control_vertices()], axis=0).max())
    flat = curve if curve.dxftype() == "SPLINE" else way  # a path holds it coarsely
    points = np.array([(point.x, point.y) for point in flat.flattening(max(_COARSENESS * size, 1e-300))])
    return points if len(points) > 1 and size > 0.0 else None

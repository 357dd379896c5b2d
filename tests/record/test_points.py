"""Files of points: CSV and DXF, with their units."""

import sys

import ezdxf
import numpy as np
import pytest

from helpers.refusals import refused
from tactile_bayes.errors import ParameterError
from tactile_bayes.record import read_points

POINTS = np.array([[-0.1, 0.12], [0.0, 0.1], [0.1, 0.13]])


@pytest.mark.parametrize(
    ("head", "scale", "unit"),
    [
        ("", 1.0, ""),
        ("x,y", 1.0, ""),
        ("x [mm],y [mm]", 1e3, "m"),
        ("X (cm),Y (cm)", 1e2, "m"),
        ("x [L],y [L]", 1.0, "1"),
        ("# column x: number [mm] across\n# column y: number [mm] up\nx,y", 1e3, "m"),
    ],
)
def test_units_are_those_of_the_names_or_of_the_header(tmp_path, head, scale, unit):
    path = tmp_path / "points.csv"
    lines = [f"{x!r},{y!r}" for x, y in (scale * POINTS).tolist()]
    path.write_text("\n".join(["# of a probe", *([head] if head else []), *lines]), encoding="utf-8")
    found = read_points(path)
    assert found.unit == unit
    assert found.pieces[0] == pytest.approx(POINTS, rel=1e-12)
    assert found.in_unit(unit or "m", "it") is found.pieces
    if unit:
        with refused(ParameterError, "it is in", "convert"):
            found.in_unit("1" if unit == "m" else "m", "it")


def test_each_column_has_its_unit_and_place(tmp_path):
    path = tmp_path / "points.csv"
    path.write_text("no;y [m];x [mm]\n1;0,12;-100\n2;0,13;100\n", encoding="utf-8")
    assert read_points(path).pieces[0] == pytest.approx(POINTS[[0, 2]], rel=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no points"),
        ("x,y\n1,\n", "'1,' is no point"),
        ("x,y\n1,2\n1,nan\n", "'1,nan' is no point"),
        ("no,height,width\n1,2,3\n", "columns are x and y"),
        ("x [mm],y\n1,2\n", "different units"),
        ("x [N],y [N]\n1,2\n", "points are in [N]"),
    ],
)
def test_what_holds_no_points_is_refused(tmp_path, text, words):
    path = tmp_path / "points.csv"
    path.write_text(text, encoding="utf-8")
    with refused(ParameterError, "points.csv", words):
        read_points(path)
    path.write_bytes(b"x,y [\xb5m]\n")
    with refused(ParameterError, "points.csv", "UTF-8"):
        read_points(path)


@pytest.mark.parametrize(("unit", "scale", "known"), [(4, 1e3, "m"), (1, 1 / 0.0254, "m"), (6, 1.0, "m"), (0, 1.0, "")])
def test_curves_of_a_drawing_are_polylines_in_its_unit(tmp_path, unit, scale, known):
    drawing, path = ezdxf.new(units=unit), tmp_path / "part.DXF"
    space = drawing.modelspace()
    space.add_lwpolyline(scale * POINTS)
    space.add_arc((0.0, 0.0), 0.1 * scale, 180.0, 360.0)
    space.add_lwpolyline([(-0.1 * scale, 0.0, 1.0), (0.1 * scale, 0.0, 0.0)], format="xyb")
    angle = np.linspace(-2.0, -1.0, 41)
    space.add_spline(0.1 * scale * np.column_stack([np.cos(angle), np.sin(angle)]))
    space.add_circle((0.0, 0.0), 0.1 * scale)
    space.add_text("part")
    space.add_line((0.0, 0.0), (1.0, 1.0), {"layer": "hidden"})
    drawing.layers.add("hidden").off()
    drawing.saveas(path)
    found = read_points(path)
    assert found.unit == known
    line, *round_ones = found.pieces
    assert line == pytest.approx(POINTS, rel=1e-9)
    assert len(round_ones) == 4
    for piece, tolerance in zip(round_ones, (1e-8, 1e-8, 1e-3, 1e-8), strict=True):  # the spline is none exactly
        assert np.hypot(*piece.T) == pytest.approx(np.full(len(piece), 0.1), rel=tolerance)
        assert np.hypot(*(0.5 * (piece[1:] + piece[:-1])).T).min() > 0.1 * (1.0 - tolerance - 5e-5)


def test_what_is_no_drawing_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "part.dxf"
    path.write_text("x,y\n1,2\n", encoding="utf-8")
    with refused(ParameterError, "part.dxf", "no drawing in DXF"):
        read_points(path)
    drawing = ezdxf.new()
    drawing.modelspace().add_text("part")
    for unit, words in ((4, ["no curve is shown", "1 TEXT"]), (3, ["number 3 of $INSUNITS"])):  # mm, miles
        drawing.units = unit
        drawing.saveas(path)
        with refused(ParameterError, *words):
            read_points(path)
    with pytest.raises(FileNotFoundError):
        read_points(tmp_path / "none.dxf")
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with refused(ParameterError, "not installed", "tactile-bayes[dxf]"):
        read_points(path)

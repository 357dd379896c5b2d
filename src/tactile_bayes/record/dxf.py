"""Curves of DXF drawings, by the package ezdxf."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError

_CURVES = "LINE LWPOLYLINE POLYLINE ARC CIRCLE ELLIPSE SPLINE"
# Size of a unit of the drawing, by its number in $INSUNITS; 0 is none.
_METRES = {1: 0.0254, 2: 0.3048, 4: 1e-3, 5: 1e-2, 6: 1.0, 13: 1e-6, 14: 0.1}
_COARSENESS = 1e-5  # largest distance of a curve from its segments, as a share of its size
_BEZIERS = 64  # number of Bézier curves for an arc, which then is off by 1e-9 of its radius; a single one by 3e-4


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

"""Another contour over an inferred one, and the distance between them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_kind, check_optional, check_path, check_probability, check_switch
from tactile_bayes.contours.polyline import Polyline
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.result import read_result
from tactile_bayes.record.points import read_points
from tactile_bayes.uncertainty.band import contour_band, length_unit
from tactile_bayes.uncertainty.rod_reach import reach


@dataclass(frozen=True, eq=False)
class Overlay:
    """Another contour, in the laboratory frame and the unit of length of a record.

    Parameters
    ----------
    name : str
        Name of its file or run.
    polyline : Polyline
        The contour; of a run the median of its band.
    band : xr.Dataset, optional
        Band of a run, from `contour_band`.
    is_unit_assumed : bool
        True if its file states no unit, so that its numbers are taken in the unit of the record.

    Examples
    --------
    >>> Overlay("part", Polyline([[(-0.1, 0.1), (0.1, 0.1)]])).polyline
    Polyline(1 pieces, 2 points)
    """

    name: str
    polyline: Polyline
    band: xr.Dataset | None = None
    is_unit_assumed: bool = False

    def __post_init__(self) -> None:
        check_kind("name", self.name, str, "give a text")
        check_kind("polyline", self.polyline, Polyline, "give a Polyline")
        check_optional("band", self.band, xr.Dataset, "give what contour_band returned")
        check_switch("is_unit_assumed", self.is_unit_assumed)

    @classmethod
    def of_band(cls, name: str, band: xr.Dataset) -> Overlay:
        """Return the overlay of another run; InferenceError if its band has no median."""
        known = np.flatnonzero(np.isfinite(band["median"].values))
        if known.size < 2:
            raise InferenceError(f"{name}: no contour reaches all of what was touched: there is no band to lay over")
        points = np.column_stack([band["x"].values, band["median"].values])
        return cls(name, Polyline((points[known],)), band)


class Distance(NamedTuple):
    """Distance of the median of a band from another contour, over the stretch that both cover; `overlay_distance`."""

    rms: float
    largest: float
    at: float
    share_inside: float
    left: float
    right: float


def read_overlay(path: str | os.PathLike[str], posterior: xr.DataTree, probability: float = 0.95) -> Overlay:
    """Read a contour that is laid over that of a posterior.

    Parameters
    ----------
    path : path-like
        Folder of a run, or a file of points in the laboratory frame of the record: CSV, or DXF (`record.read_points`).
    posterior : xr.DataTree
        Posterior of the record, whose unit of length numbers without a unit have.
    probability : float
        Probability of the band of a run.

    Raises
    ------
    ParameterError, InferenceError
        If the file holds no points, or in another kind of unit than the record; if the folder holds no run.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> posterior = xr.DataTree()
    >>> posterior.attrs["units"] = "SI"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "points.csv"
    ...     written = path.write_text("x [mm],y [mm]\\n0,100\\n50,106\\n", encoding="utf-8")
    ...     read_overlay(path, posterior).name
    'points.csv'
    """
    given = check_path("path", path, "give the folder of a run, or a file, like 'points.csv' or 'part.dxf'")
    check_probability("probability", probability)
    check_kind("posterior", posterior, xr.DataTree, "give what infer_contour returned")
    unit = length_unit(posterior)["units"]
    if not given.is_dir():
        points = read_points(given)
        polyline = Polyline(tuple(points.in_unit(unit, str(given))))
        return Overlay(given.name, polyline, is_unit_assumed=not points.unit)
    other = read_result(given / "posterior.nc")
    if length_unit(other)["units"] != unit:
        raise InferenceError(f"{given} is in SI, and the run below it in rod lengths, or the other way round")
    return Overlay.of_band(given.resolve().name, contour_band(other, reach(other), probability))


def overlay_distance(band: xr.Dataset, overlay: Overlay) -> Distance:
    """Return the distance of the median of a band from another contour.

    It is taken at the positions of the band that the rod reaches, normal to the other contour, and not beyond its ends.

    Parameters
    ----------
    band : xr.Dataset
        From `contour_band`, at evenly spaced x.
    overlay : Overlay
        The other contour.

    Returns
    -------
    Distance
        rms over x, the largest and its x ("at"), share_inside, the share of x at which the other contour is inside the
        band, and the ends of the stretch, left and right [length]; NaN if the two share none.

    Examples
    --------
    >>> flat = {"lower": ("x", [0.0, 0.0]), "median": ("x", [0.1, 0.1]), "upper": ("x", [0.2, 0.2])}
    >>> band = xr.Dataset(flat | {"status": ("x", ["ok", "ok"])}, coords={"x": [0.0, 1.0]})
    >>> found = overlay_distance(band, Overlay("part", Polyline([[(-1.0, 0.15), (2.0, 0.15)]])))
    >>> round(found.rms, 12), found.share_inside
    (0.05, 1.0)
    """
    check_kind("band", band, xr.Dataset, "give what contour_band returned")
    check_kind("overlay", overlay, Overlay, "give what read_overlay returned")
    x, lower, median, upper = (band[name].values for name in ("x", "lower", "median", "upper"))
    reached = np.where(band["status"].values == "ok", median, np.nan)
    away: Floats = overlay.polyline.distance(x, reached)
    height = overlay.polyline.height(x, reached)
    covered, known = np.isfinite(away), np.isfinite(height)
    if not covered.any():
        return Distance(*[np.nan] * 6)
    inside = float(np.mean((lower <= height)[known] & (height <= upper)[known])) if known.any() else np.nan
    most = int(np.nanargmax(away))
    ends = x[covered]
    rms = float(np.sqrt(np.mean(away[covered] ** 2)))
    return Distance(rms, float(away[most]), float(x[most]), inside, float(ends[0]), float(ends[-1]))

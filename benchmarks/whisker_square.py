"""Draws what a sweep of a real whisker past a square with rounded corners tells of it, over the square's drawing.

    python -m benchmarks.whisker_square POSTERIOR

The posterior is that of `docs/howto/gauge.md`; beside it the figure is left as square.png, and how much of the touched
contour has the drawing in its band is printed. The drawing is shifted, and not turned.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.optimize import least_squares

import tactile_bayes as tb

RADIUS = 10e-3 + 0.12e-3  # of the corner and of the whisker [m]; the flanks are at 45°
PLACES = 101  # along what was touched
BAND, DRAWN = {"color": "#0072B2", "alpha": 0.35, "linewidth": 0}, {"color": "black", "linewidth": 1.0}


def drawing(x: np.ndarray) -> np.ndarray:
    """Height of the drawing above its lowest point [m]."""
    end = RADIUS / np.sqrt(2.0)
    beyond = np.maximum(np.abs(x) - end, 0.0)
    return RADIUS - np.sqrt(RADIUS**2 - np.clip(x, -end, end) ** 2) + beyond


def distances(band: xr.Dataset, shift: np.ndarray) -> np.ndarray:
    """Distances of the shifted drawing from the band's reference, along its normals [m]."""
    along = np.linspace(-3e-3, 3e-3, 601)
    x = band.x.values[:, None] - along * np.sin(band.slope_angle.values[:, None]) - shift[0]
    above = band.y.values[:, None] + along * np.cos(band.slope_angle.values[:, None]) - shift[1] - drawing(x)
    return np.array([np.interp(0.0, each, along) for each in above])


def compared(posterior: xr.DataTree) -> tuple[xr.Dataset, np.ndarray, np.ndarray]:
    """Return the band of the shape where it was touched and no draw ends, the drawing's shift, and its distances."""
    touched = tb.uncertainty.implied_contacts(posterior, draws=10)["posterior"].contact_x.median(("chain", "draw"))
    x = np.linspace(float(touched.min()), float(touched.max()), PLACES)
    band = tb.uncertainty.normal_band(posterior, x, 0.95, align="translation")
    band = band.isel(x=band.status.values == "ok")
    lowest = int(np.argmin(band.y.values))
    start = np.array([band.x.values[lowest], band.y.values[lowest]])
    shift = least_squares(lambda at: distances(band, at) - band["median"].values, start, x_scale=1e-3, diff_step=1e-3).x
    return band, shift, distances(band, shift)


def picture(band: xr.Dataset, shift: np.ndarray, off: np.ndarray) -> Figure:
    """Draw the band over the drawing, and their distances along the normals."""
    figure = Figure(figsize=(10.0, 3.8), layout="constrained")
    plane, along = figure.subplots(1, 2)
    edges = [1e3 * band[name].values for name in ("lower_x", "lower_y", "upper_x", "upper_y")]
    plane.fill(np.append(edges[0], edges[2][::-1]), np.append(edges[1], edges[3][::-1]), label="95 % band", **BAND)
    x = np.linspace(band.x.values[0] - 2e-3, band.x.values[-1] + 2e-3, 200)
    plane.plot(1e3 * x, 1e3 * (shift[1] + drawing(x - shift[0])), label="drawing", **DRAWN)
    plane.set(xlabel="$x$ / mm", ylabel="$y$ / mm", aspect="equal")
    plane.legend(frameon=False, loc="upper left")
    slope = np.degrees(band.slope_angle.values)
    way = 1e3 * np.append(0.0, np.cumsum(np.diff(band.x.values) / np.cos(np.radians(0.5 * (slope[1:] + slope[:-1])))))
    median = band["median"].values
    along.fill_between(way, 1e3 * (band.lower.values - median), 1e3 * (band.upper.values - median), **BAND)
    along.plot(way, 1e3 * (off - median), **DRAWN)
    along.set(xlabel="way along the contour / mm", ylabel="across it / mm", ylim=(-0.6, 0.6))
    return figure


def main() -> None:
    path = Path(sys.argv[1])
    band, shift, off = compared(tb.read_result(path))
    held = (off >= band.lower.values) & (off <= band.upper.values)
    wide = 5e5 * (band.upper.values - band.lower.values)
    slopes, rms = np.degrees(band.slope_angle.values[[0, -1]]).round(), 1e6 * np.std(off - band["median"].values)
    print(f"{band.x.size} of {PLACES} places, slopes of {slopes}°: the band of ± {wide.min():.0f} to", end=" ")
    print(f"{wide.max():.0f} µm holds at {held.mean():.0%}, {rms:.0f} µm rms")
    picture(band, shift, off).savefig(path.with_name("square.png"), dpi=110, bbox_inches="tight")


if __name__ == "__main__":
    main()

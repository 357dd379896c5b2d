"""The gap: the arc between the last contact of the forward sweep and that of the backward one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.contours.base import Locus
from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.contour import contours_of
from tactile_bayes.inference.result import contour_draws, contour_events
from tactile_bayes.uncertainty.band import central_levels, contour_band, length_unit
from tactile_bayes.uncertainty.offsets import heights_of

_GRID_POINTS = 101  # number of grid points of x across the gap


class Triangle(NamedTuple):
    """Region of a convex contour between two of its points with known tangents, for each of n contours.

    The contour lies below the chord and above both tangents.
    """

    left: Locus
    right: Locus
    apex_x: Floats
    apex_y: Floats
    # Distance of the apex from the chord, the largest distance that the contour can have from it; shape (n,).
    height: Floats
    width: Floats  # largest extent of the triangle in y; shape (n,)

    def between(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the lowest and highest y of the contour at x, each of shape (triangles, x); NaN beyond the ends."""
        left, right = self.left, self.right
        after, before = x - left.x[:, None], x - right.x[:, None]
        inside = (after >= 0.0) & (before <= 0.0) & np.isfinite(self.height)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            chord = left.y[:, None] + after * ((right.y - left.y) / (right.x - left.x))[:, None]
        from_left = left.y[:, None] + after * np.tan(left.slope_angle)[:, None]
        from_right = right.y[:, None] + before * np.tan(right.slope_angle)[:, None]
        lower = np.minimum(np.maximum(from_left, from_right), chord)
        return np.where(inside, lower, np.nan), np.where(inside, chord, np.nan)


def triangle(left: Locus, right: Locus) -> Triangle:
    """Return the triangle between two contacts of each of n contours; NaN where the left one is not on the left.

    With the chord of length ℓ and its angles A and B to the tangents, the height is ℓ sin A sin B / sin(A + B).
    """
    across, up = right.x - left.x, right.y - left.y
    length, chord = np.hypot(across, up), np.arctan2(up, across)
    # Rounding may bend a nearly straight contour the wrong way.
    at_left = np.maximum(chord - left.slope_angle, 0.0)
    at_right = np.maximum(right.slope_angle - chord, 0.0)
    bent = at_left + at_right > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(bent, length * np.sin(at_right) / np.sin(at_left + at_right), 0.5 * length)
    open_ = across > 0.0
    along = np.where(open_, along, np.nan)
    height = along * np.sin(at_left)
    return Triangle(
        left,
        right,
        left.x + along * np.cos(left.slope_angle),
        left.y + along * np.sin(left.slope_angle),
        height,
        height / np.cos(chord),
    )


def gap(posterior: xr.DataTree, probability: float = 0.95, *, without_events: xr.DataTree | None = None) -> xr.Dataset:
    """Return the ends of the gap, the region to which convexity confines the contour there, and the posterior's band.

    Between the ends a convex contour lies in the triangle of their chord and their tangents; the prior enters only
    through the ends. Each contour of the posterior has a triangle of its own, which gives intervals.

    Parameters
    ----------
    posterior : xr.DataTree
        From `infer_contour`, of a record with sweeps in both directions, or with several if the base is carried.
    probability : float
        Probability of the central intervals and of the band, in (0, 1).
    without_events : xr.DataTree, optional
        Result of `infer_contour` with ``events=False`` for the same record; its band is added for comparison.

    Returns
    -------
    xr.Dataset
        Over "bound" ("lower", "median", "upper"):

        - left (the backward sweep's last contact), right (the forward sweep's) and width = right − left, negative where
          the two overlap [length];
        - left_y, right_y [length] and left_slope_angle, right_slope_angle [rad], of the same contacts;
        - snap_off_drive_angle [rad], over "segment" too;
        - vertex_x, vertex_y, the contour's lowest point [length];
        - apex_x, apex_y of the triangle, triangle_height, its distance from the chord, and triangle_width, its largest
          extent in y [length], all of the contours that leave a gap.

        Over "x", evenly from the median of left to that of right: band_lower, band_median, band_upper, as
        `contour_band` gives them; triangle_lower and triangle_upper, between which the triangles lie with that
        probability, at each x; and band_without_events_lower, _median, _upper if asked for [length].

        Scalars: band_width, the largest upper − lower of the band, and band_width_without_events, to be compared with
        triangle_width [length]; share_open, the share of contours that leave a gap; status, "ok" or the reason why
        something is NaN. The attribute gaps is the number of gaps. Draws whose contour is not touched in every sweep
        do not count.

    Raises
    ------
    InferenceError, ParameterError
        If the record has sweeps in one direction only (one sweep only, if the base is carried), or no contour is
        touched in all of them; if the probability is not in (0, 1).

    Notes
    -----
    With several pivots, or a base that is carried, a gap is an arc that no sweep has touched, after the arcs from first
    contact to snap-off are merged; its ends may then be first contacts. Of several gaps the widest is described, and if
    none remains, the smallest overlap: medians decide which arcs lie on its left and which on its right, and each
    contour's gap lies between the rightmost end of the former and the leftmost end of the latter.

    Where a contour's own arcs reach beyond the gap's ends, its height is known by contact, and counts as a triangle of
    no width: the band is between triangle_lower and triangle_upper, up to the noise of the draws.

    Examples
    --------
    >>> draws = {"a": 0.5, "q": 0.3, "x_c": 0.0}
    >>> ends = {"first_contact_x": [0.9, -0.9], "snap_off_contact_x": [0.2, -0.1], "snap_off_drive_angle": [3.2, -0.1]}
    >>> posterior = xr.Dataset({k: (("chain", "draw"), [[v]]) for k, v in draws.items()})
    >>> events = xr.Dataset({k: (("chain", "draw", "segment"), [[v]]) for k, v in ends.items()})
    >>> events = events.assign_coords(segment=["forward", "backward"])
    >>> tree = xr.DataTree.from_dict({"posterior": posterior, "events": events})
    >>> tree.attrs = {"family": "parabola", "units": "dimensionless"}
    >>> found = gap(tree).sel(bound="median")
    >>> round(found.width.item(), 6), round(found.triangle_width.item(), 6), found.status.item()
    (0.3, 0.0225, 'ok')
    """
    levels = central_levels(probability)
    draws = contour_draws(posterior)
    events = contour_events(posterior).transpose("chain", "draw", "segment", ...)
    _refuse_no_gap(events)
    ends = np.stack([_rows(events["first_contact_x"]), _rows(events["snap_off_contact_x"])])
    touched = np.flatnonzero(np.isfinite(ends).all(axis=(0, 2)))
    if not touched.size:
        raise InferenceError("none of the posterior's contours is touched in every sweep: there are no ends of a gap")
    left_x, right_x, gaps = _ends(ends[:, touched])
    draws = draws.sel(chain=events["chain"], draw=events["draw"])
    contours = contours_of(draws, posterior.attrs["family"]).take(touched)
    left, right = (contours.locate(contours.parameter_of_x(x)) for x in (left_x, right_x))
    certificate, is_open = triangle(left, right), right_x > left_x
    some = is_open if is_open.any() else np.full_like(is_open, True)  # all are NaN if none leaves a gap
    vertex_x, vertex_y = contours.point(0.0)
    lengths = {"left": left_x, "right": right_x, "width": right_x - left_x, "left_y": left.y, "right_y": right.y}
    lengths |= {"vertex_x": vertex_x, "vertex_y": vertex_y}
    lengths |= {name: getattr(certificate, name)[some] for name in ("apex_x", "apex_y")}
    lengths |= {f"triangle_{name}": getattr(certificate, name)[some] for name in ("height", "width")}
    angles = {"left_slope_angle": left.slope_angle, "right_slope_angle": right.slope_angle}
    angles |= {"snap_off_drive_angle": _rows(events["snap_off_drive_angle"])[touched]}
    length = length_unit(posterior)
    variables: dict[str, Any] = {
        name: (("bound", "segment")[: values.ndim], np.quantile(values, levels, axis=0), unit)
        for of_draws, unit in ((lengths, length), (angles, {"units": "rad"}))
        for name, values in of_draws.items()
    }
    begin, end = (float(np.median(x)) for x in (left_x, right_x))
    known = end > begin
    x = np.linspace(begin, end, _GRID_POINTS)
    trees = {"band": posterior} | ({} if without_events is None else {"band_without_events": without_events})
    heights = heights_of(contours, x)  # beyond its own gap a contour is known by contact
    lower, upper = (np.where(np.isnan(edge), heights, edge) for edge in certificate.between(x))
    between = np.quantile(lower, levels[0], axis=0), np.quantile(upper, levels[2], axis=0)
    across = dict(zip(("triangle_lower", "triangle_upper"), between, strict=True)) | _bands(trees, x, probability)
    for name, values in across.items():
        variables[name] = (("x",) if values.ndim else (), values + (0.0 if known else np.nan), length)
    cut_short = any(np.isnan(across[name.replace("band", "band_width")]) for name in trees)
    share = float(is_open.mean())
    variables["share_open"] = ((), share, {"units": "1"})
    variables["status"] = ((), _status(share, known, cut_short, touched.size < ends.shape[1]))
    coords = {"bound": ["lower", "median", "upper"], "x": ("x", x, length), "segment": events.segment.values}
    return xr.Dataset(variables, coords=coords, attrs={"probability": probability, "gaps": gaps})


def _refuse_no_gap(events: xr.Dataset) -> None:
    """Refuse events of sweeps between which no gap lies."""
    if has_gap(events):
        return
    if "first_travel" in events:
        first, last = (float(events[f"{event}_contact_x"].median()) for event in ("first", "snap_off"))
        raise InferenceError(
            f"the one sweep touches an arc without a gap, from first contact at x = {first:.4g} to its last contact at "
            f"x = {last:.4g}: what lies beyond these ends no sweep has touched, and contour_band gives there what "
            "family and prior imply"
        )
    missing = [name for name in ("forward", "backward") if name not in events.segment.values]
    raise InferenceError(f"a gap lies between sweeps of both directions, and there is no {missing[0]} one here")


def _bands(trees: Mapping[str, xr.DataTree], x: Floats, probability: float) -> dict[str, Floats]:
    """Return the edges of the bands of posteriors at x, by their names, and their largest widths."""
    found: dict[str, Floats] = {}
    for name, tree in trees.items():
        band = contour_band(tree, x, probability)
        found |= {f"{name}_{edge}": band[edge].values for edge in ("lower", "median", "upper")}
        found[name.replace("band", "band_width")] = np.asarray(np.max(band["upper"].values - band["lower"].values))
    return found


def has_gap(events: xr.Dataset) -> bool:
    """Return whether sweeps with these events may leave a gap between them.

    Those that turn the rod must be of both directions; where the base is carried, any two may.
    """
    both = {"forward", "backward"} <= set(events.segment.values.tolist())
    return both or ("first_travel" in events and events.sizes["segment"] > 1)


def _ends(ends: Floats) -> tuple[Floats, Floats, int]:
    """Return the left and right ends of each contour's gap, and the number of gaps.

    `ends` holds x of the first contact and of the snap-off, shape (2, contours, sweep segments).
    """
    low, high = ends.min(axis=0), ends.max(axis=0)
    typical_low, typical_high = np.median(low, axis=0), np.median(high, axis=0)
    order = np.argsort(typical_low + typical_high)
    reached = np.maximum.accumulate(typical_high[order])[:-1]
    next_ = np.minimum.accumulate(typical_low[order][::-1])[::-1][1:]
    cut = int(np.argmax(next_ - reached)) + 1
    left, right = high[:, order[:cut]].max(axis=1), low[:, order[cut:]].min(axis=1)
    return left, right, int(np.count_nonzero(next_ > reached))


def _rows(values: xr.DataArray) -> Floats:
    """Return the values of all draws, shape (draws, sweep segments)."""
    return np.asarray(values.values, dtype=float).reshape(-1, values.sizes["segment"])


def _status(share_open: float, known: bool, cut_short: bool, untouched: bool) -> str:
    others = "the triangle is that of the others"
    reasons = (
        (share_open == 0.0, "the sweeps overlap: no gap is left"),
        (not known, f"the sweeps overlap in most contours: {others}, and there is no band"),
        (cut_short, "some contours end inside the gap: there is no width of their band"),
        (share_open < 1.0, f"the sweeps overlap in some contours: {others}"),
        (untouched, "some contours are not touched in every sweep: this is of the others"),
    )
    return next((reason for is_so, reason in reasons if is_so), "ok")

"""Touched arcs of the contour between first contact and the end of contact, and the gaps between them."""

from __future__ import annotations

from itertools import cycle, product
from typing import TYPE_CHECKING, Any

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import ParameterError
from tactile_bayes.plotting.axes import axes_for
from tactile_bayes.plotting.labels import number, shown_unit
from tactile_bayes.plotting.legends import legend_entry
from tactile_bayes.plotting.maps import draw_gap, draw_object, draw_pivot, finish_map, limits_of, outline, write_on_top
from tactile_bayes.plotting.marks import BASES
from tactile_bayes.record import rod_of
from tactile_bayes.sweep import Scan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox

    from tactile_bayes.contours.base import Contour
    from tactile_bayes.sweep import SweepEvents

# Distance [L] below which contacts coincide: at a fold, rounding leaves a contact half of its digits.
_SAME_PLACE = 1e-7
# Line styles: the first for as many bases as there are colours, the next for as many further bases, and so on.
_STYLES: tuple[Any, ...] = ("solid", (0, (3.0, 1.0)), (0, (1.0, 0.5)))
_ARC_WIDTH = 3.0
# Distance [points] of the arcs of a base below those of the base before: side by side up to slopes of 45°.
_OFFSET = np.sqrt(2.0) * _ARC_WIDTH


def touched(scan: Scan, *, ax: Axes | None = None) -> Axes:
    """Draw the arcs of the contour that the sweeps touched, in a colour for each base, and the gaps between them.

    An arc extends from first contact to the end of contact. Arcs of the first base lie on the contour, those of every
    further base a line's width below; x is true everywhere. The way of a base that is carried is drawn up to the end of
    contact. From the seventh base on, lines are dashed. A gap is a stretch
    between the outermost contacts that no sweep touched; its width in x is written where there is room. If no gap
    remains, "no gap" is written.

    Parameters
    ----------
    scan : Scan
        A scan, from one base or several.
    ax : Axes, optional

    Returns
    -------
    Axes

    Raises
    ------
    ParameterError
        If `scan` is not a scan.

    Examples
    --------
    >>> from tactile_bayes import scan
    >>> from tactile_bayes.contours import paper_profile
    >>> [text.get_text() for text in touched(scan(paper_profile("II", q=0.5))).texts]
    ['gap\\n0.122 $L$']
    >>> [text.get_text() for text in touched(scan(paper_profile("II", q=0.5), base=[(0, 0), (0.25, 0)])).texts]
    ['no gap']
    """
    from matplotlib.transforms import ScaledTranslation

    if not isinstance(scan, Scan):
        raise ParameterError(
            f"touched draws what scan(...) returns, and not a {type(scan).__name__}: a record alone does not say what "
            "was touched; plotting.observables draws it"
        )
    rod, attrs = rod_of(scan.record), scan.record["base_x"].attrs
    same = _SAME_PLACE * rod.length_unit
    ax = axes_for(ax)
    arcs = [_arc(scan.contour, sweep) for sweep in scan.sweeps]
    looks = product(_STYLES, BASES)
    lines: dict[tuple[float, float], dict[str, Any]] = {
        base: {"color": colour, "linestyle": style, "linewidth": _ARC_WIDTH}
        for base, (style, colour) in zip(dict.fromkeys(sweep.base for sweep in scan.sweeps), cycle(looks), strict=False)
    }
    for (x, y), sweep in zip(arcs, scan.sweeps, strict=True):
        (line,) = ax.plot(x, y, **lines[sweep.base], solid_capstyle="butt", zorder=2.0)
        lowered = ScaledTranslation(0.0, -_OFFSET / 72.0 * list(lines).index(sweep.base), ax.figure.dpi_scale_trans)
        line.set_transform(ax.transData + lowered)  # only now, so that the limits are those of the arc itself
        if x[-1] - x[0] <= same:  # the sweep touched an edge alone
            line.set_marker("o")
    ends = {sweep.base: (sweep.snap_off.base_x, sweep.snap_off.base_y) for sweep in scan.sweeps}
    pivots = np.array([*lines, *ends.values()])
    x, y = (np.concatenate([*(arc[axis] for arc in arcs), pivots[:, axis]]) for axis in (0, 1))
    draw_object(ax, scan.contour, x, y, room=0.05 * rod.length_unit)
    power, unit = shown_unit("contact_x", attrs, limits_of(ax))
    for base, style in lines.items():
        ax.plot(*zip(base, ends[base], strict=True), color=style["color"], linewidth=1.0, zorder=1.5)
        draw_pivot(ax, base, colour=style["color"], label="")
        place = ", ".join(number(part, power) for part in base)
        what = "base" if ends[base] == base else "base from"
        legend_entry(ax, f"{what} ({place}) {unit}", **style, marker="o", markerfacecolor="white")

    gaps = _gaps(arcs, same)
    texts = [
        draw_gap(ax, left, right, f"gap\n{number(right - left, power, digits=3)} {unit}")
        for left, right in sorted(gaps, key=lambda gap: gap[0] - gap[1])
    ]
    _keep_apart(ax, texts)
    if not gaps and len(arcs) > 1:
        write_on_top(ax, 0.5 * sum(ax.get_xlim()), "no gap")
    finish_map(ax, attrs)
    return ax


def _arc(contour: Contour, sweep: SweepEvents) -> tuple[Floats, Floats]:
    """Return points of the arc that a sweep touched, from left to right; its ends are the events' contacts."""
    left, right = sorted((sweep.first_contact, sweep.snap_off), key=lambda event: event.contact_x)
    x, y = outline(contour, left.contact_x, right.contact_x)
    x[[0, -1]] = left.contact_x, right.contact_x
    y[[0, -1]] = left.contact_y, right.contact_y
    return x, y


def _gaps(arcs: list[tuple[Floats, Floats]], same: float) -> list[tuple[float, float]]:
    """Return the stretches in x between arcs, from left to right."""
    ends = sorted((float(x[0]), float(x[-1])) for x, _ in arcs)
    reached = np.maximum.accumulate([right for _, right in ends])
    return [(float(end), left) for end, (left, _) in zip(reached, ends[1:], strict=False) if left - end > same]


def _keep_apart(ax: Axes, texts: list[Text]) -> None:
    """Remove texts that would overlap an earlier one, or leave the Axes, at the figure's size."""
    ax.apply_aspect()
    kept: list[Bbox] = []
    for text in texts:
        box = text.get_window_extent()
        if ax.bbox.x0 <= box.x0 and box.x1 <= ax.bbox.x1 and not box.count_overlaps(kept):
            kept.append(box)
        else:
            text.remove()

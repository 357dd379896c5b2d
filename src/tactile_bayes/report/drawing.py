"""Drawings as inline SVG: elements, scales with ticks, paths, and a plot with axes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import ArrayLike

from tactile_bayes.arrays import Floats
from tactile_bayes.plotting.labels import number
from tactile_bayes.report.wording import Shown

_WIDTH = 640  # width of every drawing, in its own units, in which letters are 13 high
_LEFT, _RIGHT, _TOP, _BOTTOM = 96, 24, 12, 46  # margins beside a plot's frame
_TALLEST, _LOWEST = 460.0, 140.0  # largest and smallest height of a map's frame


def element(name: str, *content: str, **attributes: object) -> Markup:
    """Return an element of SVG; `class_` is its class, `_` in other names stands for a hyphen. Text is escaped."""
    said = Markup("").join(
        Markup(' {}="{}"').format(key.rstrip("_").replace("_", "-"), value)
        for key, value in attributes.items()
        if value is not None
    )
    return Markup("<{}{}>{}</{}>").format(name, said, Markup("").join(escape(part) for part in content), name)


def figure(identity: str, title: str, description: str, height: float, *content: Markup) -> Markup:
    """Return a whole drawing, with a title and a description for screen readers."""
    return element(
        "svg",
        element("title", title, id=f"{identity}-title"),
        element("desc", description, id=f"{identity}-desc"),
        *content,
        id=identity,
        viewBox=f"0 0 {_WIDTH} {height:g}",
        role="img",
        aria_labelledby=f"{identity}-title",
        aria_describedby=f"{identity}-desc",
    )


@dataclass(frozen=True)
class Scale:
    """A linear map from values to positions in a drawing."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, values: ArrayLike) -> Floats:
        share = (np.asarray(values, dtype=float) - self.low) / (self.high - self.low)
        return np.asarray(self.start + share * (self.end - self.start))

    def at(self, value: float) -> float:
        """Return the position of one value, to a tenth of the drawing's unit."""
        return round(float(self(value)), 1)

    def ticks(self, power: int = 0, most: int = 6) -> list[float]:
        """Return round values within the scale: multiples of 1, 2, 2.5 or 5 times a power of ten."""
        rough = (self.high - self.low) / 10.0**power / (most + 1)
        unit = 10.0 ** math.floor(math.log10(rough))
        step = next(unit * m for m in (1, 2, 2.5, 5, 10) if unit * m >= rough * (1 - 1e-9)) * 10.0**power
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        return [k * step for k in range(first, last + 1)]


def scale_of(values: ArrayLike, start: float, end: float, room: float = 0.04) -> Scale:
    """Return a scale that holds all finite values, with a margin."""
    known = np.ravel(values)[np.isfinite(np.ravel(values))]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    margin = room * (high - low) or 0.5 * abs(high) or 0.5
    return Scale(low - margin, high + margin, start, end)


@dataclass(frozen=True)
class Plot:
    """A frame with two scales and elements in it; `drawn` returns them with their axes.

    Labels of ticks are values over 10**x_power and 10**y_power.
    """

    x: Scale
    y: Scale
    x_label: str
    y_label: str
    x_power: int = 0
    y_power: int = 0
    content: list[Markup] = field(default_factory=list)

    @classmethod
    def around(
        cls, x: ArrayLike, y: ArrayLike, labels: tuple[str, str], height: float, powers: tuple[int, int] = (0, 0)
    ) -> Plot:
        """Return a plot of the full width and a given height that holds all points."""
        across = scale_of(x, _LEFT, _WIDTH - _RIGHT, room=0.02)
        up = scale_of(y, height - _BOTTOM, _TOP, room=0.06)
        return cls(across, up, *labels, *powers)

    @classmethod
    def map_of(cls, x: ArrayLike, y: ArrayLike, unit: Shown) -> tuple[Plot, float]:
        """Return a plot with equal scales, in a unit of length, that holds all points, and its height."""
        across = scale_of(x, _LEFT, _WIDTH - _RIGHT, room=0.03)
        per_unit = (across.end - across.start) / (across.high - across.low)
        up = scale_of(y, 0.0, 1.0, room=0.05)
        wanted = (up.high - up.low) * per_unit
        if wanted > _TALLEST:  # then the height decides
            per_unit *= _TALLEST / wanted
            middle, half = 0.5 * (across.low + across.high), 0.5 * (across.end - across.start) / per_unit
            across = Scale(middle - half, middle + half, across.start, across.end)
        room = max(_LOWEST / per_unit - (up.high - up.low), 0.0) / 2.0
        low, high = up.low - room, up.high + room
        height = _TOP + (high - low) * per_unit + _BOTTOM
        labels = f"x{unit.bracketed}", f"y{unit.bracketed}"
        return cls(across, Scale(low, high, height - _BOTTOM, _TOP), *labels, unit.power, unit.power), height

    def put(self, *content: Markup) -> None:
        """Put elements over all present ones."""
        self.content.extend(content)

    def put_pivots(self, places: Floats) -> None:
        """Put a mark on each pivot."""
        for x, y in places:
            self.put(element("circle", cx=self.x.at(x), cy=self.y.at(y), r=5, class_="pivot"))

    def path(self, x: ArrayLike, y: ArrayLike, class_: str) -> None:
        """Put a line through points, interrupted at points that are not finite."""
        self.put(element("path", d=_outline_path(self.x(x), self.y(y)), class_=class_))

    def area(self, x: ArrayLike, lower: ArrayLike, upper: ArrayLike, class_: str) -> None:
        """Fill the area between two edges, in a piece for each run of points at which both are finite."""
        across, low, high = self.x(x), self.y(lower), self.y(upper)
        known = np.isfinite(across) & np.isfinite(low) & np.isfinite(high)
        outlines = ""
        for run in np.split(np.arange(known.size), np.flatnonzero(np.diff(known)) + 1):
            if known[run].any():
                outlines += _outline_path(np.r_[across[run], across[run][::-1]], np.r_[low[run], high[run][::-1]]) + "Z"
        self.put(element("path", d=outlines, class_=class_))

    def stretch(self, low: float, high: float, class_: str) -> None:
        """Shade a stretch in x, from bottom to top."""
        ends = np.clip(self.x([low, high]), self.x.start, self.x.end)
        top, bottom = self.y.end, self.y.start
        width = f"{abs(ends[1] - ends[0]):.1f}"
        self.put(element("rect", x=f"{ends.min():.1f}", y=top, width=width, height=bottom - top, class_=class_))

    def drawn(self, clip: str) -> tuple[Markup, ...]:
        """Return the axes with the elements within them; `clip` is a unique id for the frame."""
        left, right, top, bottom = self.x.start, self.x.end, self.y.end, self.y.start
        frame = {"x": left, "y": top, "width": right - left, "height": round(bottom - top, 1)}
        parts = [element("clipPath", element("rect", **frame), id=clip)]
        for value in self.x.ticks(self.x_power):
            at = self.x.at(value)
            parts.append(element("line", x1=at, x2=at, y1=top, y2=bottom, class_="grid"))
            parts.append(element("text", number(value, self.x_power), x=at, y=bottom + 18, class_="tick middle"))
        for value in self.y.ticks(self.y_power, most=min(8, max(2, int((bottom - top) / 32)))):
            at = self.y.at(value)
            parts.append(element("line", x1=left, x2=right, y1=at, y2=at, class_="grid"))
            parts.append(element("text", number(value, self.y_power), x=left - 6, y=at + 4, class_="tick end"))
        turned = f"translate(16 {0.5 * (top + bottom):.1f}) rotate(-90)"
        parts.append(element("text", self.x_label, x=0.5 * (left + right), y=bottom + 39, class_="label middle"))
        parts.append(element("text", self.y_label, x=0, y=0, transform=turned, class_="label middle"))
        parts.append(element("g", *self.content, clip_path=f"url(#{clip})"))
        return *parts, element("rect", **frame, class_="frame")


def _outline_path(x: Floats, y: Floats) -> str:
    """Return points in a drawing as path data, interrupted at points that are not finite."""
    out, pen = "", "M"
    for across, down in zip(np.round(x, 1), np.round(y, 1), strict=True):
        is_known = math.isfinite(across) and math.isfinite(down)
        out += f"{pen}{across:g} {down:g}" if is_known else ""
        pen = "L" if is_known else "M"
    return out


def dots(x: Floats, y: Floats, half: float, class_: str, *, square: bool) -> Markup:
    """Return many marks of one kind, squares or discs, as one path."""
    size, arc = 2 * half, f"a{half:g} {half:g} 0 1 0"
    mark = f"h{size:g}v{size:g}h{-size:g}z" if square else f"{arc} {size:g} 0{arc} {-size:g} 0"
    good, up = np.isfinite(x) & np.isfinite(y), half if square else 0.0
    starts = zip(x[good] - half, y[good] - up, strict=True)
    return element("path", d="".join(f"M{across:.1f} {down:.1f}{mark}" for across, down in starts), class_=class_)


def legend(entries: Iterable[tuple[str, str]]) -> Markup:
    """Return a legend as a list of HTML that wraps, from pairs of a class and a text.

    The first word of a class applies to the mark, the rest to the whole entry.
    """
    items = []
    for class_, text in entries:
        key, _, shown = class_.partition(" ")
        mark = element("span", class_=f"key {key}", aria_hidden="true")
        items.append(element("li", mark, text, class_=shown or None))
    return element("ul", *items, class_="legend")

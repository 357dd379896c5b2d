"""Contours in the sweep frame: relative to the pivot, in rod lengths, mirrored for a backward sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.contours.base import Contour, Locus, Parameter

_FAR = 1e3  # rod lengths beyond which an end of a contour does not matter


@dataclass(frozen=True)
class SweepFrame:
    """A batch of n contours of one family, each in the frame of a sweep with its own pivot. The rod's centreline traces
    the parallel curve at `standoff`, half the rod's diameter. In this frame all sweeps are forward ones. Lengths are in
    the contour's unit, and what is not an array of shape (n,) holds for all contours."""

    contour: Contour  # contours whose parameters are all arrays of shape (n,)
    base_x: Floats  # pivots
    base_y: Floats
    length: Parameter  # of the rod
    standoff: Parameter
    mirrored: Flags  # whether the sweep is a backward one
    # Curvature of the unloaded rod in the laboratory frame, > 0 counter-clockwise [1/rod length]; of a rod whose
    # curvature varies along it, what is added to it.
    rest_curvature: Parameter = 0.0
    taper: Parameter = 0.0
    stem: Parameter = 0.0  # rigid piece between pivot and rod [rod length]
    way: Parameter = 0.0  # farthest that a drive carries the base to either side of the pivot [rod length]
    rest_shape: Parameter = 0.0  # amplitudes of the modes of the rest curvature, laboratory frame, (n, modes)

    @property
    def size(self) -> int:
        return int(self.base_x.size)

    def length_at(self, index: Index) -> Parameter:
        """Lengths of the rods of contours."""
        return self.length[index] if isinstance(self.length, np.ndarray) else self.length

    def locate(self, index: Index, parameter: Floats) -> Locus:
        """Points in the sweep frame; `index` and `parameter` broadcast. The parameter is in the sweep frame too: it
        grows from left to right."""
        sign = np.where(self.mirrored[index], -1.0, 1.0)
        x, y, slope, arclength_rate, slope_rate = self.contour.take(index).locate(sign * parameter)
        length = self.length_at(index)
        standoff = self.standoff[index] if isinstance(self.standoff, np.ndarray) else self.standoff
        if np.any(standoff):
            x = x + standoff * np.sin(slope)
            y = y - standoff * np.cos(slope)
            arclength_rate = arclength_rate + standoff * slope_rate
        return Locus(
            sign * (x - self.base_x[index]) / length,
            (y - self.base_y[index]) / length,
            sign * slope,
            arclength_rate / length,
            slope_rate,
        )

    def domain(self) -> tuple[Floats, Floats]:
        """Least and greatest parameter of every contour, shape (n,); an end that is absent, or so far that rounding
        hides its direction, is put just beyond the rod's reach."""
        lo, hi = (np.broadcast_to(end, (self.size,)).astype(float) for end in self.contour.domain)
        lo, hi = np.where(self.mirrored, -hi, lo), np.where(self.mirrored, -lo, hi)
        size, ends = np.arange(self.size), np.broadcast_to(1.0 + np.asarray(self.stem) + self.way, (self.size,))
        for end, outward in ((lo, -1.0), (hi, 1.0)):
            open_ended = ~np.isfinite(end)
            reach = np.full(self.size, self.length)
            while np.any(open_ended):
                end[open_ended] = outward * reach[open_ended]
                x = self.locate(size[open_ended], end[open_ended]).x
                open_ended[open_ended] = outward * x <= ends[open_ended]
                reach *= 2.0
            far = np.flatnonzero(~(outward * self.locate(size, end).x <= _FAR))
            if far.size:
                end[far] = self._parameter_at(far, outward * (1.0 + ends[far]))
        return lo, hi

    def own_domain(self) -> tuple[Floats, Floats]:
        """Least and greatest parameter of every contour in its own frame, shape (n,); see `domain`."""
        low, high = self.domain()
        return np.where(self.mirrored, -high, low), np.where(self.mirrored, -low, high)

    def _parameter_at(self, index: Index, x: Floats) -> Floats:
        """Parameters at which the contour itself, without standoff, is at x in the sweep frame."""
        sign = np.where(self.mirrored[index], -1.0, 1.0)
        from_base = sign * x * self.length_at(index)
        return np.asarray(sign * self.contour.take(index).parameter_of_x(self.base_x[index] + from_base))

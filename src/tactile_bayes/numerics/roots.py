"""Roots of many monotonic functions at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tactile_bayes.arrays import Floats, Index

_ROUNDING = 1e-14  # step, as a share of the bracket, at the level of rounding, at which the iteration ends
_FARTHEST = 2.0**60  # distance beyond which no root is sought
# Maps indices of functions and arguments to values and derivatives, each of shape (k,).
Function = Callable[[Index, Floats], tuple[Floats, Floats]]


def bound_ends(function: Function, lo: Floats, hi: Floats, near: Floats) -> None:
    """Replace infinite ends of brackets of falling functions, in place, by points beyond the root, seen from `near`."""
    for end, outward in ((lo, -1.0), (hi, 1.0)):
        open_ended, way = np.flatnonzero(~np.isfinite(end)), 1.0
        while open_ended.size and way < _FARTHEST:
            end[open_ended] = near[open_ended] + outward * way
            inside = outward * function(open_ended, end[open_ended])[0] > 0.0
            open_ended, way = open_ended[inside], 2.0 * way


def falling_root(function: Function, lo: Floats, hi: Floats, start: Floats | None = None) -> Floats:
    """Roots, shape (n,), of functions that are positive at `lo` and not at `hi`, by Newton's method in the bracket."""
    roots = 0.5 * (lo + hi) if start is None else start.astype(float)
    x, before = roots, np.abs(hi - lo)
    settled = _ROUNDING * before
    active = np.arange(lo.size)
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(100):
            if not active.size:
                break
            value, slope = function(active, x)
            positive = value > 0.0
            lo, hi = np.where(positive, x, lo), np.where(positive, hi, x)
            new = x - value / slope
            # Steps that do not shrink by half may cycle, for instance about a kink.
            trusted = ((new - lo) * (new - hi) <= 0.0) & (np.abs(new - x) <= 0.5 * before)
            new = np.where(trusted, new, np.where(value == 0.0, x, 0.5 * (lo + hi)))
            step = np.abs(new - x)
            going = (step > settled) & (value != 0.0)
            before = np.where(trusted, step, np.abs(hi - lo))
            if going.all():
                x = new
                continue
            roots[active] = new
            active, x, before, lo, hi, settled = (a[going] for a in (active, new, before, lo, hi, settled))
    roots[active] = x
    return roots

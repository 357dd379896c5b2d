"""Contours without a formula, as Chebyshev series on cells of their own parameter."""

from __future__ import annotations

import numpy as np

from tactile_bayes.arrays import Floats, Index
from tactile_bayes.contours.base import Contour
from tactile_bayes.contours.halves import CELLS, Half, Halves
from tactile_bayes.numerics import chebyshev

_ORDER = 16

_MISS = 4e-15  # largest size of the last coefficients of a series, as a share of the size of a coordinate, or in rad
_ROUNDED = 1e-15  # rounding error of a parameter, as a share of it
_HALVINGS = 40  # largest number of halvings of a cell: its size is then below rounding
# Number of further cells of a contour beyond which none is halved: a contour that is rough everywhere is not smooth in
# smaller cells either.
_MOST = 256


def in_cells(contour: Contour, low: Floats, high: Floats) -> Halves:
    """Tables of contours with parameters of shape (n,), between two parameters, each of shape (n,). Cells end at knots
    and are halved until series of 16 terms are exact to 4e-15, relative in points, in slope in rad."""
    count = low.size
    knots = np.array([np.broadcast_to(knot, (count,)) for knot in contour.knots], dtype=float).reshape(-1, count)
    edges = np.sort(np.vstack([low, np.clip(knots, low, high), high]), axis=0)
    owner = np.tile(np.arange(count), len(edges) - 1)
    begin, end = edges[:-1].ravel(), edges[1:].ravel()
    some = end > begin
    owner, begin, end = owner[some], begin[some], end[some]
    rows: list[Floats] = []
    owners = []
    cells = np.bincount(owner, minlength=count)
    most = cells + _MOST
    for halving in range(_HALVINGS + 1):
        series = _series(contour, owner, begin, end)
        size = np.abs(series).sum(axis=2)
        size[:, :2] = size[:, :2].max(axis=1, keepdims=True)
        size[:, 2] = np.maximum(size[:, 2], 1.0)
        rate = np.abs(series) @ np.arange(_ORDER) * (2.0 / (end - begin))[:, None]
        moved = _ROUNDED * np.maximum(np.abs(begin), np.abs(end))[:, None] * rate
        rough = (np.abs(series[:, :, -2:]).max(axis=2) > _MISS * size + moved).any(axis=1)
        rough &= (cells < most)[owner] & (halving < _HALVINGS)
        done = ~rough
        rows.append(np.hstack([begin[done, None], end[done, None], series[done].reshape(-1, 3 * _ORDER)]))
        owners.append(owner[done])
        if not np.any(rough):
            break
        middle = 0.5 * (begin[rough] + end[rough])
        owner = np.tile(owner[rough], 2)
        cells += np.bincount(owner, minlength=count) // 2
        begin, end = np.append(begin[rough], middle), np.append(middle, end[rough])
    found, of = np.concatenate(rows), np.concatenate(owners)
    order = np.lexsort((found[:, 0], of))
    found, of = found[order], of[order]
    cells = np.bincount(of, minlength=count)
    tables = np.full((count, cells.max(), found.shape[1]), np.inf)
    tables[of, np.arange(of.size) - (np.cumsum(cells) - cells)[of]] = found
    left, right = Half(CELLS, low, np.ones(count)), Half(CELLS, high, np.ones(count))
    return Halves(left, right, np.zeros(count), np.zeros(count), tables)


def _series(contour: Contour, owner: Index, begin: Floats, end: Floats) -> Floats:
    """Coefficients of x, y and slope angle, (cells, 3, order), fitted to differences from the middle of a cell."""
    parameter = begin[:, None] + (end - begin)[:, None] * chebyshev.nodes(_ORDER)
    locus = contour.take(np.broadcast_to(owner[:, None], parameter.shape)).locate(parameter)
    values = np.stack([locus.x, locus.y, locus.slope_angle], axis=1)
    amid = values[..., _ORDER // 2].copy()
    series = np.ascontiguousarray(np.moveaxis(chebyshev.coefficients(values - amid[..., None]), 0, -1))
    series[..., 0] += amid
    return series

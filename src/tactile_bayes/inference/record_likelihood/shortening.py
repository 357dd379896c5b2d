"""The shortening of a long record: to lines through neighbouring readings, or, without a likelihood of these, fewer."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.inference.record_likelihood.record_segments import RecordSegments
from tactile_bayes.load_cell import LoadCell, RandomWalk
from tactile_bayes.load_cell.blocks import AFTER_CONTACT, BEFORE_ONSET, IN_CONTACT
from tactile_bayes.load_cell.zero_load import quiet_zero_load
from tactile_bayes.numerics.scatter import rough_noise
from tactile_bayes.reconstruction import least_turn, turned_sweeps, with_sides
from tactile_bayes.record import CHANNELS, carried_sweeps, loads_of, present_channels, rows_of_sweeps
from tactile_bayes.record.sweep_segments import turning_points

MOST_SAMPLES = 2000  # largest number of samples that the likelihood takes one by one
_BINS = 700  # number of bins of the drive angle in all sweep segments, before they are split
_FEWEST_BINS = 12  # least number of bins of a segment
_MOST_SPLIT = 1.25  # largest number of bins after splitting, over that before
_WIDEST = np.radians(2.0)  # largest width of a bin [rad]; loads between events are cubic in it to 1e-6 EI/L
_DIVISIBLE = 8  # least number of readings of a bin that is split
# Gain of two straight lines over one, in variances of each channel, that splits a bin: without a bend its mean is 2.
_BEND = 4.0
_SAME_ANGLE = 1e-12  # standard deviation of drive angles that is rounding [rad]
_MARGIN, _MOST_SINGLE = 8, 200  # readings on either side of a snap-off that stay single, and the most around one


def is_long(record: xr.Dataset) -> bool:
    """Return True for a record of more than `MOST_SAMPLES` that is not shortened yet."""
    return bool(record.sizes["sample"] > MOST_SAMPLES and "blocks" not in record.attrs)


def shortened(record: xr.Dataset, cell: LoadCell, rubs: bool = False) -> tuple[xr.Dataset, LoadCell]:
    """Return a record as the likelihood takes it, and the load cell of its samples; `blocks` of the record states how.

    Of more than `MOST_SAMPLES`, blocks of readings at neighbouring drive angles are taken, two points on a straight
    line for each, single ones next to a snap-off; or every so many readings, for noise whose means are not normal (see
    `_averages`), for carried bases, and for drives that turn back in contact if the rod `rubs`.
    """
    if not is_long(record):
        return record, cell
    turned = turned_sweeps(record, cell) if rubs else set()
    if not turned and _averages(record, cell):
        made = _Readings(record, cell).in_blocks()
        if made.sizes["sample"] < record.sizes["sample"]:
            return made, cell
        return record, cell
    return thinned(record, cell, turned)


def _averages(record: xr.Dataset, cell: LoadCell) -> bool:
    """Return True if means of readings at one load are normal, with a noise that falls as the root of their number."""
    readings = loads_of(record)
    noise = [rough_noise(values) if step else np.inf for values, step in zip(readings.T, cell.resolution, strict=True)]
    return not (
        np.isfinite(cell.degrees_of_freedom)
        or cell.drift is not None
        or any(cell.correlation)
        or cell.drive_angle_deviation
        or np.any(cell.cuts_off(np.nan_to_num(readings)))
        or np.any(cell.resolution > np.nan_to_num(noise, nan=np.inf))
        or carried_sweeps(record)
    )


def thinned(record: xr.Dataset, cell: LoadCell, turned: Container[int] = frozenset()) -> tuple[xr.Dataset, LoadCell]:
    """Return every so many samples of a long record, all corners of carried ways and ends of the ways of sweeps that
    are turned back, and the cell of these samples."""
    if not is_long(record):
        return record, cell
    samples = record.sizes["sample"]
    every = -(-samples // MOST_SAMPLES)
    kept = np.zeros(samples, dtype=bool)
    kept[::every] = True
    carried = set(carried_sweeps(record))
    for rows in rows_of_sweeps(record["sweep"].values):
        number = int(record["sweep"].values[rows[0]])
        if number in turned:
            angle = record["drive_angle"].values[rows]
            kept[rows[[0, *turning_points(angle, least_turn(angle, cell)), -1]]] = True
        if number in carried:
            kept[rows] = False
            kept[rows[::every]] = kept[rows[-1]] = True
            kept[rows[_corners(record, rows)]] = True
    where = np.flatnonzero(kept)
    said = f"{samples:,} samples, of which every {every}th is taken: {where.size:,}"
    elapsed = ("sample", np.linspace(-0.5, 0.5, samples)[where])
    return record.isel(sample=where).assign(block_elapsed=elapsed).assign_attrs(blocks=said), _slower(cell, every)


def _corners(record: xr.Dataset, rows: Index) -> Index:
    """Return the places in a carried sweep at which its way turns."""
    way = np.column_stack([record[name].values[rows] for name in ("base_x", "base_y", "drive_angle")])
    if len(way) < 3:
        return np.arange(len(way))
    turn = np.abs(np.diff(way, n=2, axis=0))
    return 1 + np.flatnonzero((turn > 1e-3 * np.abs(np.diff(way, axis=0)).max(axis=0) + 1e-12).any(axis=1))


def _slower(cell: LoadCell, every: int) -> LoadCell:
    """Return the cell of every so many samples."""
    drift = cell.drift
    if drift is None:
        return cell
    if isinstance(drift, RandomWalk):
        size = float(np.sqrt(every))
        return replace(cell, drift=replace(drift, moment=drift.moment * size, force=drift.force * size))
    return replace(cell, drift=replace(drift, time=drift.time / every))


class _Group(NamedTuple):
    """Samples with one pivot, one side of contact and one direction of the drive."""

    samples: Index  # by drive angle, shape (n,)
    sweep_of: Index  # index of the sweep of each of them, among those of the group, shape (n,)
    sweeps: Index  # numbers of these sweeps, in the order of measurement
    direction: str
    side: str


class _Readings:
    """Readings of a record with all that their blocks depend on."""

    def __init__(self, record: xr.Dataset, cell: LoadCell) -> None:
        self.record = record
        self.present = [CHANNELS.index(name) for name in present_channels(record)]
        self.values = loads_of(record)
        self.angle = record["drive_angle"].values.astype(float)
        self.groups = self._groups(RecordSegments(record, cell))
        self.found = quiet_zero_load(record)

    def _groups(self, segments: RecordSegments) -> list[_Group]:
        sweep, groups = self.record["sweep"].values, []
        for own, backward in zip(segments.samples, segments.backward, strict=True):
            samples = own[np.argsort(self.angle[own], kind="stable")]
            places = {number: place for place, number in enumerate(dict.fromkeys(sweep[own].tolist()))}
            which = np.array([places[number] for number in sweep[samples].tolist()])
            direction, side = str(self.record["direction"].values[own[0]]), "backward" if backward else "forward"
            groups.append(_Group(samples, which, np.array(list(places)), direction, side))
        return groups

    def in_blocks(self) -> xr.Dataset:
        """Return the record of the means of blocks, in the order of sweeps, each in the order of the drive."""
        extents = [np.ptp(self.angle[group.samples]) for group in self.groups]
        width = min(_WIDEST, max(sum(extents) / _BINS, 1e-9))
        edges = [self._edges(group, width) for group in self.groups]
        slabs = max(1, _BINS // sum(len(each) - 1 for each in edges))
        parts, rows = [], 0
        for group, ends in sorted(zip(self.groups, edges, strict=True), key=lambda pair: int(pair[0].sweeps[0])):
            made = self._blocks(group, ends, min(slabs, group.sweeps.size))
            parts += made
            rows += sum(int(each.attrs["count"]) for each in made)
        samples = self.record.sizes["sample"]
        said = f"{samples:,} samples in {rows:,} blocks, of {samples / rows:.3g} on average"
        sides = {int(part["sweep"].values[0]): str(part.attrs["side"]) for part in parts}
        whole = xr.concat(parts, "sample", combine_attrs="drop_conflicts", coords="minimal", compat="override")
        whole.attrs = {**self.record.attrs, "blocks": said}
        return with_sides(whole, sides)

    def _edges(self, group: _Group, width: float) -> Index:
        """Return the places, among the samples of a group, at which its bins begin, and the last one's end."""
        angle = self.angle[group.samples]
        count = max(_FEWEST_BINS, int(np.ceil(np.ptp(angle) / width)))
        at = np.searchsorted(angle, np.linspace(angle[0], angle[-1], count + 1)[1:-1])
        ends = [np.sort(self._event(group, name)) for name in ("onset", "snap_off")]
        beside = [
            place
            for low, high in ends
            for place in (np.searchsorted(angle, low, "right"), np.searchsorted(angle, high, "left"))
        ]
        edges = np.unique(np.concatenate([[0, angle.size], at, beside, self._single(group)]).astype(np.intp))
        return self._split(group, edges)

    def _single(self, group: _Group) -> Index:
        """Return the places of samples next to a snap-off."""
        low, high = self._event(group, "snap_off")
        if not np.isfinite(low):
            return np.empty(0, dtype=np.intp)
        angle = self.angle[group.samples]
        first, last = np.searchsorted(angle, sorted((low, high)))
        margin = max(_MARGIN, int(last - first))
        middle, half = (first + last) // 2, min((last - first) // 2 + 1 + margin, _MOST_SINGLE // 2)
        return np.arange(max(0, middle - half), min(angle.size, middle + half + 1))

    def _event(self, group: _Group, name: str) -> tuple[float, float]:
        """Return the drive angles, medians over its sweeps, between which contact begins or ends; NaN if nowhere."""
        pairs = self.found[name].sel(sweep=group.sweeps).values
        pairs = pairs[(pairs >= 0).all(axis=1)]
        return tuple(np.median(self.angle[pairs], axis=0).tolist()) if len(pairs) else (np.nan, np.nan)

    def _split(self, group: _Group, edges: Index) -> Index:
        """Return the edges of bins that are split in halves wherever the readings of one bend, or jump."""
        sums = _Sums(self.angle[group.samples], self.values[group.samples][:, self.present])
        size = np.diff(edges)
        begin, end = edges[:-1][size >= _DIVISIBLE], edges[1:][size >= _DIVISIBLE]
        if not begin.size:
            return edges
        variance = np.median(sums.squares(begin, end) / (end - begin - 2)[:, None], axis=0)
        most = int(_MOST_SPLIT * (edges.size + _FEWEST_BINS))
        while begin.size and edges.size < most:
            middle = (begin + end) // 2
            gain = sums.squares(begin, end) - sums.squares(begin, middle) - sums.squares(middle, end)
            bend = (gain / np.maximum(variance, np.finfo(float).tiny)).sum(axis=1)
            bent = np.flatnonzero(bend > _BEND * len(self.present))
            bent = bent[np.argsort(-bend[bent])][: most - edges.size]
            edges = np.union1d(edges, middle[bent])
            begin, end = np.append(begin[bent], middle[bent]), np.append(middle[bent], end[bent])
            large = end - begin >= _DIVISIBLE
            begin, end = begin[large], end[large]
        return edges

    def _blocks(self, group: _Group, edges: Index, slabs: int) -> list[xr.Dataset]:
        """Return the blocks of a group, those of each slab of successive sweeps as one sweep."""
        bins = np.searchsorted(edges, np.arange(group.samples.size), side="right") - 1
        slab_of = group.sweep_of * slabs // group.sweeps.size
        made = []
        for slab in range(slabs):
            own = slab_of == slab
            first = group.sweeps[np.argmax(np.arange(group.sweeps.size) * slabs // group.sweeps.size == slab)]
            made.append(self._slab(group, group.samples[own], bins[own], int(first)))
        return made

    def _slab(self, group: _Group, samples: Index, bins: Index, sweep: int) -> xr.Dataset:
        """Return the blocks of samples, given by drive angle with their bins, as a sweep of this number."""
        _, of_block, count = np.unique(bins, return_inverse=True, return_counts=True)

        def total(values: Floats) -> Floats:
            return np.asarray(np.bincount(of_block, values, count.size), dtype=float)

        middle = total(self.angle[samples]) / count
        off = self.angle[samples] - middle[of_block]
        squares = total(off**2)
        squares[squares <= count * _SAME_ANGLE**2] = 0.0
        spread = np.sqrt(squares / count)
        points = np.where(spread > 0.0, 2, 1)
        block = np.repeat(np.arange(count.size), points)
        place = np.where(points[block] == 2, np.where(np.diff(block, prepend=-1) > 0, -1.0, 1.0), 0.0) * spread[block]

        def on_line(values: Floats) -> tuple[Floats, Floats]:
            """Return the points of the lines of blocks, and the sum of squares about each."""
            mean = total(values) / count
            left = values - mean[of_block]
            slope = total(off * left) / np.where(squares > 0.0, squares, 1.0)
            return mean[block] + place * slope[block], total((left - slope[of_block] * off) ** 2)

        elapsed = np.linspace(-0.5, 0.5, self.record.sizes["sample"])[samples]
        unloaded = total(self.found["unloaded"].values[samples].astype(float)) == count
        angle = middle[block] + place
        columns: dict[str, Any] = {
            "sweep": np.full(block.size, sweep),
            "direction": np.full(block.size, group.direction),
            **{name: np.full(block.size, self.record[name].values[samples[0]]) for name in ("base_x", "base_y")},
            "drive_angle": angle,
        }
        for name, values in zip(CHANNELS, self.values[samples].T, strict=True):
            columns[name], scatter = on_line(values)
            columns[f"block_scatter_{name}"] = (scatter / points)[block]
        columns |= {
            "block_readings": (count / points)[block],
            "block_freedom": ((count - points) / points)[block],
            "block_elapsed": on_line(elapsed)[0],
            "block_unloaded": unloaded[block].astype(int),
            "block_part": self._parts(group, angle),
        }
        order = slice(None, None, -1) if group.direction == "backward" else slice(None)
        attrs = {name: self.record[name].attrs for name in self.record.variables if name in columns}
        made = {name: ("sample", values[order], attrs.get(name, {})) for name, values in columns.items()}
        return xr.Dataset(made, attrs={"side": group.side, "count": count.size})

    def _parts(self, group: _Group, angle: Floats) -> Index:
        """Return the part of the sweep in which each drive angle lies, as in `bounds_in_blocks`."""
        sense = -1.0 if group.direction == "backward" else 1.0
        (before, begins), (ends, after) = (self._event(group, name) for name in ("onset", "snap_off"))
        past = sense * angle
        part = np.zeros(angle.size, dtype=int)
        contact: Flags = np.ones(angle.size, dtype=bool)
        if np.isfinite(before):
            part[past <= sense * before] = BEFORE_ONSET
            contact &= past >= sense * begins
        if np.isfinite(ends):
            part[past >= sense * after] = AFTER_CONTACT
            contact &= past <= sense * ends
        if np.isfinite(before) or np.isfinite(ends):
            part[contact] = IN_CONTACT
        return part


class _Sums:
    """Running sums over readings by drive angle, from which straight lines through any of them follow."""

    def __init__(self, angle: Floats, values: Floats) -> None:
        angle, values = angle - angle.mean(), values - values.mean(axis=0)
        columns = [angle, angle**2, *values.T, *(values**2).T, *(angle[:, None] * values).T]
        self._sums = np.vstack([np.zeros(len(columns)), np.cumsum(np.column_stack(columns), axis=0)])
        self._channels = values.shape[1]

    def squares(self, begin: Index, end: Index) -> Floats:
        """Return the sums of squares about straight lines through readings, shape (intervals, channels)."""
        count, k = (end - begin)[:, None].astype(float), self._channels
        within = self._sums[end] - self._sums[begin]
        angle, angles, values = within[:, :1], within[:, 1:2], within[:, 2 : 2 + k]
        squares, products = within[:, 2 + k : 2 + 2 * k], within[:, 2 + 2 * k :]
        width = angles - angle**2 / count
        slope = np.where(width > 1e-12 * np.maximum(angles, 1e-300), products - angle * values / count, 0.0)
        return np.asarray(squares - values**2 / count - slope**2 / np.where(width > 0.0, width, 1.0))

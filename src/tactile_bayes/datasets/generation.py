"""The generation of a data set: contours are drawn until the rod reaches them, swept, and measured."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tactile_bayes.arrays import Flags, Floats, Index
from tactile_bayes.contours.base import Contour
from tactile_bayes.contours.families import FAMILIES
from tactile_bayes.contours.sweep_frame import SweepFrame
from tactile_bayes.datasets.deviations import as_built, drawn_deviations, is_around_the_stated, pivot_keys
from tactile_bayes.datasets.drives import Drives, drives_of
from tactile_bayes.datasets.measurement import measure
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.datasets.specification_reading import rule_of
from tactile_bayes.errors import ContourError, SpecificationError
from tactile_bayes.mechanics.paths import Paths, trace
from tactile_bayes.mechanics.reachability import Reachability
from tactile_bayes.mechanics.rods.profile import profile_of
from tactile_bayes.mechanics.rods.rod import LARGEST_STRAIN
from tactile_bayes.sweep.columns import EVENT_COLUMNS, SAMPLE_COLUMNS, ManyUnits, phases_of, sweep_events, sweep_samples

_MOST_DRAWS = 1000  # largest number of draws of one record
# Number of draws that are tested together for the last records: superfluous draws cost less than another call.
_AT_ONCE = 500
# Distance in the random stream between two draws of a record: far more than the number of distributions, so that a
# contour does not depend on what is drawn after it.
_APART = 2**20
_CONTOUR, _NOISE = 0, 1  # purposes of random numbers: the distributions of a specification, and the load cell
_GOOD = Reachability.TOUCHES.message


@dataclass(frozen=True)
class Records:
    """Records of a data set as arrays; lengths, forces and moments are in the units of the data set."""

    index: Index
    family: Index  # index of the group of the specification of each contour, shape (n,)
    # Drawn numbers by the keys of the distributions, shape (n,); NaN for parameters of other families.
    drawn: dict[str, Floats]
    # Columns of sweeps, shape (n, sweeps): base_x and base_y of pivots, or directions of sweeps that carry the base (0
    # forward, 1 backward), phases, events, and the largest strain of a thick rod.
    sweep: dict[str, NDArray[Any]]
    # Columns of samples, shape (n, sweeps, samples): readings, base_x and base_y of a base that is carried, and
    # "truth_" columns.
    sample: dict[str, NDArray[Any]]
    redrawn: Counter[str]  # numbers of rejected draws by reason

    @property
    def counts(self) -> dict[str, Any]:
        """Counts that the manifest states of a shard, by its names for them."""
        strain = self.sweep.get("largest_strain", np.zeros((1, 1)))
        return {
            "redrawn": {reason: count for reason, count in sorted(self.redrawn.items()) if count},
            "strained": int(np.count_nonzero(np.any(strain > LARGEST_STRAIN, axis=1))),
            "untouched": int(np.count_nonzero(~np.any(self.sample["truth_contact_phase"], axis=2))),
        }


_NOT_CLEAR = "not clear after snap-off"
_NO_CONTOUR = "no contour"

_HIGHER = "raise the contours above the pivots, by a larger q or lower bases"
_WIDER = "give wider contours, or bring the pivots nearer to them, or to their middle"
_CORRECTIONS = {
    "out of reach": "bring contours and pivots closer to one another (are contours, bases and rod in one unit?)",
    "cuts the pivot": _HIGHER,
    "touched beyond its end": _WIDER,
    "too close to the pivot": _HIGHER,
    "still touched at its other end": _WIDER,
    "touched twice": "give rods that are less curved, or contours that are more so where rods touch them",
    "touched at the beginning": "begin the translations farther from the contours",
    "met head-on": "take friction = 0 under [unknown], or another heading or drive angle",
    "slips off at once": "give rods that are less curved, or bring contours and pivots closer to one another",
    "folded over at its tip": "give rods that are stiffer or less curved at their tips",
    "hardly touched": "bring contours and pivots closer to one another, or give contours of a size nearer to the rod's",
    _NOT_CLEAR: "give wider contours, or raise them: the unloaded rod would still cut the object",
    _NO_CONTOUR: "change the distribution of that parameter",
}


@threadpool_limits.wrap(limits=1)  # with more threads, products of matrices are rounded otherwise
def generate_records(spec: Specification, begin: int, end: int) -> Records:
    """Generate records from index `begin` to before `end`, each the first draw that all sweeps reach and leave clear;
    the draws ahead double for the remaining records. Random numbers of a record depend on seed and index only, those of
    its contour come first; rounding may depend on the records generated together: the same range gives identical bits.
    """
    index = np.arange(begin, end)
    drawn = {key: np.full(index.size, np.nan) for key in spec.numbers}
    records = Records(index, np.zeros(index.size, dtype=np.intp), drawn, {}, {}, Counter())
    uniform, noise = (_streams(spec.seed, index, purpose) for purpose in (_CONTOUR, _NOISE))
    turns = _turns(spec, index)
    in_vain: list[tuple[Index, NDArray[Any]]] = []
    left, draws, ahead = np.arange(index.size), 0, 1
    while left.size:
        if draws == _MOST_DRAWS:
            reasons = [why for rows, whys in in_vain for why in whys[rows == left[0]].ravel()]
            raise _hopeless(int(index[left[0]]), Counter(reasons))
        candidates = _drawn(spec, uniform, turns, np.repeat(left, ahead))
        whys, tried = _tried(spec, candidates)
        whys = whys.reshape(left.size, ahead)
        is_good = whys == _GOOD
        good_so_far = is_good.cumsum(axis=1)
        in_vain.append((left, whys))
        records.redrawn.update(whys[good_so_far == 0].tolist())
        _keep(spec, records, candidates, tried, (is_good & (good_so_far == 1)).ravel())
        left, draws = left[~is_good.any(axis=1)], draws + ahead
        ahead = max(1, min(2 * ahead, max(_AT_ONCE, index.size) // max(left.size, 1), _MOST_DRAWS - draws))
    _state_pivots(spec, records)
    measure(spec, noise, as_built(spec, records.drawn), records.sample, directions_of(spec, records.sweep))
    return records


def _streams(seed: int, records: Index, purpose: int) -> list[np.random.Generator]:
    """Return the random numbers of records for a purpose, which depend on the seed and the record's number only."""
    seeds = (np.random.SeedSequence(seed, spawn_key=(record, purpose)) for record in records.tolist())
    return [np.random.Generator(np.random.PCG64(one)) for one in seeds]


def _state_pivots(spec: Specification, records: Records) -> None:
    """Write the pivots of records as they are stated, where they are shifted."""
    for key, shift in pivot_keys(spec).items():
        place, axis = shift[5:].split("_")
        if shift in spec.unknown and spec.translations:
            records.sample[f"base_{axis}"][:, int(place) - 1] -= records.drawn[f"unknown.{shift}"][:, None]
        elif shift in spec.unknown:
            its = [sweep for sweep, (pivot, _) in enumerate(spec.sweeps) if pivot == int(place) - 1]
            records.sweep[f"base_{axis}"][:, its] = records.drawn[key][:, None]


def directions_of(spec: Specification, sweep: Mapping[str, NDArray[Any]]) -> NDArray[np.int8]:
    """Return directions, 0 forward and 1 backward, shape (sweeps,), or (n, sweeps) where the base is carried."""
    if spec.translations:
        return sweep["direction"]
    return np.array([direction == "backward" for _, direction in spec.sweeps], dtype=np.int8)


class _Candidates(NamedTuple):
    """Next draws of some records."""

    row: Index  # row of the record of each draw
    group: Index  # index of the group of the specification of its contour
    values: dict[str, Floats]  # numbers by the keys of all distributions


def _drawn(
    spec: Specification, uniform: list[np.random.Generator], turns: Mapping[str, Index], row: Index
) -> _Candidates:
    """Draw the next candidate of each of these records; a repeated record has several draws."""
    count = 1 + len(spec.distributions)
    shares = np.array([_shares(uniform[i], count) for i in row])
    if "contours" in turns:
        group = turns["contours"][row]
    else:
        weights = np.cumsum([group.weight for group in spec.groups])
        group = np.searchsorted(weights, shares[:, 0] * weights[-1], side="right")
        group = np.minimum(group, len(spec.groups) - 1)
    of_key = dict(zip((key for key, _ in spec.distributions), shares[:, 1:].T, strict=True))
    values = {
        key: distribution.at(of_key[key], turns[distribution.axis or key][row] if distribution.kind == "each" else row)
        for key, distribution in spec.distributions
        if not is_around_the_stated(key, distribution)
    }
    if "rod.youngs_modulus" in values:
        second_moment = math.pi * values["rod.diameter"] ** 4 / 64.0
        values["rod.flexural_rigidity"] = values["rod.youngs_modulus"] * second_moment
    return _Candidates(row, group, values | drawn_deviations(spec, values, of_key))


def _keep(
    spec: Specification, records: Records, candidates: _Candidates, tried: Mapping[int, _Followed], is_kept: Flags
) -> None:
    """Write accepted candidates to their records."""
    count, sweeps = records.index.size, spec.sweep_count
    for g, its in tried.items():
        taken = np.flatnonzero(is_kept[its.candidate])
        chosen = its.candidate[taken]
        kept = candidates.row[chosen]
        records.family[kept] = g
        for key, values in records.drawn.items():
            if not key.startswith("contours[") or key.startswith(f"contours[{g}]."):
                values[kept] = candidates.values[key][chosen]
        if taken.size:
            index = sweeps * taken[:, None] + np.arange(sweeps)
            found = {name: rows[index] for name, rows in _of_sweeps(spec, its).items()}
            _put(records.sweep, found, kept, count)
            for some in spec.blocks(kept.size):
                _put(records.sample, _of_samples(its, index[some]), kept[some], count)


def _shares(stream: np.random.Generator, count: int) -> Floats:
    """Return the uniform numbers of a record's next draw."""
    found = stream.random(count)
    stream.bit_generator.advance(_APART - count)  # type: ignore[attr-defined]
    return found


def _hopeless(record: int, reasons: Counter[str]) -> SpecificationError:
    found = reasons.most_common()
    commonest = found[0][0]
    correction = next(correction for reason, correction in _CORRECTIONS.items() if commonest.startswith(reason))
    return SpecificationError(
        f"record {record} was drawn {_MOST_DRAWS} times, and no contour was one that every sweep can reach "
        f"({', '.join(f'{count} {why}' for why, count in found)}): {correction}"
    )


def _turns(spec: Specification, index: Index) -> dict[str, Index]:
    """Return the position of each record in each list, by the key of the list."""
    turns, rest = {}, index
    for key, count in reversed(spec.lists):
        turns[key], rest = rest % count, rest // count
    return turns


class _Followed(NamedTuple):
    """Sweeps along the valid contours of one group, with the sweeps of a candidate side by side."""

    candidate: Index  # indices of the candidates
    paths: Paths
    drives: Drives
    units: ManyUnits


def _tried(spec: Specification, candidates: _Candidates) -> tuple[NDArray[Any], dict[int, _Followed]]:
    """Test candidates: the reason for each rejection, `_GOOD` without one, and sweeps by group."""
    why, tried = np.full(candidates.row.size, _GOOD, dtype=object), dict[int, _Followed]()
    for g in np.unique(candidates.group).tolist():
        contours, built = _built(spec, g, candidates, why)
        if contours is not None:
            values = {key: v[built] for key, v in candidates.values.items()}
            tried[g] = _swept(spec, contours, built, as_built(spec, values))
            why[built] = _judged(tried[g].paths, spec.sweep_count)
    return why, tried


def _built(spec: Specification, g: int, candidates: _Candidates, why: NDArray[Any]) -> tuple[Contour | None, Index]:
    """Build the contours of a group with arrays of parameters, and their candidates; write reasons for the others."""
    family = FAMILIES[spec.groups[g].family]
    its = np.flatnonzero(candidates.group == g)

    def contour(some: Index) -> Contour:
        return family.contour({name: candidates.values[f"contours[{g}].{name}"][some] for name in family.parameters})

    try:
        return contour(its).broadcast_to(its.shape), its
    except ContourError:
        pass
    for i in its:
        try:
            contour(np.array([i]))
        except ContourError as error:
            why[i] = f"{_NO_CONTOUR} ({rule_of(error)})"
    its = its[why[its] == _GOOD]
    return (contour(its).broadcast_to(its.shape) if its.size else None), its


def _swept(spec: Specification, contours: Contour, candidate: Index, values: Mapping[str, Floats]) -> _Followed:
    """Sweep along contours, given the numbers of rods and pivots as they are built."""
    place = np.repeat(np.arange(candidate.size), spec.sweep_count)
    count = candidate.size

    def column(key: str, default: float = 0.0) -> Floats:
        return values.get(key, np.full(count, default))[place]

    length, rigidity = column("rod.length", 1.0), column("rod.flexural_rigidity", 1.0)
    units = ManyUnits(length, rigidity / length, rigidity / length**2)
    drives = drives_of(spec, values, length)
    paths = trace(
        SweepFrame(
            contours.take(place),
            *drives[:2],
            length,
            0.5 * column("rod.diameter"),
            drives.backward,
            column("rod.rest_curvature") * length,
            column("rod.taper"),
            column("rod.stem") / length,
        ),
        friction_angle=np.arctan(column("unknown.friction")),
        suspension_compliance=column("unknown.suspension_compliance") * units.moment_unit,
        contact_compliance=column("unknown.contact_compliance") * units.force_unit / length,
        profile=profile_of() if spec.has_taper else None,
        drive_angles=drives.way,
        relative=drives.way.ndim == 1,
        polished=False,
        lines=drives.lines,
    )
    return _Followed(candidate, paths, drives, units)


def _judged(paths: Paths, sweeps: int) -> NDArray[Any]:
    """Return the reasons for rejection of candidates with so many sweeps each, side by side."""
    fate = paths.reach.reshape(-1, sweeps).max(axis=1)
    clear = paths.is_clear().reshape(-1, sweeps).all(axis=1)
    reasons = np.array([one.message for one in Reachability], dtype=object)[fate]
    return np.where((fate == Reachability.TOUCHES) & ~clear, _NOT_CLEAR, reasons)


def _of_sweeps(spec: Specification, tried: _Followed) -> dict[str, NDArray[Any]]:
    """Columns of every sweep, shape (n,)."""
    paths = tried.paths
    # Of tip and tangential contact alone, whether they slide or stick.
    words = ("-".join(phase for phase, _ in groupby(phases.upper().split("-"))) for phases in phases_of(paths))
    phases = np.array(list(words), dtype=object)
    if spec.translations:
        found = {"direction": paths.sweep_frame.mirrored.astype(np.int8), "phases": phases}
    else:
        found = {"base_x": paths.sweep_frame.base_x, "base_y": paths.sweep_frame.base_y, "phases": phases}
    for event, columns in sweep_events(paths, tried.units).items():
        found |= {f"{event}_{name}": columns[name] for name in EVENT_COLUMNS}
    if spec.translations:
        length = tried.units.length_unit * tried.drives.travel_share
        found |= {"first_contact_travel": length * paths.first_angle, "snap_off_travel": length * paths.snap_angle}
    found["snap_off_kind"] = paths.snap_off
    if spec.has_thickness:
        found["largest_strain"] = np.nan_to_num(
            paths.largest_curvature * paths.sweep_frame.standoff / paths.sweep_frame.length
        )
    return found


def _of_samples(tried: _Followed, index: Index) -> dict[str, NDArray[Any]]:
    """Columns of the samples of sweeps, shape (*index.shape, k)."""
    paths, way, ends = tried.paths, tried.drives.way, tried.drives.ends
    samples = sweep_samples(paths, tried.units, index)
    if ends is None:
        first, snap = paths.first_angle[index][..., None], paths.snap_angle[index][..., None]
        as_seen = first + way * (snap - first) if way.ndim == 1 else way[index]
        mirrored = paths.sweep_frame.mirrored[index][..., None]
        found = {"drive_angle": np.where(mirrored, np.pi - as_seen, as_seen)}
    else:
        begin, end = (ends[index, k, :, None] for k in (0, 1))
        poses = begin + (end - begin) * np.linspace(0.0, 1.0, way.shape[1])
        found = {name: poses[..., k, :] for k, name in enumerate(("base_x", "base_y", "drive_angle"))}
    return found | {f"truth_{name}": samples[name] for name in (*SAMPLE_COLUMNS, "contact_phase")}


def _put(place: dict[str, NDArray[Any]], found: Mapping[str, NDArray[Any]], rows: Index, count: int) -> None:
    """Write arrays to rows of the arrays of all records."""
    for name, values in found.items():
        if name not in place:
            place[name] = np.empty((count, *values.shape[1:]), dtype=values.dtype)
        place[name][rows] = values

"""The numbers of a data set: contours drawn until the rod reaches them, swept, and measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tactile_bayes.contours.base import Contour
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.datasets.families import FAMILIES, KNOTS, LOG_RADIUS, rule_of
from tactile_bayes.datasets.measurement import measure
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.errors import ContourError, SpecificationError
from tactile_bayes.mechanics.fates import Reach
from tactile_bayes.mechanics.paths import Paths, trace
from tactile_bayes.rod import LARGEST_STRAIN
from tactile_bayes.sweeps import EVENT_COLUMNS, SAMPLE_COLUMNS, ManyUnits, phases_of, sweep_events, sweep_samples

__all__ = ["Records", "generate_records"]

Floats = NDArray[np.float64]
Index = NDArray[np.intp]


_MOST_DRAWS = 1000
"""Draws of one record before the specification is given up."""

_AT_ONCE = 500
"""Draws that are tried together, while fewer records are left: what is drawn in vain costs less than to begin anew."""

_APART = 2**20
"""Random numbers from where one draw of a record begins to where the next does: far more than there are laws, so that a
contour is the same whatever is drawn after it."""

_GOOD = ""


@dataclass(frozen=True)
class Records:
    """Records of a data set, as arrays."""

    index: Index
    family: Index
    """Which group of the specification each contour is from, shape (n,)."""
    drawn: dict[str, Floats]
    """By the keys of the specification's laws, shape (n,), and "contours[…].log_radius", shape (n, knots); NaN where
    another family's."""
    sweep: dict[str, NDArray[Any]]
    """Of each sweep, shape (n, sweeps): base_x, base_y, phases, events, and the largest strain of a thick rod."""
    sample: dict[str, NDArray[Any]]
    """Of each sample, shape (n, sweeps, samples): what was measured, and "truth_" columns."""
    redrawn: Counter[str]
    """Draws that came to nothing, by the reason."""

    @property
    def strained(self) -> int:
        """How many have a sweep in which the rod is strained beyond the model."""
        strain = self.sweep.get("largest_strain", np.zeros((1, 1)))
        return int(np.count_nonzero(np.any(strain > LARGEST_STRAIN, axis=1)))

    @property
    def untouched(self) -> int:
        """How many sweeps have no sample in contact."""
        return int(np.count_nonzero(~np.any(self.sample["truth_contact_phase"], axis=2)))


_REASONS = {
    Reach.TOUCHES: _GOOD,
    Reach.TOO_FAR: "out of reach",
    Reach.CUTS_PIVOT: "cuts the pivot",
    Reach.ENDS: "first touched beyond its end",
    Reach.TOO_CLOSE: "too close to the pivot",
    Reach.RUNS_OUT: "still touched at its other end",
}
_NOT_CLEAR = "not clear after snap-off"
_NO_CONTOUR = "no contour"

_HIGHER = "raise the contours above the pivots, by a larger q or lower bases"
_WIDER = "give wider contours, or bring the pivots nearer to them, or to their middle"
_REMEDIES = {
    "out of reach": "bring contours and pivots closer to one another (are contours, bases and rod in one unit?)",
    "cuts the pivot": _HIGHER,
    "first touched beyond its end": _WIDER,
    "too close to the pivot": _HIGHER,
    "still touched at its other end": _WIDER,
    _NOT_CLEAR: "give wider contours, or raise them: the straight rod would still cut the object",
    _NO_CONTOUR: "change the law of that parameter",
}


@threadpool_limits.wrap(limits=1)  # with more threads, products of matrices are rounded otherwise
def generate_records(spec: Specification, begin: int, end: int) -> Records:
    """Records from index `begin` to before `end`.

    The random numbers of a record follow from the seed and its index alone, and those of its contour are drawn before
    all others; rounding may depend on which records are made together, so that bit by bit only the same stretch gives
    the same numbers.

    Raises
    ------
    SpecificationError
        If of 1000 draws of a record none is a contour that every sweep can reach.
    """
    index = np.arange(begin, end)
    streams = [_Stream(spec.seed, i) for i in index.tolist()]
    keys = [key for key, _ in spec.laws]
    free = {g: draw for g, group in enumerate(spec.groups) if (draw := FAMILIES[group.family].draw_log_radius)}
    turns = _turns(spec, index)
    drawn = {key: np.full(index.size, np.nan) for key in keys}
    drawn |= {f"contours[{g}].{LOG_RADIUS}": np.full((index.size, KNOTS.size), np.nan) for g in free}
    family = np.zeros(index.size, dtype=np.intp)
    sweep: dict[str, NDArray[Any]] = {}
    sample: dict[str, NDArray[Any]] = {}
    redrawn: Counter[str] = Counter()
    in_vain: list[tuple[Index, NDArray[Any]]] = []
    left, draws, ahead = np.arange(index.size), 0, 1
    while left.size:
        if draws == _MOST_DRAWS:
            reasons = [why for rows, whys in in_vain for why in whys[rows == left[0]].ravel()]
            raise _hopeless(int(index[left[0]]), Counter(reasons))
        of_record = np.repeat(left, ahead)
        shares = np.array([streams[i].shares(1 + len(keys)) for i in of_record])
        group = _group(spec, shares[:, 0], turns.get("contours"), of_record)
        values = {
            key: law.at(shares[:, 1 + k], turns[law.axis or key][of_record] if law.kind == "each" else of_record)
            for k, (key, law) in enumerate(spec.laws)
        }
        normals = np.full((of_record.size, KNOTS.size if free else 0), np.nan)
        for k in np.flatnonzero(np.isin(group, list(free))):
            normals[k] = streams[of_record[k]].normals(KNOTS.size)
        for g, draw_log_radius in free.items():
            parameters = {name: values[f"contours[{g}].{name}"] for name in spec.groups[g].laws}
            values[f"contours[{g}].{LOG_RADIUS}"] = draw_log_radius(parameters, normals)
        why = np.empty(of_record.size, dtype=object)
        found = []
        for g in np.unique(group).tolist():
            among = np.flatnonzero(group == g)
            why[among], swept = _swept(spec, g, {k: v[among] for k, v in values.items()})
            found.append((g, among[why[among] == _GOOD], swept))
        is_good = (why == _GOOD).reshape(left.size, ahead)
        before = is_good.cumsum(axis=1)
        in_vain.append((left, why.reshape(left.size, ahead)))
        redrawn.update(in_vain[-1][1][before == 0].tolist())
        first = (is_good & (before == 1)).ravel()
        for g, good, swept in found:
            chosen = good[first[good]]
            kept = of_record[chosen]
            family[kept] = g
            for key in drawn:
                if not key.startswith("contours[") or key.startswith(f"contours[{g}]."):
                    drawn[key][kept] = values[key][chosen]
            for name, rows in swept.items():
                place = sample if rows.ndim == 3 else sweep
                if name not in place:
                    place[name] = np.zeros(
                        (index.size, *rows.shape[1:]), dtype=object if rows.dtype.kind == "U" else rows.dtype
                    )
                place[name][kept] = rows[first[good]]
        left, draws = left[~is_good.any(axis=1)], draws + ahead
        ahead = max(1, min(2 * ahead, max(_AT_ONCE, index.size) // max(left.size, 1), _MOST_DRAWS - draws))
    measure(spec, index, drawn, sample)
    return Records(index, family, drawn, sweep, sample, redrawn)


class _Stream:
    """The random numbers that a record is drawn with."""

    def __init__(self, seed: int, record: int) -> None:
        self.key = seed, record
        self.bits = np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(record, 0)))
        self.uniform = np.random.Generator(self.bits)
        self.normal: np.random.Generator | None = None

    def shares(self, count: int) -> Floats:
        """Uniform numbers of the next draw."""
        found = self.uniform.random(count)
        self.bits.advance(_APART - count)
        return found

    def normals(self, count: int) -> Floats:
        """Normal numbers of the next shape-free contour, from a stream of their own."""
        if self.normal is None:
            seed, record = self.key
            self.normal = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(record, 2)))
        return self.normal.standard_normal(count)


def _hopeless(record: int, reasons: Counter[str]) -> SpecificationError:
    found = reasons.most_common()
    commonest = found[0][0]
    remedy = next(remedy for reason, remedy in _REMEDIES.items() if commonest.startswith(reason))
    return SpecificationError(
        f"record {record} was drawn {_MOST_DRAWS} times, and no contour was one that every sweep can reach "
        f"({', '.join(f'{count} {why}' for why, count in found)}): {remedy}"
    )


def _turns(spec: Specification, index: Index) -> dict[str, Index]:
    """Which entry of each list a record has, by the key of the list."""
    turns, rest = {}, index
    for key, count in reversed(spec.lists):
        turns[key], rest = rest % count, rest // count
    return turns


def _group(spec: Specification, share: Floats, turns: Index | None, left: Index) -> Index:
    if turns is not None:
        return turns[left]
    weights = np.cumsum([group.weight for group in spec.groups])
    return np.minimum(np.searchsorted(weights, share * weights[-1], side="right"), len(spec.groups) - 1)


def _swept(spec: Specification, g: int, values: Mapping[str, Floats]) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]:
    """Draws of one group: why each comes to nothing, `_GOOD` if it does not, and the sweeps of the good ones."""
    prefix = f"contours[{g}]."
    parameters = {key.removeprefix(prefix): v for key, v in values.items() if key.startswith(prefix)}
    why, contours = _built(spec.groups[g].family, parameters, len(next(iter(parameters.values()))))
    if contours is None:
        return why, {}
    built = np.flatnonzero(why == _GOOD)
    lengths = values["rod.length"][built] if spec.rod else np.ones(built.size)
    standoffs = 0.5 * values["rod.diameter"][built] if spec.rod else np.zeros(built.size)
    sweeps = len(spec.sweeps)
    base_x, base_y = (
        np.concatenate([values[f"scan.bases[{b}][{axis}]"][built] for b, _ in spec.sweeps]) for axis in (0, 1)
    )
    backward = np.repeat([direction == "backward" for _, direction in spec.sweeps], built.size)
    lane_of = np.tile(np.arange(built.size), sweeps)
    seen = SeenContour(
        contours.take(lane_of), base_x, base_y, np.tile(lengths, sweeps), np.tile(standoffs, sweeps), backward
    )
    drive, way = spec.drive, np.linspace(0.0, 1.0, spec.drive.samples)
    is_relative = drive.begin is None or drive.end is None
    if drive.begin is None or drive.end is None:
        as_seen = np.tile((1.0 + 2.0 * drive.margin) * way - drive.margin, (seen.lanes, 1))
    else:
        forward = drive.begin + (drive.end - drive.begin) * way
        as_seen = np.where(backward[:, None], np.pi - forward[::-1], forward)
    paths = trace(
        seen,
        friction_angle=float(np.arctan(spec.friction)),
        drive_angles=as_seen,
        relative=is_relative,
        polished=False,
    )
    if is_relative:
        as_seen = paths.first_angle[:, None] + as_seen * (paths.snap_angle - paths.first_angle)[:, None]
    fate = paths.reach.reshape(sweeps, -1).max(axis=0)
    with np.errstate(invalid="ignore"):
        clear = paths.is_clear().reshape(sweeps, -1).all(axis=0)
    reasons = np.array([_REASONS[Reach(reach)] for reach in range(len(_REASONS))], dtype=object)[fate]
    why[built] = np.where((fate == Reach.TOUCHES) & ~clear, _NOT_CLEAR, reasons)
    return why, _recorded(spec, paths, as_seen, why[built] == _GOOD, _units(spec, values, lane_of, built))


def _built(family: str, parameters: Mapping[str, Floats], count: int) -> tuple[NDArray[Any], Contour | None]:
    """Why each draw is no contour, `_GOOD` if it is one, and the contours of these, with all parameters arrays."""
    definition = FAMILIES[family]
    why = np.full(count, _GOOD, dtype=object)
    try:
        return why, definition.build(parameters).broadcast_to((count,))
    except ContourError:
        pass
    for i in range(count):
        try:
            definition.build({name: values[i : i + 1] for name, values in parameters.items()})
        except ContourError as error:
            why[i] = f"{_NO_CONTOUR} ({rule_of(error)})"
    built = np.flatnonzero(why == _GOOD)
    if not built.size:
        return why, None
    some = {name: values[built] for name, values in parameters.items()}
    return why, definition.build(some).broadcast_to((built.size,))


def _units(spec: Specification, values: Mapping[str, Floats], lane_of: Index, built: Index) -> ManyUnits:
    if not spec.rod:
        return ManyUnits(1.0, 1.0, 1.0)
    length, rigidity = (values[f"rod.{name}"][built][lane_of] for name in ("length", "flexural_rigidity"))
    return ManyUnits(length, rigidity / length, rigidity / length**2)


def _recorded(
    spec: Specification, paths: Paths, as_seen: Floats, good: NDArray[np.bool_], units: ManyUnits
) -> dict[str, NDArray[Any]]:
    """What the sweeps of the good contours record at drive angles as seen in forward sweeps, shape (good, sweeps) or
    (good, sweeps, samples)."""
    lanes = paths.seen.lanes

    def by_record(values: NDArray[Any]) -> NDArray[Any]:
        return np.moveaxis(values.reshape(len(spec.sweeps), lanes // len(spec.sweeps), *values.shape[1:]), 0, 1)[good]

    found = {
        "base_x": paths.seen.base_x,
        "base_y": paths.seen.base_y,
        "phases": np.array(phases_of(paths), dtype=np.str_),
    }
    for event, columns in sweep_events(paths, units).items():
        found |= {f"{event}_{name}": columns[name] for name in EVENT_COLUMNS}
    found["snap_off_kind"] = paths.snap_off
    if spec.has_thickness:
        found["largest_strain"] = np.nan_to_num(paths.largest_curvature * paths.seen.standoff / paths.seen.length)
    samples = sweep_samples(paths, units)
    found["drive_angle"] = np.where(paths.seen.mirrored[:, None], np.pi - as_seen, as_seen)
    found |= {f"truth_{name}": samples[name] for name in (*SAMPLE_COLUMNS, "contact_phase")}
    return {name: by_record(values) for name, values in found.items()}

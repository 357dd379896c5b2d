"""The numbers of a data set: contours drawn until the rod reaches them, swept, and measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tactile_bayes.contours.base import Contour
from tactile_bayes.contours.seen import SeenContour
from tactile_bayes.datasets.families import FAMILIES, KNOTS, LOG_RADIUS, rule_of
from tactile_bayes.datasets.measurement import measure
from tactile_bayes.datasets.specification import Specification
from tactile_bayes.datasets.streams import CONTOUR, NORMAL, streams
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

_GOOD = Reach.TOUCHES.words


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
    "hardly touched": "bring contours and pivots closer to one another, or give contours of a size nearer to the rod's",
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
    uniform = streams(spec.seed, index, CONTOUR)
    keys = [key for key, _ in spec.laws]
    free = {g: draw for g, group in enumerate(spec.groups) if (draw := FAMILIES[group.family].draw_log_radius)}
    normal = streams(spec.seed, index, NORMAL) if free else []
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
        shares = np.array([_shares(uniform[i], 1 + len(keys)) for i in of_record])
        group = _group(spec, shares[:, 0], turns.get("contours"), of_record)
        values = {
            key: law.at(shares[:, 1 + k], turns[law.axis or key][of_record] if law.kind == "each" else of_record)
            for k, (key, law) in enumerate(spec.laws)
        }
        normals = np.full((of_record.size, KNOTS.size if free else 0), np.nan)
        for k in np.flatnonzero(np.isin(group, list(free))):
            normals[k] = normal[of_record[k]].standard_normal(KNOTS.size)
        for g, draw_log_radius in free.items():
            parameters = {name: values[f"contours[{g}].{name}"] for name in spec.groups[g].laws}
            values[f"contours[{g}].{LOG_RADIUS}"] = draw_log_radius(parameters, normals)
        why = np.empty(of_record.size, dtype=object)
        found = []
        for g in np.unique(group).tolist():
            among = np.flatnonzero(group == g)
            why[among], tried = _tried(spec, g, {k: v[among] for k, v in values.items()})
            found.append((g, among, tried))
        is_good = (why == _GOOD).reshape(left.size, ahead)
        before = is_good.cumsum(axis=1)
        in_vain.append((left, why.reshape(left.size, ahead)))
        redrawn.update(in_vain[-1][1][before == 0].tolist())
        first = (is_good & (before == 1)).ravel()
        for g, among, tried in found:
            taken = np.flatnonzero(first[among])
            chosen = among[taken]
            kept = of_record[chosen]
            family[kept] = g
            for key in drawn:
                if not key.startswith("contours[") or key.startswith(f"contours[{g}]."):
                    drawn[key][kept] = values[key][chosen]
            if tried is None or not taken.size:
                continue
            sweeps = len(spec.sweeps)
            lane = sweeps * np.searchsorted(tried.built, taken)[:, None] + np.arange(sweeps)
            _put(sweep, {name: rows[lane] for name, rows in _of_sweeps(spec, tried).items()}, kept, index.size)
            for some in spec.blocks(kept.size):
                _put(sample, _of_samples(tried, lane[some]), kept[some], index.size)
        left, draws = left[~is_good.any(axis=1)], draws + ahead
        ahead = max(1, min(2 * ahead, max(_AT_ONCE, index.size) // max(left.size, 1), _MOST_DRAWS - draws))
    measure(spec, index, drawn, sample)
    return Records(index, family, drawn, sweep, sample, redrawn)


def _shares(stream: np.random.Generator, count: int) -> Floats:
    """Uniform numbers of a record's next draw."""
    found = stream.random(count)
    stream.bit_generator.advance(_APART - count)  # type: ignore[attr-defined]
    return found


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


class _Tried(NamedTuple):
    """Sweeps along the draws of one group that are contours: a lane each, those of a draw side by side."""

    built: Index
    """Which draws these are."""
    paths: Paths
    drive: Floats
    """Drive angles as seen in forward sweeps, shape (lanes, k); or shares of the way from first contact to snap-off,
    shape (k,)."""
    units: ManyUnits


def _tried(spec: Specification, g: int, values: Mapping[str, Floats]) -> tuple[NDArray[Any], _Tried | None]:
    """Draws of one group: why each comes to nothing, `_GOOD` if it does not, and their sweeps."""
    prefix = f"contours[{g}]."
    parameters = {key.removeprefix(prefix): v for key, v in values.items() if key.startswith(prefix)}
    why, contours = _built(spec.groups[g].family, parameters, len(next(iter(parameters.values()))))
    if contours is None:
        return why, None
    built, sweeps = np.flatnonzero(why == _GOOD), len(spec.sweeps)
    draw, place = np.repeat(built, sweeps), np.repeat(np.arange(built.size), sweeps)
    base_x, base_y = (
        np.stack([values[f"scan.bases[{b}][{axis}]"][built] for b, _ in spec.sweeps], axis=1).ravel() for axis in (0, 1)
    )
    backward = np.tile([direction == "backward" for _, direction in spec.sweeps], built.size)
    length, standoff, units = np.ones(draw.size), np.zeros(draw.size), ManyUnits(1.0, 1.0, 1.0)
    if spec.rod:
        length, rigidity, diameter = (
            values[f"rod.{name}"][draw] for name in ("length", "flexural_rigidity", "diameter")
        )
        standoff, units = 0.5 * diameter, ManyUnits(length, rigidity / length, rigidity / length**2)
    drive, way = spec.drive, np.linspace(0.0, 1.0, spec.drive.samples)
    if drive.begin is None or drive.end is None:
        as_seen = (1.0 + 2.0 * drive.margin) * way - drive.margin
    else:
        forward = drive.begin + (drive.end - drive.begin) * way
        as_seen = np.where(backward[:, None], np.pi - forward[::-1], forward)
    paths = trace(
        SeenContour(contours.take(place), base_x, base_y, length, standoff, backward),
        friction_angle=float(np.arctan(spec.friction)),
        drive_angles=as_seen,
        relative=as_seen.ndim == 1,
        polished=False,
    )
    fate = paths.reach.reshape(-1, sweeps).max(axis=1)
    with np.errstate(invalid="ignore"):
        clear = paths.is_clear().reshape(-1, sweeps).all(axis=1)
    reasons = np.array([reach.words for reach in Reach], dtype=object)[fate]
    why[built] = np.where((fate == Reach.TOUCHES) & ~clear, _NOT_CLEAR, reasons)
    return why, _Tried(built, paths, as_seen, units)


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


def _of_sweeps(spec: Specification, tried: _Tried) -> dict[str, NDArray[Any]]:
    """What is known of every sweep, shape (lanes,)."""
    paths = tried.paths
    found = {
        "base_x": paths.seen.base_x,
        "base_y": paths.seen.base_y,
        "phases": np.array(phases_of(paths), dtype=object),
    }
    for event, columns in sweep_events(paths, tried.units).items():
        found |= {f"{event}_{name}": columns[name] for name in EVENT_COLUMNS}
    found["snap_off_kind"] = paths.snap_off
    if spec.has_thickness:
        found["largest_strain"] = np.nan_to_num(paths.largest_curvature * paths.seen.standoff / paths.seen.length)
    return found


def _of_samples(tried: _Tried, lane: Index) -> dict[str, NDArray[Any]]:
    """What sweeps on lanes record, shape (*lane.shape, k)."""
    paths, drive = tried.paths, tried.drive
    first, snap = paths.first_angle[lane][..., None], paths.snap_angle[lane][..., None]
    as_seen = first + drive * (snap - first) if drive.ndim == 1 else drive[lane]
    samples = sweep_samples(paths, tried.units, lane)
    mirrored = paths.seen.mirrored[lane][..., None]
    found = {"drive_angle": np.where(mirrored, np.pi - as_seen, as_seen)}
    return found | {f"truth_{name}": samples[name] for name in (*SAMPLE_COLUMNS, "contact_phase")}


def _put(place: dict[str, NDArray[Any]], found: Mapping[str, NDArray[Any]], rows: Index, count: int) -> None:
    """Put what is found into rows of what is there of so many records."""
    for name, values in found.items():
        if name not in place:
            place[name] = np.empty((count, *values.shape[1:]), dtype=values.dtype)
        place[name][rows] = values

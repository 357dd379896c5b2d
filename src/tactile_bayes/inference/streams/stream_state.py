"""The state of a stream: its growing record, its e-value, and the file from which it resumes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import logsumexp

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError, RecordError
from tactile_bayes.inference.experiment import Experiment
from tactile_bayes.record import carried_sweeps, validate
from tactile_bayes.record.netcdf import read_netcdf
from tactile_bayes.tasks import check_format
from tactile_bayes.tasks.documents import read_json


def continued(record: xr.Dataset, samples: xr.Dataset) -> xr.Dataset:
    """Return a record with new samples behind its own."""
    new = validate(samples)
    for name in sorted({*record.attrs, *new.attrs}, key=str):
        one, other = record.attrs.get(name, ""), new.attrs.get(name, "")
        if not np.array_equal(one, other):
            raise RecordError(
                f"attribute {name!r} of the new samples is {other!r}, but was {one!r}: give all samples in the same "
                "units, of the same rod and load cell"
            )
    if set(record.variables) != set(new.variables):
        odd = ", ".join(map(repr, sorted(map(str, set(record.variables) ^ set(new.variables)))))
        raise RecordError(f"the new samples and those before do not have the same columns, they differ in {odd}")
    last, first = int(record.sweep[-1]), int(new.sweep[0])
    had = set(record.sweep.values.tolist()) - {last}
    if again := sorted(had & set(new.sweep.values.tolist())):
        raise RecordError(
            f"sweep {again[0]} was over when sweep {last} began: give samples in the order in which they were measured"
        )
    joined = validate(xr.concat([record, new], "sample", combine_attrs="override"))
    if first == last and last not in carried_sweeps(joined):
        _refuse_return(record, new, last)
    return joined


def _refuse_return(record: xr.Dataset, new: xr.Dataset, sweep: int) -> None:
    """Refuse new samples that begin further back in a sweep than its encoder scatters."""
    sense = 1.0 if str(new.direction.values[0]) == "forward" else -1.0
    before, after = (sense * each.drive_angle.values[each.sweep.values == sweep] for each in (record, new))
    scatter = max((float(-np.diff(part).min(initial=0.0)) for part in (before, after)), default=0.0)
    scatter = max(scatter, float(record.attrs.get("load_cell_drive_angle_noise", 0.0)))
    if after[0] < before[-1] - 6.0 * scatter - 1e-9:
        raise RecordError(
            f"the new samples of sweep {sweep} begin at a drive angle of {sense * after[0]:.6g} rad, behind the last "
            f"one, {sense * before[-1]:.6g} rad: give each sample once, in the order in which they were measured"
        )


WIDER = (1.5, 3.0, 6.0)  # factors on the noise of the alternatives with which the e-value compares the model
_KIND = "stream of tactile-bayes"
_FORMAT = 2
_HOW = "begin a new stream, or put a copy of the file back"


@dataclass(frozen=True, eq=False)
class StreamState:
    """A stream after an update."""

    record: xr.Dataset
    experiment: Experiment
    points: Floats  # particles, shape (n, parameters of the model)
    values: Floats  # logarithm of prior times likelihood of the particles, shape (n,)
    log_weights: Floats  # shape (n,), normalised
    # Logarithms of the products of ratios of `Particles` from each block on, summed by prior weights; shape (factors,).
    log_products: Floats
    log_integral: float  # logarithm of the integral of prior times likelihood
    share: float  # share of the prior within reach
    correlation: float  # correlation of the last steps of any update; NaN if there were none
    shift: float  # largest one of all updates, as of `Particles`
    rise: float  # that of the last stage of any update, as of `Particles`; 0 if there was none
    surprise: float  # logarithm of the largest e-value so far
    updates: int
    evaluations: int
    seconds: float


def surprise_after(old: StreamState | None, log_ratios: Floats) -> tuple[Floats, float]:
    """Return the products of ratios after a block, and the logarithm of the largest e-value so far. That the model is
    wrong from the k-th block on has the prior weight 1/(k(k + 1)); blocks to come have no ratio yet."""
    blocks = 1 if old is None else old.updates + 2
    before = np.full(len(WIDER), -np.inf) if old is None else old.log_products
    products = np.logaddexp(before, -np.log(blocks * (blocks + 1.0))) + log_ratios
    now = float(np.logaddexp(logsumexp(products) - np.log(len(WIDER)), -np.log(blocks + 1.0)))
    return products, now if old is None else float(np.fmax(now, old.surprise))


_ARRAYS = {
    "points": ("particle", "parameter"),
    "values": ("particle",),
    "log_weights": ("particle",),
    "log_products": ("factor",),
}
_NUMBERS = tuple(field.name for field in fields(StreamState))[6:]


def tree_of(state: StreamState, identity: Mapping[str, str]) -> xr.DataTree:
    """Return a state with its record and its identity as a tree for a file."""
    arrays = {name: (dims, getattr(state, name)) for name, dims in _ARRAYS.items()}
    particles = xr.Dataset({**arrays, **{name: getattr(state, name) for name in _NUMBERS}})
    tree = xr.DataTree.from_dict({"record": state.record, "particles": particles})
    tree.attrs = {"kind": _KIND, "format": _FORMAT, "identity": json.dumps(dict(identity))}
    return tree


def read_tree(path: Path) -> xr.DataTree:
    """Read the file of a stream, or of several."""
    if not path.is_file():
        raise InferenceError(f"there is no file {path}: give the state that a stream has saved")
    return read_netcdf(
        path,
        xr.open_datatree,
        lambda what: InferenceError(f"{path} {what}: {_HOW}"),
        decode_times=False,
        decode_timedelta=False,
    )


def state_in(tree: xr.DataTree, path: Path) -> tuple[xr.Dataset, dict[str, str], dict[str, Any]]:
    """Return record, identity, and all else of the state in a tree from `tree_of`, or of a part of the file."""
    if tree.attrs.get("kind") != _KIND:
        raise InferenceError(f"{path} holds no state of a stream: give a file that Stream.save has written")
    stated = tree.attrs.get("format")
    check_format(stated, _FORMAT, lambda what: InferenceError(f"{path} {what}: or begin a new stream"), _FORMAT)
    try:
        record = validate(tree["record"].to_dataset())
        identity = {name: str(value) for name, value in read_json(tree.attrs["identity"], "identity").items()}
        particles = tree["particles"].to_dataset()
        if any(particles[name].dims != dims for name, dims in _ARRAYS.items()) or not set(_NUMBERS) <= set(particles):
            raise ValueError("its particles have other columns")
    except (KeyError, ValueError, AttributeError, RecordError) as error:
        raise InferenceError(f"{path} holds no whole state of a stream ({error}): {_HOW}") from error
    if not np.isfinite(particles["points"]).all():
        raise InferenceError(f"{path} holds particles that are not finite: {_HOW}")
    arrays = {name: particles[name].values for name in _ARRAYS}
    return record, identity, {**arrays, **{name: particles[name].item() for name in _NUMBERS}}

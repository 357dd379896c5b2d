"""Comparison of families of contours while a record grows."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from copy import copy
from time import perf_counter
from typing import Any, Self, cast

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.special import softmax

from tactile_bayes.checks import check_function, check_numbers, check_path
from tactile_bayes.comparison.families import BY_DRAW, GIVEN_UP, checked_families, matched, with_known
from tactile_bayes.contours.families import family_named
from tactile_bayes.errors import InferenceError, ParameterError, ReachError
from tactile_bayes.inference.family import Family
from tactile_bayes.inference.streams.stream import LEVELS, Stream
from tactile_bayes.inference.streams.stream_state import read_tree
from tactile_bayes.numerics.random_numbers import Rng, seed_sequence
from tactile_bayes.record import rod_of, validate
from tactile_bayes.record.netcdf import write_netcdf
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.tasks.documents import read_json
from tactile_bayes.uncertainty.band import averaged_heights

_KIND = "streams of families of tactile-bayes"

_OF_STREAM = ("effective_number", "correlation", "log_density_shift", "e_value")
_DRAWS = 4000  # number of contours from which averaged heights are computed
_KEPT_DRAWS = 1000  # number of draws of a contour that are in a result, of each family


class StreamComparison:
    """Posteriors of several families of contours from the record so far, with the probability of each family.

    Each family has a `Stream` of its own, whose evidence gives its probability, with prior probabilities and priors of
    sizes that favour no family, as in `compare_families`.

    Parameters
    ----------
    families : sequence of str or Family
        Two or more families, as in `compare_families`.
    rig, rng, particles
        As in `Stream`, the same for all families.
    x : array_like, optional
        Positions at which every update states quantiles of the contour's height, averaged over families [length].
    stop : callable, optional
        Rule for the end of measuring, as in `Stream`.

    Raises
    ------
    ParameterError
        If an argument is not valid. What depends on the record is checked at the first update.

    Notes
    -----
    A family is lost, with the probability 0 from then on, if none of its particles explains the samples, none of its
    contours is within reach, or the logarithm of its evidence is 100 below the largest.

    Examples
    --------
    >>> from tactile_bayes import LoadCell, Rig, scan
    >>> from tactile_bayes.contours import Circle
    >>> cell = LoadCell(force_noise=0.05, moment_noise=0.02)
    >>> measured = cell.measure(scan(Circle(0.3, q=0.5), drive_step=0.05).record, rng=1)
    >>> rig = Rig(load_cell=cell, unknown="nothing")
    >>> streams = StreamComparison(["circle", "parabola"], rig=rig, rng=1, particles=200)
    >>> now = streams.update(measured)
    >>> now.attrs["most_probable"]
    'circle'
    """

    def __init__(
        self,
        families: Sequence[Family | str],
        *,
        rig: Rig | None = None,
        rng: Rng,
        particles: int = 1000,
        x: ArrayLike | None = None,
        stop: Callable[[xr.Dataset], object] | None = None,
    ) -> None:
        check_function("stop", stop)
        self._compared = {family.name: family for family in checked_families(families)}
        self._families = list(self._compared)
        self._rig, self._seed, self._particles, self._stop = rig_of(rig), seed_sequence(rng), particles, stop
        self._x = None if x is None else check_numbers("x", x, "give a list of finite numbers", shape=(None,))
        for family in self._compared.values():
            self._stream(family)  # refuses what it can before the first sample
        self._streams: dict[str, Stream] = {}
        self._lost: dict[str, str] = {}

    @property
    def record(self) -> xr.Dataset | None:
        """The record so far; None before the first update."""
        return self._streams[self._left()[0]].record if self._streams else None

    def _known_record(self) -> xr.Dataset:
        if (record := self.record) is None:
            raise InferenceError("the streams have no samples yet: call update with some first")
        return record

    def update(self, samples: xr.Dataset) -> xr.Dataset:
        """Take new samples into account, as `Stream.update` does, and return the families' probabilities.

        Returns
        -------
        xr.Dataset
            Over "family": `probability`; `log_evidence`; `effective_number`, `correlation`, `log_density_shift` and
            `e_value`, as from `Stream.update` (NaN for a family that is lost; where the shift is above 1.2, evidence
            and probability of the family are too small); `contour_draws`, of which `contour_band` computes a band
            averaged over families. `samples`, their number so far; `seconds` that the update took; with x, `height` by
            `level` and `x`, averaged over families; with a rule, `may_stop`. Attributes: `most_probable`; `lost`, JSON.

        Raises
        ------
        RecordError, ParameterError, InferenceError
            As in `Stream.update`, and if no family explains the samples. After any error all streams are as before.
        """
        began = perf_counter()
        before = self._streams, self._lost
        try:
            self._advance(samples)
            result = self.latest()
            result["seconds"] = ((), perf_counter() - began, {"units": "s"})
            if self._stop is not None:
                result["may_stop"] = bool(self._stop(result))
        except BaseException:
            self._streams, self._lost = before
            raise
        return result

    def _advance(self, samples: xr.Dataset) -> None:
        streams = {name: copy(stream) for name, stream in self._streams.items()} or self._first(samples)
        lost, logs = dict(self._lost), {}
        for name in self._left():
            try:
                logs[name] = float(streams[name].update(samples).log_evidence)
            except (InferenceError, ReachError) as error:
                lost[name] = str(error)
        if not logs:
            raise InferenceError("no family explains the samples: " + "; ".join(f"{k}: {v}" for k, v in lost.items()))
        best = max(logs, key=logs.__getitem__)
        for name, log in logs.items():
            if log < logs[best] - GIVEN_UP:
                samples_so_far = streams[name].latest().samples.item()
                lost[name] = f"dropped: {best} explains the first {samples_so_far} samples far better"
        self._streams, self._lost = streams, lost

    def latest(self) -> xr.Dataset:
        """Return the result of `update` for the record so far, without `seconds` and `may_stop`.

        Raises InferenceError before the first update.
        """
        record = self._known_record()
        every = {name: self._streams[name].latest() for name in self._left()}
        sizes = [len(family_named(name).parameters) for name in self._families]
        draws = np.full((len(sizes), _KEPT_DRAWS, max(sizes)), np.nan)
        for of_family, name, size in zip(draws, self._families, sizes, strict=True):
            if name in every:
                drawn = self._streams[name].contour_draws(_KEPT_DRAWS)
                of_family[:, :size] = with_known(self._compared[name], drawn)

        def of_each(what: str, otherwise: float = np.nan) -> list[float]:
            return [float(every[name][what]) if name in every else otherwise for name in self._families]

        logs = of_each("log_evidence", -np.inf)
        probability = softmax(logs)
        columns = {"probability": probability, "log_evidence": logs, **{name: of_each(name) for name in _OF_STREAM}}
        found = xr.Dataset(
            {name: ("family", values) for name, values in columns.items()}
            | {"contour_draws": (BY_DRAW, draws), "samples": record.sizes["sample"]},
            coords={"family": self._families},
            attrs={
                "most_probable": self._families[int(np.argmax(probability))],
                "lost": json.dumps(self._lost),
                "units": record.attrs["units"],
            },
        )
        if self._x is not None:
            heights = np.quantile(averaged_heights(found, self._x, _DRAWS), LEVELS, axis=0)
            found = found.assign_coords(x=self._x, level=list(LEVELS))
            found["height"] = (("level", "x"), heights)
        return found

    def posterior(self, family: str | None = None) -> xr.DataTree:
        """Return the posterior of a family, by default of the most probable one, as `Stream.posterior` does.

        Raises InferenceError before the first update or if the family is lost, ParameterError if it is not compared.
        """
        self._known_record()
        name = str(self.latest().attrs["most_probable"]) if family is None else family_named(family).name
        if name not in self._families:
            raise ParameterError(f"{name!r} is not compared: give one of {', '.join(self._families)}")
        if name in self._lost:
            raise InferenceError(f"{name} is lost: {self._lost[name]}")
        return self._streams[name].posterior()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all streams to a file from which `resume` continues, whole or not at all, in place of one of its name.

        Raises InferenceError before the first update.
        """
        self._known_record()
        left = self._left()
        tree = xr.DataTree.from_dict({f"family_{k}": self._streams[name].as_tree() for k, name in enumerate(left)})
        tree.attrs = {"kind": _KIND, "families": json.dumps(self._families), "lost": json.dumps(self._lost)}
        write_netcdf(tree, check_path("path", path))

    @classmethod
    def resume(cls, path: str | os.PathLike[str], record: xr.Dataset | None = None, **arguments: Any) -> Self:
        """Return the streams that were saved in a file; they continue with the numbers that they would have had.

        Parameters
        ----------
        path, record
            As for `Stream.resume`.
        **arguments
            The arguments of `StreamComparison` as they were; `x` and `stop` may be others.

        Raises
        ------
        InferenceError, RecordError, ParameterError
            As in `Stream.resume`, and if the families are others.
        """
        path, own = check_path("path", path), cls(**arguments)
        tree = read_tree(path)
        if tree.attrs.get("kind") != _KIND:
            raise InferenceError(f"{path} holds no streams of families: give a file that save has written")
        families = read_json(tree.attrs["families"], "families")
        if families != own._families:
            raise InferenceError(
                f"{path} is of the families {', '.join(families)}, not {', '.join(own._families)}: give another file, "
                "or the families of then"
            )
        own._lost = read_json(tree.attrs["lost"], "lost")
        parts = [tree[f"family_{k}"] for k in range(len(own._left()))]
        own._streams = own._first(cast(xr.DataTree, parts[0]["record"]).to_dataset() if record is None else record)
        for name, part in zip(own._left(), parts, strict=True):
            own._streams[name].restore(cast(xr.DataTree, part), path, record)
        return own

    def _first(self, samples: xr.Dataset) -> dict[str, Stream]:
        """Return streams without samples."""
        length = (self._rig.rod or rod_of(validate(samples))).length
        return {name: self._stream(matched(family, length)) for name, family in self._compared.items()}

    def _stream(self, family: Family) -> Stream:
        return Stream(family=family, rig=self._rig, rng=self._seed, particles=self._particles)

    def _left(self) -> list[str]:
        """Return the families that are not lost."""
        return [name for name in self._families if name not in self._lost]

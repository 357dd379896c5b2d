"""A contour that is inferred while its record grows, in one folder."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.arrays import Floats
from tactile_bayes.checks import check_numbers, check_positive, check_probability, check_whole_number
from tactile_bayes.comparison.streams import StreamComparison
from tactile_bayes.errors import InferenceError, ParameterError, RecordError
from tactile_bayes.inference.family import Family
from tactile_bayes.inference.streams.particles import LOST_ONCE
from tactile_bayes.inference.streams.stream import Stream
from tactile_bayes.load_cell import LoadCell
from tactile_bayes.record import record_hash
from tactile_bayes.rig.rig import Rig, rig_of
from tactile_bayes.rig.stated import memory_in, sensor_values
from tactile_bayes.runs.contour import ContourRun, RunFolder, complete, file_of, origin_of
from tactile_bayes.tasks import alone_in
from tactile_bayes.uncertainty.band import contour_band
from tactile_bayes.uncertainty.rod_reach import reach
from tactile_bayes.uncertainty.summary import summary

_POINTS = 201  # number of grid points of the band


class WatchUpdate(NamedTuple):
    """The answer after some samples."""

    samples: int  # number of samples that are taken into account so far
    new: int  # number of those that came with this update
    seconds: float  # time that the update took, with its files [s]
    restarted: bool  # whether all samples were taken again since they do not continue those before
    every: int  # stride of the samples that are taken into account; 1 if all are
    posterior: xr.DataTree
    summary: xr.Dataset  # parameters with intervals
    band: xr.Dataset | None  # None if nothing is touched
    width: float  # largest width of the band [length]; NaN without one
    probabilities: Mapping[str, float]  # probability of each family, if there are several
    underrated: Sequence[str]  # families of too small an evidence, whose particles had lost the posterior
    e_value: float  # that of `Stream.update`; of several families the least; NaN if there is none
    enough: str  # reason why measuring may stop; empty if it may not, or the posterior has not converged


@contextmanager
def open_watch(out: str | os.PathLike[str], **options: Any) -> Iterator[Watch]:
    """Open a folder for a `Watch`, and lock it."""
    watch = Watch(out, **options)
    with alone_in(watch.folder.path, InferenceError):
        yield watch


class Watch:
    """The stream behind a record that grows, with its folder, which has stream.nc and posterior.nc after each update.

    `between` are the ends of the band in x, by default those of what sweeps touch if they continue. Of more than
    `most_samples` every second one is taken, every fourth, and so on. `options` are arguments of `Stream`.
    """

    def __init__(
        self,
        out: str | os.PathLike[str],
        *,
        probability: float = 0.95,
        between: Sequence[float] | None = None,
        until_width: float | None = None,
        until_probability: float | None = None,
        most_samples: int = 1000,
        families: Sequence[Family | str] = ("parabola",),
        rig: Rig | None = None,
        record_file: str | os.PathLike[str],
        command: Sequence[str] = (),
        **options: Any,
    ) -> None:
        self._probability = check_probability("probability", probability)
        self._x: Floats | None = None
        if between is not None:
            left, right = check_numbers("between", between, "give two numbers", shape=(2,)).tolist()
            if not left < right:
                raise ParameterError(f"between is {left:g}, {right:g}: give the smaller one first")
            self._x = np.linspace(left, right, _POINTS)
        if until_width is not None:
            check_positive("until_width", until_width)
            if between is None:
                raise ParameterError(
                    "until_width is for a stretch of the contour: give its ends in x, like --between -0.02,0.02"
                )
        if until_probability is not None:
            check_probability("until_probability", until_probability)
            if len(families) < 2:
                raise ParameterError("until_probability is for several families: give two or more")
        self._most = check_whole_number("most_samples", most_samples, 100, "give a whole number of at least 100")
        self._until_width, self._until_probability = until_width, until_probability
        self._file, self._command = record_file, command
        self._rig = rig_of(rig)
        self._options = {**options, "rig": self._rig}
        if len(families) == 1:
            self._kind: type[Stream | StreamComparison] = Stream
            self._options["family"] = families[0]
        else:
            self._kind = StreamComparison
            self._options["families"] = list(families)
        self._kind(**self._options)  # which refuses what it can before the first sample
        self.folder = RunFolder(out)
        self.state = self.folder.path / "stream.nc"  # from which a watch resumes
        self._stream: Stream | StreamComparison | None = None
        self._every = 1
        self._answer: tuple[xr.DataTree, xr.Dataset] | None = None

    @property
    def samples(self) -> int:
        """Number of samples of the stream."""
        record = None if self._stream is None else self._stream.record
        return 0 if record is None else record.sizes["sample"]

    def resume(self, record: xr.Dataset, sha256: str) -> WatchUpdate | None:
        """Resume the stream in the folder; arguments are those of `take`. Return its answer, None if there is none."""
        began = perf_counter()
        if not self.state.is_file():
            return None
        stored = self._kind.resume(self.state, **self._options)
        strides = [1 << power for power in range(record.sizes["sample"].bit_length())]
        thinned = ((stride, record.isel(sample=slice(None, None, stride))) for stride in strides)
        every = next((stride for stride, some in thinned if _continues(stored.record, some)), None)
        if every is None:  # it is of another record, and the message states what differs
            stored = self._kind.resume(self.state, record, **self._options)
        self._stream, self._every = stored, every or 1
        return self._update(self._stream, self.samples, began, sha256)

    def forget(self) -> None:
        """Begin again with the next samples."""
        self._stream, self._every = None, 1

    def take(self, record: xr.Dataset, sha256: str) -> WatchUpdate | None:
        """Take the samples that are new into account, and write the stream and its posterior."""
        began, had = perf_counter(), self.samples
        every = self._stride(record)
        record = record.isel(sample=slice(None, None, every))
        if self._stream is not None and every == self._every and _continues(self._stream.record, record):
            if had == record.sizes["sample"]:
                return None
            with suppress(RecordError):  # the samples are a record, but do not follow those before
                self._stream.update(record.isel(sample=slice(had, None)))
                self._stream.save(self.state)
                return self._update(self._stream, had, began, sha256)
        stream = self._kind(**self._options)
        stream.update(record)
        restarted = had > 0 and every == self._every
        self._stream, self._every = stream, every
        stream.save(self.state)
        return self._update(stream, 0, began, sha256, restarted=restarted)

    def finish(self) -> ContourRun:
        """Write all files of a run for the last answer."""
        if self._answer is None:
            raise InferenceError("there is no answer yet: no samples have been taken into account")
        posterior, record = self._answer
        return complete(self.folder, record, self._rig, posterior, self._probability)

    def _update(
        self, stream: Stream | StreamComparison, had: int, began: float, sha256: str, *, restarted: bool = False
    ) -> WatchUpdate:
        """Write the posterior, and return the answer."""
        posterior, record = stream.posterior(), stream.record
        assert record is not None
        posterior.attrs |= origin_of(record, self._probability, self._command) | file_of(self._file, sha256)
        posterior.attrs["samples_taken_every"] = self._every
        self.folder.write_posterior(posterior)
        self._answer = posterior, record
        band, latest = None, stream.latest()
        probabilities: dict[str, float] = {}
        underrated: list[str] = []
        if isinstance(stream, StreamComparison):
            probabilities = dict(zip(latest.family.values.tolist(), latest.probability.values.tolist(), strict=True))
            underrated = latest.family.values[latest.log_density_shift.values > LOST_ONCE].tolist()
        with suppress(InferenceError):  # nothing is touched yet
            x = reach(posterior) if self._x is None else self._x
            band = contour_band(latest if probabilities else posterior, x, self._probability)
        widths = np.array([np.nan]) if band is None else (band["upper"] - band["lower"]).values
        return WatchUpdate(
            samples=record.sizes["sample"],
            new=record.sizes["sample"] - had,
            seconds=perf_counter() - began,
            restarted=restarted,
            every=self._every,
            posterior=posterior,
            summary=summary(posterior, self._probability),
            band=band,
            width=float(np.nanmax(widths)) if np.isfinite(widths).any() else np.nan,
            probabilities=probabilities,
            underrated=underrated,
            e_value=float(latest.e_value.min()),
            enough=self._enough(widths, {} if underrated else probabilities) if posterior.attrs["converged"] else "",
        )

    def _stride(self, record: xr.Dataset) -> int:
        """Return the least power of two by which a record is thinned to the largest number of samples."""
        cell = self._rig.load_cell or LoadCell.from_record(record)
        drifts = cell is not None and cell.drift is not None
        if drifts or memory_in({} if cell is None else sensor_values(cell), self._rig.said):
            return 1  # their steps are those from one sample to the next
        parts = -(-record.sizes["sample"] // self._most)
        return 1 << (parts - 1).bit_length()

    def _enough(self, widths: Floats, probabilities: Mapping[str, float]) -> str:
        """Return the first reason why measuring may stop."""
        if self._until_width is not None and np.all(widths < self._until_width):
            return "the band is narrow enough"
        if self._until_probability is not None and probabilities:
            family = max(probabilities, key=probabilities.__getitem__)
            if probabilities[family] > self._until_probability:
                return f"{family} is probable enough"
        return ""


def _continues(before: xr.Dataset | None, record: xr.Dataset) -> bool:
    """Return whether a record begins with the samples of another."""
    if before is None or before.sizes["sample"] > record.sizes["sample"]:
        return False
    return record_hash(record.isel(sample=slice(0, before.sizes["sample"]))) == record_hash(before)

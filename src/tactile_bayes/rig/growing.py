"""A record in a CSV file to which another program appends rows."""

from __future__ import annotations

import hashlib
import io
import os
import time
from itertools import pairwise
from statistics import median
from typing import NamedTuple

import numpy as np
import xarray as xr

from tactile_bayes.checks import check_path
from tactile_bayes.errors import RecordError
from tactile_bayes.numerics.scatter import rough_noise
from tactile_bayes.record.csv_format import read_csv_content
from tactile_bayes.record.files import refuse_no_file
from tactile_bayes.record.sweep import carried_sweeps
from tactile_bayes.rig.reading import record_in
from tactile_bayes.rig.rig import Rig, rig_of

_FEWEST = 10  # smallest number of rows that are left out for most of a file to count as unreadable
# Smallest and largest number of samples of a sweep from which the scatter of its encoder is estimated.
_ENOUGH, _RECENT = 12, 50
_STRAY = 2  # largest number of samples with the number of another sweep within a sweep
_WIDTHS = 6.0  # scatters of the encoder by which a drive angle may be behind


_TICK = 2.0  # longest time between two changes to which a file system may give the same time [s]


class Growth(NamedTuple):
    """The record in a file after it has changed."""

    record: xr.Dataset | None  # all samples so far; None if there are none, or `error` states why they cannot be read
    messages: tuple[str, ...]  # messages on new faults of rows, which are left out, or of the file
    is_other: bool  # true if the file no longer begins as it did
    error: RecordError | None
    sha256: str  # digest of all whole lines
    written_at: float  # time at which the file was last written [s since the epoch]


class GrowingRecord:
    """A record in a CSV file to which another program appends rows; it may not be there yet. A last line without an end
    is left until it has one. Left out are rows with which there would be no record, and samples of a sweep that was
    over, or at a drive angle further behind than the encoder scatters, unless the base is carried.
    """

    def __init__(self, path: str | os.PathLike[str], rig: Rig | None = None) -> None:
        self._path = check_path("path", path)
        refuse_no_file(self._path)
        if self._path.suffix.lower() != ".csv":
            raise RecordError(f"{self._path}: only a .csv file can be followed while it grows")
        self._rig = rig_of(rig)
        self._seen: tuple[int, int, int] | None = None
        self._content = b""
        self._left_out: set[int] = set()
        self._behind: set[int] = set()
        self._noted: list[str] = []

    def poll(self) -> Growth | None:
        """Return the record if the file has whole lines that it did not have before, or other ones; else None."""
        refuse_no_file(self._path)  # opening a pipe would wait
        try:
            with open(self._path, "rb") as file:
                stat = os.fstat(file.fileno())
                seen = (stat.st_ino, stat.st_size, stat.st_mtime_ns)
                if seen == self._seen:
                    return None
                content = file.read()
        except FileNotFoundError:
            return None
        content = content[: content.rfind(b"\n") + 1]
        is_old = time.time() - stat.st_mtime > _TICK  # else it may change again, and have the same time
        self._seen, before, self._content = seen if is_old else None, self._content, content
        if content == before:
            return None
        messages: list[str] = []
        is_other = not content.startswith(before)
        if is_other:
            self._left_out, self._behind = set(), set()
            lines = before.count(b"\n"), content.count(b"\n")
            had = f"it had {lines[0]:,} lines, and has {lines[1]:,}"
            messages.append(f"{self._path} has been replaced or cut short ({had}): begun again")
        record, error = None, None
        try:
            record = self._read(content, messages)
        except RecordError as refusal:
            error = refusal
        digest = hashlib.sha256(content).hexdigest()
        return Growth(record, tuple(messages), is_other, error, digest, stat.st_mtime)

    def _read(self, content: bytes, messages: list[str]) -> xr.Dataset | None:
        """Return the record without rows that are wrong; None if there is no sample."""
        lines = content.split(b"\n")
        while True:
            for line in self._left_out:
                lines[line - 1] = b""
            if not any(line.strip(b",;\t \r") and not line.startswith(b"#") for line in lines):
                return None  # not even the names of columns
            try:
                file = io.BytesIO(b"\n".join(lines))
                table = read_csv_content(file, str(self._path), self._rig.format.columns)
                if not table.samples:
                    return None
                record = record_in(table, self._rig)
                break
            except RecordError as error:
                wrong = sorted(set(error.lines) - self._left_out)
                if not wrong:
                    raise
                self._left_out.update(wrong)
                messages.append(_with_others(str(error), wrong))
                if len(self._left_out) > max(_FEWEST, len(lines) // 2):
                    raise
        messages += [f"{self._path}: {note}" for note in record.encoding["notes"] if note not in self._noted]
        self._noted = record.encoding["notes"]
        assert table.source.lines is not None
        at = np.asarray(table.source.lines)
        behind = _behind(record)
        if new := sorted({int(at[sample]) for sample in behind} - self._behind):
            self._behind |= set(new)
            first = int(np.searchsorted(at, new[0]))
            words = (
                f"{self._path}: line {new[0]}: sweep {int(record.sweep[first])} at a drive angle of "
                f"{float(record.drive_angle[first]):.6g} rad comes behind later samples: give samples in the order in "
                "which they were measured, and each turn of the drive a sweep of its own"
            )
            messages.append(_with_others(words, new))
        return record.isel(sample=np.delete(np.arange(len(at)), behind)) if behind else record


def _with_others(words: str, lines: list[int]) -> str:
    """Return a message on the first of some rows, with the others."""
    if len(lines) == 1:
        return f"{words}; the row is left out"
    others = f"line {lines[1]}" if len(lines) == 2 else f"{len(lines) - 1} more, up to line {lines[-1]}"
    return f"{words}; the row is left out, and {others} likewise"


def _behind(record: xr.Dataset) -> list[int]:
    """Return the samples that are behind others of their sweep, or in a sweep that was over, by those before them. One
    or two samples of another sweep within a sweep are taken to have a wrong number.
    """
    carried = carried_sweeps(record)
    noise = float(record.attrs.get("load_cell_drive_angle_noise", 0.0))
    columns = (record[name].values.tolist() for name in ("sweep", "direction", "drive_angle"))
    values, found = list[float](), list[int]()
    taken: dict[int, list[int]] = {}
    for sample, (sweep, direction, angle) in enumerate(zip(*columns, strict=True)):
        values.append(angle if direction == "forward" else -angle)
        begun = list(taken)
        if sweep in taken and sweep != begun[-1]:
            if sweep != begun[-2] or len(taken[begun[-1]]) > _STRAY:
                found.append(sample)
                continue
            found += taken.pop(begun[-1])
        had = taken.setdefault(sweep, [])
        if sweep not in carried and _is_behind(values[-1], [values[one] for one in had[-_RECENT:]], noise):
            found.append(sample)
        else:
            had.append(sample)
    return sorted(found)


def _is_behind(angle: float, before: list[float], noise: float) -> bool:
    """Return whether an angle is behind the last ones by more than the scatter, or twice the step, of the encoder."""
    if len(before) < _ENOUGH or angle >= (middle := median(before[-3:])):
        return False
    scatter = max(noise, rough_noise(np.array(before)))
    step = min((abs(b - a) for a, b in pairwise(before) if b != a), default=0.0)
    return angle < middle - max(_WIDTHS * scatter, 2.0 * step) - 1e-9

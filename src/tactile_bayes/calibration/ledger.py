"""The ledger of a calibration: which replicates are done, and what came of them, in a file that is always whole."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tactile_bayes.calibration.replicate import Outcome
from tactile_bayes.errors import CalibrationError
from tactile_bayes.files import alone_in, write_atomically

__all__ = ["LEDGER", "Ledger", "open_ledger"]

LEDGER = "replicates.json"

_FORMAT = 1


class Ledger:
    """Outcomes by number; without a folder they are kept in memory alone."""

    def __init__(self, words: Mapping[str, str], folder: Path | None) -> None:
        self._words = dict(words)
        self._file = None if folder is None else folder / LEDGER
        self.outcomes: dict[int, Outcome] = {}
        if self._file is not None and self._file.exists():
            self.outcomes = _read(self._file, self._words)

    def write(self) -> None:
        """Write what is there."""
        if self._file is None:
            return
        rows = [
            {"number": number, "ranks": dict(o.ranks), "numbers": _without_nan(o.numbers), "message": o.message}
            for number, o in sorted(self.outcomes.items())
        ]
        table = {"format": _FORMAT, "experiment": self._words, "replicates": rows}
        with write_atomically(self._file) as temporary:
            temporary.write_text(json.dumps(table, ensure_ascii=False, allow_nan=False), encoding="utf-8")


@contextmanager
def open_ledger(words: Mapping[str, str], folder: Path | None) -> Iterator[Ledger]:
    """The ledger in a folder, which is made if it is not there; written when the block ends, however it does.

    Raises
    ------
    CalibrationError
        If the folder has that of another experiment, or none that can be read, or is being worked on.
    """
    if folder is None:
        yield Ledger(words, None)
        return
    if folder.exists() and not folder.is_dir():
        raise CalibrationError(f"{folder} is a file: give a folder")
    folder.mkdir(parents=True, exist_ok=True)
    with alone_in(folder, CalibrationError):
        for leftover in folder.glob(".*.tmp.json"):
            leftover.unlink(missing_ok=True)
        ledger = Ledger(words, folder)
        try:
            yield ledger
        finally:
            ledger.write()


def _read(file: Path, words: Mapping[str, str]) -> dict[int, Outcome]:
    remedy = f"give another folder, or remove {file.name} from it to begin anew"
    try:
        table = json.loads(file.read_text(encoding="utf-8"))
        if table["format"] != _FORMAT:
            raise CalibrationError(f"{file} has format {table['format']}, this version reads {_FORMAT}: {remedy}")
        there = dict(table["experiment"])
        rows = {
            int(row["number"]): Outcome(
                {name: int(rank) for name, rank in row["ranks"].items()},
                {name: math.nan if v is None else float(v) for name, v in row["numbers"].items()},
                str(row["message"]),
            )
            for row in table["replicates"]
        }
    except CalibrationError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise CalibrationError(f"{file} holds no replicates that can be read ({error}): {remedy}") from error
    differ = [name for name in {**there, **words} if there.get(name) != words.get(name)]
    if rows and differ:
        told = ", ".join(
            f"{name} is {_short(there.get(name))} there and {_short(words.get(name))} here" for name in differ[:3]
        )
        more = f" and {len(differ) - 3} more" if len(differ) > 3 else ""
        raise CalibrationError(f"{file.parent} holds replicates of another experiment: {told}{more}; {remedy}")
    return rows


def _short(value: Any) -> str:
    words = "left out" if value is None else str(value)
    return words if len(words) <= 60 else f"{words[:57]}…"


def _without_nan(numbers: Mapping[str, float]) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in numbers.items()}

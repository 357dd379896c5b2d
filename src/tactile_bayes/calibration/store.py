"""Outcomes of replicates in the results store of a calibration."""

from __future__ import annotations

import math
from typing import Any

from tactile_bayes.calibration.replicate import Outcome
from tactile_bayes.errors import CalibrationError
from tactile_bayes.tasks import Kind


def _encode(outcome: Outcome) -> dict[str, Any]:
    row = {"ranks": dict(outcome.ranks), "numbers": outcome.numbers, "message": outcome.message}
    return row | ({"traceback": outcome.traceback} if outcome.traceback else {})


def _decode(row: dict[str, Any]) -> Outcome:
    return Outcome(
        {name: int(rank) for name, rank in row["ranks"].items()},
        {name: math.nan if v is None else float(v) for name, v in row["numbers"].items()},
        str(row["message"]),
        str(row.get("traceback", "")),  # older stores have none
    )


REPLICATES = Kind("replicates", CalibrationError, _encode, _decode)

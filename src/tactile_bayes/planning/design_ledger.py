"""The ledger of a design: which candidates were judged, and what is to be expected of them."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

from tactile_bayes.errors import StudyError
from tactile_bayes.inference.contour_problem import prior_in_words
from tactile_bayes.planning.candidate import Expected, Question
from tactile_bayes.tasks import Kind

__all__ = ["CANDIDATES", "question_in_words"]

_LIBRARIES = ("tactile-bayes", "numpy", "scipy")


def question_in_words(question: Question) -> dict[str, str]:
    """What the expectations follow from."""
    known = question.known
    return {
        "family": known.family,
        "what is known": hashlib.sha256(known.points.tobytes()).hexdigest(),
        "bases": json.dumps(known.bases),
        "rod": "dimensionless" if known.rod is None else json.dumps(asdict(known.rod)),
        "load_cell": json.dumps(known.load_cell.entries()),
        "load_cell_frame": known.load_cell.frame or "fixed",
        "friction": repr(known.friction),
        "nuisances": json.dumps(list(known.nuisances)),
        "priors": json.dumps({name: prior_in_words(prior) for name, prior in known.priors.items()}),
        "candidates": json.dumps([asdict(candidate) for candidate in question.candidates]),
        "span": json.dumps([float(question.x[0]), float(question.x[-1])]),
        "probability": repr(question.probability),
        "nested": repr(question.nested),
        "seed": repr(question.seed),
        **{f"version of {name}": version(name) for name in _LIBRARIES},
    }


def _encode(expected: Expected) -> dict[str, Any]:
    def told(value: Any) -> Any:
        if isinstance(value, tuple):
            return [told(part) for part in value]
        return float(value) if math.isfinite(value) else None

    return {name: told(value) for name, value in expected._asdict().items()}


def _decode(row: dict[str, Any]) -> Expected:
    def read(value: Any) -> Any:
        if isinstance(value, list):
            mean, error = value
            return read(mean), read(error)
        return math.nan if value is None else float(value)

    return Expected(**{name: read(row[name]) for name in Expected._fields})


CANDIDATES = Kind("candidates", StudyError, _encode, _decode)

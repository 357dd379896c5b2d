"""The log-probability as ensembles call it: checked and counted."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from tactile_bayes.arrays import Floats
from tactile_bayes.errors import InferenceError

__all__ = ["CheckedTarget", "LogProbability"]


LogProbability = Callable[[Floats], Floats]


class CheckedTarget:
    """The log-probability with its values checked and its evaluations counted."""

    def __init__(self, log_probability: LogProbability, names: Sequence[str]) -> None:
        self.log_probability = log_probability
        self.names = names
        self.evaluations = 0

    def __call__(self, points: Floats) -> Floats:
        values = np.asarray(self.log_probability(points), dtype=float)
        if values.shape != points.shape[:1]:
            raise InferenceError(
                f"the log-probability of {points.shape[0]} points came back with shape {values.shape}: it has to take "
                f"an array (n, {len(self.names)}) and return one of shape (n,)"
            )
        self.evaluations += values.size
        wrong = np.isnan(values) | (values == np.inf)
        if np.any(wrong):
            i = int(np.argmax(wrong))
            where = ", ".join(f"{name} = {value!r}" for name, value in zip(self.names, points[i].tolist(), strict=True))
            raise InferenceError(
                f"the log-probability is {values[i]} at {where}: it has to be a number, or −inf where the point is "
                "impossible"
            )
        return values

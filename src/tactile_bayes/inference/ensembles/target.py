"""The log-probability as ensembles ask for it: checked, counted, and for all of them at once."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactile_bayes.errors import InferenceError

__all__ = ["CheckedTarget", "LogProbability", "Together"]


Floats = NDArray[np.float64]
LogProbability = Callable[[Floats], Floats]


class CheckedTarget:
    """The log-probability with its answer checked and its evaluations counted."""

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


class Together:
    """Evaluates what several ensembles ask for at the same time in one call: a vectorised target likes many points.

    Every ensemble runs in a thread of its own and waits here until the others have asked as well; they make the same
    number of requests a step. What an ensemble is answered does not depend on the others.
    """

    def __init__(self, target: LogProbability, ensembles: int) -> None:
        self._target = target
        self._asked: list[Floats] = [np.empty(0)] * ensembles
        self._answers: list[Floats] = []
        self._error: BaseException | None = None
        self._meeting = threading.Barrier(ensembles, action=self._evaluate)

    def target_of(self, ensemble: int) -> LogProbability:
        def ask(points: Floats) -> Floats:
            self._asked[ensemble] = points
            self._meeting.wait()
            if self._error is not None:
                raise self._error
            return self._answers[ensemble]

        return ask

    def _evaluate(self) -> None:
        try:
            values = self._target(np.concatenate(self._asked))
            self._answers = np.split(values, np.cumsum([len(points) for points in self._asked])[:-1])
        except BaseException as error:  # every ensemble raises it, in its own thread
            self._error = error

    def abort(self) -> None:
        """Send home whoever waits: the run ends here."""
        self._meeting.abort()

    def step(self, states: Iterator[Any]) -> Any:
        """The next state of an ensemble; one that fails lets the others go."""
        try:
            return next(states)
        except BaseException:
            self._meeting.abort()
            raise

"""The progress bar of sampling, with an estimate of the remaining time."""

from __future__ import annotations

import math
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from tactile_bayes.cli.task_bar import moving_bar

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tactile_bayes.inference.ensembles import Progress

_GOAL = 1000.0  # effective sample size at which sampling stops, as in `SamplerSettings`
_MAX_R_HAT = 1.01  # R̂ below which sampling stops, as in `SamplerSettings`


class Show(Protocol):
    """Function that updates the progress bar."""

    def __call__(self, progress: Progress, what: str = "", /) -> object:
        """Show progress; `what` names one of several runs."""


@contextmanager
def sampling_bar(quiet: bool, *, max_seconds: float | None = None) -> Iterator[Show | None]:
    """Show a bar that fills with the effective sample size; no bar if quiet or without a terminal."""
    from rich.progress import BarColumn, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(12))
    with moving_bar(quiet, "looking for a start, then sampling", *columns) as move:
        if move is None:
            yield None
            return

        def show(progress: Progress, what: str = "", /) -> None:
            words = f"step {progress.steps}: R̂ {progress.r_hat:.3f}, effective draws {progress.ess:.0f}"
            if progress.ess >= _GOAL and progress.r_hat <= _MAX_R_HAT:
                words, left = "sampled" if what else "sampled; checks, band and figures follow", ""
            else:
                seconds = remaining_seconds(progress, max_seconds)
                left = "" if seconds is None else f"about {_in_words(seconds)} left"
            done = min(progress.ess, _GOAL) if progress.ess == progress.ess else 0.0
            move(total=_GOAL, completed=done, description=f"{what}, {words}" if what else words, left=left)

        yield show


def remaining_seconds(progress: Progress, max_seconds: float | None = None) -> float | None:
    """Estimate the remaining time of sampling [s] from the rate of effective draws so far; None if it is unknown.

    It is at most the time until the steps, or the time limit, are used up.
    """
    if not (progress.steps and progress.seconds > 0.0):
        return None
    rate = progress.seconds / progress.steps
    most = rate * (progress.max_steps - progress.steps)
    if max_seconds is not None:
        most = min(most, max_seconds - progress.seconds)
    if progress.ess >= _GOAL:  # R̂ has still to settle, which may take a fifth more
        return max(0.0, min(0.2 * progress.seconds, most))
    if not (math.isfinite(progress.ess) and progress.ess > 0.0):
        return None
    return max(0.0, min(progress.seconds * (_GOAL / progress.ess - 1.0), most))


def _in_words(seconds: float) -> str:
    """Return text like "40 s", "5 min" and "2 h 10 min"."""
    if seconds < 90.0:
        return f"{max(1, round(seconds))} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"

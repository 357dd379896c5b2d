"""Progress bars of tasks, steps and sampling, with the remaining time; the workers whose tasks they show."""

from __future__ import annotations

import math
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated

from tactile_bayes.cli.interrupts import resumable
from tactile_bayes.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from rich.progress import ProgressColumn, Task
    from rich.text import Text

    from tactile_bayes.inference.ensembles import Progress
    from tactile_bayes.tasks import TaskProgress, Workers

_GOAL = 1000.0  # effective sample size at which sampling stops, as in `SamplerSettings`
_MAX_R_HAT = 1.01  # R̂ below which sampling stops, as in `SamplerSettings`


@dataclass(frozen=True)
class WorkerOptions:
    """Local processes, or a Dask scheduler."""

    workers: Annotated[
        str | None,
        "Number of local processes, by default one for each core; or the address of a Dask scheduler, like "
        "tcp://10.0.0.1:8786.",
    ] = None

    def reporting(self, progress: Callable[[TaskProgress], object]) -> Workers:
        """Return the workers, of which a function hears."""
        from tactile_bayes.tasks import Workers

        if self.workers is None or "://" in self.workers:
            return Workers(self.workers, progress)
        if not (self.workers.isascii() and self.workers.isdigit() and int(self.workers)):
            raise ParameterError(
                f"--workers is {self.workers!r}: give a number of processes, or the address of a scheduler"
            )
        return Workers(int(self.workers), progress)


@contextmanager
def resumable_bar(
    noun: str,
    quiet: bool,
    where: Path | None,
    total: int | None = None,
    *,
    then: str = "the same command resumes",
) -> Iterator[Callable[[TaskProgress], object]]:
    """Show a bar, and yield a function that takes the progress of tasks.

    At an interrupt, report how many are in a folder, or that nothing was written, and what the same command then does.
    """
    last: TaskProgress | None = None

    def have() -> str:
        if where is None:
            return "nothing was written"
        if last is None:
            return f"no further {noun} was done"
        return f"{last.done:,} of {counted(last.wanted, noun)} are in {where}"

    at_first = "beginning" if total is None else f"{counted(total, noun)} to be made"
    with resumable(have, then) as raise_lost, step_bar(quiet, noun, at_first, has_rate=True) as show:

        def note(progress: TaskProgress) -> None:
            nonlocal last
            last = progress
            show(progress.done, progress.wanted)
            raise_lost()

        yield note


@contextmanager
def step_bar(
    quiet: bool, noun: str = "step", at_first: str = "beginning", *, has_rate: bool = False
) -> Iterator[Callable[[int, int], object]]:
    """Show a bar, and yield a function that takes the number done and the total; a spinner moves meanwhile."""
    from rich.progress import BarColumn, ProgressColumn, TextColumn, TimeRemainingColumn
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            if not task.speed:
                return Text("")
            return Text(f"{task.speed:,.0f} {noun}s/s" if task.speed > 2.0 else f"{1.0 / task.speed:.2g} s a {noun}")

    rate = (Rate(),) if has_rate else ()
    columns = (BarColumn(), TextColumn("{task.description}"), *rate, TimeRemainingColumn())
    with moving_bar(quiet, at_first, *columns) as move:

        def show(done: int, count: int) -> None:
            if move is not None:
                description = f"{done:,} of {counted(count, noun)}"
                move(total=count, completed=done, description=description, left="left")

        yield show


@contextmanager
def moving_bar(quiet: bool, at_first: str, *columns: ProgressColumn) -> Iterator[Callable[..., object] | None]:
    """Show a bar with a spinner, columns and remaining time; yield its update function, or None without a terminal."""
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield None
        return
    left = TextColumn("{task.fields[left]}")
    with Progress(SpinnerColumn("line"), *columns, left, console=console, transient=True) as bar:
        yield partial(bar.update, bar.add_task(at_first, total=None, left=""))


def counted(count: int, noun: str) -> str:
    """Return text like "1 record" and "2,000 records"."""
    return f"{count:,} {noun}" + "s" * (count != 1)


@dataclass(frozen=True)
class SamplingBar:
    """A bar that fills with the effective sample size, and then names what follows."""

    move: Callable[..., object]
    max_seconds: float | None

    def __call__(self, progress: Progress, what: str = "", /) -> None:
        """Show progress; `what` names one of several runs."""
        words = f"step {progress.steps}: R̂ {progress.r_hat:.3f}, effective draws {progress.ess:.0f}"
        if progress.ess >= _GOAL and progress.r_hat <= _MAX_R_HAT:
            words, left = "sampled", ""
        else:
            seconds = remaining_seconds(progress, self.max_seconds)
            left = "" if seconds is None else f"about {_in_words(seconds)} left"
        done = min(progress.ess, _GOAL) if progress.ess == progress.ess else 0.0
        self.move(total=_GOAL, completed=done, description=f"{what}, {words}" if what else words, left=left)

    def follow(self, what: str) -> None:
        """Show what is done now."""
        self.move(total=None, description=what, left="")


@contextmanager
def sampling_bar(quiet: bool, *, max_seconds: float | None = None) -> Iterator[SamplingBar | None]:
    """Show a bar that fills with the effective sample size; no bar if quiet or without a terminal."""
    from rich.progress import BarColumn, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(12))
    with moving_bar(quiet, "looking for a start, then sampling", *columns) as move:
        yield None if move is None else SamplingBar(move, max_seconds)


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

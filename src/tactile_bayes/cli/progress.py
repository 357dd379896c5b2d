"""Progress of long runs: bars with the remaining time, the workers behind them, and what an interrupt keeps."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from math import inf
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tactile_bayes as tb

if TYPE_CHECKING:
    from pathlib import Path

    from tactile_bayes.inference.ensembles import Progress

_GOAL = 1000.0  # effective sample size at which sampling stops, as in `SamplerSettings`
_MAX_R_HAT = 1.01  # R̂ below which sampling stops, as in `SamplerSettings`
_USUAL: dict[signal.Signals, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}


@dataclass(frozen=True)
class WorkerOptions:
    """Local processes, or a Dask scheduler."""

    workers: Annotated[
        str | None,
        "Number of local processes, by default one for each core; or the address of a Dask scheduler, like "
        "tcp://10.0.0.1:8786.",
    ] = None

    def reporting(self, progress: Callable[[tb.tasks.TaskProgress], object]) -> tb.tasks.Workers:
        """Return the workers, of which a function hears."""

        where = self.workers
        return tb.tasks.Workers(int(where) if where is not None and where.isdecimal() else where, progress)


@contextmanager
def resumable_bar(
    noun: str,
    quiet: bool,
    where: Path | None,
    total: int | None = None,
    *,
    then: str = "the same command resumes",
) -> Iterator[Callable[[tb.tasks.TaskProgress], object]]:
    """Show a bar, and yield a function that takes the progress of tasks.

    At an interrupt, report how many are in a folder, or that nothing was written, and what the same command then does.
    """
    last: tb.tasks.TaskProgress | None = None

    def have() -> str:
        if where is None:
            return "nothing was written"
        if last is None:
            return f"no further {noun} was done"
        return f"{last.done:,} of {counted(last.wanted, noun)} are in {where}"

    at_first = "beginning" if total is None else f"{counted(total, noun)} to be made"
    with resumable(have, then) as raise_lost, step_bar(quiet, noun, at_first) as show:

        def note(progress: tb.tasks.TaskProgress) -> None:
            nonlocal last
            last = progress
            show(progress.done, progress.wanted)
            raise_lost()

        yield note


@contextmanager
def step_bar(quiet: bool, noun: str = "step", at_first: str = "beginning") -> Iterator[Callable[[int, int], object]]:
    """Show a bar, and yield a function that takes the number done and the total; a spinner moves meanwhile."""
    with moving_bar(quiet, at_first) as move:

        def show(done: int, count: int) -> None:
            if move is not None:
                move(total=count, completed=done, description=f"{done:,} of {counted(count, noun)}", left="left")

        yield show


@contextmanager
def moving_bar(quiet: bool, at_first: str) -> Iterator[Callable[..., object] | None]:
    """Show a bar with a spinner and the remaining time; yield its update function, or None without a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield None
        return
    words, left = TextColumn("{task.description}"), TextColumn("{task.fields[left]}")
    columns = (SpinnerColumn("line"), BarColumn(12), words, TimeRemainingColumn(), left)
    with Progress(*columns, console=console, transient=True) as bar:
        yield partial(bar.update, bar.add_task(at_first, total=None, left=""))


def counted(count: int, noun: str) -> str:
    """Return text like "1 record" and "2,000 records"."""
    return f"{count:,} {noun}" + "s" * (count != 1)


@dataclass(frozen=True)
class SamplingBar:
    """A bar that fills until sampling ends: by effective draws, steps or seconds; and then names what follows."""

    move: Callable[..., object]
    max_seconds: float | None

    def __call__(self, progress: Progress, what: str = "", /) -> None:
        """Show progress; `what` names one of several runs."""
        words = f"step {progress.steps}: R̂ {progress.r_hat:.3f}, effective draws {progress.ess:.0f}"
        if progress.ess >= _GOAL and progress.r_hat <= _MAX_R_HAT:
            words = "sampled"
        time = progress.seconds / (self.max_seconds or inf)
        shares = (progress.ess / _GOAL, progress.steps / progress.max_steps, time)
        done = max(share for share in shares if share == share)  # NaN without effective draws
        self.move(total=1.0, completed=min(done, 1.0), description=f"{what}, {words}" if what else words, left="left")

    def follow(self, what: str) -> None:
        """Show what is done now."""
        self.move(total=None, description=what, left="")


@contextmanager
def sampling_bar(quiet: bool, *, max_seconds: float | None = None) -> Iterator[SamplingBar | None]:
    """Show a bar of sampling; none if quiet or without a terminal."""
    with moving_bar(quiet, "looking for a start, then sampling") as move:
        yield None if move is None else SamplingBar(move, max_seconds)


@contextmanager
def resumable(have: Callable[[], str], then: str) -> Iterator[Callable[[], object]]:
    """Run a block that an interrupt ends with a message on what was kept, and what the same command then does.

    Call the yielded function regularly: it raises an interrupt that was lost, as in the callback of a weak reference.
    """
    come = list[int]()

    def interrupt(number: int, frame: FrameType | None) -> None:
        come.append(number)
        raise KeyboardInterrupt

    def raise_lost() -> None:
        if come:
            raise KeyboardInterrupt

    try:
        with _handled(interrupt):
            yield raise_lost
    except KeyboardInterrupt:
        if come[:1] == [signal.SIGTERM]:  # as batch systems send it before they kill
            typer.echo(f"tactile-bayes: terminated, {have()}: {then}", err=True)
            raise typer.Exit(143) from None
        raise KeyboardInterrupt(f"interrupted, {have()}: {then}") from None


@contextmanager
def acknowledge_interrupt(words: str) -> Iterator[None]:
    """Print a message on stderr at the first interrupt or SIGTERM, since the end of the run takes a while."""

    def answer(number: int, frame: FrameType | None) -> None:
        for each in ours:
            signal.signal(each, _USUAL[each])
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, f"\ntactile-bayes: {words}\n".encode())
        raise KeyboardInterrupt

    with _handled(answer) as ours:
        yield


@contextmanager
def _handled(handler: Callable[[int, FrameType | None], None]) -> Iterator[list[signal.Signals]]:
    """Handle signals in the main thread, except those with another handler; yield those that are handled."""
    is_main = threading.current_thread() is threading.main_thread()
    ours = [number for number, usual in _USUAL.items() if is_main and signal.getsignal(number) is usual]
    for number in ours:
        signal.signal(number, handler)
    try:
        yield ours
    finally:
        for number in ours:
            signal.signal(number, _USUAL[number])

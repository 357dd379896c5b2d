"""Bars that show how many of many tasks, or of a few steps, are done, and how long the rest will take."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from tactile_bayes.cli.interrupts import resumable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

__all__ = ["counted", "resumable_bar", "step_bar", "task_bar"]


@contextmanager
def resumable_bar(
    total: int,
    noun: str,
    quiet: bool,
    have: Callable[[int | None], str],
    *,
    then: str = "the same command goes on",
) -> Iterator[Callable[[int], object]]:
    """A bar that is told how many are done; where an interrupt comes, `have` says what is there of this last number.

    It is None before the first is told. `then` is what the same command does after the interrupt.
    """
    last: int | None = None
    with resumable(lambda: have(last), then=then) as raise_lost, task_bar(total, noun, quiet) as show:

        def note(done: int) -> None:
            nonlocal last
            last = done
            show(done)
            raise_lost()

        yield note


@contextmanager
def task_bar(total: int, noun: str, quiet: bool) -> Iterator[Callable[[int], object]]:
    """A bar that is told how many are done; none where nobody sees it move."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TextColumn, TimeRemainingColumn
    from rich.text import Text

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda done: None
        return

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            if not task.speed:
                return Text("")
            return Text(f"{task.speed:,.0f} {noun}s/s" if task.speed > 2.0 else f"{1.0 / task.speed:.2g} s a {noun}")

    words = (TextColumn("{task.description}"), Rate(), TimeRemainingColumn(), TextColumn("{task.fields[left]}"))
    with Progress(SpinnerColumn(), BarColumn(), *words, console=console, transient=True) as bar:
        task = bar.add_task(f"{counted(total, noun)} to be made", total=None, left="")

        def show(done: int) -> None:
            description = f"{done:,} of {counted(total, noun)}"
            bar.update(task, total=total, completed=done, description=description, left="left")

        yield show


@contextmanager
def step_bar(quiet: bool, noun: str = "step", *, at_first: str = "beginning") -> Iterator[Callable[[int, int], object]]:
    """A bar that is told how many of how many are done, and that moves before the first of them is."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda done, count: None
        return
    words = (TextColumn("{task.description}"), TimeRemainingColumn(), TextColumn("{task.fields[left]}"))
    with Progress(SpinnerColumn(), BarColumn(), *words, console=console, transient=True) as bar:
        task = bar.add_task(at_first, total=None, left="")

        def show(done: int, count: int) -> None:
            description = f"{done:,} of {counted(count, noun)}"
            bar.update(task, total=count, completed=done, description=description, left="left")

        yield show


def counted(count: int, noun: str) -> str:
    """Like "1 record" and "2,000 records"."""
    return f"{count:,} {noun}" + "s" * (count != 1)

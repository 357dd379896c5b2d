"""Progress bars of tasks and steps, with the remaining time."""

from __future__ import annotations

from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from tactile_bayes.cli.interrupts import resumable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.progress import ProgressColumn, Task
    from rich.text import Text


@contextmanager
def resumable_bar(
    total: int,
    noun: str,
    quiet: bool,
    have: Callable[[int | None], str],
    *,
    then: str = "the same command resumes",
) -> Iterator[Callable[[int], object]]:
    """Show a bar, and yield a function that takes the number of tasks done; at an interrupt, report what was kept.

    `have` returns that report from the last number done, None if there was none. `then` says what the same command does
    after the interrupt.
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
    """Show a bar with its rate, and yield a function that takes the number done; no bar if quiet."""
    with step_bar(quiet, noun, at_first=f"{counted(total, noun)} to be made", has_rate=True) as show:
        yield lambda done: show(done, total)


@contextmanager
def step_bar(
    quiet: bool, noun: str = "step", *, at_first: str = "beginning", has_rate: bool = False
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

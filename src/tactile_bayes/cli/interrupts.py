"""Interrupts of long runs, with messages on what was kept and how to resume."""

from __future__ import annotations

import os
import signal
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

_USUAL: dict[signal.Signals, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}


@contextmanager
def resumable(have: Callable[[], str], *, then: str = "the same command resumes") -> Iterator[Callable[[], object]]:
    """Run a block that an interrupt ends with a message on what was kept, and what the same command then does.

    Call the yielded function regularly: it raises an interrupt that was lost.
    """
    try:
        with _interrupts_kept() as raise_lost:
            yield raise_lost
    except KeyboardInterrupt as interrupt:
        is_terminated = isinstance(interrupt, _Terminated)
        words = f"{'terminated' if is_terminated else 'interrupted'}, {have()}: {then}"
        if is_terminated:
            typer.echo(f"tactile-bayes: {words}", err=True)
            raise typer.Exit(143) from None
        raise KeyboardInterrupt(words) from None


@contextmanager
def acknowledge_interrupt(words: str) -> Iterator[None]:
    """Print a message on stderr at the first interrupt or SIGTERM, since the end of the run takes a while."""

    def answer(number: int, frame: FrameType | None) -> None:
        for each in ours:
            signal.signal(each, _USUAL[each])
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, f"\ntactile-bayes: {words}\n".encode())
        raise KeyboardInterrupt

    with _handled(answer, signal.SIGINT, signal.SIGTERM) as ours:
        yield


class _Terminated(KeyboardInterrupt):
    """SIGTERM, as batch systems send it before they kill."""


@contextmanager
def _interrupts_kept() -> Iterator[Callable[[], object]]:
    """Yield a function that raises a lost interrupt: Python ignores one in the callback of a weak reference."""
    come: list[type[KeyboardInterrupt]] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        come.append(_Terminated if number == signal.SIGTERM else KeyboardInterrupt)
        raise come[0]

    def raise_lost() -> None:
        if come:
            raise come[0]

    with _handled(interrupt, signal.SIGINT, signal.SIGTERM):
        try:
            yield raise_lost
        except KeyboardInterrupt:  # it may replace the one that came first
            raise_lost()
            raise


@contextmanager
def _handled(
    handler: Callable[[int, FrameType | None], None], *signals: signal.Signals
) -> Iterator[list[signal.Signals]]:
    """Handle signals in the main thread, except those with another handler; yield those that are handled."""
    is_main = threading.current_thread() is threading.main_thread()
    ours = [number for number in signals if is_main and signal.getsignal(number) is _USUAL[number]]
    for number in ours:
        signal.signal(number, handler)
    try:
        yield ours
    finally:
        for number in ours:
            signal.signal(number, _USUAL[number])

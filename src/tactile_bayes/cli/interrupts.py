"""Interrupts of long runs, with messages on what was kept and how to resume."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

import typer

_USUAL: dict[signal.Signals, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}


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

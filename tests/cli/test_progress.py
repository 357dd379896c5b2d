"""Bars as a terminal gets them, and what an interrupt says of the tasks behind one."""

import os
import pty
import re
import signal
import sys
from contextlib import contextmanager, suppress

import pytest
import typer

from tactile_bayes.cli.progress import resumable_bar, step_bar
from tactile_bayes.tasks import TaskProgress


@contextmanager
def terminal():
    """A terminal for standard error; what it was sent is in the list once it is closed."""
    ours, theirs = pty.openpty()
    sent, before = [], sys.stderr
    try:
        with open(theirs, "w", encoding="utf-8") as sys.stderr:
            yield sent
            sys.stderr.flush()
            os.set_blocking(ours, False)
            with suppress(BlockingIOError):
                while True:
                    sent.append(os.read(ours, 65536).decode())
    finally:
        sys.stderr = before
        os.close(ours)


def test_it_says_how_many_steps_are_done_and_how_long_the_rest_takes(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    with terminal() as sent, step_bar(quiet=False) as show:
        show(1, 3)
        show(2, 3)
    words = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", "".join(sent))
    assert "2 of 3 steps" in words
    assert "left" in words


def test_it_is_silent_where_it_is_told_to_be_and_where_nobody_looks(monkeypatch, capsys):
    monkeypatch.setenv("TERM", "xterm")
    with terminal() as sent, step_bar(quiet=True) as show:
        show(1, 3)
    assert sent == []
    with step_bar(quiet=False) as show:
        show(1, 3)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("where", "done", "said"),
    [
        (None, 3, "nothing was written"),
        ("out", None, "no further cell was done"),
        ("out", 3, "3 of 5 cells are in out"),
    ],
)
def test_an_interrupt_says_what_is_kept_and_how_to_go_on(where, done, said):
    def interrupted():
        with resumable_bar("cell", True, where, 5) as note:
            if done is not None:
                note(TaskProgress(done, 5, done, 1.0))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match=f"^interrupted, {said}: .*resumes$"):
        interrupted()


def test_a_termination_that_the_sampler_answers_is_still_one():
    """It ends with the code of one, though what reaches the command is an interrupt of the sampler's own."""

    def sampler():
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt:
            raise KeyboardInterrupt("interrupted while sampling replicate 3") from None

    with pytest.raises(typer.Exit) as ended, resumable_bar("replicate", True, None):
        sampler()
    assert ended.value.exit_code == 143

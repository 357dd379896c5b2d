"""Control-C at a moment that is known."""

from __future__ import annotations


def interrupted_at(call, function):
    """The function until it is called for so many times, when Control-C is pressed, and again after that."""
    count = 0

    def until_then(*arguments):
        nonlocal count
        count += 1
        if count == call:
            raise KeyboardInterrupt
        return function(*arguments)

    return until_then

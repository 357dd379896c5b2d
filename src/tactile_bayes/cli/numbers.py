"""Numbers in options, and options of the form NAME=VALUE."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

__all__ = ["assigned", "numbers_asked"]


def numbers_asked(text: str, option: str, count: int) -> tuple[float, ...]:
    """Parse a given number of numbers, with commas between them.

    Raises
    ------
    ParameterError
        If there are more or fewer, or one is no number.
    """
    from tactile_bayes.errors import ParameterError

    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        wanted = "a number" if count == 1 else f"{count} numbers with commas between them"
        raise ParameterError(f"{option} is {text!r}: give {wanted}")
    return numbers


def assigned(
    option: str, texts: Sequence[str] | None, form: str = "", *, known: Collection[str] = ()
) -> dict[str, str]:
    """Parse the values of a repeated option NAME=VALUE, by name.

    Raises
    ------
    ParameterError
        If a text has another form, its name is not known, or it is given twice.
    """
    from tactile_bayes.errors import ParameterError

    values: dict[str, str] = {}
    like = form or f"NAME=VALUE, with one of {', '.join(known)}"
    for text in texts or []:
        name, _, value = (part.strip() for part in text.partition("="))
        if not (name and value) or (known and name not in known):
            raise ParameterError(f"{option} {text}: write {like}")
        if name in values:
            raise ParameterError(f"{option} {name}= is given twice: keep one of them")
        values[name] = value
    return values

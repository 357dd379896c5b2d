"""Numbers in options and in small files, and options of the form NAME=VALUE."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from tactile_bayes.errors import ParameterError


def numbers_asked(text: str, option: str, count: int) -> tuple[float, ...]:
    """Parse a given number of numbers, with commas between them."""
    from tactile_bayes.record.spelling import plain_number

    try:
        numbers = tuple(float(plain_number(part)) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        wanted = "a number" if count == 1 else f"{count} numbers with commas between them"
        raise ParameterError(f"{option} is {text!r}: give {wanted}")
    return numbers


def as_typed(word: str) -> str:
    """Return a word of a command line as it would be typed: dashes of options, and numbers, in plain characters.

    Programs for texts turn -- into a dash, and a hyphen before a digit into a minus sign.
    """
    if word.isascii():
        return word
    from tactile_bayes.record.parsing import number_in
    from tactile_bayes.record.spelling import plain, plain_number

    option = word.lstrip("-\N{EN DASH}\N{EM DASH}\N{MINUS SIGN}")
    if option != word and not word.startswith("-") and option[:1].isalpha():
        return f"{'-' if len(option) == 1 else '--'}{option}"
    numbers = plain(plain_number(word))
    return numbers if all(part and number_in(part) is not None for part in numbers.split(",")) else word


def assigned(
    option: str, texts: Sequence[str] | None, form: str = "", *, known: Collection[str] = ()
) -> dict[str, str]:
    """Parse the values of a repeated option NAME=VALUE, by name."""
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

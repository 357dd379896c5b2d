"""What a refusal is to say: the kind of error, and in its message the names, values and places that matter."""

import re

import pytest

from tactile_bayes.checks import shown

_NO_LETTER = r"(?!(?<=\w)\w)"  # a place that is not inside a word or a number


def refused(error, /, *named, **arguments):
    """Expect an error of this kind that names all of these, and each argument with its value."""
    words = [*map(str, named), *arguments, *map(shown, arguments.values())]
    each = "".join(f"(?=.*{_NO_LETTER}{re.escape(word)}{_NO_LETTER})" for word in words)
    return pytest.raises(error, match=f"(?s)^{each}")

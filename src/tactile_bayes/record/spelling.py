"""Misspelt names, and characters that look like others."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping
from difflib import SequenceMatcher

from tactile_bayes.errors import ParameterError

# What characters stand for; beside them are those of full width, and digits of any script.
_STAND_FOR = {
    **dict.fromkeys("\u2010\u2011\u2012\u2013\u2014\u2015\u2212\ufe63\uff0d", "-"),
    **dict.fromkeys("\u00ba\u02da\u2218", "°"),
    **dict.fromkeys("\u00d7\u2022\u2027\u2219\u22c5", "·"),
    **dict.fromkeys("\u201c\u201d\u201e\u201f\u2033", '"'),
    **dict.fromkeys("\u2018\u2019\u201a\u201b\u2032", "'"),
    **dict.fromkeys("\u2044\u2215", "/"),
    "\u066b": ".",
    "\u00b5": "μ",
}
_FULL_WIDTH, _TO_ASCII = range(0xFF01, 0xFF5F), 0xFEE0
# Separators of thousands that are used for nothing else; a blank or a comma may separate columns.
_THOUSANDS = re.compile(r"(?<=[0-9])[\u00a0\u2007\u2009\u202f\u066c\u2019](?=[0-9]{3}(?![0-9]))")
_MOST_NAMED = 8  # largest number of keys that the message about an unknown key lists
_LONGEST = 200  # largest number of characters of a name that is compared


def nearest(name: str, candidates: Iterable[str], cutoff: float = 0.6) -> str | None:
    """Find the candidate most similar to a name, regardless of case and the order of words; None below a similarity."""
    found = max(candidates, key=lambda candidate: _likeness(name, candidate), default=None)
    return found if found is not None and _likeness(name, found) >= cutoff else None


def refuse_unknown_keys(
    table: Iterable[str], known: Iterable[str], prefix: str = "", tables: Mapping[str, Iterable[str]] | None = None
) -> None:
    """Refuse keys of a table of a file that it cannot have, with the nearest one, or the table that has it."""
    known = list(known)
    for key in table:
        if key in known:
            continue
        if elsewhere := [where for where, keys in (tables or {}).items() if key in keys]:
            place = f"the table [{elsewhere[0]}]" if elsewhere[0] else "the top, above the first table"
            hint = f"its place is {place}"
        elif near := nearest(key, known):
            hint = f"did you mean {near!r}?"
        else:
            hint = f"there are {', '.join(known[:_MOST_NAMED])}{' and others' if len(known) > _MOST_NAMED else ''}"
        raise ParameterError(f"there is no key {prefix + key!r}{look_alikes(key)}: {hint}")


def plain(text: str) -> str:
    """Replace characters by those that they look like and stand for; those without a width are removed."""
    return text if text.isascii() else "".join(map(_meant, text))


def visible(text: str) -> str:
    """Remove characters without a width, and replace blanks of any width by usual ones."""
    return text if text.isascii() else "".join(_meant(sign) if _meant(sign) in ("", " ") else sign for sign in text)


def plain_number(text: str) -> str:
    """Return the text of a number in plain characters, without separators of thousands that stand for nothing else."""
    if text.isascii():
        return text
    digits = "".join(sign if (value := unicodedata.decimal(sign, None)) is None else str(value) for sign in text)
    return plain(_THOUSANDS.sub("", digits)).strip()


def look_alikes(text: str) -> str:
    """Name the characters that look like others, for messages; "" without."""
    odd = [sign for sign in dict.fromkeys(text) if not sign.isascii() and _meant(sign) != sign and sign not in "\u00b5"]
    named = [f"U+{ord(sign):04X} {unicodedata.name(sign, 'without a name')}" for sign in odd[:3]]
    meant = [f"stands there for {_meant(sign)!r}" if _meant(sign) else "cannot be seen" for sign in odd[:3]]
    words = ", ".join(f"{name} {what}" for name, what in zip(named, meant, strict=True))
    return f" ({words})" if words else ""


def _meant(sign: str) -> str:
    """Return the character that a character stands for, "" for one without a width."""
    if sign in _STAND_FOR:
        return _STAND_FOR[sign]
    if ord(sign) in _FULL_WIDTH:
        return chr(ord(sign) - _TO_ASCII)
    category = unicodedata.category(sign)
    if category == "Zs":
        return " "
    if category == "Cf":
        return ""
    return str(unicodedata.decimal(sign)) if category == "Nd" else sign


def is_misspelling(name: str, meant: str) -> bool:
    """Return whether a name differs from another in a letter, or one in eight: left out, added, other, or exchanged."""
    most = max(1, len(meant) // 8)
    return abs(len(name) - len(meant)) <= most and _edits(name, meant) <= most


def _edits(one: str, other: str) -> int:
    """Return the number of letters by which two names differ (optimal string alignment)."""
    before, row = [0], list(range(len(other) + 1))
    for i, letter in enumerate(one, start=1):
        older, before, row = before, row, [i]
        for j, wanted in enumerate(other, start=1):
            fewest = min(before[j - 1] + (letter != wanted), before[j] + 1, row[j - 1] + 1)
            if i > 1 < j and letter == other[j - 2] and one[i - 2] == wanted:
                fewest = min(fewest, older[j - 2] + 1)
            row.append(fewest)
    return row[-1]


def _likeness(one: str, other: str) -> float:
    one, other = one[:_LONGEST], other[:_LONGEST]
    return max(SequenceMatcher(None, form(one), form(other)).ratio() for form in (str.lower, _in_order))


def _in_order(text: str) -> str:
    return "_".join(sorted(re.split(r"[\W_]+", text.lower())))

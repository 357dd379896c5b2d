"""Suggestions for misspelt names."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import SequenceMatcher

__all__ = ["is_misspelling", "nearest"]

_LONGEST = 200
"""Largest number of characters of a name that is compared."""


def nearest(name: str, candidates: Iterable[str], cutoff: float = 0.6) -> str | None:
    """Find the candidate most similar to a name, regardless of case and the order of words; None if none is similar.

    Parameters
    ----------
    name : str
        Misspelt name.
    candidates : iterable of str
        Valid names.
    cutoff : float
        Least similarity, from 0 to 1 for the same letters.

    Examples
    --------
    >>> nearest("noise_force", ["bias_force_x", "force_noise"])
    'force_noise'
    >>> nearest("FX / mN", ["Fx / mN", "Fy / mN"])
    'Fx / mN'
    """
    found = max(candidates, key=lambda candidate: _likeness(name, candidate), default=None)
    return found if found is not None and _likeness(name, found) >= cutoff else None


def is_misspelling(name: str, meant: str) -> bool:
    """Return whether a name differs from another one in at most a letter, or one in eight: left out, added, other,
    or exchanged with its neighbour.

    Examples
    --------
    >>> is_misspelling("tapre", "taper"), is_misspelling("type", "taper"), is_misspelling("rodent", "rod")
    (True, False, False)
    """
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

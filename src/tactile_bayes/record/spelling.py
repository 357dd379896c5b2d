"""Suggestions for misspelt names."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import SequenceMatcher

__all__ = ["nearest"]


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


def _likeness(one: str, other: str) -> float:
    return max(SequenceMatcher(None, form(one), form(other)).ratio() for form in (str.lower, _in_order))


def _in_order(text: str) -> str:
    return "_".join(sorted(re.split(r"[\W_]+", text.lower())))

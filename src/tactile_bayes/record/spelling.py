"""Spelling: which name was probably meant."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import SequenceMatcher

__all__ = ["nearest"]


def nearest(name: str, candidates: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The candidate that is most like a name, whatever their case and the order of their words; None if none is.

    Parameters
    ----------
    name : str
        What was written.
    candidates : iterable of str
        What could have been meant.
    cutoff : float
        How like it has to be, from 0 to 1 for the same letters.

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

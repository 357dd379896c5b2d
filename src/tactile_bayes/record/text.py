"""Text in columns: arrays of equal width, or of objects where equal widths would waste memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["text_array"]

FREE = 1 << 26
"""Bytes that a column of text may take whatever is in it."""


def text_array(texts: Sequence[str]) -> NDArray[Any]:
    """Texts as an array of NumPy's text, or of str objects.

    NumPy gives every cell the room of the longest one, four bytes a character. Where that is much, and less than half
    of it would be used, the cells are objects, equal ones the same.

    Parameters
    ----------
    texts : sequence of str, length n_samples
        The cells.

    Examples
    --------
    >>> text_array(["a", "bc"]).dtype
    dtype('<U2')
    """
    width = max(map(len, texts), default=0)
    if 4 * width * len(texts) > FREE and width * len(texts) > 2 * (sum(map(len, texts)) + len(texts)):
        seen: dict[str, str] = {}
        return np.fromiter((seen.setdefault(text, text) for text in texts), dtype=object, count=len(texts))
    return np.array(texts, dtype=np.str_)

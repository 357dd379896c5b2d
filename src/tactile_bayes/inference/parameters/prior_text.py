"""Priors as text, for attributes of results and for the identity of a computation that can be resumed."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Mapping

import numpy as np
from scipy import stats

from tactile_bayes.errors import InferenceError
from tactile_bayes.inference.parameters.priors import Prior, numbers_of

__all__ = ["is_prior_in_words", "prior_in_words", "prior_of_words", "priors_in_words"]

_WORDS = re.compile(r"(\w+)\((.*)\)")


def prior_in_words(prior: Prior) -> str:
    """Return a distribution as text, the same however its numbers were given.

    Examples
    --------
    >>> prior_in_words(stats.norm(scale=0.1)), prior_in_words(stats.lognorm(0.5, scale=2.0))
    ('norm(0, 0.1)', 'lognorm(s=0.5, scale=2)')
    """
    distribution = getattr(prior, "dist", None)
    if isinstance(distribution, stats.rv_histogram):
        counts, edges = distribution._histogram  # type: ignore[attr-defined]
        return f"histogram of {len(counts)} bins ({zlib.crc32(np.concatenate([counts, edges]).tobytes()):08x})"
    numbers = numbers_of(prior)
    if distribution is None or not numbers:
        return repr(prior)
    if numbers.keys() == {"loc", "scale"}:
        written = [f"{value:g}" for value in numbers.values()]
    else:
        written = [f"{name}={value:g}" for name, value in numbers.items() if name != "loc" or value]
    return f"{distribution.name}({', '.join(written)})"


def priors_in_words(priors: Mapping[str, Prior]) -> str:
    """Return distributions by name as text, for an attribute."""
    return json.dumps({name: prior_in_words(prior) for name, prior in priors.items()})


def prior_of_words(name: str, words: str) -> Prior:
    """Return the distribution of a text from `prior_in_words`.

    Raises
    ------
    InferenceError
        If the text does not determine the prior of this parameter.
    """
    match = _WORDS.fullmatch(words)
    kind = getattr(stats, match[1], None) if match else None
    if match is None or not isinstance(kind, stats.rv_continuous):
        raise InferenceError(f"the prior of {name} was {words}, which text does not determine: give priors=")
    parts = [part.partition("=") for part in match[2].split(", ")] if match[2] else []
    positional = [float(value) for value, _, other in parts if not other]
    return kind(*positional, **{key: float(value) for key, _, value in parts if value})


def is_prior_in_words(prior: Prior, words: str) -> bool:
    """Return True if a text states this prior, in the form of today or of results that are older."""
    own = prior_in_words(prior)
    if own == words:
        return True
    try:
        return prior_in_words(prior_of_words("", words)) == own
    except InferenceError:
        return False

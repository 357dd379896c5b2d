"""The e-value of a model: how much better noise that is wider from some block on predicts a growing record."""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from tactile_bayes.arrays import Floats
from tactile_bayes.inference.streams.stream_state import StreamState

WIDER = (1.5, 3.0, 6.0)  # factors on the noise of the alternatives with which the e-value compares the model


def surprise_after(old: StreamState | None, log_ratios: Floats) -> tuple[Floats, float]:
    """Return the products of ratios after a block, and the logarithm of the largest e-value so far.

    That the model is wrong from the k-th block on has the prior weight 1/(k(k + 1)); blocks to come have no ratio yet.
    """
    blocks = 1 if old is None else old.updates + 2
    before = np.full(len(WIDER), -np.inf) if old is None else old.log_products
    products = np.logaddexp(before, -np.log(blocks * (blocks + 1.0))) + log_ratios
    now = float(np.logaddexp(logsumexp(products) - np.log(len(WIDER)), -np.log(blocks + 1.0)))
    return products, now if old is None else float(np.fmax(now, old.surprise))

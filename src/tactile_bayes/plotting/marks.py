"""Colours, lines and markers that have the same meaning in every figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# Colours after Okabe and Ito, distinguishable with any colour vision.
PALETTE = {"tip": "#0072B2", "tangential": "#D55E00", "change": "#000000", "none": "#8C8C8C", "sample": "#9A9A9A"}
PALETTE |= {"object": "#EFEFEF", "band": "#9CCBE8", "median": "#0072B2", "gap": "#F0E442"}
# Colours of bases in their order, after Okabe and Ito, without the gap's; the seventh base has the first again.
BASES = ("#0072B2", "#E69F00", "#CC79A7", "#009E73", "#56B4E9", "#D55E00")
# The mark on the best of several choices.
BEST: Mapping[str, Any] = {"marker": "*", "color": "#D55E00", "markeredgecolor": "white", "linestyle": "none"}
SWEEP_LINES: Mapping[str, str] = {"forward": "-", "backward": "--"}
SWEEP_MARKERS: Mapping[str, str] = {"forward": "o", "backward": "^"}

PHASES = {"tip": "tip contact", "tangential": "tangential contact"}
CONTACT_MARKERS = {"tip": "o", "tangential": "s", "none": "o"}

# The line of the true contour.
TRUTH: Mapping[str, Any] = {"color": PALETTE["change"], "linewidth": 1.0, "linestyle": "--"}

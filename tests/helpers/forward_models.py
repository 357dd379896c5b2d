"""Sweeps for which numba compiles different functions, most of a minute each: `python -m helpers.forward_models`."""

from __future__ import annotations

import numpy as np

import tactile_bayes as tb
from tactile_bayes.contours import Circle

_CARRIED = tb.Translation(base=(0.9, 0.0), heading=np.pi, drive_angle=1.5, travel=1.8)
_KINDS = (
    {"rig": tb.Rig(rod=tb.Rod(taper=0.5)), "direction": "forward"},
    {"drive": [_CARRIED]},
    {"rig": tb.Rig(rod=tb.Rod(taper=0.5)), "drive": [_CARRIED]},
    {"direction": "forward"},
)


def compile_share(number: int, of: int) -> None:
    """Compile one share of the forward models, which are cached on disk."""
    for arguments in _KINDS[number::of]:
        tb.scan(Circle(0.1, 0.6, 0.1), **arguments)


if __name__ == "__main__":  # beside it a demonstration compiles the last one
    for kind in range(len(_KINDS) - 1):
        compile_share(kind, len(_KINDS))

"""Sweeps for which numba compiles different functions, half a minute each: `python -m helpers.forward_models`."""

from __future__ import annotations

import tactile_bayes as tb
from tactile_bayes.contours import Circle

_RODS = (tb.Rod(taper=0.5), tb.Rod())


def compile_share(number: int, of: int) -> None:
    """Compile one share of the forward models, which are cached on disk."""
    for rod in _RODS[number::of]:
        tb.scan(Circle(0.1, 0.6, 0.1), tb.Rig(rod=rod), direction="forward")


if __name__ == "__main__":  # beside it a demonstration compiles the last one
    compile_share(0, len(_RODS))

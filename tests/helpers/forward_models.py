"""Sweeps for which numba compiles different functions, half a minute each: `python -m helpers.forward_models`."""

from __future__ import annotations

import tactile_bayes as tb
from tactile_bayes.contours import Circle

_CONTOUR = Circle(0.1, 0.6, 0.1)
_CELL = tb.LoadCell(force_noise=0.05, moment_noise=0.02)
# The first takes half as long again as the other, beside which Step 2 is compiled for both.
_RIGS = tuple(tb.Rig(rod=rod, load_cell=_CELL) for rod in (tb.Rod(taper=0.5), tb.Rod()))


def compile_share(number: int, of: int) -> None:
    """Compile one share of the forward models, which are cached on disk."""
    for rig in _RIGS[number::of]:
        scanned = tb.scan(_CONTOUR, rig, direction="forward").record
    if number == len(_RIGS) - 1:
        measured = _CELL.measure(scanned, rng=1)
        for rig in _RIGS:
            tb.equilibria(_CONTOUR, [0.6], rig=rig)
            tb.reconstruct(measured, rig=rig)
            tb.reconstruct(measured, rig=rig, method="constrained")


if __name__ == "__main__":  # beside it a demonstration compiles the other
    compile_share(0, len(_RIGS))
